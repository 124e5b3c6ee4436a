// Where bodies go between a step's ends, as far as anybody knows: by their frames in between, and by what carries them.
// What contradicts the step, or is not known, is said of it.
#include <algorithm>
#include <memory>
#include <sstream>
#include <utility>

#include "step/parts.h"
#include "stream/monitor_impl.h"
#include "stream/radii.h"

namespace dccd {
namespace {

constexpr double STILL = 1e-12;  // of a pose's numbers: what interpolating between two equal ones may round

const char* const FORGOTTEN = "stamps of tf went back, or a static transform is another one";

double fractionOf(const Step& step, StampNs stamp_ns) {
  return static_cast<double>(stamp_ns - step.start_ns) / static_cast<double>(step.stamp_ns - step.start_ns);
}

/// How far the two poses bring points within the bounds from each other: the most that they do its corners [m].
double apart(const Eigen::Isometry3d& seen, const Eigen::Isometry3d& expected, const Eigen::AlignedBox3d& bounds) {
  double off = 0;
  if (bounds.isEmpty()) return off;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 p = bounds.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner));
    off = std::max(off, (seen * p - expected * p).norm());
  }
  return off;
}

/// Of all of its places in the step that are known.
Eigen::AlignedBox3d boundsOf(const Body& body) {
  Eigen::AlignedBox3d bounds;
  forEachLeg(body, [&](const Positions& from, const Positions& to, double) {
    for (const Positions* positions : {&from, &to}) {
      for (const Vec3& p : *positions) {
        if (p.allFinite()) bounds.extend(p);
      }
    }
  });
  return bounds;
}

Eigen::AlignedBox3d boundsOfThoseThatMeetTheMap(const Step& step) {
  Eigen::AlignedBox3d bounds;
  for (const Body& body : step.bodies) {
    if (meetsMap(body)) bounds.extend(boundsOf(body));
  }
  return bounds;
}

/// Where vertices are at a knot between two frames, on the way of what carries them, on which they go straight. `first`
/// and `last` are its poses at the two.
Positions carriedTo(const Knot& knot, const Knot& first, const Knot& last, const Positions& from, const Positions& to) {
  const double u =
      static_cast<double>(knot.stamp_ns - first.stamp_ns) / static_cast<double>(last.stamp_ns - first.stamp_ns);
  const Eigen::Isometry3d from_first = knot.pose * first.pose.inverse(), from_last = knot.pose * last.pose.inverse();
  Positions carried(from.size());
  for (std::size_t v = 0; v < from.size(); ++v) carried[v] = (1 - u) * (from_first * from[v]) + u * (from_last * to[v]);
  return carried;
}

/// A frame that stands still, as a camera's on its mount, costs no look at the vertices.
bool standsStill(const std::vector<Knot>& knots) {
  return std::all_of(knots.begin(), knots.end(),
                     [&](const Knot& knot) { return knot.pose.isApprox(knots.front().pose, STILL); });
}

/// Has the frame lost a vertex that is to be looked at?
bool hasLost(const MeshFrame& frame, const Body& body) {
  const std::vector<Index>& used = frame.topology->usedVertices();
  return std::any_of(used.begin(), used.end(), [&](Index v) {
    return !frame.positions[v].allFinite() &&
           std::find(body.vertex_mask.begin(), body.vertex_mask.end(), v) == body.vertex_mask.end();
  });
}

/// Once: both ends of a step may say the same.
void addSentence(std::string& text, const std::string& sentence) {
  if (text.find(sentence) == std::string::npos) text += (text.empty() ? "" : "; ") + sentence;
}

}  // namespace

void Monitor::Impl::sayUnknown(const std::string& name, const std::string& why, Step& step) {
  const std::string where = "where " + name + " was", known = " is not known for all of this step (" + why + ")";
  const std::size_t same = step.off_path.find(known);
  // Of a robot without tf the reason once, with the names of all links.
  if (same == std::string::npos) {
    addSentence(step.off_path, where + known);
  } else if (step.off_path.find(where) == std::string::npos) {
    step.off_path.insert(same + known.size(), ", nor " + where);
  }
}

/// What was seen of the body between the step's ends must not be contradicted in silence: how uncertain it was, and
/// what was missing of it.
void Monitor::Impl::lookBetween(std::size_t b, Step& step) const {
  Body& body = step.bodies[b];
  bool lost = false;
  for (const std::shared_ptr<const MeshFrame>& frame : stores[b].framesWithin(step.start_ns, step.stamp_ns)) {
    lost = lost || hasLost(*frame, body);
    if (!frame->radius_m.empty()) {
      body.radius_m = share(largerRadii(body.radius_m ? *body.radius_m : std::vector<double>(), frame->radius_m));
    }
    body.dropped_faces = std::max(body.dropped_faces, frame->dropped_faces);
  }
  if (lost) {
    sayUnknown("body '" + body.name + "'", "a frame between its ends has lost vertices", step);
  }
}

/// Whether tf may have forgotten what the frame was placed by. Asked last: tf may forget while it is asked.
bool Monitor::Impl::isForgotten(const MeshFrame& frame) const { return frame.carrier.epoch != tracks->epoch(); }

/// The track of what carries a body from one of its frames to the next. Empty: it stands still, or `why` says why it is
/// not known.
std::vector<Knot> Monitor::Impl::trackOf(const MeshFrame& from, const MeshFrame& to, std::string& why) const {
  if (!tracks || (from.carrier.frame.empty() && to.carrier.frame.empty())) return {};
  if (from.carrier.frame != to.carrier.frame) why = "the frame that carries it is another one than before";
  if (!why.empty()) return {};
  std::vector<Knot> knots = tracks->between({}, to.carrier.frame, from.stamp_ns, to.stamp_ns, to.carrier.silence);
  if (isForgotten(from) || isForgotten(to)) why = FORGOTTEN;
  const auto unknown = std::find_if(knots.begin(), knots.end(), [](const Knot& k) { return !k.why_unknown.empty(); });
  if (unknown != knots.end() && why.empty()) why = unknown->why_unknown;
  return why.empty() ? knots : std::vector<Knot>();
}

/// The body's frame at the stamp, or where it is between two: on the way of what carries them.
std::shared_ptr<const MeshFrame> Monitor::Impl::frameAt(std::size_t b, StampNs stamp_ns, Step& step) const {
  const std::shared_ptr<const MeshFrame> straight = stores[b].frameAt(stamp_ns);
  for (const MeshStore::Stretch& stretch : stores[b].pathWithin(stamp_ns, stamp_ns)) {
    const MeshFrame &from = *stretch.from, &to = *stretch.to;
    const std::string& carrier = to.carrier.frame;
    if (!tracks || to.rigid || carrier.empty() || from.carrier.frame != carrier) continue;
    if (stamp_ns <= from.stamp_ns || stamp_ns >= to.stamp_ns) continue;
    const std::vector<Knot> track = tracks->between({}, carrier, from.stamp_ns, stamp_ns, to.carrier.silence);
    if (track.empty()) continue;
    const Knot first{from.stamp_ns, from.pose}, here = track.back(), last{to.stamp_ns, to.pose};
    if (!here.why_unknown.empty()) {
      sayUnknown("body '" + bodies[b].name + "'", here.why_unknown, step);
      return straight;
    }
    if (standsStill({first, here, last})) continue;
    MeshFrame carried = *straight;
    carried.positions = carriedTo(here, first, last, from.positions, to.positions);
    return std::make_shared<const MeshFrame>(std::move(carried));
  }
  return straight;
}

/// Where the body is between two of its frames: at the knots of what carries it, and at more of them until what is
/// between leaves the way from one to the next by a quarter of the tolerance. A middle that is off by d leaves d / 4,
/// for between two samples of tf joints turn evenly. False: it is not known, or not followed so far.
bool Monitor::Impl::findPlaces(const MeshStore::Stretch& stretch, const Step& step, const Body& body,
                               std::vector<Waypoint>& places, std::string& why) const {
  const MeshFrame &from = *stretch.from, &to = *stretch.to;
  std::vector<Knot> knots = trackOf(from, to, why);
  if (!why.empty()) return false;
  places.clear();
  if (knots.empty() || standsStill(knots)) return true;
  const Knot first = knots.front(), last = knots.back();
  const auto placeAt = [&](const Knot& knot) {
    return Waypoint{fractionOf(step, knot.stamp_ns), knot.pose * first.pose.inverse() * from.pose,
                    body.turns ? nullptr : share(carriedTo(knot, first, last, from.positions, to.positions))};
  };
  for (const Knot& knot : knots) places.push_back(placeAt(knot));
  const WayBends bends(body);
  bool is_fine = false;
  while (!is_fine && knots.size() <= tolerance::MOST_POSES_A_STEP) {
    is_fine = true;
    std::vector<Knot> finer;
    std::vector<Waypoint> finer_places;
    const auto add = [&](const Knot& knot, const Waypoint& place) {
      finer.push_back(knot);
      finer_places.push_back(place);
    };
    const auto addMiddle = [&](std::size_t k) {
      const std::vector<Knot> half =
          tracks->between({}, to.carrier.frame, knots[k].stamp_ns, knots[k + 1].stamp_ns, to.carrier.silence);
      for (std::size_t h = 1; h + 1 < half.size(); ++h) add(half[h], placeAt(half[h]));
    };
    for (std::size_t k = 0; k < knots.size(); ++k) {
      const bool is_off =
          knots[k].is_middle && bends.at(places[k - 1], places[k], places[k + 1]) > options.detector.rigid_tolerance_m;
      if (is_off) {
        is_fine = knots[k].is_middle = false;
        addMiddle(k - 1);
      }
      add(knots[k], places[k]);
      if (is_off) addMiddle(k);
    }
    knots = std::move(finer);
    places = std::move(finer_places);
  }
  if (!is_fine) why = "its way bends too much between two transforms";
  for (const Knot& knot : knots) {
    if (!knot.why_unknown.empty()) why = knot.why_unknown;
  }
  if (isForgotten(from)) why = FORGOTTEN;
  return why.empty();
}

/// Between two frames of a mesh its vertices go straight in the frame that carries it, and that one as tf has it; a
/// rigid body is carried as it is. Where that leaves the way from the step's start to its end, it becomes waypoints.
bool Monitor::Impl::follow(const std::string& who, const std::vector<MeshStore::Stretch>& stretches, Body& body,
                           Step& step) const {
  std::vector<Waypoint> waypoints, places;
  const auto add = [&](const Waypoint& place) {
    if (place.u > 0 && place.u < 1 && (waypoints.empty() || place.u > waypoints.back().u)) waypoints.push_back(place);
  };
  StampNs known_ns = step.start_ns;
  for (const MeshStore::Stretch& stretch : stretches) {
    if (stretch.from->stamp_ns > known_ns) return false;
    known_ns = stretch.to->stamp_ns;
    std::string why;
    if (!findPlaces(stretch, step, body, places, why)) {
      sayUnknown(who, why, step);
      return true;
    }
    for (std::size_t k = 1; k + 1 < places.size(); ++k) add(places[k]);
    const std::shared_ptr<const MeshFrame>& to = stretch.to;
    add({fractionOf(step, to->stamp_ns), to->pose,
         body.turns ? nullptr : std::shared_ptr<const Positions>(to, &to->positions)});
  }
  if (offWay(body, waypoints) > options.detector.rigid_tolerance_m) body.waypoints = std::move(waypoints);
  return known_ns >= step.stamp_ns;
}

/// What came and was not used may have had the body anywhere.
void Monitor::Impl::lookForUnused(std::size_t body, StampNs from_ns, StampNs to_ns, Step& step) const {
  const std::string why = stores[body].unknownWithin(from_ns, to_ns);
  if (!why.empty()) sayUnknown("body '" + bodies[body].name + "'", why, step);
}

void Monitor::Impl::lookAtHeld(std::uint64_t epoch, Shown& shown, Step& step) const {
  for (std::size_t b = 0; b <= bodies.size(); ++b) {
    const bool is_held = b == bodies.size() || !isStream(b);
    if (is_held) shown[b] = lookAtHeld(b, epoch, step);
  }
}

void Monitor::Impl::sayUnshown(const Shown& shown, Step& step) const {
  for (std::size_t b = 0; b < shown.size(); ++b) {
    if (shown[b]) continue;
    sayUnknown(b < bodies.size() ? "body '" + bodies[b].name + "'" : "the octomap's frame", "nobody looked", step);
  }
}

/// What tf says since it was placed must not be contradicted in silence. body: their number stands for the map.
bool Monitor::Impl::lookAtHeld(std::size_t b, std::uint64_t epoch, Step& step) const {
  const bool is_map = b == bodies.size();
  if (is_map && !step.map.surface) return true;
  const MeshFrame* const frame = is_map ? nullptr : &stores[b].newest();
  const std::string& carrier = is_map ? step.map.frame_id : frame->carrier.frame;
  const auto name = [&] {  // most of the time nobody asks
    return is_map ? "the octomap's frame '" + carrier + "'" : "the frame of the static body '" + bodies[b].name + "'";
  };
  const auto say = [&](const std::string& why) { sayUnknown(name(), why, step); };
  if (frame && !frame->doubt.empty()) say(frame->doubt);
  if (const std::string why = frame ? stores[b].unknownWithin(frame->stamp_ns, frame->stamp_ns) : ""; !why.empty()) {
    say(why);
  }
  if (!tracks || carrier.empty()) return true;
  const std::vector<Knot> knots =
      is_map ? tracks->between(carrier, {}, step.start_ns, step.stamp_ns, Silence::UNKNOWN)
             : tracks->between({}, carrier, step.start_ns, step.stamp_ns, frame->carrier.silence);
  if (!knots.empty() && epoch != tracks->epoch()) {
    say(FORGOTTEN);
    return true;
  }
  const Eigen::Isometry3d held = is_map ? step.map.map_from_fixed : frame->pose;
  double off_m = 0;
  Eigen::AlignedBox3d bounds;
  for (const Knot& knot : knots) {
    if (!knot.why_unknown.empty()) {
      say(knot.why_unknown);
      return true;
    }
    if (knot.pose.matrix() == held.matrix()) continue;
    if (bounds.isEmpty()) bounds = is_map ? boundsOfThoseThatMeetTheMap(step) : boundsOf(step.bodies[b]);
    off_m = std::max(off_m, is_map ? apart(knot.pose, held, bounds)
                                   : apart(knot.pose * held.inverse(), Eigen::Isometry3d::Identity(), bounds));
  }
  if (off_m <= options.detector.rigid_tolerance_m) return true;
  // What is own of a map is told from where bodies were to it, one pose a map.
  if (is_map ? tracked().empty() : frame->carrier.takes_along) {
    bounds.min().array() -= off_m;
    bounds.max().array() += off_m;
    takeAlong(b, epoch, bounds, step);
    return true;
  }
  std::ostringstream text;
  text << name() << " was seen up to " << off_m << " m from where it was at its stamp; "
       << (is_map ? "set fixed_frame to it" : "send it again, or set fixed_frame to what is at rest");
  addSentence(step.off_path, text.str());
  return true;
}

/// A map and a static body go where their frames do, as a rigid body does: of the map what is within the bounds.
void Monitor::Impl::takeAlong(std::size_t b, std::uint64_t epoch, const Eigen::AlignedBox3d& bounds, Step& step) const {
  const bool is_map = b == bodies.size();
  MeshFrame held = is_map ? MeshFrame() : stores[b].newest();
  if (is_map) {
    held.pose = step.map.map_from_fixed.inverse();
    held.carrier.frame = step.map.frame_id;
    for (const Vec3& corner : cornersOf(bounds)) held.positions.push_back(corner);
  }
  held.rigid = true;
  held.carrier.epoch = epoch;
  const std::vector<Knot> knots =
      tracks->between({}, held.carrier.frame, step.start_ns, step.stamp_ns, held.carrier.silence);
  const std::string who = is_map ? "the octomap's frame" : "body '" + step.bodies[b].name + "'";
  for (const Knot& knot : knots) {  // tf goes on while it is asked
    if (!knot.why_unknown.empty()) return sayUnknown(who, knot.why_unknown, step);
  }
  const auto at = [&](const Knot& knot, StampNs stamp_ns) {
    MeshFrame frame = held;
    frame.stamp_ns = stamp_ns;
    frame.pose = knot.pose;
    for (Vec3& p : frame.positions) p = knot.pose * (held.pose.inverse() * p);
    return share(std::move(frame));
  };
  const auto from = at(knots.front(), step.start_ns);
  const auto to = step.start_ns == step.stamp_ns ? from : at(knots.back(), step.stamp_ns);
  Body of_map;
  Body& body = is_map ? of_map : step.bodies[b];
  placeBetween(from, to, body);
  if (from != to && !follow(who, {{from, to, 0, 1}}, body, step)) sayUnknown(who, "nobody looked", step);
  if (!is_map) return;
  step.map.map_from_fixed = from->pose.inverse();
  step.map.way = std::move(body.waypoints);
  if (from != to) step.map.way.push_back({1, to->pose});
}

}  // namespace dccd
