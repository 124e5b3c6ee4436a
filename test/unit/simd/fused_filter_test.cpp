// The fused planar and non-penetration filter: against a reference in long double with the same certificates, against
// exact truth on pairs that graze, and one representable number either side of its margins.
#include "simd/fused_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "oracle/oracle.h"
#include "support/generators.h"
#include "support/pair_list.h"
#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

using simd::FusedPlanes;
constexpr long double UNIT = 1.0L / 16777216.0L;

std::vector<std::uint32_t> keptOf(const PairList& list, FusedPlanes planes) {
  std::vector<std::uint32_t> kept(list.size());
  kept.resize(simd::fusedFilter(list.vertices[0].t0, list.pairs[0].data(), list.size(),
                                list.kind == PairKind::EDGE_EDGE, planes, kept.data()));
  return kept;
}

std::vector<bool> asMask(const std::vector<std::uint32_t>& kept, std::size_t n) {
  std::vector<bool> mask(n, false);
  for (const std::uint32_t i : kept) mask[i] = true;
  return mask;
}

// --- the reference ---------------------------------------------------------------------------------------------------

struct L3 {
  long double x, y, z;
};
L3 operator+(const L3& a, const L3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
L3 cross(const L3& a, const L3& b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
long double dot(const L3& a, const L3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// b(t) x c(t) as coefficients of (1-t)^2, t (1-t), t^2.
struct Q3 {
  L3 A, B, C;
};
Q3 cross(const L3 (&b)[2], const L3 (&c)[2]) {
  return {cross(b[0], c[0]), cross(b[0], c[1]) + cross(b[1], c[0]), cross(b[1], c[1])};
}

/// Certificates of one pair: how far the best one is beyond its sign, in units of the margin that the header derives.
class Reference {
 public:
  Reference(PairKind kind, const PairMotion& pair) : edge_edge_(kind == PairKind::EDGE_EDGE) {
    const int origin = edge_edge_ ? 3 : 0;
    L3 p[3][2];
    for (int i = 0; i < 3; ++i) {
      for (int t = 0; t < 2; ++t) {
        const double *v = pair.x[t][edge_edge_ ? i : i + 1], *o = pair.x[t][origin];
        p[i][t] = {static_cast<long double>(v[0]) - o[0], static_cast<long double>(v[1]) - o[1],
                   static_cast<long double>(v[2]) - o[2]};
        M_ = std::max({M_, std::abs(p[i][t].x), std::abs(p[i][t].y), std::abs(p[i][t].z)});
      }
    }
    bc_ = cross(p[1], p[2]);
    ca_ = cross(p[2], p[0]);
    ab_ = cross(p[0], p[1]);
    T_ = {bc_.A + ca_.A + ab_.A, bc_.B + ca_.B + ab_.B, bc_.C + ca_.C + ab_.C};
    const long double f[4] = {dot(p[0][0], bc_.A), dot(p[0][1], bc_.A) + dot(p[0][0], bc_.B),
                              dot(p[0][1], bc_.B) + dot(p[0][0], bc_.C), dot(p[0][1], bc_.C)};
    const auto [lo, hi] = std::minmax({f[0], f[1], f[2], f[3]});
    cubic_ = std::max(lo, -hi) / (192 * UNIT * M_ * M_ * M_);
  }

  /// The certificate in the plane with the normal n.
  long double inPlane(const L3& n) const {
    const Q3* quantities[4] = {&bc_, &ca_, &ab_, &T_};
    long double largest_lo = -HUGE_VALL, smallest_hi = HUGE_VALL;
    for (int i = 0; i < 4; ++i) {
      const long double s = edge_edge_ && i == 2 ? -1 : 1;
      const auto [lo, hi] =
          std::minmax({s * dot(n, quantities[i]->A), s * dot(n, quantities[i]->B), s * dot(n, quantities[i]->C)});
      largest_lo = std::max(largest_lo, lo);
      smallest_hi = std::min(smallest_hi, hi);
    }
    const long double size = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
    return std::min(largest_lo, -smallest_hi) / (128 * UNIT * M_ * M_ * size);
  }
  long double coordinatePlanes() const {
    return std::max({cubic_, inPlane({1, 0, 0}), inPlane({0, 1, 0}), inPlane({0, 0, 1})});
  }
  long double paperPlanes() const {
    static const L3 NORMALS[5] = {{1, -1, 0}, {1, 1, 0}, {1, 1, -1}, {-1, 1, 1}, {1, 1, 1}};
    long double best = coordinatePlanes();
    for (const L3& n : NORMALS) best = std::max(best, inPlane(n));
    return best;
  }
  long double M() const { return M_; }

 private:
  bool edge_edge_;
  Q3 bc_, ca_, ab_, T_;
  long double M_ = 0, cubic_ = 0;
};

PairMotion randomPair(const Draw& draw, int bits, double approach) {
  PairMotion pair;
  for (auto& points : pair.x) {
    for (auto& point : points) {
      for (double& x : point) x = std::ldexp(draw(-(1 << bits), 1 << bits), -bits);
    }
  }
  for (int i = 0; i < 4; ++i) pair.x[0][i][2] += i == 0 ? approach : 0;
  return pair;
}

/// Random pairs, the well separated ones among them, pairs of slivers, of little motion and far from the origin.
PairList mixedPairs(PairKind kind, std::size_t count, std::uint64_t seed) {
  PairList list(kind);
  const Draw draw = drawFrom(seed);
  for (std::size_t i = 0; i < count; ++i) {
    PairMotion pair = randomPair(draw, draw(2, 26), draw(0, 4));
    if (draw(0, 3) == 0) {
      for (int p = 0; p < 4; ++p) {
        for (int k = 0; k < 3; ++k) pair.x[1][p][k] = pair.x[0][p][k] + std::ldexp(draw(-100, 100), -draw(7, 40));
      }
    }
    if (draw(0, 3) == 0) {
      for (auto& points : pair.x) {
        for (auto& point : points) point[1] = std::ldexp(point[1], -draw(10, 30));
      }
    }
    const double scale = std::ldexp(1.0, draw(-20, 20)), offset = draw(0, 2) == 0 ? draw(-1000, 1000) : 0;
    for (auto& points : pair.x) {
      for (auto& point : points) {
        for (double& x : point) x = x * scale + offset;
      }
    }
    list.add(pair);
  }
  return list;
}

// Whatever the kernel rejects has a certificate; whatever has one beyond twice the margin is rejected. The planes that
// depend on the pair are the kernel's own choice: they may only add to the second.
TEST(FusedFilter, RejectsWhatTheReferenceCertifies) {
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    const PairList list = mixedPairs(kind, 30000, 3);
    const std::vector<bool> coordinate = asMask(keptOf(list, FusedPlanes::COORDINATE), list.size());
    const std::vector<bool> adaptive = asMask(keptOf(list, FusedPlanes::ADAPTIVE), list.size());
    const std::vector<bool> all = asMask(keptOf(list, FusedPlanes::ALL), list.size());
    std::size_t rejected = 0, close = 0;
    for (std::size_t i = 0; i < list.size(); ++i) {
      const Reference reference(kind, motionOf(list, i));
      const long double certificate = reference.coordinatePlanes();
      if (!coordinate[i]) {
        ASSERT_GT(certificate, 0) << toString(kind) << " pair " << i;
      }
      if (coordinate[i]) {
        ASSERT_LE(certificate, 2) << toString(kind) << " pair " << i;
      }
      if (!coordinate[i]) {
        ASSERT_FALSE(adaptive[i]) << "more planes keep less";
      }
      if (!adaptive[i]) {
        ASSERT_FALSE(all[i]) << "more planes keep less";
      }
      if (all[i]) {
        ASSERT_LE(reference.paperPlanes(), 3) << toString(kind) << " pair " << i;
      }
      rejected += !coordinate[i];
      close += std::abs(certificate) < 100;
    }
    EXPECT_GT(rejected, list.size() / 10);
    EXPECT_GT(close, 100u) << "the list has too few pairs near the margins";
  }
}

TEST(FusedFilter, EveryTargetKeepsTheSame) {
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    for (const std::size_t count : {1, 2, 3, 4, 7, 8, 9, 15, 16, 17, 31, 5000}) {
      PairList list = mixedPairs(kind, count, 100 + count);
      RandomSource random(count);
      for (int i = 0; i < 100; ++i) list.add(hardQuery(random, kind, static_cast<Hardness>(i % 15)).motion);
      for (const FusedPlanes planes : {FusedPlanes::COORDINATE, FusedPlanes::ADAPTIVE, FusedPlanes::ALL}) {
        const auto expected = keptOf(list, planes);
        ASSERT_TRUE(std::is_sorted(expected.begin(), expected.end()));
        forEachSimdTarget(
            [&](const std::string& target) { ASSERT_EQ(keptOf(list, planes), expected) << target << count; });
      }
    }
  }
}

// --- truth -----------------------------------------------------------------------------------------------------------

/// A pair that touches on a corner, on a border or inside, made of few bits and then turned and moved with rounding:
/// whether it still touches only exact arithmetic can tell, and certificates are near their margins.
PairMotion grazingPair(const Draw& draw, PairKind kind) {
  double at[4][3], velocity[4][3];  // at the time of contact, in eighths
  for (auto& point : at) {
    for (double& x : point) x = 8 * draw(-16, 16);
  }
  // On a corner, on a border, or inside; of an edge, inside is as good as it gets.
  const int where = draw(0, 3);
  const int s = where == 0 ? 0 : where == 1 ? 8 : draw(0, 8);
  const int r = where == 2 ? 0 : draw(0, kind == PairKind::VERTEX_FACE ? 8 - s : 8);
  for (int k = 0; k < 3; ++k) {
    const double along = (at[1][k] - at[0][k]) / 8;
    if (kind == PairKind::VERTEX_FACE) {
      at[0][k] = at[1][k] + (at[2][k] - at[1][k]) / 8 * s + (at[3][k] - at[1][k]) / 8 * r;
    } else {
      const double meeting = at[0][k] + along * s, direction = at[3][k] / 8;
      at[2][k] = meeting - direction * r;
      at[3][k] = meeting + direction * (8 - r);
    }
  }
  for (auto& v : velocity) {
    for (double& x : v) x = draw(0, 3) == 0 ? 0 : draw(-64, 64);
  }
  const double u = draw(0, 8) / 8.0, size = std::ldexp(1.0, -draw(0, 24));
  double turn[3][3];
  for (auto& row : turn) {
    for (double& x : row) x = draw(-1000000, 1000000) * 1e-6;
  }
  const bool exact = draw(0, 3) == 0;
  const double offset = draw(0, 2) == 0 ? draw(-1000, 1000) * 0.37 : 0;
  PairMotion pair;
  for (int t = 0; t < 2; ++t) {
    for (int i = 0; i < 4; ++i) {
      double x[3];
      for (int k = 0; k < 3; ++k) x[k] = at[i][k] + (t - u) * size * velocity[i][k];
      for (int k = 0; k < 3; ++k) {
        pair.x[t][i][k] = exact ? x[k] : turn[k][0] * x[0] + turn[k][1] * x[1] + turn[k][2] * x[2] + offset;
      }
    }
  }
  return pair;
}

/// No pair that is rejected may touch. Judged by the exact rung; what it calls a contact the oracle must confirm.
std::size_t expectNoContactLost(const PairList& list, const std::string& what) {
  AccuracyOptions options;
  const auto exact = makeRung(options);
  std::vector<ElementaryResult> truth(list.size());
  TierCounters counters;
  exact->run(batchOf(list), truth.data(), counters);
  std::size_t contacts = 0;
  const std::vector<bool> kept = asMask(keptOf(list, FusedPlanes::ALL), list.size());
  for (std::size_t i = 0; i < list.size(); ++i) {
    const bool contact = truth[i].verdict == Verdict::CONTACT;
    contacts += contact;
    if (!contact || kept[i]) continue;
    EXPECT_FALSE(firstContact(list.kind, motionOf(list, i)).has_value())
        << what << ": a true contact is culled, pair " << i;
  }
  return contacts;
}

TEST(FusedFilter, LosesNoContactThatGrazes) {
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    const Draw draw = drawFrom(29);
    PairList list(kind);
    for (int i = 0; i < 60000; ++i) list.add(grazingPair(draw, kind));
    const std::size_t contacts = expectNoContactLost(list, toString(kind));
    std::cout << toString(kind) << ": " << contacts << " of " << list.size() << " grazing pairs touch\n";
    EXPECT_GT(contacts, list.size() / 5);
  }
}

TEST(FusedFilter, LosesNoHardContact) {
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    RandomSource random(31);
    PairList list(kind);
    for (int i = 0; i < 20000; ++i) list.add(hardQuery(random, kind, static_cast<Hardness>(i % 15)).motion);
    EXPECT_GT(expectNoContactLost(list, toString(kind)), 2000u);
  }
}

// --- margins ---------------------------------------------------------------------------------------------------------

bool isKept(PairKind kind, const double (&origin)[3], const double (&a)[3], const double (&b)[3], const double (&c)[3],
            FusedPlanes planes) {
  PairMotion pair;
  const double(*points[4])[3] = {&origin, &a, &b, &c};
  for (auto& x : pair.x) {
    for (int i = 0; i < 4; ++i) {
      // The kernel's origin is the vertex of VF, the last point of EE.
      const int from = kind == PairKind::VERTEX_FACE ? i : (i + 1) % 4;
      std::copy_n(*points[from], 3, x[i]);
    }
  }
  PairList list(kind);
  list.add(pair);
  return !keptOf(list, planes).empty();
}

// Features at rest in a coordinate plane, a = b = (1,0,0), c = (0,x,0) from the origin: n.bc = x, n.ca = -x, all else
// 0, everything exact in float. M = 1, so the margin is 128 u = 2^-17 to the last bit.
TEST(FusedFilter, PlaneMarginToTheLastBit) {
  const double margin = 0x1p-17;
  const double above = std::nextafter(static_cast<float>(margin), 1.0f),
               below = std::nextafter(static_cast<float>(margin), 0.0f);
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const double sign : {1.0, -1.0}) {
        const auto kept = [&](double x) {
          double o[3] = {}, a[3] = {}, c[3] = {};
          a[axis] = 1;
          c[(axis + 1) % 3] = sign * x;
          return isKept(kind, o, a, a, c, FusedPlanes::COORDINATE);
        };
        EXPECT_TRUE(kept(below)) << toString(kind) << axis;
        EXPECT_TRUE(kept(margin)) << toString(kind) << axis;
        EXPECT_FALSE(kept(above)) << toString(kind) << axis;
      }
    }
  }
}

// A vertex above a right triangle at rest: the cubic is h, M = 1, the margin 192 u; no coordinate plane separates them.
TEST(FusedFilter, CubicMarginToTheLastBit) {
  const float margin = 192 * 0x1p-24f;
  const double above = std::nextafter(margin, 1.0f), below = std::nextafter(margin, 0.0f);
  for (const double sign : {1.0, -1.0}) {
    const auto kept = [&](double h) {
      const double o[3] = {0, 0, 0}, a[3] = {0, 0, sign * h}, b[3] = {1, 0, 0}, c[3] = {0, 1, 0};
      return isKept(PairKind::VERTEX_FACE, o, a, b, c, FusedPlanes::COORDINATE);
    };
    EXPECT_TRUE(kept(below));
    EXPECT_TRUE(kept(margin));
    EXPECT_FALSE(kept(above));
  }
}

// What float cannot represent is kept: too large, too small, or a difference that overflows.
TEST(FusedFilter, KeepsWhatIsOutOfRange) {
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    const auto kept = [&](double size) {
      const double o[3] = {0, 0, 0}, a[3] = {size, 0, 0}, b[3] = {size, size / 2, 0}, c[3] = {size, 0, size / 2};
      return isKept(kind, o, a, b, c, FusedPlanes::ALL);
    };
    const auto keptReversed = [&](double size) {
      const double o[3] = {size, size, size}, a[3] = {-size, 0, 0}, b[3] = {-size, size / 2, 0},
                   c[3] = {-size, 0, size / 2};
      return isKept(kind, o, a, b, c, FusedPlanes::ALL);
    };
    if (kind == PairKind::VERTEX_FACE) {
      EXPECT_FALSE(kept(1));
      EXPECT_FALSE(kept(0x1p30)) << "the largest size";
      EXPECT_FALSE(kept(0x1p-30));
    }
    for (const double size : {0x1.000002p30, 1e12, 1e30, 1e39, 1e308, 1.7e308, 1e-18, 1e-30, 1e-200, 5e-324}) {
      EXPECT_TRUE(kept(size)) << size;
      EXPECT_TRUE(keptReversed(size)) << size;
    }
  }
}

TEST(FusedFilter, NothingToDo) {
  const VertexMotion none{};
  std::uint32_t kept = 17;
  for (const bool edge_edge : {false, true}) {
    EXPECT_EQ(simd::fusedFilter(none.t0, nullptr, 0, edge_edge, FusedPlanes::ALL, &kept), 0u);
  }
  EXPECT_EQ(kept, 17u);
}

}  // namespace
}  // namespace test
}  // namespace dccd
