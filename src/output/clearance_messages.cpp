#include "output/clearance_messages.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "output/output_messages.h"
#include "output/patch_messages.h"

namespace dccd {
namespace {

using DistanceMessage = deformable_ccd::ClearanceDistance;

static_assert(static_cast<int>(ClearanceStatus::FARTHER) == static_cast<int>(DistanceMessage::FARTHER));
static_assert(static_cast<int>(ClearanceStatus::TOUCHING) == static_cast<int>(DistanceMessage::TOUCHING));
static_assert(static_cast<int>(ClearanceStatus::UNKNOWN) == static_cast<int>(DistanceMessage::UNKNOWN));

constexpr double NONE = std::numeric_limits<double>::quiet_NaN();
constexpr double ROUNDING = 1 + 1e-12;  // of the few operations of a speed

/// In the step no point of the body was faster [m/s]. One that turns does so about its frame's origin.
double speedBound(const Body& body, double duration_s) {
  double fastest = 0, radius_m = 0;
  for (std::size_t v = 0; body.turns && v < body.t0->size(); ++v)
    radius_m = std::max(radius_m, ((*body.t0)[v] - body.pose_t0.translation()).norm());
  Waypoint from{0, body.pose_t0, body.t0};
  const auto goTo = [&](const Waypoint& to) {
    double way_m = 0;
    if (body.turns) {
      way_m = radius_m * Eigen::AngleAxisd(from.pose.linear().transpose() * to.pose.linear()).angle() +
              (to.pose.translation() - from.pose.translation()).norm();
    }
    for (std::size_t v = 0; !body.turns && v < body.t0->size(); ++v)
      way_m = std::max(way_m, ((*to.positions)[v] - (*from.positions)[v]).norm());
    fastest = std::max(fastest, way_m / (to.u - from.u));
    from = to;
  };
  for (const Waypoint& point : body.waypoints) goTo(point);
  goTo({1, body.pose_t1, body.t1});
  return fastest * ROUNDING / duration_s;
}

/// How far the feature's point at the step's end moved in the step [m]: as its vertices did, each by its weight.
Vec3 motionOf(const Body& body, const std::array<Index, 3>& vertices, const Vec3& point) {
  const auto end = [&](int i) { return Vec3((*body.t1)[vertices[i]]); };
  const auto motion = [&](int i) { return Vec3(end(i) - (*body.t0)[vertices[i]]); };
  const auto count = std::count_if(vertices.begin(), vertices.end(), [](Index v) { return v != NO_INDEX; });
  Eigen::MatrixXd along(3, count - 1), moved(3, count - 1);
  for (int i = 1; i < count; ++i) {
    along.col(i - 1) = end(i) - end(0);
    moved.col(i - 1) = motion(i) - motion(0);
  }
  if (count == 1) return motion(0);
  return motion(0) + moved * along.colPivHouseholderQr().solve(point - end(0));
}

DistanceMessage toMessage(const Outcome& outcome, const ClearanceDistance& distance) {
  DistanceMessage out;
  const bool known = distance.status != ClearanceStatus::UNKNOWN, taken = std::isfinite(distance.upper_m);
  put(distance.status, out.status);
  out.lower = known ? plottable(distance.lower_m) : NONE;
  out.upper = known ? plottable(distance.upper_m) : NONE;
  out.t = known && taken ? distance.t : NONE;
  if (known && taken) out.stamp = toRosTime(outcome.stampBefore(distance.t));
  for (std::size_t side = 0; side < 2; ++side) put(distance.point[side], out.points[side]);
  put(distance.vertex[0], out.first_vertices);
  put(distance.vertex[1], out.second_vertices);
  put(distance.voxel, out.voxel_key);
  out.voxel_size = distance.voxel_size;
  return out;
}

deformable_ccd::Clearance toMessage(const Outcome& outcome, const Clearance& clearance,
                                    const std::vector<double>& speeds, const std::vector<Body>& bodies) {
  deformable_ccd::Clearance out;
  out.expected = clearance.expected;
  out.at_end = toMessage(outcome, clearance.at_end);
  out.over_step = toMessage(outcome, clearance.over_step);
  const std::array<Vec3, 2>& points = clearance.at_end.point;
  const Vec3 direction = (points[0] - points[1]) / (points[0] - points[1]).norm();  // NaN where one has no place
  put(direction, out.direction);
  putNames(clearance.body, bodies, out.bodies);
  double speed = 0;
  Vec3 closing = Vec3::Zero();
  for (std::size_t side = 0; side < 2; ++side) {
    const std::uint16_t body = clearance.body[side];
    if (body == OBSTACLE_BODY) continue;  // at rest
    speed += speeds[body];
    if (!direction.allFinite() || clearance.at_end.vertex[side][0] == NO_INDEX) continue;
    const Vec3 motion = motionOf(outcome.step->bodies[body], clearance.at_end.vertex[side], points[side]);
    closing += side == 0 ? Vec3(-motion) : motion;
  }
  out.closing_speed = plottable(closing.dot(direction) / outcome.duration_s());
  const auto unknown = [](const ClearanceDistance& distance) { return distance.status == ClearanceStatus::UNKNOWN; };
  out.speed_bound = unknown(clearance.at_end) || unknown(clearance.over_step) ? NONE : plottable(speed);
  return out;
}

}  // namespace

deformable_ccd::ClearanceArray toClearanceArray(const Outcome& outcome, const std::vector<Body>& bodies,
                                                const std::string& frame) {
  deformable_ccd::ClearanceArray out;
  out.header = headerOf(outcome.stamp_ns, frame);
  out.start = toRosTime(outcome.start_ns);
  out.sequence = outcome.sequence;
  put(outcome.status, out.status);
  out.answered = outcome.answered;
  if (outcome.clearances.empty()) return out;
  std::vector<double> speeds;
  for (const Body& body : outcome.step->bodies) speeds.push_back(speedBound(body, outcome.duration_s()));
  for (const Clearance& c : outcome.clearances) out.pairs.push_back(toMessage(outcome, c, speeds, bodies));
  const std::uint64_t pairs = outcome.stats[Effect::CLEARANCE].in;
  out.farther = static_cast<std::uint32_t>(pairs - std::min<std::uint64_t>(pairs, outcome.clearances.size()));
  return out;
}

NearestPartners nearestPartners(const Outcome& outcome) {
  NearestPartners nearest{"", NONE, NONE};
  double least_m = std::numeric_limits<double>::infinity(), upper_m = least_m;
  if (outcome.clearances.empty()) return nearest;
  // What is inside of another one touches it, however far apart their surfaces are.
  for (const StartIntersection& start : outcome.intersections) {
    if (start.expected || start.body[0] == start.body[1] || least_m == 0) continue;
    least_m = upper_m = 0;
    std::array<std::uint16_t, 2> both = start.body;
    std::sort(both.begin(), both.end());
    nearest = {pairOf(both, outcome.step->bodies), 0, 0};
  }
  for (const Clearance& clearance : outcome.clearances) {
    if (clearance.expected || clearance.body[0] == clearance.body[1]) continue;
    const ClearanceDistance& distance = clearance.over_step;
    const bool unknown = distance.status == ClearanceStatus::UNKNOWN;
    upper_m = std::min(upper_m, distance.upper_m);
    const double lower_m = unknown ? -1 : distance.lower_m;
    if (!(lower_m < least_m)) continue;
    least_m = lower_m;
    nearest = {pairOf(clearance.body, outcome.step->bodies), unknown ? NONE : lower_m, NONE};
  }
  nearest.upper_m = plottable(upper_m);
  return nearest;
}

}  // namespace dccd
