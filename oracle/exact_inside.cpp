#include "oracle/exact_inside.h"

#include <algorithm>
#include <optional>
#include <random>

#include "oracle/algebraic.h"

namespace dccd {
namespace test {
namespace {

using Point = std::array<Rational, 3>;

Rational dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Point cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Point minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

/// Is the origin on the closed segment?
bool holdsOrigin(const Point& a, const Point& b) {
  const Point normal = cross(a, b);
  return dot(normal, normal) == 0 && dot(a, b) <= 0;
}

/// Is the origin on the closed triangle? A triangle without area is the union of its sides.
bool holdsOrigin(const Point& a, const Point& b, const Point& c) {
  if (holdsOrigin(a, b) || holdsOrigin(b, c) || holdsOrigin(c, a)) return true;
  const Point normal = cross(minus(b, a), minus(c, a));
  if (dot(normal, normal) == 0 || dot(normal, a) != 0) return false;
  return dot(cross(a, b), normal) > 0 && dot(cross(b, c), normal) > 0 && dot(cross(c, a), normal) > 0;
}

/// Does the ray from the origin cross the triangle, which does not hold the origin? None: it meets the border.
std::optional<bool> crosses(const Point& ray, const Point& a, const Point& b, const Point& c) {
  const Point normal = cross(minus(b, a), minus(c, a));
  if (dot(normal, normal) == 0) return false;  // thin as it is, a ray that meets no edge passes it
  const Rational u = dot(ray, cross(b, c)), v = dot(ray, cross(c, a)), w = dot(ray, cross(a, b));
  if (std::min({u, v, w}) < 0 && std::max({u, v, w}) > 0) return false;
  if (u == 0 || v == 0 || w == 0) return std::nullopt;
  return dot(normal, a) * dot(normal, ray) > 0;
}

}  // namespace

bool isInSolid(const Vec3& point, const std::vector<std::array<Vec3, 3>>& faces) {
  std::vector<std::array<Point, 3>> from_here;
  for (const auto& face : faces) {
    std::array<Point, 3> f;
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) f[i][k] = Rational(face[i][k]) - Rational(point[k]);
    }
    if (holdsOrigin(f[0], f[1], f[2])) return true;
    from_here.push_back(f);
  }
  std::mt19937 random(1);
  for (;;) {
    Point ray;
    for (Rational& x : ray) x = static_cast<int>(random() % 2000001) - 1000000;
    std::size_t crossings = 0;
    bool generic = true;
    for (const auto& f : from_here) {
      const std::optional<bool> crossing = crosses(ray, f[0], f[1], f[2]);
      generic = generic && crossing.has_value();
      crossings += crossing.value_or(false);
    }
    if (generic) return crossings % 2 == 1;
  }
}

}  // namespace test
}  // namespace dccd
