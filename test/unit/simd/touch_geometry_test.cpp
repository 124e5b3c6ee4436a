// Where pairs touch, in lanes: to the bit what closest_points.h says of each pair, on every target.
#include "simd/touch_geometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

#include "dccd/contact.h"
#include "step/pairs/closest_points.h"
#include "support/generators.h"
#include "support/simd_targets.h"

namespace dccd {
namespace test {
namespace {

struct TouchingShapes {
  PairMotion pair;
  double toc;
};

/// Of every hard family, and as many as leave the last vector of a block half empty.
std::vector<TouchingShapes> touchesOf(PairKind kind) {
  RandomSource random(38);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<TouchingShapes> all;
  for (int h = 0; h < static_cast<int>(Hardness::COUNT); ++h) {
    for (int i = 0; i < 53; ++i) {
      const double toc = i % 4 == 0 ? 0 : i % 4 == 1 ? 1 : unit(random);
      all.push_back({hardQuery(random, kind, static_cast<Hardness>(h)).motion, toc});
    }
  }
  return all;
}

Vec3 at(const PairMotion& pair, int vertex, int end) { return Eigen::Map<const Vec3>(pair.x[end][vertex]); }

/// Point and normal as the step begins, without lanes.
ContactGeometry placeOf(PairKind kind, const TouchingShapes& one) {
  const auto along = [&](int v) {
    const Vec3 from = at(one.pair, v, 0), to = at(one.pair, v, 1);
    return one.toc == 0 ? from : Vec3(from + one.toc * (to - from));
  };
  Vec3 x[4];
  for (int i = 0; i < 4; ++i) x[i] = at(one.pair, i, 0);
  const bool face = kind == PairKind::VERTEX_FACE;
  ContactGeometry out;
  if (face) {
    out.point = along(0);
  } else {
    const Closest closest = closestOnSegments(along(0), along(1), along(2), along(3));
    out.point = 0.5 * (closest.on_first + closest.on_second);
  }
  const Vec3 cross = face ? (x[2] - x[1]).cross(x[3] - x[1]) : (x[1] - x[0]).cross(x[3] - x[2]);
  out.normal = unitOr(cross, Vec3::Zero());
  if (out.normal.dot(x[0] - x[face ? 1 : 2]) < 0) out.normal = -out.normal;
  return out;
}

bool isSame(double a, double b) { return (std::isnan(a) && std::isnan(b)) || std::memcmp(&a, &b, sizeof a) == 0; }

void compare(PairKind kind) {
  const std::vector<TouchingShapes> touches = touchesOf(kind);
  forEachTarget([&](const std::string& target) {
    for (std::size_t first = 0; first < touches.size(); first += simd::TOUCHES) {
      const std::size_t count = std::min(simd::TOUCHES, touches.size() - first);
      const auto block = std::make_unique<simd::TouchBlock>();
      for (std::size_t i = 0; i < count; ++i) {
        block->toc[i] = touches[first + i].toc;
        for (int k = 0; k < 24; ++k) {
          block->x[k / 12][k / 3 % 4][i][k % 3] = touches[first + i].pair.x[k / 12][k / 3 % 4][k % 3];
        }
      }
      simd::touchPlaces(kind == PairKind::EDGE_EDGE, count, *block);
      for (std::size_t i = 0; i < count; ++i) {
        const ContactGeometry truth = placeOf(kind, touches[first + i]);
        for (int axis = 0; axis < 3; ++axis) {
          ASSERT_TRUE(isSame(block->point[axis][i], truth.point[axis])) << target << ", pair " << first + i;
          ASSERT_TRUE(isSame(block->normal[axis][i], truth.normal[axis])) << target << ", pair " << first + i;
        }
      }
    }
  });
}

TEST(TouchGeometry, PlacesAreThoseWithoutLanes) {
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) compare(kind);
}

}  // namespace
}  // namespace test
}  // namespace dccd
