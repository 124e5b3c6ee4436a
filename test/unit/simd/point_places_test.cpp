#include "simd/point_places.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include <Eigen/Core>

#include "support/simd_targets.h"

namespace dccd {
namespace simd {
namespace {

constexpr float INFINITE = std::numeric_limits<float>::infinity(), NOTHING = std::numeric_limits<float>::quiet_NaN();
constexpr float LARGEST = std::numeric_limits<float>::max();

const PlaceLimits GRID{{32768.25, 32700, 32768}, {32760, 0, 32768}, {32800, 65536, 32770.5}, 0.01, 900};

/// A place, number by number in plain doubles.
struct Place {
  Eigen::Vector3d at;
  float depth = 0;
};

/// True: some repeat the one before.
bool expectPlaces(const PointPlaces& places, const std::vector<Place>& expected, const std::string& target) {
  bool some_repeat = false;
  bool was_within = false;
  std::int32_t last[3] = {};
  std::vector<std::int32_t> fresh;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const Eigen::Vector3d& p = expected[i].at;
    bool is_in = true;
    std::int32_t keys[3];
    for (int axis = 0; axis < 3; ++axis) {
      const double at = GRID.sensor[axis] + p[axis];
      is_in = is_in && at >= GRID.lo[axis] && at < GRID.hi[axis];
      keys[axis] = static_cast<std::int32_t>(std::floor(std::fmin(std::fmax(at, 0), 65535)));
    }
    EXPECT_EQ(Eigen::Vector3d(places.x[i], places.y[i], places.z[i]), p) << target << ' ' << i;
    EXPECT_EQ(places.away2[i], p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) << target << ' ' << i;
    EXPECT_EQ(places.depth[i], expected[i].depth) << target << ' ' << i;
    EXPECT_EQ(places.is_in[i], is_in ? 1 : 0) << target << ' ' << i << ": " << p.transpose();
    for (int axis = 0; is_in && axis < 3; ++axis) EXPECT_EQ(places.key[axis][i], keys[axis]) << target << ' ' << i;
    const double away2 = places.away2[i];
    const bool is_within = is_in && away2 > 0 && away2 >= GRID.nearest2 && away2 <= GRID.farthest2;
    const bool repeats = is_within && was_within && std::equal(keys, keys + 3, last);
    if (!repeats) fresh.push_back(static_cast<std::int32_t>(i));
    some_repeat = some_repeat || repeats;
    was_within = is_within;
    std::copy(keys, keys + 3, last);
  }
  EXPECT_EQ(std::vector<std::int32_t>(places.fresh, places.fresh + places.fresh_count), fresh) << target;
  return some_repeat;
}

/// Numbers of all sizes and kinds, and some at the limits.
std::vector<float> numbers(std::size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> small(-3, 40);
  std::uniform_int_distribution<int> which(0, 19);
  const float odd[] = {0, -0.0f, INFINITE, -INFINITE, NOTHING, LARGEST, -LARGEST, 1e-44f, -1.0f, 1e30f};
  std::vector<float> values(count);
  for (std::size_t i = 0; i < count; ++i) {
    float& value = values[i];
    if (i >= 3 && which(random) < 12) {  // as some before it
      value = values[i - 3];
      continue;
    }
    const int kind = which(random);
    value = kind < 10 ? small(random) : kind < 15 ? std::floor(small(random)) : odd[2 * (kind - 15) + random() % 2];
  }
  return values;
}

TEST(PointPlaces, OfDepthsAreThoseOfPlainNumbersOnEachTarget) {
  const Eigen::Vector3d first(-0.5, 0.25, 1.0 / 3), right(1.0 / 512, -1e-3, 1e-5);
  for (const std::size_t count : {std::size_t{1}, std::size_t{7}, std::size_t{321}, PointPlaces::MOST}) {
    const std::vector<float> depths = numbers(count);
    std::vector<Place> expected(count);
    for (std::size_t i = 0; i < count; ++i) {
      const bool is_ahead = std::isfinite(depths[i]) && depths[i] > 0;
      expected[i].depth = is_ahead ? depths[i] : 0;
      for (int axis = 0; axis < 3; ++axis) {
        expected[i].at[axis] = (first[axis] + right[axis] * double(i)) * double(expected[i].depth);
      }
    }
    test::forEachTarget([&](const std::string& target) {
      const auto places = std::make_unique<PointPlaces>();
      places->count = count;
      placeDepths(depths.data(), first.data(), right.data(), GRID, *places);
      EXPECT_EQ(expectPlaces(*places, expected, target), count > 100) << target;
    });
  }
}

TEST(PointPlaces, OfPointsAreThoseOfPlainNumbersOnEachTarget) {
  Eigen::Matrix3d m;
  m << 0.3, -0.7, 0.1, 0.9, 0.2, -0.4, 1e-3, 0.5, 0.8;
  const Eigen::Vector3d ahead(0.1, -0.2, 0.97);
  for (const std::size_t count : {std::size_t{1}, std::size_t{7}, std::size_t{321}, PointPlaces::MOST}) {
    const std::vector<float> xyz = numbers(3 * count);
    std::vector<Place> expected(count);
    for (std::size_t i = 0; i < count; ++i) {
      const float* p = &xyz[3 * i];
      if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) {
        expected[i].at.setZero();
        continue;
      }
      const double x = p[0], y = p[1], z = p[2];
      for (int axis = 0; axis < 3; ++axis) expected[i].at[axis] = m(axis, 0) * x + m(axis, 1) * y + m(axis, 2) * z;
      expected[i].depth = static_cast<float>(ahead[0] * x + ahead[1] * y + ahead[2] * z);
    }
    test::forEachTarget([&](const std::string& target) {
      const auto places = std::make_unique<PointPlaces>();
      places->count = count;
      placePoints(xyz.data(), m.data(), ahead.data(), GRID, *places);
      EXPECT_EQ(expectPlaces(*places, expected, target), count > 100) << target;
    });
  }
}

/// A camera's rows; of fewer points than vectors have lanes, too. The one that is off the most may be any of them.
TEST(PointPlaces, OffItsPixelIsAPointAsInPlainNumbersOnEachTarget) {
  const Eigen::Vector3d to_u(80.5, 0.3, 31), to_v(-0.2, 79, 17), ahead(0.01, -0.02, 0.999);
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(0, 1);
  for (const std::size_t width : {1, 2, 3, 7, 8, 9, 64, 161}) {
    for (int round = 0; round < 40; ++round) {
      std::vector<float> xyz(3 * width);
      double expected = 0;
      for (std::size_t u = 0; u < width; ++u) {
        const float z = 0.05f + unit(random), far = unit(random) < 0.1f ? 0.3f : 0.001f;
        float p[3] = {z * ((float(u) - 31) / 80.5f + far * unit(random)), z * (-13.0f / 79 + far * unit(random)), z};
        if (unit(random) < 0.1f) p[2] = unit(random) < 0.5f ? NOTHING : INFINITE;
        if (round % 8 == 7 && u == width / 2) p[2] = -z;  // behind
        std::copy(p, p + 3, &xyz[3 * u]);
        const double x = p[0], y = p[1], depth_z = p[2], square = x * x + y * y + depth_z * depth_z;
        if (!std::isfinite(square) || square < 0.04) continue;
        const auto along = [&](const Eigen::Vector3d& way) { return way[0] * x + way[1] * y + way[2] * depth_z; };
        const double inverse = 1 / along(ahead);
        const double off = std::max(std::abs(along(to_u) * inverse - double(u)), std::abs(along(to_v) * inverse - 4.0));
        expected = std::max(expected, along(ahead) > 0 ? off : std::numeric_limits<double>::infinity());
      }
      test::forEachTarget([&](const std::string& target) {
        const PixelRow row{xyz.data(), width, 4, 0.04};
        EXPECT_EQ(mostOffPx(row, to_u.data(), to_v.data(), ahead.data()), expected) << target << ' ' << width;
      });
    }
  }
}

}  // namespace
}  // namespace simd
}  // namespace dccd
