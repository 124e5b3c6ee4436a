#include "paper/paper_record.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "oracle/algebraic.h"

namespace dccd {
namespace {

using test::Rational;

Rational exactProjection(const double* x, std::size_t lane) {
  Rational sum = 0;
  for (std::size_t k = 0; k < 3; ++k) sum += Rational(x[k]) * PAPER_DIRECTION[lane][k];
  return sum;
}

std::vector<VertexMotion> randomVertices(std::size_t count, double centre, double size, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> place(-size, size);
  std::vector<VertexMotion> vertices(count);
  for (VertexMotion& v : vertices) {
    v = VertexMotion{};
    for (int k = 0; k < 3; ++k) {
      v.t0[k] = centre + place(random);
      v.t1[k] = centre + place(random);
    }
  }
  return vertices;
}

TEST(PaperRecord, TheEightPlanesAreDistinct) {
  // A plane is told by its normal: the cross product of its two directions, up to a factor.
  std::set<std::array<int, 3>> normals;
  for (std::size_t i = 0; i < PAPER_DIRECTIONS; ++i) {
    const auto &a = PAPER_DIRECTION[i], &b = PAPER_DIRECTION[PAPER_ROTATED[i]];
    std::array<int, 3> n{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    int first = 0;
    for (int k = 2; k >= 0; --k) first = n[k] != 0 ? n[k] : first;
    ASSERT_NE(first, 0) << "plane " << i << " is no plane";
    for (int& k : n) k = k * (first < 0 ? -1 : 1);
    EXPECT_TRUE(normals.insert(n).second) << "plane " << i << " occurs twice";
  }
}

TEST(PaperRecord, StoredValuesErrByTheStatedBoundAtMost) {
  // Far from the origin the projected sums are rounded coarsely; small scenes are scaled up, large ones down.
  const std::array<std::array<double, 2>, 6> cases{
      {{0, 1}, {1e6, 1}, {1e15, 1}, {-3, 1e-8}, {0, 1e30}, {7e-310, 2e-310}}};
  for (const auto& [centre, size] : cases) {
    const auto vertices = randomVertices(300, centre, size, 3);
    PaperRecords records;
    records.build(vertices.data(), vertices.size());
    ASSERT_GT(records.scale(), 0);
    const Rational bound(records.error());
    Rational largest_error = 0;
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      for (std::size_t k = 0; k < PAPER_DIRECTIONS; ++k) {
        const auto check = [&](const double* x, float stored) {
          EXPECT_LE(std::abs(stored), 1.0f);
          const Rational exact = (exactProjection(x, k) - Rational(records.centre(k))) * Rational(records.scale());
          const Rational error = abs(exact - Rational(stored));
          EXPECT_LE(error, bound) << "centre " << centre << " size " << size << " lane " << k;
          largest_error = std::max(largest_error, error);
        };
        check(vertices[i].t0, records[i].t0[k]);
        check(vertices[i].t1, records[i].t1[k]);
      }
    }
    if (centre != 7e-310) {
      EXPECT_GT(largest_error * 5, bound) << "the bound is loose: centre " << centre << " size " << size;
    }
  }
}

TEST(PaperRecord, StoredValuesAreMonotoneInTheExactProjection) {
  // Pairs one representable number apart, near each other in a scene whose centre is far away.
  constexpr double INF = std::numeric_limits<double>::infinity();
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> place(-1, 1);
  std::vector<VertexMotion> vertices;
  for (int i = 0; i < 2000; ++i) {
    VertexMotion v{};
    for (int k = 0; k < 3; ++k) v.t0[k] = v.t1[k] = place(random);
    for (int k = 0; k < 3; ++k) v.t1[k] = std::nextafter(v.t0[k], random() % 2 ? INF : -INF);
    vertices.push_back(v);
  }
  VertexMotion far{};
  far.t0[0] = far.t1[1] = 1000.0 / 3;
  vertices.push_back(far);
  PaperRecords records;
  records.build(vertices.data(), vertices.size());
  for (std::size_t i = 0; i + 1 < vertices.size(); ++i) {
    for (std::size_t k = 0; k < PAPER_DIRECTIONS; ++k) {
      const Rational exact_t0 = exactProjection(vertices[i].t0, k), exact_t1 = exactProjection(vertices[i].t1, k);
      if (records[i].t0[k] < records[i].t1[k]) {
        EXPECT_LT(exact_t0, exact_t1);
      }
      if (records[i].t0[k] > records[i].t1[k]) {
        EXPECT_GT(exact_t0, exact_t1);
      }
    }
  }
}

TEST(PaperRecord, InactiveAndUnusableVerticesSeparateNothing) {
  auto vertices = randomVertices(4, 0, 1, 9);
  vertices[1].t1[2] = std::numeric_limits<double>::quiet_NaN();
  vertices[2].t0[0] = std::numeric_limits<double>::infinity();
  const std::uint8_t active[4] = {1, 0, 0, 1};
  PaperRecords records;
  records.build(vertices.data(), 4, active);
  for (std::size_t k = 0; k < PAPER_DIRECTIONS; ++k) {
    EXPECT_EQ(records[1].t1[k], 0.0f);
    EXPECT_EQ(records[2].t0[k], 0.0f);
    EXPECT_TRUE(std::isfinite(records[0].t0[k]));
  }
  EXPECT_GT(records.scale(), 0);
  vertices = randomVertices(4, 0, 0x1p1020, 9);  // sums of two overflow: beyond the range in which the bound holds
  records.build(vertices.data(), 4);
  EXPECT_EQ(records.scale(), 0);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(records[i].t0[3], 0.0f);
  records.build(vertices.data(), 0);
  EXPECT_EQ(records.size(), 0u);
}

TEST(PaperRecord, AllVerticesInOnePlace) {
  const std::vector<VertexMotion> vertices(3, VertexMotion{{1, 2, 3, 0}, {1, 2, 3, 0}});
  PaperRecords records;
  records.build(vertices.data(), vertices.size());
  for (std::size_t k = 0; k < PAPER_DIRECTIONS; ++k) EXPECT_EQ(records[2].t1[k], 0.0f);
  EXPECT_TRUE(std::isfinite(records.error()));
}

}  // namespace
}  // namespace dccd
