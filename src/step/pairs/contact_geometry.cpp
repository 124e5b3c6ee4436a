// Where two mesh features touch, for display and control; nothing is decided here.
#include "dccd/contact.h"
#include "step/pairs/closest_points.h"

namespace dccd {

ContactGeometry contactGeometry(PairKind kind, const PairMotion& pair, double toc) {
  Vec3 at[4], motion[4];
  for (int i = 0; i < 4; ++i) {
    const Vec3 from = Eigen::Map<const Vec3>(pair.x[0][i]), to = Eigen::Map<const Vec3>(pair.x[1][i]);
    at[i] = (1 - toc) * from + toc * to;
    motion[i] = to - from;
  }
  ContactGeometry out;
  Vec3 on_first, on_second, first_motion, second_motion, cross;
  if (kind == PairKind::VERTEX_FACE) {
    const std::array<double, 3> w = barycentric(at[0], at[1], at[2], at[3]);
    out.weights = {1, w[0], w[1], w[2]};
    on_first = at[0];
    on_second = w[0] * at[1] + w[1] * at[2] + w[2] * at[3];
    first_motion = motion[0];
    second_motion = w[0] * motion[1] + w[1] * motion[2] + w[2] * motion[3];
    cross = (at[2] - at[1]).cross(at[3] - at[1]);
  } else {
    const Closest c = closestOnSegments(at[0], at[1], at[2], at[3]);
    out.weights = {1 - c.u, c.u, 1 - c.v, c.v};
    on_first = c.on_first;
    on_second = c.on_second;
    first_motion = (1 - c.u) * motion[0] + c.u * motion[1];
    second_motion = (1 - c.v) * motion[2] + c.v * motion[3];
    cross = (at[1] - at[0]).cross(at[3] - at[2]);
  }
  out.point = 0.5 * (on_first + on_second);
  // At the touch the distance is no direction; the features' normal is, turned against the approach.
  const Vec3 relative = first_motion - second_motion;
  out.normal = unitOr(cross, unitOr(-relative, Vec3::UnitZ()));
  if (out.normal.dot(relative) > 0) out.normal = -out.normal;
  out.approach_speed = -out.normal.dot(relative);
  return out;
}

}  // namespace dccd
