#include "support/generators.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "support/query_symmetries.h"

namespace dccd {
namespace test {
namespace {

using Point = std::array<double, 3>;
using Points = std::array<Point, 4>;

int integer(RandomSource& random, int lo, int hi) { return std::uniform_int_distribution<int>(lo, hi)(random); }
double real(RandomSource& random, double lo, double hi) {
  return std::uniform_real_distribution<double>(lo, hi)(random);
}
bool oneIn(RandomSource& random, int n) { return integer(random, 1, n) == 1; }

template <typename Draw>
Point drawPoint(Draw draw) {
  Point point;
  for (double& value : point) value = draw();
  return point;
}

Point operator+(const Point& a, const Point& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
Point operator-(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Point operator*(double s, const Point& a) { return {s * a[0], s * a[1], s * a[2]}; }

Query queryOf(PairKind kind, const Points& t0, const Points& t1) {
  Query query;
  query.kind = kind;
  for (int point = 0; point < 4; ++point) {
    std::copy(t0[point].begin(), t0[point].end(), query.motion.x[0][point]);
    std::copy(t1[point].begin(), t1[point].end(), query.motion.x[1][point]);
  }
  return query;
}

Point smallIntegers(RandomSource& random, int largest) {
  return drawPoint([&] { return double(integer(random, -largest, largest)); });
}

/// Features of integer coordinates that touch: in a random place of both, borders and corners included.
Points touching(RandomSource& random, PairKind kind) {
  constexpr int PARTS = 4;
  const auto vector = [&] { return smallIntegers(random, 3); };
  const Point a = vector(), u = vector(), v = vector();
  if (kind == PairKind::VERTEX_FACE) {
    const int i = integer(random, 0, PARTS), j = integer(random, 0, PARTS - i);
    return {a + double(i) * u + double(j) * v, a, a + double(PARTS) * u, a + double(PARTS) * v};
  }
  const int i = integer(random, 0, PARTS), j = integer(random, 0, PARTS);
  const Point meeting = a + double(i) * u;
  return {a, a + double(PARTS) * u, meeting - double(j) * v, meeting + double(PARTS - j) * v};
}

/// The positions `at` at the time tenth/8, moving with the velocities.
Query movingThrough(PairKind kind, const Points& at, const Points& velocity, int eighth) {
  Points t0, t1;
  for (int i = 0; i < 4; ++i) {
    t0[i] = 8.0 * at[i] - double(eighth) * velocity[i];
    t1[i] = 8.0 * at[i] + double(8 - eighth) * velocity[i];
  }
  return queryOf(kind, t0, t1);
}

Points velocities(RandomSource& random, int largest) {
  Points result;
  for (Point& velocity : result) velocity = oneIn(random, 4) ? Point{} : smallIntegers(random, largest);
  return result;
}

void nudgeOneUlp(RandomSource& random, double& value) {
  value = std::nextafter(value, oneIn(random, 2) ? HUGE_VAL : -HUGE_VAL);
}

double& anyCoordinate(RandomSource& random, Query& query) {
  return query.motion.x[integer(random, 0, 1)][integer(random, 0, 3)][integer(random, 0, 2)];
}

/// A rotation and scaling that rounds: exact contacts become contacts to within rounding.
void rotateRounded(RandomSource& random, Query& query) {
  double matrix[3][3];
  for (auto& row : matrix) {
    for (double& value : row) value = real(random, -1, 1);
  }
  for (auto& points : query.motion.x) {
    for (auto& point : points) {
      double result[3];
      for (int i = 0; i < 3; ++i) {
        result[i] = matrix[i][0] * point[0] + matrix[i][1] * point[1] + matrix[i][2] * point[2];
      }
      std::copy(result, result + 3, point);
    }
  }
}

Query general(RandomSource& random, PairKind kind) {
  Query query;
  query.kind = kind;
  const double motion = std::ldexp(1.0, -integer(random, 0, 20));
  forEachCoordinate(query, [&](double& value) { value = real(random, -1, 1); });
  if (oneIn(random, 2)) return query;
  for (int point = 0; point < 4; ++point) {
    for (int axis = 0; axis < 3; ++axis) {
      query.motion.x[1][point][axis] = query.motion.x[0][point][axis] + motion * real(random, -1, 1);
    }
  }
  return query;
}

Query smallGrid(RandomSource& random, PairKind kind) {
  Query query;
  query.kind = kind;
  const int largest = integer(random, 1, 3);
  forEachCoordinate(query, [&](double& value) { value = integer(random, -largest, largest); });
  return query;
}

Query grazing(RandomSource& random, PairKind kind, int eighth) {
  Query query = movingThrough(kind, touching(random, kind), velocities(random, 5), eighth);
  if (oneIn(random, 3)) rotateRounded(random, query);
  if (oneIn(random, 3)) nudgeOneUlp(random, anyCoordinate(random, query));
  return query;
}

Query parallel(RandomSource& random, PairKind kind) {
  const Point along = smallIntegers(random, 4), across = smallIntegers(random, 4), start = smallIntegers(random, 4);
  const auto onPlane = [&](double s, double r) { return start + s * along + r * across; };
  const auto number = [&] { return double(integer(random, -3, 3)); };
  Points t0, t1;
  if (kind == PairKind::VERTEX_FACE) {  // the face and its motion stay in one plane; the vertex comes from anywhere
    for (int i = 1; i < 4; ++i) t0[i] = onPlane(number(), number());
    for (int i = 1; i < 4; ++i) t1[i] = onPlane(number(), number());
    t0[0] = onPlane(number(), number());
    t1[0] = oneIn(random, 2) ? onPlane(number(), number()) : smallIntegers(random, 4);
  } else {
    for (Points* points : {&t0, &t1}) {
      const Point a = smallIntegers(random, 3), c = oneIn(random, 2) ? a + number() * along : smallIntegers(random, 3);
      *points = {a, a + number() * along, c, c + number() * along};
    }
  }
  return queryOf(kind, t0, t1);
}

Query collinear(RandomSource& random, PairKind kind) {
  const Point direction = smallIntegers(random, 4), start = smallIntegers(random, 4);
  const Point drift = oneIn(random, 2) ? Point{} : smallIntegers(random, 4);
  Points t0, t1;
  for (int i = 0; i < 4; ++i) {
    t0[i] = start + double(integer(random, -6, 6)) * direction;
    t1[i] = start + drift + double(integer(random, -6, 6)) * direction;
  }
  return queryOf(kind, t0, t1);
}

/// Shrinks the features onto a line, but for a little, and lets them move.
Query sliver(RandomSource& random, PairKind kind) {
  Points at = touching(random, kind);
  const Point direction = smallIntegers(random, 3);
  const double little = std::ldexp(1.0, -integer(random, 10, 60));
  for (Point& point : at) {
    const double along = double(integer(random, -3, 3));
    point = along * direction + little * point;
  }
  Points velocity = velocities(random, 3);
  if (oneIn(random, 2)) std::for_each(velocity.begin(), velocity.end(), [&](Point& v) { v = little * v; });
  Query query = movingThrough(kind, at, velocity, integer(random, 0, 8));
  if (oneIn(random, 3)) rotateRounded(random, query);
  return query;
}

/// At a dyadic time all points lie in one plane or on one line; before and after it, on the two sides of it.
Query turning(RandomSource& random, PairKind kind) {
  Points at;
  const Point u = smallIntegers(random, 3), v = oneIn(random, 2) ? Point{} : smallIntegers(random, 3);
  for (Point& point : at) point = double(integer(random, -3, 3)) * u + double(integer(random, -3, 3)) * v;
  Query query = movingThrough(kind, at, velocities(random, 4), integer(random, 0, 8));
  if (oneIn(random, 3)) rotateRounded(random, query);
  return query;
}

Query oneUlp(RandomSource& random, PairKind kind) {
  Query query = grazing(random, kind, integer(random, 0, 8));
  auto& x = query.motion.x;
  const int from = integer(random, 0, 1);
  for (int point = 0; point < 4; ++point) {
    for (int axis = 0; axis < 3; ++axis) {
      double& value = x[1 - from][point][axis] = x[from][point][axis];
      if (oneIn(random, 3)) nudgeOneUlp(random, value);
    }
  }
  return query;
}

Query hugeTranslation(RandomSource& random, PairKind kind) {
  Query query = oneIn(random, 2) ? grazing(random, kind, integer(random, 0, 8)) : general(random, kind);
  const double size = std::ldexp(1.0, integer(random, 10, 50));
  const Point place = drawPoint([&] { return oneIn(random, 3) ? 0.0 : size * real(random, -1, 1); });
  const Point way = oneIn(random, 2) ? Point{} : drawPoint([&] { return size * real(random, -1, 1); });
  for (int time = 0; time < 2; ++time) {
    for (auto& point : query.motion.x[time]) {
      for (int axis = 0; axis < 3; ++axis) point[axis] += place[axis] + time * way[axis];
    }
  }
  return query;
}

Query coincident(RandomSource& random, PairKind kind) {
  Query query = oneIn(random, 2) ? smallGrid(random, kind) : general(random, kind);
  const int first = kind == PairKind::VERTEX_FACE ? 0 : integer(random, 0, 1);
  const int second = kind == PairKind::VERTEX_FACE ? integer(random, 1, 3) : integer(random, 2, 3);
  const int times = integer(random, 1, 3);
  for (int time = 0; time < 2; ++time) {
    if ((times & (1 << time)) != 0) std::copy_n(query.motion.x[time][first], 3, query.motion.x[time][second]);
  }
  if (oneIn(random, 4)) nudgeOneUlp(random, anyCoordinate(random, query));
  return query;
}

Query atRest(RandomSource& random, PairKind kind) {
  Query query = oneIn(random, 4) ? smallGrid(random, kind) : grazing(random, kind, integer(random, 0, 1) * 8);
  const int from = integer(random, 0, 1);
  std::copy_n(&query.motion.x[from][0][0], 12, &query.motion.x[1 - from][0][0]);
  return query;
}

Query coplanar(RandomSource& random, PairKind kind) {
  const Point u = smallIntegers(random, 3), v = smallIntegers(random, 3), start = smallIntegers(random, 3);
  const Point drift = oneIn(random, 2) ? Point{} : smallIntegers(random, 3);  // the plane itself may move
  Points t0, t1;
  const auto number = [&] { return double(integer(random, -8, 8)); };
  for (int i = 0; i < 4; ++i) {
    t0[i] = start + number() * u + number() * v;
    t1[i] = start + drift + number() * u + number() * v;
  }
  return queryOf(kind, t0, t1);
}

Query subnormal(RandomSource& random, PairKind kind) {
  const bool from_grid = oneIn(random, 2);
  Query query = from_grid ? smallGrid(random, kind) : grazing(random, kind, integer(random, 0, 8));
  const int exponent = integer(random, -1074, -1030);
  forEachCoordinate(query, [&](double& value) { value = std::ldexp(std::round(value), exponent); });
  if (oneIn(random, 4)) anyCoordinate(random, query) = std::numeric_limits<double>::denorm_min();
  if (oneIn(random, 8)) anyCoordinate(random, query) = real(random, -1, 1);
  return query;
}

Query mixed(RandomSource& random, PairKind kind, double decades) {
  Query query = oneIn(random, 2) ? general(random, kind) : grazing(random, kind, integer(random, 0, 8));
  const bool per_axis = oneIn(random, 2);  // an axis as a whole keeps contacts, single coordinates make new shapes
  double scale[3];
  for (double& s : scale) s = std::pow(10.0, real(random, -decades, decades));
  for (auto& points : query.motion.x) {
    for (auto& point : points) {
      for (int axis = 0; axis < 3; ++axis) {
        point[axis] *= per_axis ? scale[axis] : std::pow(10.0, real(random, -decades, decades));
      }
    }
  }
  return query;
}

Query extreme(RandomSource& random, PairKind kind) {
  constexpr double LARGEST = std::numeric_limits<double>::max();
  Query query = oneIn(random, 2) ? smallGrid(random, kind) : general(random, kind);
  forEachCoordinate(query, [&](double& value) { value = std::max(-1.0, std::min(1.0, value / 3)) * LARGEST; });
  return query;
}

Query drawn(RandomSource& random, PairKind kind, Hardness hardness) {
  switch (hardness) {
    case Hardness::SMALL_GRID:
      return smallGrid(random, kind);
    case Hardness::GRAZING:
      return grazing(random, kind, integer(random, 1, 7));
    case Hardness::AT_THE_ENDS:
      return grazing(random, kind, 8 * integer(random, 0, 1));
    case Hardness::PARALLEL:
      return parallel(random, kind);
    case Hardness::COLLINEAR:
      return collinear(random, kind);
    case Hardness::SLIVER:
      return sliver(random, kind);
    case Hardness::TURNING:
      return turning(random, kind);
    case Hardness::ONE_ULP:
      return oneUlp(random, kind);
    case Hardness::HUGE_TRANSLATION:
      return hugeTranslation(random, kind);
    case Hardness::COINCIDENT:
      return coincident(random, kind);
    case Hardness::AT_REST:
      return atRest(random, kind);
    case Hardness::COPLANAR:
      return coplanar(random, kind);
    case Hardness::SUBNORMAL:
      return subnormal(random, kind);
    case Hardness::MIXED_15:
      return mixed(random, kind, 15);
    case Hardness::MIXED_150:
      return mixed(random, kind, 150);
    case Hardness::EXTREME:
      return extreme(random, kind);
    case Hardness::GENERAL:
    case Hardness::COUNT:
      break;
  }
  return general(random, kind);
}

Hardness drawHardness(RandomSource& random) {
  constexpr int COMMON = static_cast<int>(Hardness::MIXED_150);
  int hardness = integer(random, 0, COMMON - 1);
  if (oneIn(random, 400)) hardness = integer(random, COMMON, static_cast<int>(Hardness::COUNT) - 1);
  return static_cast<Hardness>(hardness);
}

}  // namespace

const char* toString(Hardness hardness) {
  constexpr const char* NAMES[] = {"general",  "small-grid", "grazing",  "at-the-ends",      "parallel",   "collinear",
                                   "sliver",   "turning",    "one-ulp",  "huge-translation", "coincident", "at-rest",
                                   "coplanar", "subnormal",  "mixed-15", "mixed-150",        "extreme"};
  static_assert(sizeof NAMES / sizeof *NAMES == static_cast<std::size_t>(Hardness::COUNT), "a name for each");
  return NAMES[static_cast<int>(hardness)];
}

Query hardQuery(RandomSource& random, PairKind kind, Hardness hardness) {
  Query query = drawn(random, kind, hardness);
  const auto orders = vertexPermutations(kind);
  const auto axes = axisPermutations();
  query = permuted(query, orders[random() % orders.size()]);
  query = permuted(query, axes[random() % axes.size()]);
  return oneIn(random, 2) ? query : timeReversed(query);
}

Query hardQuery(RandomSource& random) {
  const Hardness hardness = drawHardness(random);
  return hardQuery(random, oneIn(random, 2) ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE, hardness);
}

Query hardQuery(RandomSource& random, PairKind kind) {
  const Hardness hardness = drawHardness(random);
  return hardQuery(random, kind, hardness);
}

}  // namespace test
}  // namespace dccd
