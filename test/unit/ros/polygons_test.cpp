// Polygons become triangles that fill their outline and nothing else: held against rational arithmetic.
#include "input/polygons.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <numeric>
#include <random>

#include <boost/multiprecision/cpp_int.hpp>

namespace dccd {
namespace {

using Rational = boost::multiprecision::cpp_rational;
using Point = std::array<Rational, 2>;

Polygons polygonsOf(const std::vector<std::vector<Index>>& all) {
  Polygons polygons;
  for (const auto& one : all) polygons.add(one);
  return polygons;
}

Polygons onePolygon(std::size_t corners) {
  std::vector<Index> all(corners);
  std::iota(all.begin(), all.end(), Index{0});
  return polygonsOf({all});
}

/// Twice the area of a triangle, positive where it turns left.
Rational area(const Point& a, const Point& b, const Point& c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/// The corners seen along an axis, in rational numbers, and twice their area there.
struct View {
  std::vector<Point> points;
  Rational twice_area = 0;
};

/// Along the axis that shows the largest area, or those that do within rounding.
std::vector<View> largestViews(const Positions& corners) {
  std::vector<View> views(3);
  double extent = 0;
  for (const Vec3& p : corners) extent = std::max(extent, p.cwiseAbs().maxCoeff());
  for (int axis = 0; axis < 3; ++axis) {
    View& view = views[static_cast<std::size_t>(axis)];
    for (const Vec3& p : corners) view.points.push_back({Rational(p[(axis + 1) % 3]), Rational(p[(axis + 2) % 3])});
    for (std::size_t i = 2; i < corners.size(); ++i) {
      view.twice_area += area(view.points[0], view.points[i - 1], view.points[i]);
    }
  }
  Rational least = 0;
  for (const View& view : views) least = std::max<Rational>(least, abs(view.twice_area));
  least -= Rational(extent) * Rational(extent) * Rational(1e-13);
  views.erase(std::remove_if(views.begin(), views.end(), [&](const View& v) { return abs(v.twice_area) < least; }),
              views.end());
  return views;
}

/// Whether the closed segments have a point in common, by the parameters of where their lines meet.
bool meet(const Point& a, const Point& b, const Point& c, const Point& d) {
  const Rational ux = b[0] - a[0], uy = b[1] - a[1], vx = d[0] - c[0], vy = d[1] - c[1];
  const Rational wx = c[0] - a[0], wy = c[1] - a[1];
  const Rational determinant = ux * vy - uy * vx;
  if (determinant != 0) {
    const Rational s = (wx * vy - wy * vx) / determinant, t = (wx * uy - wy * ux) / determinant;
    return s >= 0 && s <= 1 && t >= 0 && t <= 1;
  }
  if (wx * uy != wy * ux) return false;
  const Rational length = ux * ux + uy * uy;  // on one line: where c and d are along a to b
  Rational from = (wx * ux + wy * uy) / length, to = from + (vx * ux + vy * uy) / length;
  if (from > to) std::swap(from, to);
  return from <= 1 && to >= 0;
}

/// Edges that do not follow each other have no point in common, and those that do have only their corner.
bool isSimple(std::vector<Point> points) {
  points.erase(std::unique(points.begin(), points.end()), points.end());
  while (points.size() > 1 && points.front() == points.back()) points.pop_back();
  const std::size_t n = points.size();
  if (n < 3) return false;
  for (std::size_t i = 0; i < n; ++i) {
    const Point &a = points[i], &b = points[(i + 1) % n], &c = points[(i + 2) % n];
    const bool folds = area(a, b, c) == 0 && (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0;
    if (folds) return false;
    for (std::size_t j = 0; j < n; ++j) {
      if (j == i || (j + 1) % n == i || (i + 1) % n == j) continue;
      if (meet(a, b, points[j], points[(j + 1) % n])) return false;
    }
  }
  return true;
}

/// Each triangle turns as the outline does, their areas sum up to its area, its edges are each on one triangle and all
/// others on two: they lie side by side and fill it.
bool fills(const PolygonFaces& got, const View& view) {
  const std::size_t n = view.points.size();
  Rational sum = 0;
  std::map<std::pair<Index, Index>, int> uses;  // of each directed edge
  for (const Face& f : got.faces) {
    const Rational one = area(view.points[f[0]], view.points[f[1]], view.points[f[2]]);
    if (view.twice_area > 0 ? one < 0 : one > 0) return false;
    sum += one;
    for (std::size_t k = 0; k < 3; ++k) ++uses[{f[k], f[(k + 1) % 3]}];
  }
  std::size_t outer = 0;
  for (const auto& [edge, count] : uses) {
    const bool is_outer = edge.second == (edge.first + 1) % n;
    if (count != 1 || uses.count({edge.second, edge.first}) != (is_outer ? 0u : 1u)) return false;
    outer += is_outer;
  }
  return got.faces.size() == n - 2 && sum == view.twice_area && outer == n;
}

/// True: it is simple, and its faces are one triangulation of it. Else it must be unchecked.
bool expectTriangulated(const Positions& corners, const std::string& what) {
  const PolygonFaces got = facesOf(onePolygon(corners.size()), corners);
  EXPECT_EQ(got.ends, std::vector<std::size_t>{got.faces.size()}) << what;
  EXPECT_EQ(got.faces.empty(), got.unchecked.size() == 1) << what;
  const std::vector<View> views = largestViews(corners);
  const bool right = std::any_of(views.begin(), views.end(), [&](const View& view) {
    const bool simple = view.twice_area != 0 && isSimple(view.points);
    return simple ? fills(got, view) : got.faces.empty();
  });
  EXPECT_TRUE(right) << what << (got.faces.empty() ? ": unchecked, but simple" : ": no triangulation");
  return right && !got.faces.empty();
}

/// From another corner, backwards, and in other planes and places.
void expectTriangulatedAnyWay(const Positions& flat, const std::string& what) {
  Positions corners = flat;
  std::rotate(corners.begin(), corners.begin() + static_cast<std::ptrdiff_t>(corners.size() / 3), corners.end());
  expectTriangulated(corners, what + ", turned");
  std::reverse(corners.begin(), corners.end());
  expectTriangulated(corners, what + ", backwards");
  for (Vec3& p : corners) p = Vec3(p.y(), p.z(), p.x());
  expectTriangulated(corners, what + ", upright");
  for (Vec3& p : corners) p.y() = 3 * p.x() - 2 * p.z();
  expectTriangulated(corners, what + ", tilted");
  for (Vec3& p : corners) p *= 1.0 / 3;
  expectTriangulated(corners, what + ", scaled");
  for (Vec3& p : corners) p += Vec3(1000, -2000, 77);
  expectTriangulated(corners, what + ", far off");
  for (const double scale : {1e-200, 1e+200}) {
    Positions scaled = flat;
    for (Vec3& p : scaled) p *= scale;
    expectTriangulated(scaled, what + ", times " + std::to_string(scale));
  }
}

const Positions L = {{3, 0, 0}, {3, 1, 0}, {1, 1, 0}, {1, 3, 0}, {0, 3, 0}, {0, 0, 0}};
const Positions DART = {{0, 0, 0}, {2, 1, 0}, {0, 2, 0}, {1.5, 1, 0}};

TEST(Polygons, TheNotchOfAnLAndOfADartStaysOpen) {
  EXPECT_TRUE(expectTriangulated(L, "L"));
  EXPECT_TRUE(expectTriangulated(DART, "dart"));
  expectTriangulatedAnyWay(L, "L");
  expectTriangulatedAnyWay(DART, "dart");
  const PolygonFaces got = facesOf(onePolygon(4), DART);
  EXPECT_EQ(got.faces, (std::vector<Face>{{3, 0, 1}, {1, 2, 3}})) << "the diagonal from the notch";
}

TEST(Polygons, AConvexOneIsTheFanOfItsFirstCorner) {
  for (const std::size_t n : {4u, 5u, 7u, 1000u}) {
    Positions corners;
    for (std::size_t i = 0; i < n; ++i) {
      const double angle = 2 * M_PI * static_cast<double>(i) / static_cast<double>(n);
      corners.push_back({std::cos(angle), std::sin(angle), 0.5 * std::cos(angle)});
    }
    const PolygonFaces got = facesOf(onePolygon(n), corners);
    ASSERT_EQ(got.faces.size(), n - 2);
    for (Index k = 2; k < n; ++k) EXPECT_EQ(got.faces[k - 2], (Face{0, k - 1, k}));
  }
  // Corners in a row, and two at one place as at the pole of a sphere, are still convex.
  const Positions row = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 2, 0}, {2, 2, 0}, {0, 2, 0}};
  EXPECT_EQ(facesOf(onePolygon(6), row).faces, (std::vector<Face>{{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}}));
  EXPECT_TRUE(expectTriangulated(row, "row"));
}

TEST(Polygons, EveryOneOfASmallGrid) {
  std::mt19937_64 random(7);
  std::size_t simple = 0;
  for (int round = 0; round < 6000; ++round) {
    const std::size_t n = 4 + random() % 4;
    Positions corners;
    for (std::size_t i = 0; i < n; ++i) {
      corners.push_back({static_cast<double>(random() % 4), static_cast<double>(random() % 4), 0});
    }
    simple += expectTriangulated(corners, "grid " + std::to_string(round));
  }
  EXPECT_GT(simple, 300u);
}

/// Around a point, at growing angles, as near and as far as it happens.
Positions star(std::mt19937_64& random, std::size_t n, double flatness) {
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<double> angles;
  for (std::size_t i = 0; i < n; ++i) angles.push_back(2 * M_PI * unit(random));
  std::sort(angles.begin(), angles.end());
  Positions corners;
  for (const double angle : angles) {
    const double r = 0.05 + unit(random);
    corners.push_back({r * std::cos(angle), flatness * r * std::sin(angle), 0});
  }
  return corners;
}

/// Teeth upwards; the gaps reach down to the spine, with corners in a row along it.
Positions comb(std::size_t teeth, double width) {
  Positions corners;
  const double length = static_cast<double>(2 * teeth - 1);
  for (double x = 0; x <= length; ++x) corners.push_back({x * width, 0, 0});
  for (std::size_t t = teeth; t-- > 0;) {
    const double x = 2 * static_cast<double>(t);
    if (t + 1 < teeth) corners.push_back({(x + 1) * width, 1, 0});
    corners.push_back({(x + 1) * width, 4, 0});
    corners.push_back({x * width, 4, 0});
    if (t > 0) corners.push_back({x * width, 1, 0});
  }
  return corners;
}

Positions spiral(std::size_t n) {
  Positions corners;
  for (std::size_t i = 0; i < n; ++i) {
    const double a = 0.5 * static_cast<double>(i);
    corners.push_back({(1 + a) * std::cos(a), (1 + a) * std::sin(a), 0});
  }
  for (std::size_t i = n; i-- > 0;) {
    const double a = 0.5 * static_cast<double>(i);
    corners.push_back({(1.6 + a) * std::cos(a), (1.6 + a) * std::sin(a), 0});
  }
  return corners;
}

TEST(Polygons, StarsCombsAndSpirals) {
  std::mt19937_64 random(11);
  for (int round = 0; round < 20; ++round) {
    const std::size_t n = 4 + random() % 30;
    for (const double flatness : {1.0, 1e-9, 1e-16}) {
      expectTriangulatedAnyWay(star(random, n, flatness), "star " + std::to_string(round));
    }
  }
  for (const std::size_t teeth : {2u, 3u, 8u}) {
    for (const double width : {1.0, 1e-12}) expectTriangulatedAnyWay(comb(teeth, width), "comb");
  }
  EXPECT_TRUE(expectTriangulated(comb(20, 1), "comb"));
  EXPECT_TRUE(expectTriangulated(spiral(40), "spiral"));
  expectTriangulatedAnyWay(spiral(12), "spiral");
}

/// A notch that is one or two bits of a coordinate deep or wide, inwards or outwards.
TEST(Polygons, SliversOfOneBit) {
  std::mt19937_64 random(13);
  const auto bits = [&](double x) {
    for (auto k = random() % 3; k > 0; --k) x = std::nextafter(x, random() % 2 ? 10 : -10);
    return x;
  };
  std::size_t simple = 0;
  for (int round = 0; round < 3000; ++round) {
    Positions corners = {{0.1, 0.1, 0}, {1.1, 0.1, 0}, {1.1, 1.1, 0}, {0.6, 0.6, 0}, {0.3, 0.3, 0}};
    if (round % 3 == 0) corners.push_back({0.2, 0.2, 0});
    if (round % 5 == 0) corners.insert(corners.begin() + 2, corners[2]);
    for (Vec3& p : corners) p = Vec3(bits(p.x()), bits(p.y()), 0);
    simple += expectTriangulated(corners, "sliver " + std::to_string(round));
  }
  EXPECT_GT(simple, 1000u);
}

/// A quadrilateral that is bent is still its two triangles, and an L that is bent is what its outline is from above.
TEST(Polygons, ThoseThatAreNotPlaneAreTriangulatedAsTheyAreSeen) {
  std::mt19937_64 random(17);
  std::normal_distribution<double> bend(0, 0.1);
  for (int round = 0; round < 100; ++round) {
    Positions corners = round % 2 ? L : DART;
    for (Vec3& p : corners) p.z() = bend(random);
    EXPECT_TRUE(expectTriangulated(corners, "bent")) << round;
    EXPECT_EQ(facesOf(onePolygon(corners.size()), corners).faces,
              facesOf(onePolygon(corners.size()), round % 2 ? L : DART).faces);
  }
}

TEST(Polygons, WhatCannotBeTriangulatedIsUnchecked) {
  const double nan = std::nan("");
  const Positions points = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {2, 0, 0}, {3, 0, 0}, {nan, 0, 0}};
  const auto unchecked = [&](const std::vector<Index>& polygon) {
    const PolygonFaces got = facesOf(polygonsOf({polygon}), points);
    EXPECT_EQ(got.faces.empty(), !got.unchecked.empty());
    return !got.unchecked.empty();
  };
  EXPECT_FALSE(unchecked({0, 1, 2, 3}));
  EXPECT_TRUE(unchecked({0, 2, 1, 3})) << "a bow tie";
  EXPECT_TRUE(unchecked({0, 1, 4, 5})) << "no area";
  EXPECT_TRUE(unchecked({0, 1, 2, 0, 3})) << "a corner twice";
  EXPECT_FALSE(unchecked({0, 0, 1, 2, 2, 0})) << "the same one again is no other corner";
  EXPECT_FALSE(unchecked({0, 1, 4})) << "a triangle is itself";
  EXPECT_FALSE(unchecked({0, 1, 6})) << "be it where it may";
  for (const std::vector<Index>& few : {std::vector<Index>{0}, {0, 1}, {0, 1, 1}, {1, 1, 1}}) {
    EXPECT_TRUE(unchecked(few));
  }
  EXPECT_TRUE(unchecked({0, 1, 2, 6}));
  EXPECT_TRUE(facesOf(polygonsOf({{}}), points).unchecked.empty());
}

TEST(Polygons, WhatTheyBecameIsKeptAndWhatWasNotFiniteIsLookedAtAgain) {
  // A dart, a bow tie and an L, whose last corner is missing at first; and an edge that only the L has.
  Positions points = DART;
  points.insert(points.end(), {{5, 0, 0}, {6, 1, 0}, {6, 0, 0}, {5, 1, 0}});
  points.insert(points.end(), L.begin(), L.end());
  const Polygons polygons = polygonsOf({{0, 1, 2, 3}, {4, 5, 6, 7}, {8, 9, 10, 11, 12, 13}, {8, 9}});
  Positions gap = points;
  gap.back().x() = std::nan("");
  const PolygonFaces first = facesOf(polygons, gap);
  EXPECT_EQ(first.unchecked, (std::vector<std::size_t>{1, 2, 3}));
  EXPECT_EQ(first.unseen, (std::vector<std::size_t>{2}));
  // By then the dart is convex, and the bow tie a square.
  points[3] = {-1, 1, 0};
  std::swap(points[5], points[6]);
  const PolygonFaces second = facesOf(polygons, points, &first);
  EXPECT_EQ(second.unchecked, (std::vector<std::size_t>{1}));
  EXPECT_TRUE(second.unseen.empty());
  EXPECT_EQ(second.faces.size(), 6u);
  EXPECT_TRUE(std::equal(first.faces.begin(), first.faces.end(), second.faces.begin()));
  EXPECT_EQ(second.ends, (std::vector<std::size_t>{2, 2, 6, 6}));
  EXPECT_NE(facesOf(polygons, points).faces, second.faces) << "as if they had not come before";
}

TEST(Polygons, AnEdgeOrAVertexThatAFaceHasIsChecked) {
  const Positions points = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {5, 5, 5}};
  const PolygonFaces got =
      facesOf(polygonsOf({{2, 0}, {0, 1, 2, 3}, {1, 3}, {3, 3, 3}, {4}, {3, 4, 4}, {1, 2, 2}, {0, 4, 3}}), points);
  EXPECT_EQ(got.unchecked, (std::vector<std::size_t>{2})) << "the other diagonal";
  EXPECT_EQ(got.ends, (std::vector<std::size_t>{0, 2, 2, 2, 2, 2, 2, 3})) << "the faces of each polygon";
}

TEST(Polygons, ManyCornersTakeBoundedTime) {
  const auto combOf = [](std::size_t corners) { return comb((corners + 4) / 6, 1); };
  EXPECT_EQ(facesOf(onePolygon(256), combOf(256)).unchecked.size(), 0u);
  EXPECT_EQ(combOf(256).size(), MAX_CONCAVE_CORNERS);
  const Positions more = combOf(262);
  EXPECT_EQ(facesOf(onePolygon(more.size()), more).unchecked.size(), 1u);
  const Positions million = combOf(1000000);
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(facesOf(onePolygon(million.size()), million).unchecked.size(), 1u);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
}

}  // namespace
}  // namespace dccd
