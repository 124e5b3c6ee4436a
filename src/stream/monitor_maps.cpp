// Which map a step has: the newest one whose own voxels can be told, with the one that is trusted.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <iomanip>
#include <limits>
#include <new>
#include <sstream>
#include <utility>

#include "step/history.h"
#include "stream/monitor_impl.h"

namespace dccd {

namespace {

// Maps that may wait for the bodies' frames: half a second of a camera's. Of large ones fewer, so that max_map_mb has
// room for what follows.
constexpr std::size_t MOST_MAPS_TO_COME = 16, FEWEST_MAPS_TO_COME = 4, MOST_BYTES_TO_COME = std::size_t{32} << 20;

/// Whether both are of one lattice: a publisher may have its resolution as a float. By 10 m from the origin voxels of
/// the two are 1.2 um apart then at the most.
bool isSameLattice(const VoxelSurface& a, const VoxelSurface& b) {
  constexpr double FLOAT_PRECISION = std::numeric_limits<float>::epsilon();
  return std::abs(a.resolution() - b.resolution()) <= FLOAT_PRECISION * b.resolution();
}

}  // namespace

const ObstacleMap& Monitor::map() const {
  return impl_->maps_to_come.empty() ? impl_->map : impl_->maps_to_come.back();
}

const ObstacleMap& Monitor::mapInUse() const { return impl_->map; }

std::optional<std::int64_t> Monitor::mapWaitsSince() const {
  if (impl_->maps_to_come.empty()) return std::nullopt;
  return impl_->maps_to_come.front().arrival_ns;
}

std::set<std::string> Monitor::heldFrames() const {
  const Impl& m = *impl_;
  std::set<std::string> frames;
  if (m.map.surface) frames.insert(m.map.frame_id);
  for (const ObstacleMap& one : m.maps_to_come) frames.insert(one.frame_id);
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    if (m.isStream(b) || m.stores[b].empty()) continue;
    const Carrier& carrier = m.stores[b].newest().carrier;
    if (carrier.silence == Silence::UNKNOWN) frames.insert(carrier.frame);
  }
  frames.erase("");
  return frames;
}

void Monitor::setMap(ObstacleMap map) {
  Impl& m = *impl_;
  const bool is_one = map.surface || !map.problem.empty();  // else there is none, and none came
  if (map.number == 0 && is_one) map.number = m.map_number + 1;
  m.map_number = std::max(m.map_number, map.number);
  const bool as_it_is = map.trusted || (m.tracked().empty() && !m.trusted.surface && !map.own.doubted_surface);
  if (!map.surface || as_it_is) {  // what was there before is void, and what is to come is older
    m.awaitTelling();
    m.telling = {};
    if (!map.problem.empty()) m.own_voxels.say(map.problem);
    m.maps_to_come.clear();
    if (as_it_is) m.own_voxels.forget();
    m.map = std::move(map);
    return;
  }
  m.maps_to_come.push_back(std::move(map));
  m.limitMapsToCome();
  if (m.tracked().empty()) {
    m.takeMaps(m.maps_to_come.back().stamp_ns);
  } else if (m.pending.empty() && !m.stores[m.options.clock_body].empty()) {
    // No step to come ends before the newest frame: what is own is told now, and the next answer need not wait for it.
    m.followOwnVoxels(m.stores[m.options.clock_body].newest().stamp_ns);
  }
}

void Monitor::sayOfMaps(const std::string& why) {
  impl_->awaitTelling();
  impl_->own_voxels.say(why);
}

/// Of too many the oldest and the newest ones are kept.
void Monitor::Impl::limitMapsToCome() {
  const auto isTooMuch = [&] {
    std::size_t bytes = 0;
    for (const ObstacleMap& one : maps_to_come) bytes += one.surface->memoryBytes();
    return maps_to_come.size() > (bytes > MOST_BYTES_TO_COME ? FEWEST_MAPS_TO_COME : MOST_MAPS_TO_COME);
  };
  if (isTooMuch()) {
    awaitTelling();
    finishTelling();
  }
  while (isTooMuch()) {
    maps_to_come.erase(maps_to_come.begin() + 1);
    own_voxels.say("too many came between two frames of the bodies");
  }
}

void Monitor::setMapBeside(ObstacleMap map) { impl_->trusted = std::move(map); }

std::vector<TrackedBody> Monitor::Impl::tracked() const {
  std::vector<TrackedBody> tracked;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (!ownsVoxels(bodies[b])) continue;
    tracked.push_back({static_cast<std::uint16_t>(b), bodies[b].name, bodies[b].own_voxels_m, &stores[b], !isStream(b),
                       bodies[b].shell, !bodies[b].link.empty()});
    for (const Expectation& one : options.held) {
      for (const std::size_t side : {0, 1}) {
        if (one.partners[side].body == b) tracked.back().held.add(one.partners[1 - side].body);
      }
    }
  }
  return tracked;
}

/// Until when the bodies' ways are known. Of several maps up to then each is looked at, and the newest is in force.
void Monitor::Impl::takeMaps(StampNs known_until_ns) {
  finishTelling();
  if (telling.valid() || (maps_to_come.empty() && std::any_of(bodies.begin(), bodies.end(), ownsVoxels))) return;
  const std::vector<TrackedBody> bodies_tracked = tracked();
  std::size_t taken = maps_to_come.size();
  while (taken > 0 && !bodies_tracked.empty() && maps_to_come[taken - 1].stamp_ns > known_until_ns) --taken;
  if (bodies_tracked.empty()) own_voxels.forget();
  for (; taken > 0; --taken) {
    const ObstacleMap& next = maps_to_come.front();
    if (fitsTrusted(next)) {
      if (options.own_voxels_beside && !bodies_tracked.empty()) return tellBeside(taken, bodies_tracked);
      const auto start = Deadline::Clock::now();
      map = own_voxels.reduce(next, trusted.surface.get(), bodies_tracked, options.own_voxels_lag_s,
                              options.own_voxels_trust);
      own_voxels_ms += msSince(start);
    }
    maps_to_come.pop_front();  // should memory end before, the next step takes it
  }
}

/// By copies of the bodies' frames: which those are does not depend on how long it takes. All maps that can be told at
/// once: else a node that has fallen behind would tell one from frame to frame, and never catch up.
void Monitor::Impl::tellBeside(std::size_t count, std::vector<TrackedBody> bodies_tracked) {
  std::vector<ObstacleMap> next;
  while (next.size() < count && fitsTrusted(maps_to_come[next.size()])) next.push_back(maps_to_come[next.size()]);
  told_from_ns = own_voxels.pathNeededFrom(next.front().stamp_ns, options.own_voxels_lag_s);
  std::vector<MeshStore> frames;
  frames.reserve(bodies_tracked.size());
  for (TrackedBody& body : bodies_tracked) {
    frames.push_back(*body.frames);
    body.frames = &frames.back();  // there it stays when the vector moves
  }
  // Where there can be no thread the next step tells it.
  telling =
      std::async(std::launch::async | std::launch::deferred,
                 [this, next = std::move(next), sure = trusted.surface, tracked = std::move(bodies_tracked),
                  frames = std::move(frames), lag_s = options.own_voxels_lag_s, trust = options.own_voxels_trust] {
                   const auto start = Deadline::Clock::now();
                   ToldMaps told;
                   try {
                     for (const ObstacleMap& map : next) {
                       told.map = own_voxels.reduce(map, sure.get(), tracked, lag_s, trust);
                       ++told.count;
                     }
                   } catch (const std::bad_alloc&) {  // the others are told later
                     if (told.count == 0) throw;
                   }
                   told.ms = msSince(start);
                   return told;
                 });
}

void Monitor::Impl::finishTelling() {
  if (!telling.valid() || telling.wait_for(std::chrono::seconds(0)) == std::future_status::timeout) return;
  ToldMaps told = telling.get();  // should memory have ended, the next step has it told again
  map = std::move(told.map);
  own_voxels_ms += told.ms;
  maps_to_come.erase(maps_to_come.begin(), maps_to_come.begin() + static_cast<std::ptrdiff_t>(told.count));
}

void Monitor::Impl::followOwnVoxels(StampNs stamp_ns) try {
  StampNs known_until_ns = stamp_ns;
  for (const TrackedBody& body : tracked()) {
    if (body.holds_always) continue;
    if (body.frames->empty()) return;  // what it reaches would be taken for obstacles
    known_until_ns = std::min(known_until_ns, body.frames->newest().stamp_ns);
  }
  takeMaps(known_until_ns);
} catch (const std::bad_alloc&) {
  // The maps wait for the next one.
}

/// When all that can be is answered: within a step, what tells what is own would take the processor from it.
void Monitor::Impl::tellBetweenSteps() {
  if (!tellsBeside() || maps_to_come.empty() || stores[options.clock_body].empty()) return;
  followOwnVoxels(pending.empty() ? stores[options.clock_body].newest().stamp_ns : pending.front().to->stamp_ns);
}

bool Monitor::Impl::fitsTrusted(const ObstacleMap& next) {
  const VoxelSurface* sure = trusted.surface.get();
  // The one lattice of both is the live map's: a message has all digits of its resolution, a file's header six.
  if (sure && (trusted.frame_id != next.frame_id || !isSameLattice(*sure, *next.surface))) {
    std::ostringstream problem;
    problem << std::setprecision(9) << "the octomap has voxels of " << next.surface->resolution() << " m in frame '"
            << next.frame_id << "', and octomap_file of " << sure->resolution() << " m in '" << trusted.frame_id
            << "'; used together they must have the same";
    map = ObstacleMap();
    map.problem = problem.str();
    own_voxels.say(map.problem);
    return false;
  }
  return true;
}

/// From the next step on what was the body's own is an obstacle, as far as the map in force shows it.
void Monitor::Impl::forgetOwnVoxels(std::size_t body) {
  awaitTelling();
  finishTelling();
  if (!own_voxels.forgetBody(static_cast<std::uint16_t>(body)) || !map.surface) return;
  const ObstacleMap before = std::exchange(map, ObstacleMap());  // should memory end, there is none until the next one
  map = own_voxels.reducedAnew(before, trusted.surface.get(), tracked(), options.own_voxels_trust);
}

/// What is in doubt matters to a step that would touch it, were it an obstacle.
void Monitor::Impl::settleDoubt(Step& step, const Deadline& deadline) {
  if (!step.map.own.doubted_surface || !step.map.surface) return;
  Step asked = step;
  asked.map.surface = asked.map.own.doubted_surface;
  for (Body& body : asked.bodies) body.self_collision = body.against_bodies = false;
  Options how = options.detector;
  how.check_start_state = how.patches = how.suppress_initial = how.clearance.wanted = false;
  how.expected.clear();
  how.exclude_boxes.clear();
  const Outcome outcome = detect(asked, how, doubt_history, deadline);
  if (outcome.complete && outcome.total_contacts == 0) step.map.own.doubt.clear();
}

StampNs Monitor::Impl::wayNeededFrom(std::size_t body, StampNs stamp_ns) const {
  if (!ownsVoxels(bodies[body])) return stamp_ns;
  if (telling.valid()) return std::min(stamp_ns, told_from_ns);
  const StampNs map_ns = maps_to_come.empty() ? stamp_ns : std::min(stamp_ns, maps_to_come.front().stamp_ns);
  return own_voxels.pathNeededFrom(map_ns, options.own_voxels_lag_s);
}

ObstacleMap Monitor::Impl::usableMap(StampNs stamp_ns) const {
  ObstacleMap used = map;
  if (!options.detector.obstacle_expected) return used;
  if (!used.surface) {
    if (used.problem.empty()) {
      used.problem = maps_to_come.empty()
                         ? "no octomap has been received yet"
                         : "the octomap is stamped after the end of the step, and where the bodies are "
                           "at its stamp, which tells their own voxels, is not known yet";
    }
    return used;
  }
  if (!(options.octomap_timeout_s > 0) || used.stamp_ns <= 0) return used;
  // Also one from the future: by its stamp it would be fresh for ever, and its clock is not that of the meshes.
  const double age_s = secondsBetween(used.stamp_ns, stamp_ns);
  if (std::abs(age_s) <= options.octomap_timeout_s) return used;
  used.surface = nullptr;
  std::ostringstream problem;
  if (age_s > 0) {
    problem << "the octomap is older than octomap_timeout_s";
  } else {
    problem << "the octomap is stamped " << -age_s << " s after the end of the step, more than octomap_timeout_s";
  }
  used.problem = problem.str();
  return used;
}

}  // namespace dccd
