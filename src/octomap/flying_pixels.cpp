#include "octomap/flying_pixels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace dccd {
namespace {

constexpr float NOTHING = std::numeric_limits<float>::quiet_NaN();

float depthOf(const float* pixel, std::size_t dimensions) {
  if (dimensions == 1) return *pixel > 0 && std::isfinite(*pixel) ? *pixel : NOTHING;
  const float away = std::sqrt(pixel[0] * pixel[0] + pixel[1] * pixel[1] + pixel[2] * pixel[2]);
  return away > 0 && std::isfinite(away) ? away : NOTHING;
}

}  // namespace

void leaveOutFlying(std::vector<float>& values, std::size_t width, std::size_t dimensions, double apart_m) {
  std::vector<float> depths(values.size() / dimensions);
  for (std::size_t i = 0; i < depths.size(); ++i) depths[i] = depthOf(&values[i * dimensions], dimensions);
  const auto apart = static_cast<float>(apart_m);
  const auto step = static_cast<std::ptrdiff_t>(width);
  const std::array<std::ptrdiff_t, 4> pairs{1, step - 1, step, step + 1};
  for (std::size_t i = width + 1; i + width + 1 < depths.size(); ++i) {
    if (i % width == 0 || i % width == width - 1) continue;
    const float* const at = &depths[i];
    const auto flies = [&](std::ptrdiff_t pair) {
      const float low = std::min(at[-pair], at[pair]), high = std::max(at[-pair], at[pair]);
      return low < *at && *at < high;  // not where one of them is no number
    };
    const auto isNear = [&](std::ptrdiff_t pair) {
      return std::abs(at[-pair] - *at) <= apart || std::abs(at[pair] - *at) <= apart;
    };
    if (std::any_of(pairs.begin(), pairs.end(), isNear) || std::none_of(pairs.begin(), pairs.end(), flies)) continue;
    std::fill_n(&values[i * dimensions], dimensions, NOTHING);
  }
}

}  // namespace dccd
