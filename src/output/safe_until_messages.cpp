#include "output/safe_until_messages.h"

#include <algorithm>
#include <sstream>
#include <tuple>

#include "output/output_messages.h"

namespace dccd {
namespace {

template <class Message>
void fillPair(const Outcome& outcome, std::size_t limiting, Message& out) {
  if (limiting == SafeUntil::NO_PAIR) return;
  putNames(outcome.clearances[limiting].body, outcome.step->bodies, out.bodies);
}

/// What is assumed of one body's speed.
std::string assumedOf(const std::vector<Body>& bodies, const Body& body, const SpeedBound& bound) {
  std::ostringstream text;
  if (bound.carrier < bodies.size())
    text << "no vertex of '" << body.name << "' leaves where '" << bodies[bound.carrier].name
         << "' carries it faster than " << bound.relative_m_s << " m/s, and ";
  if (bound.max_m_s == 0) {
    text << "'" << body.name << "' stands still";
  } else if (std::isfinite(bound.max_m_s)) {
    text << "no vertex of '" << body.name << "' is faster than " << bound.max_m_s << " m/s";
  } else {
    text << "nobody says how fast '" << body.name << "' is: nothing is promised of it";
  }
  return text.str();
}

/// With clearance/self_m each body that may touch itself has such a row.
bool asksItself(const Outcome& outcome) {
  return std::any_of(outcome.clearances.begin(), outcome.clearances.end(),
                     [](const Clearance& row) { return row.body[0] == row.body[1]; });
}

}  // namespace

std::vector<std::string> assumptions(const Outcome& outcome, const std::vector<SpeedBound>& bounds) {
  std::vector<std::string> sentences;
  if (!outcome.answered) return sentences;
  const std::vector<Body>& bodies = outcome.step->bodies;
  for (std::size_t b = 0; b < bodies.size() && b < bounds.size(); ++b) {
    if (bodies[b].topology->vertexCount() > 0) sentences.push_back(assumedOf(bodies, bodies[b], bounds[b]));
  }
  sentences.push_back(outcome.obstacle
                          ? "all that can be touched is in the map, which stands still and gets no new voxel"
                          : "nothing was checked against a map");
  const OwnVoxels& own = outcome.step->map.own;
  const std::uint64_t seen = own.seen ? own.seen->size() : 0, doubted = own.doubted - std::min(own.doubted, seen);
  if (doubted > 0) sentences.push_back("voxels of the map in doubt are no obstacle: " + std::to_string(doubted));
  for (const Body& body : bodies) {
    if (!meetsItself(body)) continue;
    sentences.push_back(asksItself(outcome)
                            ? "neighbours on the surface of '" + body.name + "' are not spoken of"
                            : "what '" + body.name + "' does to itself is not spoken of (clearance/self_m is 0)");
  }
  return sentences;
}

deformable_ccd::SafeUntil toSafeUntil(const Outcome& outcome, const PromiseWatch& watch,
                                      const std::vector<SpeedBound>& bounds, const ros::Time& now,
                                      const std::string& frame) {
  const SafeUntil& promise = watch.promise();
  deformable_ccd::SafeUntil out;
  out.header = headerOf(promise.stamp_ns, frame);
  out.until = toRosTime(promise.until_ns);
  out.seconds = promise.seconds();
  out.others_until = toRosTime(promise.others_until_ns);
  out.others_seconds = promise.othersSeconds();
  // Where stamps are ahead of the clock here the promise is made now, and does not last until that clock is there.
  out.left = std::min(out.seconds, (out.until - now).toSec());
  out.most = MOST_PROMISED_S;
  out.reason = promise.reason;
  fillPair(outcome, promise.limiting, out);
  out.distance = promise.distance_m;
  out.closing_speed = promise.closing_m_s;
  out.assumed = assumptions(outcome, bounds);
  out.broken = watch.broken();
  return out;
}

deformable_ccd::SpeedScale toSpeedScale(const Outcome& outcome, const SpeedScale& speed, const std::string& frame) {
  deformable_ccd::SpeedScale out;
  out.header = headerOf(outcome.stamp_ns, frame);
  out.scale = speed.scale;
  out.reason = speed.reason;
  fillPair(outcome, speed.limiting, out);
  out.distance = speed.distance_m;
  out.needed = speed.needed_m;
  if (outcome.answered) out.holds_until = toRosTime(outcome.stamp_ns);
  return out;
}

deformable_ccd::AlongPath toAlongPath(const Outcome& outcome, const IntendedPath& path, const AlongPath& along,
                                      const std::string& frame) {
  deformable_ccd::AlongPath out;
  out.header = headerOf(outcome.stamp_ns, frame);
  out.used = along.unused.empty();
  out.reason = along.unused;
  for (const IntendedPath::Of& of : path.bodies) out.bodies.push_back(outcome.step->bodies[of.body].name);
  out.ahead = path.endsAt();
  out.contact = static_cast<std::uint8_t>(along.contact);
  return out;
}

deformable_ccd::Limits toLimits(const Outcome& outcome, const ApproachLimits& limits,
                                const std::vector<SpeedBound>& bounds, const std::string& frame) {
  deformable_ccd::Limits out;
  out.header = headerOf(outcome.stamp_ns, frame);
  out.horizon = limits.horizon_s;
  out.most_speed = limits.most_speed_m_s;
  out.unknown = limits.unknown;
  out.assumed = assumptions(outcome, bounds);
  const auto point = [](const Vec3& p) {
    geometry_msgs::Point at;
    std::tie(at.x, at.y, at.z) = std::tie(p.x(), p.y(), p.z());
    return at;
  };
  for (const std::uint16_t number : limits.bodies) {
    const Body& body = outcome.step->bodies[number];
    out.links.push_back(body.name);
    out.origins.push_back(point(body.pose_t1.translation()));
    double reach_m = 0;
    for (const Vec3& p : *body.t1) reach_m = std::max(reach_m, (p - body.pose_t1.translation()).norm());
    out.reaches.push_back(reach_m);
  }
  for (const ApproachLimit& limit : limits.of) {
    const auto link = std::find(limits.bodies.begin(), limits.bodies.end(), limit.body);
    out.link.push_back(static_cast<std::uint32_t>(link - limits.bodies.begin()));
    out.partners.push_back(limit.partner == OBSTACLE_BODY ? "octomap" : outcome.step->bodies[limit.partner].name);
    for (const Vec3& corner : limit.corner) out.corners.push_back(point(corner));
    geometry_msgs::Vector3& normal = out.normals.emplace_back();
    std::tie(normal.x, normal.y, normal.z) = std::tie(limit.normal.x(), limit.normal.y(), limit.normal.z());
    out.speeds.push_back(limit.speed_m_s);
  }
  return out;
}

std::string assumedOf(const Outcome& outcome, const IntendedPath& path) {
  std::ostringstream text;
  for (const IntendedPath::Of& of : path.bodies)
    text << (text.tellp() > 0 ? ", '" : "'") << outcome.step->bodies[of.body].name << "'";
  text << " go along the intended path, at no more than its pace, within " << path.deviation_m << " m and "
       << path.deviation_rate_m_s << " m/s";
  for (const IntendedPath::Of& of : path.bodies)
    if (of.frameOf() != of.body)
      text << ", and '" << outcome.step->bodies[of.body].name << "' " << of.relative_m_s << " m/s more";
  return text.str();
}

std::string whyTooOld(double since_stamp_s, double since_arrival_s, const SpeedLaw& law) {
  if (std::max(since_stamp_s, since_arrival_s) <= law.reaction_time_s) return "";
  const double offset_s = since_stamp_s - since_arrival_s;
  if (!(offset_s > law.reaction_time_s)) return "no newer answer within the reaction time";
  std::ostringstream text;
  text << "the newest frame came " << offset_s << " s after its stamp, which alone is more than the reaction time of "
       << law.reaction_time_s << " s: the clock of the stamps and the monitor's (ros::Time) differ, or frames are late";
  return text.str();
}

void limitSpeed(const std::string& reason, deformable_ccd::SpeedScale& message) {
  message.scale = 0;
  message.reason = reason;
}

}  // namespace dccd
