// Paths that are meant: their pieces, and where on them bodies are.
#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "dccd/intended.h"
#include "dccd/mesh_store.h"
#include "step/parts.h"

namespace dccd {
namespace {

bool isLength(double value) { return value >= 0 && std::isfinite(value); }

bool isAllFinite(const Body& body) {
  return !body.t1->empty() && body.pose_t1.matrix().allFinite() &&
         std::all_of(body.t1->begin(), body.t1->end(), [](const Vec3& p) { return p.allFinite(); });
}

}  // namespace

const IntendedPath::Of* IntendedPath::find(std::size_t body) const {
  const auto found = std::find_if(bodies.begin(), bodies.end(), [&](const Of& of) { return of.body == body; });
  return found == bodies.end() ? nullptr : &*found;
}

std::size_t IntendedPath::pieceAt(double at_s) const {
  const auto after = std::upper_bound(time_s.begin() + 1, time_s.end() - 1, at_s);
  return static_cast<std::size_t>(after - time_s.begin()) - 1;
}

double IntendedPath::shareAt(std::size_t piece, double at_s) const {
  return std::clamp((at_s - time_s[piece]) / (time_s[piece + 1] - time_s[piece]), 0.0, 1.0);
}

std::string problemOf(const IntendedPath& path, const std::vector<Body>& bodies) {
  const std::size_t times = path.time_s.size();
  if (path.bodies.empty()) return "it moves no body that is watched";
  if (times < 2) return "it is over";
  if (path.time_s[0] != 0) return "it does not begin at 0 s";
  for (std::size_t k = 1; k < times; ++k) {
    if (!(path.time_s[k] > path.time_s[k - 1]) || !std::isfinite(path.time_s[k])) return "its times do not ascend";
  }
  if (!isLength(path.deviation_m) || !isLength(path.deviation_rate_m_s)) return "its tube is not 0 or more";
  const bool bends = path.bend_m.size() + 1 == times && std::all_of(path.bend_m.begin(), path.bend_m.end(), isLength);
  if (!bends) return "nobody says how far its pieces are from straight";
  std::set<std::uint16_t> seen;
  for (const IntendedPath::Of& of : path.bodies) {
    if (of.body >= bodies.size()) return "it moves a body that is not there";
    const Body& body = bodies[of.body];
    if (!seen.insert(of.body).second) return "it moves '" + body.name + "' twice";
    const auto isPose = [](const Eigen::Isometry3d& pose) {
      return pose.matrix().allFinite() && (pose.linear() * pose.linear().transpose()).isIdentity(1e-6);
    };
    if (of.pose.size() != times || !std::all_of(of.pose.begin(), of.pose.end(), isPose))
      return "it has not a pose of '" + body.name + "' for each time";
    if (!isAllFinite(body)) return "nobody knows where '" + body.name + "' is";
    if (of.frameOf() != of.body && (!path.find(of.carrier) || !isLength(of.relative_m_s)))
      return "nobody knows how '" + body.name + "' is carried";
  }
  return "";
}

/// What is meant leaves the chord of a piece of h seconds by a h^2 / 8 at the most, and the way from pose to pose
/// leaves it by angle^2 r / 8: along any direction both are 0 at the ends, and these bound their second derivatives.
void addPieces(const PosesAt& poses, double until_s, double acceleration_m_s2, double reach_m, double bend_m,
               std::size_t most_pieces, IntendedPath& path) {
  if (path.time_s.empty()) {
    path.time_s.push_back(0);
    const std::vector<Eigen::Isometry3d> first = poses(0);
    for (std::size_t i = 0; i < path.bodies.size(); ++i) path.bodies[i].pose.push_back(first.at(i));
  }
  const double from_s = path.endsAt(), span_s = until_s - from_s;
  if (!(span_s > 0)) return;
  // Either of the two takes half of it.
  const double wanted = std::ceil(span_s * std::sqrt(acceleration_m_s2 / (4 * bend_m)));
  const double most = static_cast<double>(std::max<std::size_t>(1, most_pieces));
  const auto count = static_cast<std::size_t>(wanted >= 1 ? std::min(wanted, most) : wanted < 1 ? 1 : most);
  const double h = span_s / static_cast<double>(count);
  for (std::size_t k = 1; k <= count; ++k) {
    const double time_s = k == count ? until_s : from_s + static_cast<double>(k) * h;
    const std::vector<Eigen::Isometry3d> next = poses(time_s);
    double angle = 0;
    for (std::size_t i = 0; i < path.bodies.size(); ++i) {
      angle = std::max(angle, rotationAngle(path.bodies[i].pose.back(), next.at(i)));
      path.bodies[i].pose.push_back(next[i]);
    }
    path.time_s.push_back(time_s);
    path.bend_m.push_back((acceleration_m_s2 * h * h + angle * angle * reach_m) / 8 * (1 + 1e-9));
  }
}

/// Between which shares of the way the point is within so far of `to`; the first is more than the second: nowhere.
static void limitToBall(const Vec3& from, const Vec3& way, const Vec3& to, double radius_m, double& least,
                        double& most) {
  const Vec3 off = from - to;
  const double a = way.squaredNorm(), b = way.dot(off), c = off.squaredNorm() - radius_m * radius_m;
  const double root = b * b - a * c;
  if (a > 0 ? root < 0 : c > 0) {
    most = least - 1;
  } else if (a > 0) {
    least = std::max(least, (-b - std::sqrt(root)) / a);
    most = std::min(most, (-b + std::sqrt(root)) / a);
  }
}

PlaceOnPath placeOnPath(const IntendedPath& path, const Step& step, double from_s, double to_s, double within_m) {
  PlaceOnPath best;
  if (!problemOf(path, step.bodies).empty()) return best;
  constexpr double ROUNDING = 1 + 1e-9;
  to_s = std::clamp(to_s, 0.0, path.endsAt());
  from_s = std::clamp(from_s, 0.0, to_s);
  // Of the boxes around the bodies: a vertex is off a place by no more than one of these is.
  std::vector<std::array<Vec3, 8>> now, local;
  for (const IntendedPath::Of& of : path.bodies) {
    const Body& body = step.bodies[of.body];
    Eigen::AlignedBox3d box;
    for (const Vec3& p : *body.t1) box.extend(p);
    now.push_back(cornersOf(box));
    for (Vec3& p : local.emplace_back(now.back())) p = step.bodies[of.frameOf()].pose_t1.inverse() * p;
  }
  bool is_found = false, is_left = false;  // a stretch that is near enough
  for (std::size_t k = path.pieceAt(from_s); k + 1 < path.time_s.size(); ++k) {
    const double begins_s = path.time_s[k], lasts_s = path.time_s[k + 1] - begins_s;
    if (begins_s > to_s) break;
    const double least = std::max(0.0, (from_s - begins_s) / lasts_s),
                 most = std::min(1.0, (to_s - begins_s) / lasts_s);
    double near_from = least, near_to = most;
    double along = 0, way_sq = 0;  // of the least sum of squares on the chords
    for (std::size_t i = 0; i < now.size(); ++i) {
      const std::vector<Eigen::Isometry3d>& pose = path.bodies[i].pose;
      for (std::size_t c = 0; c < now[i].size(); ++c) {
        const Vec3 from = pose[k] * local[i][c], way = pose[k + 1] * local[i][c] - from;
        along += way.dot(now[i][c] - from);
        way_sq += way.squaredNorm();
        limitToBall(from, way, now[i][c], (within_m + path.bend_m[k]) * ROUNDING, near_from, near_to);
      }
    }
    const bool is_near = near_from <= near_to;
    const double u =
        std::clamp(way_sq > 0 ? along / way_sq : most, is_near ? near_from : least, is_near ? near_to : most);
    double off_sq = 0;
    for (std::size_t i = 0; i < now.size(); ++i) {
      const Eigen::Isometry3d pose = interpolate(path.bodies[i].pose[k], path.bodies[i].pose[k + 1], u);
      for (std::size_t c = 0; c < now[i].size(); ++c)
        off_sq = std::max(off_sq, (pose * local[i][c] - now[i][c]).squaredNorm());
    }
    const double off_m = std::sqrt(off_sq) + path.bend_m[k];
    is_left = is_left || (is_found && (!is_near || near_from > least));
    const bool is_first = !is_found && off_m <= within_m;
    if (is_first || (!is_left && off_m < best.off_m)) {
      best.time_s = begins_s + u * lasts_s;
      best.off_m = off_m;
    }
    is_found = is_found || is_first;
    if (is_near) best.last_s = begins_s + near_to * lasts_s;
  }
  best.last_s = std::max(best.last_s, best.time_s);
  return best;
}

IntendedPath restOf(const IntendedPath& path, double from_s, double by_s, double lasts_s) {
  constexpr double NO_TIME_S = 1e-9;  // of a piece
  IntendedPath rest = path;
  rest.time_s.clear();
  rest.bend_m.clear();
  for (IntendedPath::Of& of : rest.bodies) of.pose.clear();
  from_s = std::max(0.0, from_s);
  by_s = std::max(from_s, by_s);
  const double until_s = std::min(path.endsAt(), by_s + lasts_s);
  if (path.time_s.size() < 2 || !(from_s < until_s)) return rest;
  std::vector<double> cuts{from_s, by_s, until_s};
  for (const double time_s : path.time_s) {
    if (time_s > from_s && time_s < until_s) cuts.push_back(time_s);
  }
  std::sort(cuts.begin(), cuts.end());
  cuts.erase(std::unique(cuts.begin(), cuts.end()), cuts.end());
  for (const double time_s : cuts) {
    const std::size_t piece = path.pieceAt(time_s);
    const double share = path.shareAt(piece, time_s);
    const double after_s = rest.time_s.empty() ? 0 : rest.time_s.back() + NO_TIME_S;
    rest.time_s.push_back(std::max(after_s, time_s - by_s));
    if (time_s < until_s) rest.bend_m.push_back(path.bend_m[piece]);
    for (std::size_t i = 0; i < path.bodies.size(); ++i) {
      const std::vector<Eigen::Isometry3d>& pose = path.bodies[i].pose;
      rest.bodies[i].pose.push_back(interpolate(pose[piece], pose[piece + 1], share));
    }
  }
  return rest;
}

Positions carriedTo(const Step& from, const Step& to, std::size_t body, std::size_t carrier) {
  const Eigen::Isometry3d moved = to.bodies[carrier].pose_t1 * from.bodies[carrier].pose_t1.inverse();
  Positions places;
  for (const Vec3& p : *from.bodies[body].t1) places.push_back(moved * p);
  return places;
}

IntendedPath beginningAt(const IntendedPath& path, const Step& step) {
  IntendedPath moved = path;
  for (IntendedPath::Of& of : moved.bodies) {
    const Eigen::Isometry3d begin = of.pose[0].inverse() * step.bodies[of.frameOf()].pose_t1;
    for (Eigen::Isometry3d& pose : of.pose) pose = pose * begin;
    of.pose[0] = step.bodies[of.frameOf()].pose_t1;
  }
  return moved;
}

}  // namespace dccd
