#include "support/margin_bounds.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "culling/contour.h"
#include "culling/toc_bound.h"
#include "obstacle/static_filters.h"
#include "oracle/exact_distance.h"
#include "oracle/oracle.h"
#include "support/margin_numbers.h"
#include "support/margin_pairs.h"
#include "support/pair_list.h"

namespace dccd {
namespace test {
namespace margins {

MarginInput meetingInput(RandomSource& random) {
  MarginInput input;
  const double hi = uniform(random), reach = random() % 2 ? 0 : power(random, -30, -1);
  input.x = {hi + reach + power(random, -40, 1), hi + reach - power(random, -40, 1), hi - 1, hi, reach};
  return input;
}
IsWrong judgeMeeting(const MarginInput& input) {
  const std::vector<double> x = input.x;
  const Rational gap0 = exact(x[0]) - exact(x[3]) - exact(x[4]), gap1 = exact(x[1]) - exact(x[3]) - exact(x[4]);
  return [=] {
    if (!(x[4] >= 0 && x[2] < x[3]) || gap0.sign() <= 0 || gap1.sign() > 0) return false;
    const double min[2] = {x[0], x[1]}, max[2] = {x[0] + 1, x[1] + 1};
    const double bound = firstMeeting(min, max, 1, x[2], x[3], x[4]);
    return exact(bound) * (gap0 - gap1) > gap0;
  };
}

MarginInput boundInput(RandomSource& random) {
  PairMotion motion;
  const PairKind kind = anyKind(random);
  const V3 direction =
      random() % 2 ? V3(V3::Unit(static_cast<int>(random() % 3))) : V3(1, random() % 2 ? 1 : 0, random() % 2);
  const double separation = random() % 2 ? 0 : power(random, -20, -1);
  const int first = kind == PairKind::VERTEX_FACE ? 1 : 2;
  const V3 meeting_point = anyVector(random);
  const double t = share(random), before = power(random, -30, 1), after = power(random, -30, 1);
  for (int i = 0; i < 4; ++i) {
    const bool corner = i == 0 || i == first;
    const V3 offset = corner ? V3(V3::Zero()) : V3(0.5 * share(random) * (i < first ? 1 : -1) * direction);
    const double size = i < first ? 1 : 0;
    for (int end = 0; end < 2; ++end) {
      V3 x = meeting_point + offset + size * (end == 0 ? before * t : -after * (1 - t)) * direction;
      if (i < first) x += separation * direction.normalized();
      for (int k = 0; k < 3; ++k) motion.x[end][i][k] = x[k];
    }
  }
  MarginInput input = inputOf(kind, motion);
  input.x.push_back(separation);
  return input;
}
IsWrong judgeBound(const MarginInput& input) {
  const PairKind kind = kindOf(input);
  const PairMotion motion = motionOf(input);
  const double separation = input.x[24];
  if (!(separation >= 0)) return [] { return false; };
  std::optional<Root> toc = separation == 0 ? firstContact(kind, motion) : std::nullopt;
  return [=]() mutable {
    PairList pair(kind);
    pair.add(motion);
    const double bound = linearTocBound(kind, pair.vertices.data(), pair.pairs[0], separation);
    if (separation == 0) {
      return toc && (bound > 1 || toc->compareWith(Dyadic::fromDouble(bound)) < 0);
    }
    // Just before the bound the features are certainly further apart.
    const double t = std::min(1.0, bound) * (1 - 0x1p-53);
    return bound > 0 && isWithin(kind, motion, t, separation);
  };
}

MarginInput viewInput(RandomSource& random) {
  const V3 along = heavyVector(random);
  const V3 point = random() % 2 ? V3(power(random, -20, 20) * along) : V3(power(random, -20, 20) * heavyVector(random));
  MarginInput input;
  input.x = {along[0], along[1], along[2], point[0], point[1], point[2]};
  return input;
}

IsWrong judgeView(const MarginInput& input) {
  return [input] {
    const V3 along = V3(input.x[0], input.x[1], input.x[2]).normalized();
    ViewPlane plane(V3::UnitX());
    plane.u = along.unitOrthogonal();  // any plane, more than those that are seen in
    plane.w = along.cross(plane.u);
    const double* point = input.x.data() + 3;
    const std::array<double, 2> seen = plane.coordinates(point);
    const Rational error = exact(ViewPlane::error(V3(point[0], point[1], point[2]).lpNorm<1>()));
    const auto isOff = [&](const V3& axis, double coordinate) {
      Rational truth;
      for (int k = 0; k < 3; ++k) truth += exact(axis[k]) * exact(point[k]);
      return abs(exact(coordinate) - truth) > error;
    };
    return isOff(plane.u, seen[0]) || isOff(plane.w, seen[1]);
  };
}

}  // namespace margins
}  // namespace test
}  // namespace dccd
