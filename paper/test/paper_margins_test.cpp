// The filters' margins: they hold against exact arithmetic, they decide one representable number either side, and
// zero proves nothing.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "oracle/algebraic.h"
#include "paper/linear_reference.h"
#include "paper/non_penetration.h"
#include "paper/paper_filters.h"
#include "paper/planar_reference.h"
#include "support/simd_targets.h"

namespace dccd {
namespace {

using test::Rational;

constexpr Quad PAIR{0, 1, 2, 3};
constexpr PairKind KINDS[] = {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE};

struct Plane2 {
  Rational x, y;
};
Plane2 operator-(const Plane2& a, const Plane2& b) { return {a.x - b.x, a.y - b.y}; }
Rational cross(const Plane2& a, const Plane2& b) { return a.x * b.y - a.y * b.x; }

Rational projection(const double* x, std::size_t lane) {
  Rational sum = 0;
  for (std::size_t k = 0; k < 3; ++k) sum += Rational(x[k]) * PAPER_DIRECTION[lane][k];
  return sum;
}

/// Four points near each other, at `centre`; two more widen the scene to `extent`, which sets the records' rounding.
/// flat: nearly coplanar and nearly degenerate, where signs are hardest.
std::vector<VertexMotion> closePair(std::mt19937_64& random, double centre, double extent, bool flat) {
  std::uniform_real_distribution<double> place(-1, 1);
  std::vector<VertexMotion> v(6, VertexMotion{});
  const double size = std::ldexp(1.0, -static_cast<int>(random() % 30));
  for (int i = 0; i < 4; ++i) {
    for (double* x : {v[i].t0, v[i].t1}) {
      const double along = size * place(random), across = size * place(random);
      const int flatness = flat ? static_cast<int>(random() % 40) : 0;
      const double off = size * std::ldexp(place(random), -flatness);
      x[0] = centre + along;
      x[1] = centre + across;
      x[2] = centre + along - across + off;
    }
  }
  v[4].t0[0] = v[4].t1[1] = centre - extent;
  v[5].t0[0] = v[5].t1[1] = centre + extent;
  return v;
}

TEST(PlanarMargin, ExceedsTheErrorOfEveryCoefficient) {
  std::mt19937_64 random(11);
  double closest = 0;
  for (int n = 0; n < 1500; ++n) {
    const double centre = n % 3 == 0 ? 0.0 : n % 3 == 1 ? 17.3 : 1e9;
    const auto v = closePair(random, centre, n % 2 ? 1.0 : 100.0, n % 4 < 2);
    PaperRecords records;
    records.build(v.data(), v.size());
    const Rational scale_sq = Rational(records.scale()) * Rational(records.scale());
    for (PairKind kind : KINDS) {
      const std::size_t plane = random() % PAPER_DIRECTIONS;
      const auto q = planarCoefficients(kind, records.data(), PAIR, plane, records.error());
      const bool vf = kind == PairKind::VERTEX_FACE;
      const int o = vf ? 0 : 3, a = vf ? 1 : 0, b = vf ? 2 : 1, c = vf ? 3 : 2;
      Plane2 p[2][3];
      for (int t = 0; t < 2; ++t) {
        const auto at = [&](int i) {
          const double* x = t ? v[i].t1 : v[i].t0;
          return Plane2{projection(x, plane), projection(x, PAPER_ROTATED[plane])};
        };
        p[t][0] = at(a) - at(o);
        p[t][1] = at(b) - at(o);
        p[t][2] = at(c) - at(o);
      }
      const Rational margin(q.margin);
      Rational total[3] = {0, 0, 0};
      const auto check = [&](const float* computed, int i, int j) {
        const Rational exact[3] = {cross(p[0][i], p[0][j]) * scale_sq,
                                   (cross(p[0][i], p[1][j]) + cross(p[1][i], p[0][j])) * scale_sq,
                                   cross(p[1][i], p[1][j]) * scale_sq};
        for (int k = 0; k < 3; ++k) {
          EXPECT_LE(abs(exact[k] - Rational(computed[k])), margin);
          total[k] += exact[k];
        }
      };
      check(q.bc, 1, 2);
      check(q.ca, 2, 0);
      check(q.ab, 0, 1);
      for (int k = 0; k < 3; ++k) {
        const Rational error = abs(total[k] - Rational(q.total[k]));
        EXPECT_LE(error, margin);
        closest = std::max(closest, static_cast<double>(Rational(error / margin)));
      }
    }
  }
  EXPECT_GT(closest, 0.01) << "the margin is so wide that this test could not see a wrong term";
}

using Space3 = std::array<Rational, 3>;
Rational det(const Space3& u, const Space3& v, const Space3& w) {
  return u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
}

TEST(NonPenetrationMargin, ExceedsTheErrorOfEveryCoefficient) {
  std::mt19937_64 random(12);
  double closest_float = 0, closest_double = 0;
  for (int n = 0; n < 1500; ++n) {
    const double centre = n % 3 == 0 ? 0.0 : n % 3 == 1 ? 17.3 : 1e9;
    const auto v = closePair(random, centre, n % 2 ? 1.0 : 100.0, n % 4 < 2);
    PaperRecords records;
    records.build(v.data(), v.size());
    const Rational scale(records.scale());
    for (PairKind kind : KINDS) {
      const bool vf = kind == PairKind::VERTEX_FACE;
      Space3 u[2], w[2], s[2];
      const auto difference = [&](int t, int i, int j) {
        Space3 d;
        for (int k = 0; k < 3; ++k) {
          d[k] = Rational(t ? v[i].t1[k] : v[i].t0[k]) - Rational(t ? v[j].t1[k] : v[j].t0[k]);
        }
        return d;
      };
      for (int t = 0; t < 2; ++t) {
        u[t] = vf ? difference(t, 2, 1) : difference(t, 1, 0);
        s[t] = vf ? difference(t, 3, 1) : difference(t, 3, 2);
        w[t] = vf ? difference(t, 0, 1) : difference(t, 2, 0);
      }
      const Rational exact[4] = {
          det(u[0], s[0], w[0]), det(u[0], s[0], w[1]) + det(u[0], s[1], w[0]) + det(u[1], s[0], w[0]),
          det(u[0], s[1], w[1]) + det(u[1], s[0], w[1]) + det(u[1], s[1], w[0]), det(u[1], s[1], w[1])};
      const auto in_double = coplanarityCoefficients(kind, v.data(), PAIR);
      const auto in_float = coplanarityCoefficients(kind, records.data(), PAIR, records.error());
      for (int k = 0; k < 4; ++k) {
        if (!std::isfinite(in_double.margin)) break;  // all points in one place: kept without looking
        const Rational error_double = abs(exact[k] - Rational(in_double.b[k]));
        EXPECT_LE(error_double, Rational(in_double.margin));
        closest_double = std::max(closest_double, static_cast<double>(Rational(error_double / in_double.margin)));
        const Rational error_float = abs(exact[k] * scale * scale * scale - Rational(in_float.b[k]));
        EXPECT_LE(error_float, Rational(in_float.margin));
        closest_float = std::max(closest_float, static_cast<double>(Rational(error_float / in_float.margin)));
      }
    }
  }
  EXPECT_GT(closest_double, 0.002) << "the margin is so wide that this test could not see a wrong term";
  EXPECT_GT(closest_float, 0.005) << "the margin is so wide that this test could not see a wrong term";
}

/// Rejected by the reference and by the kernel of every target; they must agree.
bool rejected(PaperFilter filter, PairKind kind, const std::vector<VertexMotion>& v) {
  PaperRecords records;
  records.build(v.data(), v.size());
  const bool reference = filterRejects(filter, kind, records, v.data(), PAIR);
  test::forEachTarget([&](const std::string& target) {
    Quad out;
    EXPECT_EQ(filterPairs(filter, kind, records, v.data(), &PAIR, 1, &out), reference ? 0u : 1u) << target;
  });
  return reference;
}

/// The edge of a feature at y = 0 and the other feature above it, `gap` away in y alone; the scene spans [-1, 1].
/// Every direction but y sees the features overlap or touch.
std::vector<VertexMotion> stacked(PairKind kind, double gap) {
  const double face[3][3] = {{-1, 0, -1}, {1, 0, -1}, {0, 0, 1}};
  std::vector<VertexMotion> v(6, VertexMotion{});
  const auto place = [&](int i, double x, double y, double z) {
    for (double* p : {v[i].t0, v[i].t1}) {
      p[0] = x;
      p[1] = y;
      p[2] = z;
    }
  };
  if (kind == PairKind::VERTEX_FACE) {
    place(0, 0, gap, 0);
    for (int i = 0; i < 3; ++i) place(i + 1, face[i][0], face[i][1], face[i][2]);
  } else {
    place(0, -1, gap, 0);
    place(1, 1, gap, 0);
    place(2, 0, 0, -1);
    place(3, 0, 0, 1);
  }
  place(4, -1, -1, -1);
  place(5, 1, 1, 1);
  return v;
}

TEST(LinearFilter, TouchingIsKeptAndOneRepresentableNumberApartIsRejected) {
  // The scene is 4 wide in its widest direction, so that its records are scaled by 1/4.
  const double smallest = 4.0 * std::numeric_limits<float>::denorm_min();
  for (PairKind kind : KINDS) {
    for (PaperFilter filter : {PaperFilter::LINEAR, PaperFilter::PRIMITIVE_BV}) {
      EXPECT_FALSE(rejected(filter, kind, stacked(kind, 0.0)));
      EXPECT_FALSE(rejected(filter, kind, stacked(kind, -0.0)));
      EXPECT_TRUE(rejected(filter, kind, stacked(kind, smallest)));
      EXPECT_TRUE(rejected(filter, kind, stacked(kind, -smallest)));
      // Too small for a record: stored as equal, hence kept although apart.
      EXPECT_FALSE(rejected(filter, kind, stacked(kind, smallest / 4)));
    }
  }
}

TEST(LinearFilter, CrossingDuringTheStepIsKeptWhateverTheEndsSay) {
  for (PairKind kind : KINDS) {
    auto v = stacked(kind, 0.25);
    const int moving = kind == PairKind::VERTEX_FACE ? 1 : 2;
    for (int i = 0; i < moving; ++i) v[i].t1[1] = -0.25;
    EXPECT_FALSE(rejected(PaperFilter::LINEAR, kind, v));
    for (int i = 0; i < moving; ++i) v[i].t1[1] = 0;  // ends in contact
    EXPECT_FALSE(rejected(PaperFilter::LINEAR, kind, v));
  }
}

TEST(LinearFilter, FollowsBothFeaturesWhereSweptBoundsOverlap) {
  for (PairKind kind : KINDS) {
    auto v = stacked(kind, 0.25);
    for (int i = 0; i < 4; ++i) v[i].t1[1] += 0.5;  // both move up by more than the gap
    EXPECT_TRUE(rejected(PaperFilter::LINEAR, kind, v));
    EXPECT_FALSE(rejected(PaperFilter::PRIMITIVE_BV, kind, v));
  }
}

/// Between a distance that is kept and one that is rejected: two neighbouring floats, the first kept, the second not.
template <class Rejects>
std::pair<float, float> threshold(float kept, float rejected_at, const Rejects& rejects) {
  while (std::nextafter(kept, rejected_at) != rejected_at) {
    const float middle = kept + (rejected_at - kept) / 2;
    const float m = middle == kept || middle == rejected_at ? std::nextafter(kept, rejected_at) : middle;
    (rejects(m) ? rejected_at : kept) = m;
  }
  return {kept, rejected_at};
}

/// A vertex right of the diagonal edge of a face in the plane z = 0, at `distance` from it (VF), or two edges side by
/// side (EE); all in one plane, so that only planar tests in that plane see the gap.
std::vector<VertexMotion> sideBySide(PairKind kind, float distance) {
  std::vector<VertexMotion> v(6, VertexMotion{});
  const auto place = [&](int i, double x, double y) {
    for (double* p : {v[i].t0, v[i].t1}) {
      p[0] = x;
      p[1] = y;
    }
  };
  // The line from (-1/2, -1) to (1/2, 1): none of the directions is its normal.
  if (kind == PairKind::VERTEX_FACE) {
    place(0, distance, 0);
    place(1, -0.5, -1);
    place(2, 0.5, 1);
    place(3, -1, 1);
  } else {
    place(0, distance, 0);
    place(1, distance + 0.25, 0.125);
    place(2, -0.5, -1);
    place(3, 0.5, 1);
  }
  place(4, -1, -1);
  place(5, 1, 1);
  return v;
}

TEST(PlanarFilter, DecidesOneRepresentableNumberEitherSideOfItsMargin) {
  for (PairKind kind : KINDS) {
    for (PaperFilter filter : {PaperFilter::PLANAR_PAPER, PaperFilter::PLANAR_BRANCH_FREE}) {
      ASSERT_FALSE(rejected(filter, kind, sideBySide(kind, 0.0f))) << "in contact";
      ASSERT_TRUE(rejected(filter, kind, sideBySide(kind, 0.25f)));
      const auto [kept, apart] = threshold(0.0f, 0.25f, [&, filter = filter, kind = kind](float d) {
        return rejected(filter, kind, sideBySide(kind, d));
      });
      EXPECT_GT(kept, 0.0f) << "no margin at all";
      EXPECT_LT(apart, 1e-4f) << "a needlessly wide margin";
      // In the xy plane the coefficient that decides is on the margin's two sides.
      const auto deciding = [kind = kind](float d) {
        const auto v = sideBySide(kind, d);
        PaperRecords records;
        records.build(v.data(), v.size());
        const auto q = planarCoefficients(kind, records.data(), PAIR, 0, records.error());
        const float* c = kind == PairKind::VERTEX_FACE ? q.ab : q.ca;
        return std::min({std::abs(c[0]), std::abs(c[1]), std::abs(c[2])}) / q.margin;
      };
      EXPECT_LE(deciding(kept), 1.0f);
      EXPECT_GT(deciding(apart), 1.0f - 1e-6f);
    }
  }
}

TEST(NonPenetrationFilter, DecidesOneRepresentableNumberEitherSideOfItsMargin) {
  const auto lifted = [](PairKind kind, float height) {
    auto v = sideBySide(kind, 0.25f);
    const int moving = kind == PairKind::VERTEX_FACE ? 1 : 2;
    for (int i = 0; i < moving; ++i) v[i].t0[2] = v[i].t1[2] = height;
    return v;
  };
  for (PairKind kind : KINDS) {
    for (PaperFilter filter : {PaperFilter::NON_PENETRATION, PaperFilter::NON_PENETRATION_BATCHED}) {
      ASSERT_FALSE(rejected(filter, kind, lifted(kind, 0.0f)));
      ASSERT_TRUE(rejected(filter, kind, lifted(kind, 0.25f)));
      const auto [kept, apart] = threshold(
          0.0f, 0.25f, [&, filter = filter, kind = kind](float h) { return rejected(filter, kind, lifted(kind, h)); });
      EXPECT_GT(kept, 0.0f) << "no margin at all";
      EXPECT_LT(apart, filter == PaperFilter::NON_PENETRATION ? 1e-12f : 1e-3f) << "a needlessly wide margin";
    }
  }
}

TEST(NonPenetrationFilter, KeepsWhatItsArithmeticCannotHold) {
  for (const double scale : {0x1p-310, 0x1p310}) {
    for (PairKind kind : KINDS) {
      auto v = stacked(kind, 0.25);
      for (VertexMotion& x : v) {
        for (int k = 0; k < 3; ++k) {
          x.t0[k] *= scale;
          x.t1[k] *= scale;
        }
      }
      EXPECT_FALSE(nonPenetrationSeparated(kind, v.data(), PAIR));
      EXPECT_TRUE(rejected(PaperFilter::NON_PENETRATION_BATCHED, kind, v)) << "records are scaled, so this one can";
    }
  }
}

TEST(PlanarFilter, BranchFreeFormCoversBothAlgorithms) {
  std::mt19937_64 random(21);
  std::uniform_real_distribution<double> place(-1, 1), shift(-0.2, 0.2);
  std::size_t paper = 0, more = 0;
  for (int n = 0; n < 20000; ++n) {
    std::vector<VertexMotion> v(4, VertexMotion{});
    for (VertexMotion& x : v) {
      for (int k = 0; k < 3; ++k) {
        x.t0[k] = place(random);
        x.t1[k] = x.t0[k] + shift(random);
      }
    }
    PaperRecords records;
    records.build(v.data(), v.size());
    for (PairKind kind : KINDS) {
      const bool by_paper = planarSeparated(PlanarForm::PAPER, kind, records.data(), PAIR, records.error());
      const bool branch_free = planarSeparated(PlanarForm::BRANCH_FREE, kind, records.data(), PAIR, records.error());
      EXPECT_TRUE(branch_free || !by_paper);
      paper += by_paper;
      more += branch_free && !by_paper;
    }
  }
  EXPECT_GT(paper, 1000u);
  EXPECT_GT(more, 100u) << "it should cover more than the algorithms";
}

}  // namespace
}  // namespace dccd
