#include "support/closed_loop.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <random>
#include <utility>
#include <vector>

#include "dccd/detect.h"

namespace dccd {
namespace test {
namespace {

constexpr std::size_t ROWS = 8, COLS = 6;
constexpr double SPACING_M = 0.035, HANGS_M = (ROWS - 1) * SPACING_M, VOXEL_M = 0.025, TICK_S = 1.0 / 600,
                 DRAG_PER_S = 5;
constexpr int TICKS_A_FRAME = 20, TICKS_A_CHECK = 5;

double uniform(std::mt19937_64& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// Point masses on rods, by position: the upper row is the gripper's.
class Cloth {
 public:
  Cloth(double x, double z) {
    for (std::size_t i = 0; i < ROWS * COLS; ++i) {
      const double y = (static_cast<double>(i % COLS) - 0.5 * (COLS - 1)) * SPACING_M;
      now_.emplace_back(x, y, z - static_cast<double>(i / COLS) * SPACING_M);
    }
    before_ = now_;
  }
  const Positions& positions() const { return now_; }
  void tick(double gripper_m, double gust_m_s2) {
    const Vec3 acceleration(gust_m_s2, 0, -9.81);
    for (std::size_t i = 0; i < now_.size(); ++i) {
      const Vec3 speed = (1 - DRAG_PER_S * TICK_S) * (now_[i] - before_[i]);
      before_[i] = now_[i];
      if (i < COLS) {
        now_[i].x() += gripper_m;
      } else {
        now_[i] += speed + acceleration * (TICK_S * TICK_S);
      }
    }
    static const std::vector<std::array<std::size_t, 2>> RODS = rods();
    for (int round = 0; round < 12; ++round) {
      for (const auto& [a, b] : RODS) pull(a, b);
    }
  }

 private:
  /// From row to row, and along each from point to point, the rod down from it before the one to the next. All of that
  /// holds for each point, but several rows are on their way at once, each two rods behind the one above: rods that
  /// stand side by side here have no point in common, so that a processor need not wait for one to begin the next.
  static std::vector<std::array<std::size_t, 2>> rods() {
    std::vector<std::array<std::size_t, 2>> rods;
    for (std::size_t turn = 0; turn < 2 * COLS + 2 * ROWS; ++turn) {
      for (std::size_t row = 0; row < ROWS && 2 * row <= turn; ++row) {
        const std::size_t k = turn - 2 * row, col = k / 2, i = row * COLS + col;
        if (col >= COLS) continue;
        if (k % 2 == 0 && row + 1 < ROWS) rods.push_back({i, i + COLS});
        if (k % 2 == 1 && col + 1 < COLS) rods.push_back({i, i + 1});
      }
    }
    return rods;
  }
  void pull(std::size_t a, std::size_t b) {
    const double share_a = a < COLS ? 0 : b < COLS ? 1 : 0.5, share_b = b < COLS ? 0 : a < COLS ? 1 : 0.5;
    const Vec3 along = now_[b] - now_[a];
    const double length_m = along.norm();
    const Vec3 off = along * ((length_m - SPACING_M) / length_m);
    now_[a] += share_a * off;
    now_[b] -= share_b * off;
  }
  Positions now_, before_;
};

/// What the arm wants by itself, as a share of full speed.
class Wish {
 public:
  Wish(std::uint64_t seed, ArmManner manner) : manner_(manner), random_(~seed) {}
  double at(double now_s) {
    if (manner_ == ArmManner::STEADY || now_s < until_s_) return share_;
    until_s_ = now_s + uniform(random_, 0.1, 1.5);
    const double kind = uniform(random_, 0, 1), before = std::exchange(share_, 1);
    if (kind < 0.6) share_ = kind < 0.25 ? 0 : uniform(random_, 0.002, 0.05);
    restarts_ += before < 1 && share_ == 1;
    return share_;
  }
  int restarts() const { return restarts_; }

 private:
  ArmManner manner_;
  std::mt19937_64 random_;  // its own: what else happens in a run is the same in every manner
  double share_ = 1, until_s_ = 0;
  int restarts_ = 0;
};

std::uint16_t keyOf(double x) { return static_cast<std::uint16_t>(std::lround(x / VOXEL_M) + 32768); }

void addBox(const Vec3& low, const Vec3& high, std::vector<OccupiedLeaf>& leaves) {
  for (std::uint16_t x = keyOf(low.x()); x < keyOf(high.x()); ++x) {
    for (std::uint16_t y = keyOf(low.y()); y < keyOf(high.y()); ++y) {
      for (std::uint16_t z = keyOf(low.z()); z < keyOf(high.z()); ++z) leaves.push_back({{x, y, z}, 1});
    }
  }
}

}  // namespace

double distanceToMap(const Outcome& outcome) {
  double least_m = std::numeric_limits<double>::infinity();
  for (const Clearance& pair : outcome.clearances) {
    if (pair.body[1] == OBSTACLE_BODY) least_m = std::min(least_m, pair.at_end.lower_m);
  }
  return std::isfinite(least_m) ? least_m : 0;
}

ClosedLoopRun runClosedLoop(std::uint64_t seed, ArmManner manner, const std::function<double(const Outcome&)>& scale) {
  using Loop = ClosedLoop;
  std::mt19937_64 random(seed);
  const double post_m = 0.025 * std::floor(uniform(random, 8, 20)), top_m = 0.025 * std::floor(uniform(random, 4, 16)),
               wall_m = 0.025 * std::floor(uniform(random, 40, 60)), clears_m = uniform(random, 0.03, 0.08),
               braking_m_s2 = Loop::BRAKING_M_S2 * uniform(random, 0.8, 1.2), gusts_m_s2 = uniform(random, 0, 0.3);
  std::vector<OccupiedLeaf> leaves;
  addBox({post_m, -0.2, 0}, {post_m + 0.1, 0.2, top_m}, leaves);
  addBox({wall_m, -0.2, 0}, {wall_m + 0.05, 0.2, top_m + 0.4}, leaves);

  Body body;
  body.name = "cloth";
  body.self_collision = false;
  body.topology = share(Topology::grid(ROWS, COLS));
  Step step;
  step.map.surface = VoxelSurface::build(VOXEL_M, std::move(leaves));
  Options options, truth;
  options.clearance.wanted = true;
  History history, truth_history;
  const auto answer = [&](const Positions& from, const Positions& to, const Options& how, History& from_history) {
    body.t0 = share(from);
    body.t1 = share(to);
    step.bodies = {body};
    return detect(step, how, from_history);
  };
  const auto stampOf = [](double at_s) { return static_cast<StampNs>(std::llround(at_s * 1e9)); };

  Cloth cloth(0, top_m + clears_m + HANGS_M);
  Positions frame = cloth.positions(), checked = frame, now = frame;  // the last answered, checked, and due one
  struct Command {
    double at_s, scale, stamp_s;
  };
  std::deque<Command> on_the_way;
  double gripper_m = 0, speed_m_s = 0, wanted = 0, gust_m_s2 = 0, answered_s = 0, near_m = 0, end_s = Loop::LONGEST_S;
  double followed_s = 0;  // stamp of the frame that `wanted` is of
  Wish wish(seed, manner);
  const double picks_up_m_s2 = manner == ArmManner::STEADY ? Loop::PICKS_UP_M_S2 : Loop::JERKS_M_S2;
  ClosedLoopRun run;
  int tick = 0;
  for (double now_s = 0; now_s < end_s && !run.contact; now_s = ++tick * TICK_S) {
    while (!on_the_way.empty() && on_the_way.front().at_s <= now_s) {
      wanted = on_the_way.front().scale;
      followed_s = on_the_way.front().stamp_s;
      on_the_way.pop_front();
    }
    // The arm knows nothing of the wall, and follows no scale of a frame that is older than the law reckons with.
    const bool late = now_s - followed_s > Loop::REACTION_S;
    const double target_m_s = (late ? 0 : std::min(wanted, wish.at(now_s))) * Loop::FULL_SPEED_M_S;
    if (!late && wanted > 0) run.oldest_s = std::max(run.oldest_s, now_s - followed_s);
    speed_m_s = std::clamp(target_m_s, speed_m_s - braking_m_s2 * TICK_S, speed_m_s + picks_up_m_s2 * TICK_S);
    gripper_m += speed_m_s * TICK_S;
    gust_m_s2 = std::clamp(gust_m_s2 + uniform(random, -0.02, 0.02) * gusts_m_s2, -gusts_m_s2, gusts_m_s2);
    cloth.tick(speed_m_s * TICK_S, gust_m_s2);
    if (!run.arrived && gripper_m >= wall_m - Loop::NEAR_WALL_M) {
      run.arrived = true;
      run.mean_speed_m_s = gripper_m / now_s;
      end_s = now_s + Loop::ON_S;
    }
    if (tick % TICKS_A_CHECK == 0) {
      // Far from all that it could reach until the next look there is nothing to see.
      if (near_m < 0.2) {
        const Outcome true_one = answer(checked, cloth.positions(), truth, truth_history);
        run.contact = true_one.total_contacts > 0 || true_one.start_state != StartState::CLEAR;
      } else {
        truth_history.clear();
      }
      checked = cloth.positions();
    }
    if (tick % TICKS_A_FRAME != 0) continue;
    for (std::size_t v = 0; v < now.size(); ++v) {
      run.fastest_m_s = std::max(run.fastest_m_s, (cloth.positions()[v] - now[v]).norm() / Loop::FRAME_S);
    }
    now = cloth.positions();
    if (uniform(random, 0, 1) < Loop::LOST_SHARE) continue;
    step.start_ns = stampOf(answered_s);
    step.stamp_ns = stampOf(now_s);
    const Outcome seen = answer(frame, cloth.positions(), options, history);
    frame = cloth.positions();
    near_m = distanceToMap(seen);
    answered_s = now_s;
    // In their order: a later command overtakes no earlier one.
    const double at_s = now_s + uniform(random, 0.03, Loop::MOST_LATENCY_S);
    on_the_way.push_back({on_the_way.empty() ? at_s : std::max(at_s, on_the_way.back().at_s), scale(seen), now_s});
  }
  run.restarts = wish.restarts();
  if (!run.arrived) run.mean_speed_m_s = gripper_m / (tick * TICK_S);
  return run;
}

}  // namespace test
}  // namespace dccd
