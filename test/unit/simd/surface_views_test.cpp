// How faces are seen during a step, against whole numbers, on every target that runs.
#include "simd/surface_views.h"

#include <gtest/gtest.h>
#include <hwy/aligned_allocator.h>

#include <array>
#include <random>
#include <string>
#include <vector>

#include "simd/group_pairs.h"
#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

using Whole = std::array<int, 3>;

Whole difference(const Whole& a, const Whole& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

/// Along a line, the normal of a face with these corners.
int normalAlong(const int (&line)[3], const Whole& a, const Whole& b, const Whole& c) {
  const Whole p = difference(b, a), q = difference(c, a);
  int sum = 0;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    sum += line[k] * (p[i] * q[j] - p[j] * q[i]);
  }
  return sum;
}

// Whole numbers of so few digits lie beyond each margin, or are 0: a view is set where all three coefficients are above
// 0, and only there. The one in the middle comes from the face as it is at t = 1/2, here twice as large.
TEST(SurfaceViews, AFaceIsFacedWhereItsNormalPointsThereAllTheStep) {
  constexpr std::size_t GROUPS = 200, FACES = GROUPS * simd::GROUP;
  std::mt19937_64 random(5);
  const auto positions = hwy::AllocateAligned<double>(FACES * 3 * 8);
  std::vector<Whole> at[2];
  for (std::size_t v = 0; v < FACES * 3; ++v) {
    for (std::size_t end = 0; end < 2; ++end) {
      Whole x;
      for (std::size_t k = 0; k < 3; ++k) {
        x[k] = static_cast<int>(random() % 17) - 8;
        positions[v * 8 + end * 4 + k] = x[k];
      }
      at[end].push_back(x);
      positions[v * 8 + end * 4 + 3] = 0;
    }
  }
  std::vector<std::uint32_t> groups(FACES * 3);
  const auto corner = [](std::size_t face, std::size_t i) { return face * 3 + i; };
  for (std::size_t f = 0; f < FACES; ++f) {
    for (std::size_t i = 0; i < 3; ++i) {
      groups[f / simd::GROUP * 3 * simd::GROUP + i * simd::GROUP + f % simd::GROUP] =
          static_cast<std::uint32_t>(corner(f, i));
    }
  }
  std::vector<std::uint32_t> expected(FACES, 0);
  std::size_t over_and_back = 0;
  for (std::size_t f = 0; f < FACES; ++f) {
    Whole x[3], y[3], both[3];
    for (std::size_t i = 0; i < 3; ++i) {
      x[i] = at[0][corner(f, i)], y[i] = at[1][corner(f, i)];
      both[i] = {x[i][0] + y[i][0], x[i][1] + y[i][1], x[i][2] + y[i][2]};
    }
    for (std::size_t view = 0; view < simd::VIEWS; ++view) {
      const int sign = view % 2 == 0 ? 1 : -1;
      const auto& line = simd::VIEW_LINE[view / 2];
      const int first = sign * normalAlong(line, x[0], x[1], x[2]), last = sign * normalAlong(line, y[0], y[1], y[2]);
      const int middle = sign * normalAlong(line, both[0], both[1], both[2]) - first - last;
      if (first > 0 && middle > 0 && last > 0) expected[f] |= 1u << view;
      over_and_back += first > 0 && middle <= 0 && last > 0;
    }
  }
  EXPECT_GT(over_and_back, 1000u);
  forEachSimdTarget([&](const std::string& target) {
    std::vector<std::uint32_t> views(FACES, 0);
    simd::facedViews(positions.get(), groups.data(), GROUPS, views.data());
    EXPECT_EQ(views, expected) << target;
  });
}

}  // namespace
}  // namespace test
}  // namespace dccd
