// No voxel is own that the rule of stream/own_voxels.h does not name, and none that it names is missing but at the rim:
// random bodies, motions, maps and faults against a model that keeps every voxel by itself and measures distances by
// the oracle. DEFORMABLE_CCD_LONG=1 runs many more worlds.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <deque>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <tuple>

#include "obstacle/voxel_surface_impl.h"
#include "stream/own_voxels.h"
#include "support/box_oracle.h"

namespace dccd {
namespace test {
namespace {

constexpr double VOXEL_M = 0.1;
constexpr StampNs MS = 1000000;
constexpr int SIDE = 8;  // voxels of the world, each way
// What the finder may miss: half of the way between two places at which it asks for a body.
constexpr double RIM_M = 0.5 * tolerance::OWN_PLACES * VOXEL_M + 1e-9;
// By how much distance() may be too large, where a point goes a metre: the rest of the ways that it narrows down.
constexpr double NEAREST_M = 0.008;

using Cell = std::array<int, 3>;

OccupiedLeaf leafOf(const Cell& cell, std::uint32_t size = 1) {
  const auto key = [](int i) { return static_cast<std::uint16_t>(32768 + i); };
  return {{key(cell[0]), key(cell[1]), key(cell[2])}, size};
}

/// One frame, and whether it goes on from the one before.
struct Seen {
  StampNs stamp_ns;
  Positions positions;
  bool goes_on;
};

/// The least distance between a voxel and the body on its way between two fractions of a stretch. For each face it is
/// convex in time: both move straight.
double distance(const Cell& cell, const Topology& topology, const Positions& a, const Positions& b, double first,
                double last) {
  double least = 1e300;
  for (const Face& face : topology.faces()) {
    ObstacleScene scene{VOXEL_M, {leafOf(cell)}, Topology::fromTriangles(3, {{0, 1, 2}}), {}, {}};
    for (const Index v : face) {
      scene.t0.push_back(a[v]);
      scene.t1.push_back(b[v]);
    }
    double lo = first, hi = last;
    for (int i = 0; i < 12 && hi > lo; ++i) {
      const double u = lo + (hi - lo) / 3, v = hi - (hi - lo) / 3;
      const double at_u = distanceToBoxes(scene, u), at_v = distanceToBoxes(scene, v);
      least = std::min({least, at_u, at_v});
      if (least == 0) return 0;
      (at_u < at_v ? hi : lo) = at_u < at_v ? v : u;
    }
    least = std::min({least, distanceToBoxes(scene, lo), distanceToBoxes(scene, hi)});
  }
  return least;
}

enum class Kind { UNKNOWN, FREE, OWN, OBSTACLE, DOUBT, LEFT };
enum class Maybe { NO, PERHAPS, YES };

/// What a voxel may be: at the rim of a reach the finder may see it or not.
struct State {
  Kind kind = Kind::UNKNOWN;
  unsigned owners = 0;     // bits, of OWN
  StampNs since_ns = -1;   // when it was FREE, of what was until it became occupied
  StampNs grew_ns = -1;    // since when it makes what appears beside it doubtful; -1: it does not
  bool is_marked = false;  // the same, shown free with a body near; else by resolved()
  bool is_seen = false;    // of LEFT: one look found something there
  StampNs left_ns = -1;    // the same: since when
  friend bool operator<(const State& a, const State& b) {
    return std::tie(a.kind, a.owners, a.since_ns, a.grew_ns, a.is_marked, a.is_seen, a.left_ns) <
           std::tie(b.kind, b.owners, b.since_ns, b.grew_ns, b.is_marked, b.is_seen, b.left_ns);
  }
};

struct Walker {
  std::shared_ptr<const Topology> topology;
  std::vector<Seen> frames{};
  MeshStore store{MeshStoreOptions()};
  Positions at{};
  double reach_m = 0;
};

/// The rule as doc/algorithm.md has it, read voxel by voxel.
class Model {
 public:
  explicit Model(std::set<Cell> trusted) : trusted_(std::move(trusted)) {}

  static double boundedBelow(const Cell& cell, const Positions& a, const Positions& b) {
    Eigen::AlignedBox3d all, box;
    for (const Positions* positions : {&a, &b}) {
      for (const Vec3& p : *positions) all.extend(p);
    }
    const Vec3 low = VOXEL_M * Vec3(cell[0], cell[1], cell[2]);
    return all.exteriorDistance(box.extend(low).extend(Vec3(low.array() + VOXEL_M)));
  }

  /// The body's least distance on its known ways in a time, and the largest of moments close to each other.
  static std::pair<double, double> distances(const Cell& cell, const Walker& body, StampNs since_ns, StampNs until_ns) {
    const std::vector<Seen>& frames = body.frames;
    double least = 1e300, most = 0;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const bool alone = !frames[i].goes_on && !(i + 1 < frames.size() && frames[i + 1].goes_on);
      if (alone && frames[i].stamp_ns >= since_ns && frames[i].stamp_ns <= until_ns) {
        const double m = distance(cell, *body.topology, frames[i].positions, frames[i].positions, 0, 0);
        least = std::min(least, m);
        most = std::max(most, m);
      }
      if (!frames[i].goes_on) continue;
      const StampNs from = frames[i - 1].stamp_ns, to = frames[i].stamp_ns;
      if (from > until_ns || to < since_ns) continue;
      if (boundedBelow(cell, frames[i - 1].positions, frames[i].positions) > body.reach_m + RIM_M) {
        most = 1e300;
        continue;
      }
      const auto at = [&](StampNs t) { return static_cast<double>(t - from) / static_cast<double>(to - from); };
      const double first = at(std::max(from, since_ns)), last = at(std::min(to, until_ns));
      least =
          std::min(least, distance(cell, *body.topology, frames[i - 1].positions, frames[i].positions, first, last));
      for (int k = 0; k <= 4; ++k) {
        const double u = first + (last - first) * k / 4;
        most = std::max(most, distance(cell, *body.topology, frames[i - 1].positions, frames[i].positions, u, u));
      }
    }
    return {least, most};
  }

  struct Look {
    std::set<Cell> occupied, free, found;
    bool tells_free = false;
    StampNs stamp_ns = 0, lag_ns = 0;
    bool is_seam = false;         // of the map
    std::map<Cell, bool> said{};  // what the finder says: in doubt, else own
  };

  void judge(const Look& look, const std::vector<Walker>& bodies) {
    if (look.is_seam) {
      states_.clear();
      past_.clear();
      before_ns_.reset();
    }
    const StampNs since_ns = (before_ns_ ? *before_ns_ : look.stamp_ns) - look.lag_ns;
    const bool is_gap = before_ns_ && look.stamp_ns - *before_ns_ > 500 * MS;
    std::vector<bool> seam, not_yet;
    for (const Walker& body : bodies) {
      const StampNs first_ns = body.frames.front().stamp_ns;
      not_yet.push_back(look.stamp_ns < first_ns);
      const auto hasSeamAt = [&](const Seen& frame) {  // it is not known where the body was just before this frame
        const auto it = &frame - &body.frames[0];
        if (it == 0 || frame.goes_on) return false;
        return body.frames[static_cast<std::size_t>(it) - 1].stamp_ns < look.stamp_ns && frame.stamp_ns > since_ns;
      };
      seam.push_back(!not_yet.back() && std::any_of(body.frames.begin(), body.frames.end(), hasSeamAt));
    }
    while (past_.size() > 1 && past_[1].stamp_ns <= look.stamp_ns - 500 * MS) past_.pop_front();
    here_ = {look.stamp_ns, {}};
    any_seam_ = std::count(seam.begin(), seam.end(), true) > 0;
    std::map<Cell, std::set<State>> now;
    for (int i = 0; i < SIDE * SIDE * SIDE; ++i) {
      const Cell cell{i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE};
      const bool occupied = look.occupied.count(cell) > 0;
      const bool free = !occupied && (!look.tells_free || look.free.count(cell) > 0);
      std::vector<Maybe> near, always;
      for (std::size_t b = 0; b < bodies.size(); ++b) {
        const StampNs until_ns = std::max(look.stamp_ns, bodies[b].frames.front().stamp_ns);
        const auto [least, most] = distances(cell, bodies[b], since_ns, until_ns);
        const double reach_m = bodies[b].reach_m;
        near.push_back(least > reach_m + NEAREST_M ? Maybe::NO
                       : least <= reach_m - RIM_M  ? Maybe::YES
                                                   : Maybe::PERHAPS);
        always.push_back(near.back() == Maybe::NO || most > reach_m + RIM_M ? Maybe::NO
                         : most <= reach_m - RIM_M                          ? Maybe::YES
                                                                            : Maybe::PERHAPS);
      }
      const auto was = states_.find(cell);
      std::set<State> before = was == states_.end() ? std::set<State>{State()} : was->second;
      if (look.tells_free && before_ns_ && known_.count(cell) == 0) before = resolved(before, cell);
      const unsigned combinations = 1u << (2 * bodies.size());
      for (unsigned c = 0; c < combinations; ++c) {
        unsigned is_near = 0, owners = 0, away = 0;
        bool may_be = true;
        for (std::size_t b = 0; b < bodies.size(); ++b) {
          const bool n = c >> (2 * b) & 1, a = c >> (2 * b + 1) & 1;
          may_be = may_be && agrees(n, near[b]) && (is_gap ? agrees(a, always[b]) && (n || !a) : a == n);
          is_near |= n ? 1u << b : 0;
          away |= n && not_yet[b] ? 1u << b : 0;
          owners |= a && !seam[b] ? 1u << b : 0;
        }
        if (!may_be) continue;
        for (const State& state : before) {
          const State after = next(state, occupied, free, look, is_near, owners, away, look.found.count(cell) > 0);
          now[cell].insert(after);
          // That it was UNKNOWN out of reach need not be known of what appears there.
          if (before_ns_ && state.kind == Kind::UNKNOWN && after.kind == Kind::OBSTACLE)
            now[cell].insert({Kind::OBSTACLE, 0, -1, *before_ns_});
        }
      }
      const auto count = [&](Maybe said) { return std::count(near.begin(), near.end(), said); };
      reached_now_[cell] = count(Maybe::YES) > 0 ? Maybe::YES : count(Maybe::PERHAPS) > 0 ? Maybe::PERHAPS : Maybe::NO;
      Maybe there = any_seam_ ? Maybe::YES : Maybe::NO;
      for (std::size_t b = 0; b < bodies.size(); ++b) {
        if (!not_yet[b] && there != Maybe::YES && near[b] != Maybe::NO) there = near[b];
      }
      here_.near[cell] = there;
      if (trusted_.count(cell) > 0) now[cell] = {{Kind::OBSTACLE}};
    }
    for (auto& [cell, states] : now) {
      if (look.occupied.count(cell) > 0) settle(cell, states, now, look);
    }
    states_ = std::move(now);
    past_.push_back(here_);
    known_ = look.occupied;
    known_.insert(look.free.begin(), look.free.end());
    before_last_ns_ = before_ns_.value_or(0);
    before_ns_ = look.stamp_ns;
  }

  std::map<Kind, std::uint64_t> counts;  // of what was shown and was sure
  std::uint64_t grew = 0;

 private:
  const std::set<Cell> trusted_;
  std::map<Cell, std::set<State>> states_;
  std::optional<StampNs> before_ns_;
  StampNs before_last_ns_ = 0;
  bool any_seam_ = false;
  struct Past {
    StampNs stamp_ns;
    std::map<Cell, Maybe> near;
  };
  std::deque<Past> past_;  // of each map: whether a body was within reach, or may have been
  Past here_;
  std::set<Cell> known_;  // of the last map
  std::map<Cell, Maybe> reached_now_;

  /// Of what the last map left out: free, unless a body was within reach then and in the time of the last map a gap
  /// ago.
  std::set<State> resolved(const std::set<State>& states, const Cell& cell) const {
    const Maybe ends[] = {past_.back().near.at(cell), past_.front().near.at(cell)};
    std::set<State> after;
    for (const State& state : states) {
      const bool is_free = state.kind == Kind::FREE;
      if (!is_free || ends[0] != Maybe::YES || ends[1] != Maybe::YES) after.insert(state);
      if (is_free && ends[0] != Maybe::NO && ends[1] != Maybe::NO) after.insert({Kind::UNKNOWN});
    }
    return after;
  }

  static bool agrees(bool is, Maybe said) { return said == Maybe::PERHAPS || is == (said == Maybe::YES); }

  State next(State state, bool occupied, bool free, const Look& look, unsigned near, unsigned owners, unsigned away,
             bool found) const {
    const bool alone = near == 0 && !any_seam_;
    if (free) {
      state.grew_ns = state.since_ns = -1;
      const bool is_alone = (near & ~away) == 0 && !any_seam_;
      const bool was_own = state.kind == Kind::OWN || state.kind == Kind::LEFT;
      if (is_alone || state.kind == Kind::FREE || was_own) return {Kind::FREE};
      if (state.kind == Kind::OBSTACLE) return {Kind::OBSTACLE};
      if (state.kind == Kind::DOUBT) return {look.tells_free ? Kind::FREE : Kind::DOUBT};
      return {look.tells_free ? Kind::UNKNOWN : Kind::FREE, 0, -1, -1, true};
    }
    if (!occupied) state.grew_ns = -1;
    if (!occupied && (state.kind == Kind::FREE || state.kind == Kind::UNKNOWN)) {
      const bool stays = state.kind == Kind::UNKNOWN && state.is_marked && ((near & ~away) != 0 || any_seam_);
      return {stays ? Kind::UNKNOWN : Kind::FREE, 0, -1, -1, stays};
    }
    switch (state.kind) {
      case Kind::UNKNOWN:
        return {near == 0 ? Kind::OBSTACLE : Kind::DOUBT};
      case Kind::FREE:
        owners &= ~away;
        if (owners != 0) return {Kind::OWN, owners, *before_ns_};
        return {alone ? Kind::OBSTACLE : Kind::DOUBT, 0, *before_ns_, *before_ns_};
      case Kind::LEFT:
        if (look.stamp_ns - state.left_ns > 500 * MS) return {Kind::DOUBT, 0, state.since_ns};
        [[fallthrough]];
      case Kind::OWN:
        if ((state.owners & owners) != 0) return {Kind::OWN, state.owners & owners, state.since_ns};
        if ((state.owners & near) == 0 && !any_seam_ && look.tells_free && !(found && state.is_seen))
          return {Kind::LEFT,
                  state.owners,
                  state.since_ns,
                  -1,
                  false,
                  found || state.is_seen,
                  state.kind == Kind::LEFT ? state.left_ns : look.stamp_ns};
        return {Kind::DOUBT, 0, state.since_ns};
      case Kind::OBSTACLE:
        return state;
      case Kind::DOUBT:
        if (alone && occupied && found) state.kind = Kind::OBSTACLE;
        return state;
    }
    return state;
  }

  /// Holds what the finder says against what may be, and keeps of that what agrees.
  void settle(const Cell& cell, std::set<State>& states, const std::map<Cell, std::set<State>>& now, const Look& look) {
    const auto said = look.said.find(cell);
    const Kind kind = said == look.said.end() ? Kind::OBSTACLE : said->second ? Kind::DOUBT : Kind::OWN;
    bool perhaps_grew = false, is_beside_doubt = false;
    for (int i = 0; i < 27; ++i) {
      const Cell beside{cell[0] + i % 3 - 1, cell[1] + i / 3 % 3 - 1, cell[2] + i / 9 - 1};
      if (beside == cell || look.occupied.count(beside) == 0) continue;
      is_beside_doubt = is_beside_doubt || (look.said.count(beside) > 0 && look.said.at(beside));
      const auto its = now.find(beside);
      if (its == now.end()) continue;
      const bool is_own = look.said.count(beside) > 0 && !look.said.at(beside);
      const Maybe reached = reached_now_.at(beside);
      const auto grows = [&](const State& state) {
        // One that appeared as own and is said to be in doubt grew, too.
        const bool turned = state.kind == Kind::OWN && state.since_ns == before_ns_ && !is_own;
        const StampNs since_ns = std::min(look.stamp_ns - 1000 * MS, before_last_ns_ - 1);
        return turned || (state.grew_ns > since_ns && state.grew_ns >= 0);
      };
      const auto perhapsGrows = [&](const State& state) {
        return grows(state) && (state.kind != Kind::OBSTACLE || reached != Maybe::YES);
      };
      perhaps_grew = perhaps_grew || std::any_of(its->second.begin(), its->second.end(), perhapsGrows);
    }
    std::set<State> left;
    for (State state : states) {
      const bool appeared = state.kind == Kind::OWN && state.since_ns == before_ns_;
      if ((state.kind == Kind::LEFT ? Kind::DOUBT : state.kind) == kind) left.insert(state);
      // Own, and beside one that grew: in doubt in this map. That it must be then own_worlds_test holds.
      if (state.kind == Kind::OWN && kind == Kind::DOUBT && is_beside_doubt) left.insert(state);
      if (!(appeared && perhaps_grew && kind == Kind::DOUBT)) continue;
      left.insert({Kind::DOUBT, 0, *before_ns_, *before_ns_});
      ++grew;
    }
    if (left.empty()) {
      ADD_FAILURE() << cell[0] << ' ' << cell[1] << ' ' << cell[2] << " is said to be " << static_cast<int>(kind)
                    << ", and may be " << static_cast<int>(states.begin()->kind) << " of " << states.size();
      return;
    }
    if (states.size() == 1) ++counts[kind];
    states = left;
  }
};

/// Random voxels near the body and elsewhere, among them whole blocks of 2^3 and 4^3 as one leaf.
std::set<Cell> randomCells(std::mt19937_64& random, const Positions& body, std::set<Cell> kept) {
  const auto any = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  for (auto it = kept.begin(); it != kept.end();) it = any(4) == 0 ? kept.erase(it) : std::next(it);
  const auto add = [&](const Cell& cell) {
    for (const int c : cell) {
      if (c < 0 || c >= SIDE) return;
    }
    kept.insert(cell);
  };
  for (int i = any(8); i > 0; --i) {
    const Vec3& p = body[static_cast<std::size_t>(any(static_cast<int>(body.size())))];
    Cell cell;
    for (int a = 0; a < 3; ++a)
      cell[static_cast<std::size_t>(a)] = static_cast<int>(std::floor(p[a] / VOXEL_M)) + any(5) - 2;
    add(cell);
  }
  for (int i = any(3); i > 0; --i) add({any(SIDE), any(SIDE), any(SIDE)});
  if (any(3) == 0) {
    const int size = any(2) == 0 ? 2 : 4, blocks = SIDE / size;
    const Cell corner{size * any(blocks), size * any(blocks), size * any(blocks)};
    for (int i = 0; i < size * size * size; ++i) {
      add({corner[0] + i % size, corner[1] + i / size % size, corner[2] + i / size / size});
    }
  }
  return kept;
}

/// As an octree has them: where all eight of a block are occupied they are one leaf, up to 4 voxels a side.
std::vector<OccupiedLeaf> pruned(const std::set<Cell>& cells) {
  std::vector<OccupiedLeaf> leaves;
  const std::function<int(const Cell&, int)> occupied = [&](const Cell& at, int size) {
    int count = 0;
    for (int i = 0; i < size * size * size; ++i) {
      count += static_cast<int>(cells.count({at[0] + i % size, at[1] + i / size % size, at[2] + i / size / size}));
    }
    return count;
  };
  const std::function<void(const Cell&, int)> add = [&](const Cell& at, int size) {
    const int count = occupied(at, size);
    if (count == size * size * size) return leaves.push_back(leafOf(at, static_cast<std::uint32_t>(size)));
    for (int k = 0; count > 0 && k < 8; ++k) {
      const int half = size / 2;
      add({at[0] + half * (k & 1), at[1] + half * (k >> 1 & 1), at[2] + half * (k >> 2)}, half);
    }
  };
  for (int i = 0; i < SIDE * SIDE * SIDE / 64; ++i) {
    constexpr int BLOCKS = SIDE / 4;
    add({4 * (i % BLOCKS), 4 * (i / BLOCKS % BLOCKS), 4 * (i / BLOCKS / BLOCKS)}, 4);
  }
  return leaves;
}

TEST(OwnVoxelsProperty, WhatIsOwnIsWhatTheRuleNames) {
  const int worlds = std::getenv("DEFORMABLE_CCD_LONG") ? 1000 : 12;
  std::map<Kind, std::uint64_t> counts;
  std::uint64_t grew = 0;
  for (int world = 0; world < worlds && !::testing::Test::HasFailure(); ++world) {
    SCOPED_TRACE("world " + std::to_string(world));
    std::mt19937_64 random(static_cast<std::uint64_t>(world) + 1);
    const auto real = [&](double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(random); };
    const auto chance = [&](int n) { return random() % static_cast<unsigned>(n) == 0; };
    OwnVoxelFinder finder;
    std::vector<Walker> bodies(chance(2) ? 1 : 2);
    for (Walker& body : bodies) {
      body.topology = share(Topology::fromTriangles(3, {{0, 1, 2}}));
      body.reach_m = chance(2) ? VOXEL_M : real(0.01, 0.25);
      for (int v = 0; v < 3; ++v) body.at.push_back({real(0.2, 0.6), real(0.2, 0.6), real(0.2, 0.6)});
    }
    const double lag_s = chance(2) ? 0 : real(0, 0.3);
    const bool tells_free = !chance(3);
    std::set<Cell> trusted, cells;
    if (chance(4)) trusted = randomCells(random, bodies[0].at, {});
    const auto beside = trusted.empty() ? nullptr : VoxelSurface::build(VOXEL_M, pruned(trusted));
    Model model(trusted);
    StampNs now_ns = 1000 * MS, map_ns = 0;
    Eigen::Isometry3d map_from_fixed = Eigen::Isometry3d::Identity();
    for (int event = 0; event < 16 && !::testing::Test::HasFailure(); ++event) {
      const bool gap = chance(10);
      now_ns += (gap ? 700 : 50 + static_cast<StampNs>(random() % 100)) * MS;
      for (Walker& body : bodies) {
        const double far_m = chance(3) ? 0.4 : 0.1;
        const Vec3 way(real(-far_m, far_m), real(-far_m, far_m), real(-far_m, far_m));
        const Vec3 before = body.at[0];
        for (Vec3& p : body.at) p += way + Vec3(real(-0.02, 0.02), real(-0.02, 0.02), real(-0.02, 0.02));
        if ((body.at[0] - Vec3::Constant(0.4)).norm() > 0.7) {  // it comes back
          for (Vec3& p : body.at) p -= way + 0.2 * (before - Vec3::Constant(0.4));
        }
        const StepStatus status = body.store.push({now_ns, body.topology, body.at});
        body.frames.push_back({now_ns, body.at, status == StepStatus::OK});
      }
      if (!chance(2)) continue;
      Model::Look look;
      look.tells_free = tells_free;
      look.lag_ns = std::llround(lag_s * 1e9);
      map_ns = look.stamp_ns = std::max(map_ns + 1, now_ns - static_cast<StampNs>(random() % 120) * MS);
      look.occupied = cells = randomCells(random, bodies[random() % bodies.size()].at, cells);
      if (chance(20)) {  // by half a voxel: the bodies' ways are given in the fixed frame
        look.is_seam = true;
        map_from_fixed.translation().x() += VOXEL_M / 2;
      }
      ObstacleMap map;
      map.surface = VoxelSurface::build(VOXEL_M, pruned(cells));
      map.stamp_ns = map_ns;
      map.map_from_fixed = map_from_fixed;
      if (tells_free) {
        std::vector<OccupiedLeaf> known = pruned(cells), found;
        for (int i = 0; i < SIDE * SIDE * SIDE; ++i) {
          const Cell cell{i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE};
          if (cells.count(cell) > 0 && chance(2)) look.found.insert(cell);
          if (cells.count(cell) > 0 || chance(10)) continue;
          look.free.insert(cell);
          known.push_back(leafOf(cell));
        }
        for (const Cell& cell : look.found) found.push_back(leafOf(cell));
        std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return codeOf(a) < codeOf(b); });
        map.known = KnownSpace::build(VOXEL_M, known, found);
      }
      std::vector<TrackedBody> tracked;
      for (std::size_t b = 0; b < bodies.size(); ++b) {
        tracked.push_back({static_cast<std::uint16_t>(b), "cloth", bodies[b].reach_m, &bodies[b].store});
      }
      const ObstacleMap reduced = finder.reduce(map, beside.get(), tracked, lag_s, false);
      for (const OwnVoxel& voxel : *reduced.own.voxels) {
        look.said[{voxel.key.x - 32768, voxel.key.y - 32768, voxel.key.z - 32768}] = voxel.doubted;
      }
      // The model asks in the map's frame.
      std::vector<Walker> in_map;
      for (const Walker& body : bodies) {
        Walker& moved = in_map.emplace_back();
        moved.topology = body.topology;
        moved.frames = body.frames;
        moved.reach_m = body.reach_m;
        for (Seen& frame : moved.frames) {
          for (Vec3& p : frame.positions) p = map_from_fixed * p;
        }
      }
      model.judge(look, in_map);
      std::size_t left = 0;
      for (const OccupiedLeaf& leaf : reduced.surface->leaves()) left += leaf.size * leaf.size * leaf.size;
      EXPECT_EQ(left, cells.size() - look.said.size() +
                          std::count_if(trusted.begin(), trusted.end(),
                                        [&](const Cell& cell) { return cells.count(cell) == 0; }));
      // However it was made: as from the beginning.
      const auto whole = VoxelSurface::build(VOXEL_M, reduced.surface->leaves());
      EXPECT_EQ(VoxelSurface::Impl::of(*reduced.surface).features, VoxelSurface::Impl::of(*whole).features);
    }
    for (const auto& [kind, count] : model.counts) counts[kind] += count;
    grew += model.grew;
  }
  for (const Kind kind : {Kind::OWN, Kind::OBSTACLE, Kind::DOUBT}) {
    EXPECT_GT(counts[kind], 3u * static_cast<unsigned>(worlds)) << static_cast<int>(kind);
  }
  EXPECT_GT(grew, static_cast<unsigned>(worlds) / 4);
}

}  // namespace
}  // namespace test
}  // namespace dccd
