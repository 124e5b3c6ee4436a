#include "stream/own_voxels.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <utility>

#include "dccd/tolerances.h"
#include "obstacle/known_space_impl.h"
#include "obstacle/leaf_sets.h"
#include "obstacle/voxel_surface_impl.h"
#include "stream/own_voxels_look.h"

namespace dccd {
namespace {

const VoxelTree NO_VOXELS{std::vector<OccupiedLeaf>()};

StampNs nanoseconds(double s) { return static_cast<StampNs>(std::llround(s * 1e9)); }

}  // namespace

void OwnVoxelFinder::forget() {
  before_ = nullptr;
  known_before_ = nullptr;
  stated_.clear();
  known_.clear();
  past_.clear();
  unseen_ = UnseenSpace();
  growth_.clear();
  entered_.clear();
  entered_from_.clear();
  remembered_.clear();
  seen_.clear();
  seen_alone_.clear();
}

bool OwnVoxelFinder::forgetBody(std::uint16_t body) {
  shapes_.erase(body);
  first_.erase(body);
  last_frames_.erase(body);
  known_.erase(body);
  bool any = false;
  for (auto one = stated_.begin(); one != stated_.end();) {
    Stated& voxel = one->second;
    const bool was_its = voxel.owners.has(body);
    const bool is_over = was_its && std::next(voxel.owners.begin()) == voxel.owners.end();
    // What it may have hidden is an obstacle where it is shown again.
    if (is_over && !voxel.shown && voxel.state != VoxelState::OWN) remembered_.push_back({voxel.key, 1});
    voxel.owners.removeIf([&](int owner) { return owner == body; });
    any = any || was_its;
    one = is_over ? stated_.erase(one) : std::next(one);
  }
  return before_ && any;
}

/// What the map shows otherwise than the one before, and of all that has a state.
void OwnVoxelFinder::listChanges(Look& look) {
  using Why = ReachedCube::Why;
  const VoxelTree &now = look.change.now, &before = look.change.before, remembered(remembered_);
  std::vector<OccupiedLeaf> stated;
  for (const auto& [key, voxel] : stated_) stated.push_back({voxel.key, 1});
  const VoxelTree has_state(stated);
  auto appeared = [&](const OccupiedLeaf& voxel) {
    if (look.cubes.size() < tolerance::MOST_OWN_ASKED) look.ask(voxel, Why::APPEARED);
  };
  const KeyBox& region = look.mayBeNear() && before_ ? ALL_KEYS : look.region;
  const auto take = [&](const OccupiedLeaf& part) {
    const bool was_free = look.change.has_before && !unseen_.holds(part);
    if (was_free && look.shows_growth && !isInside(part, region))
      growth_.add(part, false, before_ns_, look.map.stamp_ns);
    visitVoxels(part, region, appeared);
  };
  visitDifference(now, before, [&](const OccupiedLeaf& fresh) {
    visitUncovered(look.sure, fresh, [&](const OccupiedLeaf& unsure) {
      visitUncovered(remembered, unsure, [&](const OccupiedLeaf& left) { visitUncovered(has_state, left, take); });
    });
  });
  visitDifference(before, now, [&](const OccupiedLeaf& gone) {
    visitUncovered(has_state, gone, [&](const OccupiedLeaf& part) { look.ask(part, Why::VANISHED); });
  });
  for (const OccupiedLeaf& leaf : remembered_) {
    visitUncovered(now, leaf, [&](const OccupiedLeaf& part) { look.ask(part, Why::REMEMBERED); });
  }
  for (auto& [key, voxel] : stated_) {
    const OccupiedLeaf leaf{voxel.key, 1};
    voxel.shown = coverage(now, leaf) == VoxelTree::Coverage::FULL;
    look.ask(leaf, Why::STATED, voxel.state == VoxelState::DOUBT ? BodySet() : look.askedWith(voxel.owners));
  }
}

void OwnVoxelFinder::seeAlone(const OccupiedLeaf& voxel, Look& look) {
  const std::uint64_t key = packed(voxel.min);
  const auto before = seen_alone_.find(key);
  const bool was_seen = before != seen_alone_.end();
  // What one look left behind stands in the next map, too, if nothing looks there.
  look.seen_alone[key] = was_seen && (before->second || !look.tellsFound() || look.wasFound(voxel));
  seen_.push_back(voxel);
}

bool OwnVoxelFinder::wasSeenAgain(const OccupiedLeaf& voxel) const {
  const auto seen = seen_alone_.find(packed(voxel.min));
  return seen != seen_alone_.end() && seen->second;
}

/// What is in doubt for the map's maker.
void OwnVoxelFinder::listSeen(Look& look) {
  seen_.clear();
  if (!look.map.own.doubted_surface) return;
  const std::size_t most = look.cubes.size() + tolerance::MOST_OWN_ASKED;
  auto askSeen = [&](const OccupiedLeaf& voxel) {
    if (!meets(voxel, look.region) || look.cubes.size() >= most) return seeAlone(voxel, look);
    look.ask(voxel, ReachedCube::Why::SEEN);
  };
  for (const OccupiedLeaf& leaf : VoxelSurface::Impl::of(*look.map.own.doubted_surface).tree.leaves())
    visitUncovered(look.sure, leaf, askSeen);
}

void OwnVoxelFinder::appear(const ReachedCube& cube, Look& look) {
  const bool was_seen = wasSeenAgain(cube.leaf);
  const bool was_free = look.change.has_before && !was_seen && !unseen_.holds(cube.leaf) &&
                        look.unknown.count(packed(cube.leaf.min)) == 0;
  const auto isNotYet = [&](int body) { return look.not_yet.count(body) > 0; };
  BodySet owners = look.ownersOf(cube);
  owners.removeIf(isNotYet);
  VoxelState state = nextState(was_free ? VoxelState::FREE : VoxelState::UNKNOWN, look.occupied(cube, owners));
  const bool on_trust = look.trust_first && !cube.near.empty() && (!was_free || isNotYet(*cube.near.begin()));
  if (on_trust) state = VoxelState::OWN;
  if (((was_free && look.shows_growth) || was_seen) && state != VoxelState::OWN)
    growth_.add(cube.leaf, state == VoxelState::DOUBT, before_ns_, look.map.stamp_ns);
  if (state == VoxelState::OBSTACLE) return;
  if (owners.empty()) owners = cube.near;
  if (owners.empty()) {
    owners.add(static_cast<std::uint16_t>(look.seamed.empty() ? *look.lost.begin() : *look.seamed.begin()));
  }
  look.appeared.push_back({cube.leaf.min, state, owners, true, was_seen && state == VoxelState::DOUBT});
}

/// Says of a cube, by who reached it, what it is from now on.
void OwnVoxelFinder::follow(const ReachedCube& cube, Look& look) {
  switch (cube.why) {
    case ReachedCube::Why::APPEARED:
      return appear(cube, look);
    case ReachedCube::Why::VANISHED:
    case ReachedCube::Why::REMEMBERED: {
      const bool is_free =
          look.change.isFree(cube.leaf) && nextState(VoxelState::OBSTACLE, look.free(cube, {})) == VoxelState::FREE;
      if (!is_free) look.hidden.push_back(cube.leaf);
      return;
    }
    case ReachedCube::Why::SEEN:
      if (cube.near.empty() || wasSeenAgain(cube.leaf)) seeAlone(cube.leaf, look);
      return;
    case ReachedCube::Why::STATED:
      break;
  }
  const auto found = stated_.find(packed(cube.leaf.min));
  Stated& voxel = found->second;
  const BodySet owners = look.ownersOf(cube);
  const VoxelEvent if_free = look.free(cube, owners);
  // By a map without anything free no ray went there, and a body may hide it.
  const bool may_hide = !look.change.known && voxel.state == VoxelState::DOUBT && if_free != VoxelEvent::FREE_ALONE;
  const bool is_free = !voxel.shown && look.change.isFree(cube.leaf) && !may_hide;
  const bool was_left = voxel.state == VoxelState::LEFT || voxel.state == VoxelState::LEFT_SEEN;
  const bool is_over = was_left && look.map.stamp_ns - voxel.left_ns > nanoseconds(tolerance::OWN_LEFT_S);
  const VoxelEvent if_occupied = is_over ? VoxelEvent::OCCUPIED_WITH_OTHER : look.occupied(cube, owners);
  voxel.state = nextState(voxel.state, is_free ? if_free : if_occupied);
  if (!was_left) voxel.left_ns = look.map.stamp_ns;
  if (voxel.state == VoxelState::OWN) {
    voxel.owners = owners;
  } else if (voxel.state == VoxelState::FREE || voxel.state == VoxelState::UNKNOWN ||
             voxel.state == VoxelState::OBSTACLE) {
    stated_.erase(found);
  }
}

/// What appeared as own and touches what grew from outside is in doubt. Then all that appeared is stated, not before:
/// should memory end, the same map comes again.
void OwnVoxelFinder::stateWhatAppeared(Look& look, const std::vector<TrackedBody>& bodies,
                                       const std::vector<BodyWay>& ways) {
  std::vector<std::uint64_t> appeared;
  for (const Stated& voxel : look.appeared) {
    if (voxel.state == VoxelState::OWN) appeared.push_back(packed(voxel.key));
  }
  std::vector<std::uint64_t> own = appeared;
  for (const auto& [key, voxel] : stated_) {
    if (voxel.shown && voxel.state == VoxelState::OWN) own.push_back(key);
  }
  const StampNs now_ns = look.map.stamp_ns;
  // Where maps are seldom what was added with the last one counts, too.
  const StampNs since_ns = std::min(now_ns - nanoseconds(tolerance::OWN_GROWTH_S), before_last_ns_ - 1);
  growth_.keep(look.change.now, look.change.before, since_ns, now_ns);
  std::vector<Growth::Seed> seeds = growth_.beside(appeared, true);
  const std::vector<Growth::Seed> obstacles = growth_.beside(own, false);
  std::vector<OccupiedLeaf> asked, outside;
  for (const Growth::Seed& one : obstacles) asked.push_back(one.voxel);
  const std::vector<ReachedCube> cubes = look.reached(asked, bodies, ways);
  for (std::size_t i = 0; i < cubes.size(); ++i) {
    if (!cubes[i].near.empty()) continue;
    seeds.push_back(obstacles[i]);
    outside.push_back(asked[i]);
  }
  std::unordered_set<std::uint64_t> grew;
  for (const Growth::Seed& one : renewed(growth_.touched(appeared, std::move(seeds)), look)) {
    growth_.add(one.voxel, true, one.free_ns, now_ns);
    grew.insert(packed(one.voxel.min));
  }
  for (Stated& voxel : look.appeared) {
    const std::uint64_t key = packed(voxel.key);
    if (grew.count(key) > 0) {
      voxel.state = VoxelState::DOUBT;
      voxel.grew = true;
    }
    stated_[key] = voxel;
  }
  seen_alone_ = std::move(look.seen_alone);
  listEntered(look, bodies, std::move(outside));
}

/// What grew on goes by what it grew from: a body that moves comes to more and more voxels. But where it was within
/// reach a gap ago already, something came to the body.
std::vector<Growth::Seed> OwnVoxelFinder::renewed(std::vector<Growth::Seed> grown, const Look& look) const {
  const PastLook* const past = past_.empty() ? nullptr : &past_.front();
  if (!past || past->stamp_ns > look.map.stamp_ns - nanoseconds(tolerance::OWN_GAP_S)) return grown;
  std::vector<OccupiedLeaf> voxels;
  for (const Growth::Seed& one : grown) voxels.push_back(one.voxel);
  const std::vector<ReachedCube> cubes = look.reached(voxels, past->bodies, past->ways);
  for (std::size_t i = 0; i < cubes.size(); ++i) {
    if (!cubes[i].near.empty()) grown[i].free_ns = before_ns_;
  }
  return grown;
}

/// Which own voxels may hold more of what came from outside: those between a body and where it entered, if there it
/// met voxels that were own before and so did not appear; and as long as maps show what they were entered from.
/// from: what grew out of reach beside own voxels.
void OwnVoxelFinder::listEntered(const Look& look, const std::vector<TrackedBody>& bodies,
                                 std::vector<OccupiedLeaf> from) {
  std::unordered_set<std::uint64_t> left, were;
  std::vector<OccupiedLeaf> earlier;
  for (auto one = entered_from_.begin(); one != entered_from_.end();) {
    const OccupiedLeaf leaf{unpacked(*one), 1};
    const bool is_shown = coverage(look.change.now, leaf) == VoxelTree::Coverage::FULL;
    if (is_shown) earlier.push_back(leaf);
    one = is_shown ? std::next(one) : entered_from_.erase(one);
  }
  for (const OccupiedLeaf& leaf : from) entered_from_.insert(packed(leaf.min));
  for (const auto& [key, voxel] : stated_) {
    if (voxel.shown && voxel.state == VoxelState::OWN) left.insert(key);
    if (voxel.shown && voxel.state == VoxelState::DOUBT && voxel.grew) from.push_back({voxel.key, 1});
  }
  for (const std::uint64_t key : entered_) {
    if (left.count(key) > 0) were.insert(key);
  }
  double deepest_m = 0;
  for (const TrackedBody& body : bodies) deepest_m = std::max(deepest_m, body.reach_m);
  const double resolution_m = look.map.surface->resolution();
  entered_.clear();
  const auto flood = [&](std::vector<OccupiedLeaf> seeds, std::unordered_set<std::uint64_t>& own) {
    for (double deep_m = -resolution_m; deep_m < deepest_m && !seeds.empty(); deep_m += resolution_m) {
      std::vector<OccupiedLeaf> next;
      const auto enter = [&](std::uint64_t key) {
        if (own.erase(key) > 0 && entered_.insert(key).second) next.push_back({unpacked(key), 1});
        return false;
      };
      for (const OccupiedLeaf& one : seeds) anyAround(one.min, enter);
      seeds = std::move(next);
    }
  };
  flood(std::move(from), left);
  flood(std::move(earlier), were);
}

/// Which of what the map before left out is UNKNOWN: a body was within reach of it at that look, and already at the
/// last one that is a gap ago. What nobody looks at for no longer than that is free.
std::vector<OccupiedLeaf> OwnVoxelFinder::unknownOf(std::vector<OccupiedLeaf> left_out, const Look& look) const {
  if (past_.empty()) return left_out;
  for (const PastLook* past : {&past_.back(), &past_.front()}) {
    if (past->may_be_near) continue;
    const std::vector<ReachedCube> asked = look.reached(left_out, past->bodies, past->ways);
    left_out.clear();
    for (const ReachedCube& cube : asked) {
      if (!cube.near.empty()) left_out.push_back(cube.leaf);
    }
  }
  return left_out;
}

void OwnVoxelFinder::listLeftOut(Look& look) const {
  if (!look.change.known_before) return;
  std::vector<OccupiedLeaf> left_out;
  for (const ReachedCube& cube : look.cubes) {
    const bool is_new = cube.why == ReachedCube::Why::APPEARED;
    if (is_new && coverage(*look.change.known_before, cube.leaf) != VoxelTree::Coverage::FULL)
      left_out.push_back(cube.leaf);
  }
  for (const OccupiedLeaf& leaf : unknownOf(std::move(left_out), look)) look.unknown.insert(packed(leaf.min));
}

void OwnVoxelFinder::askUnseen(Look& look, const std::vector<TrackedBody>& there,
                               const std::vector<BodyWay>& ways_there) {
  const StampNs gap_ago_ns = look.map.stamp_ns - nanoseconds(tolerance::OWN_GAP_S);
  while (past_.size() > 1 && past_[1].stamp_ns <= gap_ago_ns) past_.pop_front();
  listLeftOut(look);
  std::vector<OccupiedLeaf> first_free = unseen_.firstFree(look.change, look.boxes, look.mayBeNear());
  const auto hasState = [&](const OccupiedLeaf& leaf) { return leaf.size == 1 && stated_.count(packed(leaf.min)) > 0; };
  first_free.erase(std::remove_if(first_free.begin(), first_free.end(), hasState), first_free.end());
  std::vector<OccupiedLeaf> unseen = unknownOf(std::move(first_free), look);
  std::vector<OccupiedLeaf> asked = unseen_.ask(look.change, look.boxes, look.mayBeNear(), std::move(unseen));
  while (!asked.empty()) asked = unseen_.settle(look.reached(asked, there, ways_there));
}

std::string OwnVoxelFinder::gapBefore(const ObstacleMap& map) const {
  std::ostringstream text;
  text << secondsBetween(before_ns_, map.stamp_ns) << " s without a look";
  if (map.number > number_ + 1) {
    const std::uint64_t count = map.number - number_ - 1;
    text << ", in which " << count << (count == 1 ? " map was" : " maps were") << " not looked at ("
         << (why_lost_.empty() ? "they come faster than they are used; send fewer" : why_lost_) << ")";
  }
  return text.str();
}

ObstacleMap OwnVoxelFinder::reduce(const ObstacleMap& map, const VoxelSurface* trusted, std::vector<TrackedBody> bodies,
                                   double lag_s, bool trust_first) {
  const double resolution_m = map.surface->resolution();
  for (TrackedBody& body : bodies) {
    if (body.reach_m == ONE_VOXEL) body.reach_m = resolution_m;
  }
  endWhereItMoved(map, bodies);
  std::size_t hidden = remembered_.size() + unseen_.size();
  for (const auto& one : stated_) hidden += one.second.shown ? 0 : 1;
  if (hidden > MOST_REMEMBERED) forget();
  const double since_s = before_ ? secondsBetween(before_ns_, map.stamp_ns) : 0;
  const bool is_blind = since_s < 0 || since_s > tolerance::OWN_PATH_S;
  Look look{map,
            {VoxelSurface::Impl::of(*map.surface).tree, before_ ? VoxelSurface::Impl::of(*before_).tree : NO_VOXELS,
             map.known ? &KnownSpace::Impl::treeOf(*map.known) : nullptr,
             known_before_ ? &KnownSpace::Impl::treeOf(*known_before_) : nullptr, before_ != nullptr},
            trusted ? VoxelSurface::Impl::of(*trusted).tree : NO_VOXELS,
            shapes_,
            trust_first,
            is_blind || since_s > tolerance::OWN_GAP_S,
            is_blind,
            past_.size() > 1};
  const std::vector<BodyWay> ways = waysOf(bodies, map.stamp_ns, lag_s);
  findSeams(look, bodies, lag_s);
  std::vector<TrackedBody> there;
  std::vector<BodyWay> ways_there;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (!look.addBoxOf(bodies[b], ways[b])) continue;
    there.push_back(bodies[b]);
    ways_there.push_back(ways[b]);
  }
  listChanges(look);
  listSeen(look);
  searchReach(bodies, ways, map.map_from_fixed, resolution_m, look.cubes, &shapes_, look.is_gap);
  askUnseen(look, there, ways_there);
  for (const ReachedCube& cube : look.cubes) follow(cube, look);
  remembered_ = std::move(look.hidden);
  stateWhatAppeared(look, bodies, ways);
  unseen_.keep();
  if (before_ && look.is_gap) gap_ = gapBefore(map);
  const auto isDoubted = [](const auto& one) { return one.second.state != VoxelState::OWN; };
  if (std::none_of(stated_.begin(), stated_.end(), isDoubted)) gap_.clear();
  for (const TrackedBody& body : bodies) {
    const auto seen = body.frames->framesWithin(std::numeric_limits<StampNs>::min(), map.stamp_ns + 1);
    if (!seen.empty()) last_frames_[body.body] = seen.back();
  }
  if (!before_) map_from_fixed_ = map.map_from_fixed;
  past_.push_back({map.stamp_ns, std::move(there), std::move(ways_there), look.mayBeNear()});
  frame_id_ = map.frame_id;
  before_ = map.surface;
  known_before_ = map.known;
  before_last_ns_ = std::exchange(before_ns_, map.stamp_ns);
  if (map.number > number_ + 1) why_lost_.clear();
  number_ = map.number;

  ObstacleMap next = map;
  next.own = OwnVoxels();
  next.own.seen = map.own.seen;
  const auto appeared = [](const ReachedCube& cube) { return cube.why == ReachedCube::Why::APPEARED; };
  next.own.looked_at = static_cast<std::uint64_t>(std::count_if(look.cubes.begin(), look.cubes.end(), appeared));
  return withoutOwn(std::move(next), trusted, bodies, trust_first);
}

}  // namespace dccd
