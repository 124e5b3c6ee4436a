// The records of the clustered broad phase: monotone in the exact projection, on every target that runs.
#include <gtest/gtest.h>
#include <hwy/aligned_allocator.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "simd/cluster_bounds.h"
#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

using simd::RECORD;
constexpr int LOWEST = 3, HIGHEST = 65531;  // of all records

struct Records {
  double low[8], scale[8];
  std::vector<std::uint16_t> values;
};

/// As the scene does it: bounds, scale, records.
Records quantized(const std::vector<VertexMotion>& vertices) {
  Records r;
  double high[8];
  std::fill_n(r.low, 8, HUGE_VAL);
  std::fill_n(high, 8, -HUGE_VAL);
  simd::projectionBounds(vertices[0].t0, vertices.size(), r.low, high);
  for (int d = 0; d < 8; ++d) {
    const double range = high[d] / 2 - r.low[d] / 2;
    const bool usable = range > 0 && std::isfinite(r.low[d]) && std::isfinite(high[d]) && std::isfinite(2 * range);
    if (!usable) r.low[d] = 0;
    r.scale[d] = usable ? std::min(simd::RECORD_RANGE / 2 / range, 1e300) : 0;
  }
  r.values.resize(vertices.size() * RECORD);
  simd::quantize(vertices[0].t0, vertices.size(), r.low, r.scale, r.values.data());
  return r;
}

std::vector<VertexMotion> randomVertices(const Draw& draw, std::size_t n, Coordinates coordinates) {
  const Positions t0 = randomPositions(draw, n, coordinates), t1 = randomMotion(draw, t0, coordinates);
  std::vector<VertexMotion> vertices(n);
  for (std::size_t i = 0; i < n; ++i) {
    vertices[i] = {};
    std::copy_n(t0[i].data(), 3, vertices[i].t0);
    std::copy_n(t1[i].data(), 3, vertices[i].t1);
  }
  return vertices;
}

/// Sign of the exact difference of two projections: every coordinate is a multiple of a power of two.
int compareExactly(const double* a, const double* b, int d) {
  static const int TERMS[8][2] = {{0, -1}, {1, -1}, {2, -1}, {0, 1}, {0, 2}, {1, 2}, {0, 1}, {1, 2}};
  const auto projection = [&](const double* x) {
    Rational p(x[TERMS[d][0]]);
    if (TERMS[d][1] >= 0) p += (d < 6 ? 1 : -1) * Rational(x[TERMS[d][1]]);
    return p;
  };
  const Rational pa = projection(a), pb = projection(b);
  return pa > pb ? 1 : pa < pb ? -1 : 0;
}

void expectMonotone(const std::vector<VertexMotion>& vertices, const std::string& what) {
  const Records r = quantized(vertices);
  const auto point = [&](std::size_t i) { return i % 2 ? vertices[i / 2].t1 : vertices[i / 2].t0; };
  for (std::size_t i = 0; i < 2 * vertices.size(); ++i) {
    for (std::size_t k = 0; k < 8; ++k) {
      const int q = r.values[8 * i + k];
      ASSERT_GE(q, LOWEST) << what;
      ASSERT_LE(q, HIGHEST) << what;
      for (std::size_t j = 0; j < i; ++j) {
        const int other = r.values[8 * j + k];
        const int order = compareExactly(point(i), point(j), static_cast<int>(k));
        ASSERT_FALSE((q > other && order <= 0) || (q < other && order >= 0))
            << what << ": record values " << q << " and " << other << " of projections in another order (" << order
            << ')';
      }
    }
  }
}

TEST(ClusterRecords, RecordsAreMonotoneInTheExactProjection) {
  forEachSimdTarget([](const std::string& target) {
    for (int style = 0; style < static_cast<int>(Coordinates::COUNT); ++style) {
      for (std::uint64_t seed = 0; seed < 4; ++seed) {
        const auto coordinates = static_cast<Coordinates>(style);
        expectMonotone(randomVertices(drawFrom(100 * seed + static_cast<std::uint64_t>(style)), 12, coordinates),
                       target + ", style " + std::to_string(style));
      }
    }
  });
}

// Neighbouring doubles across a step of the grid, near one and far from the origin.
TEST(ClusterRecords, RecordsAreMonotoneForAdjacentDoubles) {
  forEachSimdTarget([](const std::string& target) {
    for (const double offset : {0.0, 1.0, 1e15, -1e15}) {
      for (const double size : {1.0, 65528.0, 1e-9}) {
        std::vector<VertexMotion> vertices;
        VertexMotion v{};
        v.t1[0] = size;
        for (int i = 0; i < 3; ++i) v.t0[i] = offset;
        for (int i = 0; i < 3; ++i) v.t1[i] = offset + size;
        vertices.push_back(v);
        for (int step = 1; step < 6; ++step) {
          double x = offset + size * step / simd::RECORD_RANGE * 1024;
          for (int k = 0; k < 4; ++k) x = std::nextafter(x, -HUGE_VAL);
          for (int k = 0; k < 6; k += 2) {
            VertexMotion w{};
            for (int i = 0; i < 3; ++i) w.t0[i] = x;
            x = std::nextafter(x, HUGE_VAL);
            for (int i = 0; i < 3; ++i) w.t1[i] = x;
            x = std::nextafter(x, HUGE_VAL);
            vertices.push_back(w);
          }
        }
        expectMonotone(vertices, target);
      }
    }
  });
}

TEST(ClusterRecords, RecordsUseTheirRange) {
  std::vector<VertexMotion> vertices = randomVertices(drawFrom(3), 100, Coordinates::REAL);
  forEachSimdTarget([&](const std::string& target) {
    const Records r = quantized(vertices);
    for (std::size_t k = 0; k < 8; ++k) {
      int lo = HIGHEST, hi = LOWEST;
      for (std::size_t i = k; i < r.values.size(); i += 8) {
        lo = std::min<int>(lo, r.values[i]);
        hi = std::max<int>(hi, r.values[i]);
      }
      EXPECT_EQ(lo, LOWEST) << target;
      EXPECT_GE(hi, HIGHEST - 1) << target;
    }
  });
}

// A body without any active vertex is not in the range, but has records all the same.
TEST(ClusterRecords, WhatLiesOutsideTheRangeTakesItsEnd) {
  const double below = 5e5 - 1e-4, above = 5e5 + 1.0001;  // by more than a unit, by less than what wraps around
  const double far[8] = {0, 0, 0, 0, 1e9, 1e9, 1e9, 0}, near[8] = {below, below, below, 0, above, above, above, 0};
  double low[8], scale[8];
  std::fill_n(low, 8, 5e5);
  std::fill_n(scale, 8, simd::RECORD_RANGE);
  forEachSimdTarget([&](const std::string& target) {
    for (const double* vertex : {far, near}) {
      std::uint16_t records[RECORD];
      simd::quantize(vertex, 1, low, scale, records);
      for (std::size_t d = 0; d < 3; ++d) {
        EXPECT_EQ(records[d], LOWEST) << target;
        EXPECT_EQ(records[8 + d], HIGHEST) << target;
      }
    }
  });
}

/// A group of leaves, each a vertex of its own.
struct VertexLeaves {
  hwy::AlignedFreeUniquePtr<std::uint16_t[]> soa = hwy::AllocateAligned<std::uint16_t>(simd::SOA_SIZE),
                                             aos = hwy::AllocateAligned<std::uint16_t>(simd::AOS_SIZE);
  explicit VertexLeaves(const std::vector<std::uint16_t>& records) {
    std::vector<std::uint32_t> lanes(simd::GROUP, UINT32_MAX);
    for (std::uint32_t i = 0; i < records.size() / RECORD && i < simd::GROUP; ++i) lanes[i] = i;
    simd::buildLeaves(records.data(), lanes.data(), 1, simd::GROUP, nullptr, soa.get(), aos.get());
  }
  /// The values at the second end: lowest or highest.
  int at1(std::size_t direction, std::size_t lane, bool highest) const {
    const std::uint16_t* values = soa.get() + simd::SOA_T1 + simd::soaIndex(direction, lane);
    return highest ? simd::turned(values[simd::SOA_SIZE / 2]) : values[0];
  }
};

/// Sign of p - q at the time end / WHOLE_STEP, for two vertices that move straight.
int compareMoved(const VertexMotion& p, const VertexMotion& q, std::int32_t end, int d) {
  static const int TERMS[8][2] = {{0, -1}, {1, -1}, {2, -1}, {0, 1}, {0, 2}, {1, 2}, {0, 1}, {1, 2}};
  const auto at = [&](const VertexMotion& v, int axis) {
    return Rational(v.t0[axis]) * Rational(simd::WHOLE_STEP - end) + Rational(v.t1[axis]) * Rational(end);
  };
  const auto projection = [&](const VertexMotion& v) {
    Rational sum = at(v, TERMS[d][0]);
    if (TERMS[d][1] >= 0) sum += (d < 6 ? 1 : -1) * at(v, TERMS[d][1]);
    return sum;
  };
  const Rational a = projection(p), b = projection(q);
  return a > b ? 1 : a < b ? -1 : 0;
}

// The bounds of two vertices in strict order say that the vertices are, at that time; swept, at t0 as well. And they
// are no wider than they must be.
TEST(ShortenedBounds, OrderOfBoundsIsOrderOfVertices) {
  std::size_t ordered = 0, pairs = 0;
  forEachSimdTarget([&](const std::string& target) {
    for (std::uint64_t seed = 0; seed < 24; ++seed) {
      const Draw draw = drawFrom(seed);
      const std::int32_t end = seed % 3 == 0 ? draw(1, 9) : draw(1, simd::WHOLE_STEP);
      const bool swept = seed % 2 == 0;
      const std::vector<VertexMotion> vertices =
          randomVertices(draw, simd::GROUP, seed % 4 < 2 ? Coordinates::REAL : Coordinates::SMALL_INTEGERS);
      const Records r = quantized(vertices);
      VertexLeaves leaves(r.values);
      simd::shortenBounds(leaves.soa.get(), leaves.aos.get(), 1, end, swept);
      for (std::size_t d = 0; d < 8; ++d) {
        int lowest = simd::EMPTY, highest = 0;
        for (std::size_t i = 0; i < simd::GROUP; ++i) {
          lowest = std::min(lowest, leaves.at1(d, i, false));
          highest = std::max(highest, leaves.at1(d, i, true));
          const int q0 = r.values[RECORD * i + d], q1 = r.values[RECORD * i + 8 + d];
          const double moved = q0 + (q1 - q0) * static_cast<double>(end) / simd::WHOLE_STEP;
          ASSERT_GE(leaves.at1(d, i, false), (swept ? std::min<double>(q0, moved) : moved) - 2) << target;
          ASSERT_LE(leaves.at1(d, i, true), (swept ? std::max<double>(q0, moved) : moved) + 2) << target;
          for (std::size_t j = 0; j < simd::GROUP; ++j) {
            ++pairs;
            if (leaves.at1(d, i, false) <= leaves.at1(d, j, true)) continue;
            ++ordered;
            ASSERT_EQ(compareMoved(vertices[i], vertices[j], end, static_cast<int>(d)), 1) << target << ' ' << seed;
            const int order_before = compareExactly(vertices[i].t0, vertices[j].t0, static_cast<int>(d));
            ASSERT_TRUE(!swept || order_before == 1) << target << ' ' << seed;
          }
        }
        ASSERT_LE(leaves.aos[8 + d], lowest) << "the group's bounds hold those of its members";
        ASSERT_GE(simd::turned(leaves.aos[RECORD + 8 + d]), highest);
      }
    }
  });
  EXPECT_GT(ordered, pairs / 10);
}

// A record is truncated after a product that is rounded: a coordinate can lie a little below its record. Vertices are
// looked for that are in another order than the line between their records says, by less than a rounding.
TEST(ShortenedBounds, TheUnitThatTheyAreWidenedByHoldsTheRounding) {
  const std::int32_t end = simd::WHOLE_STEP / 4 * 3;
  constexpr double RANGE = 13;  // of the scene: its scale is no power of two
  std::size_t tried = 0;
  for (int k = 4; k < 40000; k += 3) {
    // What is at rest has a product that rounds up to k. What moves has one just below 1 and one just below 4/3 (k - 1)
    // + 1, so that it is just below k after three quarters of its way, but less so: its records say k - 1.
    const int last = 4 * (k - 1) / 3;
    const double scale = simd::RECORD_RANGE / 2 / (RANGE / 2);
    const auto firstAt = [&](int record) {  // the first double whose product is not below the record
      double x = record / scale;
      while (x * scale >= record) x = std::nextafter(x, 0);
      while (x * scale < record) x = std::nextafter(x, RANGE);
      return x;
    };
    VertexMotion rest{}, moving{}, low{}, high{};
    rest.t0[0] = rest.t1[0] = firstAt(k);
    moving.t0[0] = std::nextafter(firstAt(1), 0);
    moving.t1[0] = std::nextafter(firstAt(last + 1), 0);
    high.t0[0] = high.t1[0] = RANGE;
    if (compareMoved(moving, rest, end, 0) < 0) continue;
    ++tried;
    const Records r = quantized({rest, moving, low, high});
    ASSERT_EQ(r.scale[0], scale);
    ASSERT_EQ(r.values[0], k + LOWEST);
    ASSERT_EQ(r.values[RECORD], 0 + LOWEST);
    ASSERT_EQ(r.values[RECORD + 8], last + LOWEST);
    forEachSimdTarget([&](const std::string& target) {
      for (const bool swept : {false, true}) {
        VertexLeaves leaves(r.values);
        simd::shortenBounds(leaves.soa.get(), leaves.aos.get(), 1, end, swept);
        // One of both may be of a body that is still, whose bounds are not moved.
        EXPECT_LE(leaves.at1(0, 0, false), leaves.at1(0, 1, true)) << target << ": k = " << k;
        EXPECT_LE(VertexLeaves(r.values).at1(0, 0, false), leaves.at1(0, 1, true)) << target << ": k = " << k;
      }
    });
  }
  EXPECT_GT(tried, 10u) << "no vertices of the kind were found";
}

TEST(ClusterRecords, RecordsAndBoundsAreTheSameOnEveryTarget) {
  for (int style = 0; style < static_cast<int>(Coordinates::COUNT); ++style) {
    const auto vertices = randomVertices(drawFrom(5), 33, static_cast<Coordinates>(style));
    const Records expected = quantized(vertices);
    forEachSimdTarget([&](const std::string& target) {
      const Records r = quantized(vertices);
      EXPECT_EQ(r.values, expected.values) << target << ", style " << style;
      EXPECT_TRUE(std::equal(r.low, r.low + 8, expected.low)) << target;
    });
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
