// What ~safe_until promises, against adversaries: motions within the bounds that go for contact as fast as they may,
// whose contacts exact detection finds. And what ~speed_scale is for: an arm that carries a cloth past obstacles.
// DEFORMABLE_CCD_LONG=1 runs 100,000 motions, and 1,000 arms.
#include "dccd/monitor_extras.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>

#include "support/closed_loop.h"
#include "support/detector.h"
#include "support/query_property.h"

namespace dccd {
namespace test {
namespace {

constexpr double VOXEL_M = 0.1;

enum class Partners : std::uint8_t { BODIES, ITSELF, MAP, COUNT };
enum class Plan : std::uint8_t {
  STRAIGHT,  ///< all of both along the line of the nearest points
  PURSUIT,   ///< the same, with the nearest points of each moment
  RUFFLED,   ///< the nearest features' vertices pursue, the others go anywhere
  ANY,       ///< each vertex goes for any vertex of the other
  COUNT
};

/// Two parts of at most three triangles each, of one or of two bodies, or one part beside a voxel or two.
class Adversary {
 public:
  Adversary(std::uint64_t seed, Partners partners, Plan plan) : random_(seed), partners_(partners), plan_(plan) {
    // Of one body the two parts are a triangle each: what is of one part goes together.
    const bool single = partners == Partners::ITSELF;
    const std::size_t first = single ? 1 : triangles(), second = partners == Partners::MAP ? 0
                                                                 : single                  ? 1
                                                                                           : triangles();
    place(first, Vec3::Zero());
    split_ = positions_.size();
    const Vec3 way = direction();
    place(second, way * uniform(0.3, 1.5));
    if (partners == Partners::MAP) {
      const auto key = [](double x) { return static_cast<std::uint16_t>(32768 + std::floor(x / VOXEL_M)); };
      const Vec3 at = way * uniform(0.4, 1.5);
      step_.map.surface =
          VoxelSurface::build(VOXEL_M, {{{key(at.x()), key(at.y()), key(at.z())}, 1},
                                        {{key(at.x()), key(at.y()), static_cast<std::uint16_t>(key(at.z()) + 1)}, 1}});
    }
    speeds_ = {uniform(0.1, 2), uniform(0, 1) < 0.2 ? 0 : uniform(0.1, 2)};
    if (partners == Partners::ITSELF) speeds_[1] = speeds_[0];
    options_.clearance.wanted = true;
    options_.clearance.tolerance_m = 1e-7;
    options_.clearance.max_m = 10;
    options_.clearance.self_m = 20;
    setBodies(positions_, positions_);
  }

  std::vector<SpeedBound> bounds() const { return {{speeds_[0]}, {speeds_[1]}}; }
  Outcome look() { return detect(step_, options_, history_); }

  /// The outcome of a piece of the motion, from where it is, as long as the bounds allow.
  Outcome go(const Outcome& seen, double seconds) {
    Positions next = positions_;
    for (std::size_t v = 0; v < next.size(); ++v) next[v] += (1 - 1e-9) * speedOf(v) * seconds * aim(seen, v);
    setBodies(positions_, next);
    positions_ = next;
    return detect(step_, options_, history_);
  }

 private:
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  std::size_t triangles() { return 1 + random_() % 3; }
  Vec3 direction() {
    Vec3 some;
    do {
      some = Vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    } while (some.norm() > 1 || some.norm() < 0.1);
    return some.normalized();
  }
  void place(std::size_t count, const Vec3& about) {
    for (std::size_t t = 0; t < count; ++t) {
      const auto first = static_cast<Index>(positions_.size());
      faces_.push_back({first, first + 1, first + 2});
      for (int corner = 0; corner < 3; ++corner) positions_.push_back(about + 0.2 * direction());
    }
  }
  bool isFirst(std::size_t vertex) const { return vertex < split_; }
  double speedOf(std::size_t vertex) const { return speeds_[isFirst(vertex) ? 0 : 1]; }

  void setBodies(const Positions& from, const Positions& to) {
    step_.bodies.clear();
    const auto add = [&](std::size_t begin, std::size_t end) {
      Body body;
      body.name = "part " + std::to_string(begin);
      body.self_collision = partners_ == Partners::ITSELF;
      std::vector<Face> faces;
      for (std::size_t f = begin / 3; f < end / 3; ++f) {
        const auto shift = static_cast<Index>(begin);
        faces.push_back({faces_[f][0] - shift, faces_[f][1] - shift, faces_[f][2] - shift});
      }
      body.topology = share(Topology::fromTriangles(end - begin, faces));
      body.t0 = share(Positions(from.begin() + static_cast<std::ptrdiff_t>(begin),
                                from.begin() + static_cast<std::ptrdiff_t>(end)));
      body.t1 = share(
          Positions(to.begin() + static_cast<std::ptrdiff_t>(begin), to.begin() + static_cast<std::ptrdiff_t>(end)));
      step_.bodies.push_back(body);
    };
    if (partners_ == Partners::BODIES) {
      add(0, split_);
      add(split_, positions_.size());
    } else {
      add(0, positions_.size());
    }
  }

  /// Where a vertex goes, of length 1.
  Vec3 aim(const Outcome& seen, std::size_t vertex) {
    if (plan_ == Plan::ANY) {
      if (partners_ == Partners::MAP)
        return (seen.clearances[nearest(seen)].at_end.point[1] - positions_[vertex]).normalized();
      const std::size_t others = isFirst(vertex) ? positions_.size() - split_ : split_;
      const std::size_t other = (isFirst(vertex) ? split_ : 0) + random_() % others;
      return (positions_[other] - positions_[vertex]).normalized();
    }
    if (plan_ == Plan::STRAIGHT && straight_) return isFirst(vertex) ? *straight_ : Vec3(-*straight_);
    const ClearanceDistance& distance = seen.clearances[nearest(seen)].at_end;
    // From a little within the one feature to a little within the other: corners that go for corners miss by rounding.
    std::array<Vec3, 2> within = distance.point;
    bool flipped = false, is_near = false;
    for (std::size_t side = 0; side < 2; ++side) {
      Vec3 sum = Vec3::Zero();
      int count = 0;
      for (const Index v : distance.vertex[side]) {
        if (v == NO_INDEX) continue;
        const std::size_t global = partners_ == Partners::BODIES && side == 1 ? v + split_ : v;
        sum += positions_[global];
        ++count;
        is_near = is_near || global == vertex;
        flipped = flipped || (side == 0 && !isFirst(global));
      }
      const auto middle = [&](std::uint16_t key) { return (key - 32768 + 0.5 * distance.voxel_size) * VOXEL_M; };
      const VoxelKey& key = distance.voxel;
      const Vec3 centre = count > 0 ? Vec3(sum / count) : Vec3(middle(key.x), middle(key.y), middle(key.z));
      within[side] += 1e-3 * std::min(1.0, 5 * distance.lower_m) * (centre - within[side]);
    }
    Vec3 along = (within[1] - within[0]).normalized();
    if (flipped) along = -along;
    if (plan_ == Plan::STRAIGHT) straight_ = along;
    if (plan_ == Plan::RUFFLED && !is_near) return direction();
    return isFirst(vertex) ? along : Vec3(-along);
  }

  /// The pair of the two parts.
  static std::size_t nearest(const Outcome& seen) {
    std::size_t best = 0;
    for (std::size_t p = 0; p < seen.clearances.size(); ++p) {
      if (seen.clearances[p].at_end.upper_m < seen.clearances[best].at_end.upper_m) best = p;
    }
    return best;
  }

  std::mt19937_64 random_;
  Partners partners_;
  Plan plan_;
  Positions positions_;
  std::vector<Face> faces_;
  std::size_t split_ = 0;
  std::array<double, 2> speeds_{};
  std::optional<Vec3> straight_;
  Step step_;
  Options options_;
  History history_;
};

TEST(AdversaryProperty, NoMotionWithinTheBoundsTouchesBeforeTheCertificate) {
  const std::uint64_t motions = longRun() ? 100000 : 2000;
  std::size_t promised = 0, touched = 0, half = 0, straight = 0;
  for (std::uint64_t seed = 0; seed < motions; ++seed) {
    const auto partners = static_cast<Partners>(seed % static_cast<std::uint64_t>(Partners::COUNT));
    const auto plan = static_cast<Plan>(seed / 3 % static_cast<std::uint64_t>(Plan::COUNT));
    Adversary adversary(seed, partners, plan);
    Outcome seen = adversary.look();
    if (seen.start_state != StartState::CLEAR || seen.total_contacts > 0) {
      EXPECT_FALSE(safeUntil(seen, adversary.bounds()).isPromise()) << seed;
      continue;
    }
    const SafeUntil promise = safeUntil(seen, adversary.bounds());
    ASSERT_TRUE(promise.isPromise()) << seed << ": " << promise.reason;
    ++promised;
    const double piece_s = promise.seconds() / 6;
    for (int piece = 0; piece < 18; ++piece) {
      seen = adversary.go(seen, piece_s);
      double toc = 2;
      for (const Contact& contact : seen.contacts) toc = std::min(toc, contact.toc_upper);
      if (toc > 1) continue;
      const double touches_s = (piece + toc) * piece_s;
      ASSERT_GE(touches_s, promise.seconds() * (1 - 1e-12)) << "seed " << seed << ", piece " << piece;
      ++touched;
      half += promise.seconds() >= 0.5 * touches_s;
      if (plan == Plan::STRAIGHT && promise.seconds() < MOST_PROMISED_S) {
        ++straight;
        EXPECT_GE(promise.seconds(), 0.99 * touches_s)
            << "straight on, as fast as the bounds allow: seed " << seed << ", " << promise.distance_m << " m";
      }
      break;
    }
  }
  EXPECT_GT(promised, motions / 2);
  EXPECT_GT(touched, promised / 2) << "they do go for contact";
  EXPECT_GE(2 * half, touched);
  EXPECT_GT(straight, motions / 8);
  RecordProperty("promised", static_cast<int>(promised));
  RecordProperty("touched", static_cast<int>(touched));
  RecordProperty("at least half of the true time", static_cast<int>(half));
}

constexpr SpeedLaw LAW{ClosedLoop::REACTION_S, ClosedLoop::FULL_SPEED_M_S / (0.8 * ClosedLoop::BRAKING_M_S2), 0.025};

TEST(ClosedLoopProperty, AnArmThatSlowsDownTouchesNothingAndIsFasterThanAThreshold) {
  const std::uint64_t seeds = longRun() ? 1000 : 10;
  double ours_m_s = 0, threshold_m_s = 0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const ClosedLoopRun ours = runClosedLoop(seed, ArmManner::STEADY, [&](const Outcome& outcome) {
      return speedScale(outcome, {{ClosedLoop::CLOTH_SPEED_M_S}}, LAW).scale;
    });
    EXPECT_FALSE(ours.contact) << seed;
    EXPECT_TRUE(ours.arrived) << seed;
    EXPECT_LE(ours.fastest_m_s, ClosedLoop::CLOTH_SPEED_M_S) << seed << ": the law rests on that";
    ours_m_s += ours.mean_speed_m_s;
    // Thresholds with which the cloth touches nothing, either; nearer or faster ones touch (doc/slow_down.md).
    const ClosedLoopRun threshold = runClosedLoop(seed, ArmManner::STEADY, [](const Outcome& outcome) {
      const double d = distanceToMap(outcome);
      return d > 0.2 ? 1 : d > 0.03 ? 0.1 : 0;
    });
    EXPECT_FALSE(threshold.contact) << seed;
    threshold_m_s += threshold.mean_speed_m_s;
  }
  EXPECT_GT(ours_m_s, threshold_m_s);
}

// Before the wall it creeps, rests and sets off again. What it did of late allows nothing: the scale is a share of its
// full speed.
TEST(ClosedLoopProperty, AnArmThatCreepsRestsAndSetsOffAgainTouchesNothing) {
  const std::uint64_t seeds = longRun() ? 1000 : 20;
  int restarts = 0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const ClosedLoopRun run = runClosedLoop(seed, ArmManner::RESTARTING, [&](const Outcome& outcome) {
      return speedScale(outcome, {{ClosedLoop::CLOTH_SPEED_M_S}}, LAW).scale;
    });
    EXPECT_FALSE(run.contact) << seed;
    EXPECT_TRUE(run.arrived) << seed;
    EXPECT_LE(run.fastest_m_s, ClosedLoop::CLOTH_SPEED_M_S) << seed << ": the law rests on that";
    restarts += run.restarts;
  }
  EXPECT_GT(restarts, 2 * static_cast<int>(seeds));
}

TEST(ClosedLoopProperty, AnArmThatDoesNotSlowDownTouches) {
  int contacts = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    contacts += runClosedLoop(seed, ArmManner::STEADY, [](const Outcome&) { return 1; }).contact;
  }
  EXPECT_GT(contacts, 0) << "or the loop would judge nothing";
}

}  // namespace
}  // namespace test
}  // namespace dccd
