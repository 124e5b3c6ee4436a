// What ~safe_until and ~speed_scale promise along an intended path, against adversaries: bodies within tubes and bounds
// that go for contact, at any pace, judged by distances of triangles that share nothing with the engine, taken densely.
// DEFORMABLE_CCD_LONG=1 runs 100,000 motions.
#include "dccd/intended.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "../../examples/guard_twist.h"
#include "dccd/approach_limits.h"
#include "support/query_property.h"

namespace dccd {
namespace test {
namespace {

using Triangle = std::array<Vec3, 3>;

/// From a point to a segment, to a triangle, and between two segments and triangles: each by itself, plainly.
double distanceToSegment(const Vec3& p, const Vec3& a, const Vec3& b) {
  const double u = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return (p - (a + u * (b - a))).norm();
}

double distanceToTriangle(const Vec3& p, const Triangle& t) {
  const Vec3 normal = (t[1] - t[0]).cross(t[2] - t[0]);
  bool is_over = normal.norm() > 0;
  for (std::size_t i = 0; i < 3; ++i) is_over = is_over && normal.dot((t[(i + 1) % 3] - t[i]).cross(p - t[i])) >= 0;
  if (is_over) return std::abs(normal.normalized().dot(p - t[0]));
  double least = SpeedBound::NONE;
  for (std::size_t i = 0; i < 3; ++i) least = std::min(least, distanceToSegment(p, t[i], t[(i + 1) % 3]));
  return least;
}

double distanceOfSegments(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  double least = std::min(
      {distanceToSegment(a, c, d), distanceToSegment(b, c, d), distanceToSegment(c, a, b), distanceToSegment(d, a, b)});
  const Vec3 u = b - a, v = d - c, w = a - c;
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), det = uu * vv - uv * uv;
  if (det < 1e-12 * uu * vv) return least;
  const double s = (uv * v.dot(w) - vv * u.dot(w)) / det, t = (uu * v.dot(w) - uv * u.dot(w)) / det;
  if (s >= 0 && s <= 1 && t >= 0 && t <= 1) least = std::min(least, (w + s * u - t * v).norm());
  return least;
}

bool pierces(const Vec3& a, const Vec3& b, const Triangle& t) {
  const Vec3 normal = (t[1] - t[0]).cross(t[2] - t[0]);
  const double from = normal.dot(a - t[0]), to = normal.dot(b - t[0]);
  if (from * to > 0 || from == to) return false;
  const Vec3 at = a + from / (from - to) * (b - a);
  for (std::size_t i = 0; i < 3; ++i)
    if (normal.dot((t[(i + 1) % 3] - t[i]).cross(at - t[i])) < 0) return false;
  return true;
}

double distanceOf(const Triangle& s, const Triangle& t) {
  double least = SpeedBound::NONE;
  for (std::size_t i = 0; i < 3; ++i) {
    least = std::min({least, distanceToTriangle(s[i], t), distanceToTriangle(t[i], s)});
    if (pierces(s[i], s[(i + 1) % 3], t) || pierces(t[i], t[(i + 1) % 3], s)) return 0;
    for (std::size_t j = 0; j < 3; ++j)
      least = std::min(least, distanceOfSegments(s[i], s[(i + 1) % 3], t[j], t[(j + 1) % 3]));
  }
  return least;
}

/// An arm of one to three triangles on a path of its own, and a cloth of as many, of which every vertex goes by itself.
/// Half of the arms carry a towel, as large, whose vertices leave them.
class Chase {
 public:
  explicit Chase(std::uint64_t seed) : random_(seed) {
    arm_ = some(Vec3::Zero());
    const Vec3 away = direction();
    cloth_ = some(away * uniform(0.4, 1.2));
    cloth_speed_ = uniform(0, 1) < 0.3 ? 0 : uniform(0.05, 1);
    path_.bodies = {{0, {}}};
    path_.deviation_m = uniform(0, 1) < 0.3 ? 0 : uniform(0, 0.05);
    path_.deviation_rate_m_s = uniform(0, 1) < 0.3 ? 0 : uniform(0, 0.1);
    // Towards the cloth, past it or away, and a turn about an axis through the arm.
    const double kind = uniform(0, 1);
    way_ = kind < 0.5 ? Vec3(away * uniform(0.1, 1)) : Vec3(direction() * uniform(0.1, 1));
    turn_ = uniform(0, 1) < 0.3 ? Vec3(Vec3::Zero()) : Vec3(direction() * uniform(0.1, 2));
    const double second = turn_.squaredNorm() * 0.25;
    addPieces([&](double t) { return std::vector<Eigen::Isometry3d>{pose(t)}; }, horizon_s, second, 0.25, 1e-3, 40,
              path_);
    step_.bodies = {bodyOf("arm", arm_), bodyOf("cloth", cloth_)};
    step_.stamp_ns = 1;
    step_.bodies[0].rigid = true;
    if (seed % 2 == 0) return;
    const Vec3 beside = away.cross(direction()).normalized();
    towel_ = some((beside - 0.3 * away).normalized() * uniform(0.45, 0.7));
    leaves_m_s_ = uniform(0.02, 0.5);
    step_.bodies.push_back(bodyOf("towel", towel_));
    path_.bodies.push_back({2, path_.bodies[0].pose, 0, leaves_m_s_});
    path_.bend_m.assign(path_.bend_m.size(), 5 * path_.bend_m[0]);  // it reaches further from the arm's origin
  }

  /// What is promised.
  AlongPath ask(const std::optional<SpeedLaw>& law) {
    PathSearch search;
    return search.run(outcome(), options(), bounds(), law, path_);
  }
  ApproachLimits limits(double max_m, double horizon_s) {
    ApproachSearch search;
    return search.run(outcome(), options(), bounds(), max_m, horizon_s);
  }

  /// The least distance until then, of bodies that pass the path as `place` says: of each time its time on the path.
  double leastUntil(double until_s, const std::function<double(double)>& place) {
    return leastOf(
        until_s, [&](double t) { return pose(std::min(place(t), horizon_s)); }, path_.deviation_m,
        path_.deviation_rate_m_s);
  }
  double leastOf(double until_s, const std::function<Eigen::Isometry3d(double)>& poseThen, double tube_m,
                 double tube_m_s) {
    constexpr int LOOKS = 48;
    Positions cloth = cloth_, left(towel_.size(), Vec3::Zero());
    double least = distanceNow(arm_, cloth);
    for (int i = 1; i <= LOOKS; ++i) {
      const double t = until_s * i / LOOKS;
      Positions arm = arm_;
      for (Vec3& p : arm) p = poseThen(t) * p;
      // Both go for the nearest of each other: the cloth vertex by vertex, the arm as far as its tube allows.
      const auto [from, to] = nearest(arm, cloth);
      const Vec3 along = (to - from).normalized();
      for (Vec3& p : cloth) {
        const Vec3 aim = i % 7 == 0 ? direction() : Vec3(-along);
        p += aim * (cloth_speed_ * until_s / LOOKS);
      }
      const double tube = (tube_m + tube_m_s * t) * (1 - 1e-9);
      for (Vec3& p : arm) p += along * tube;
      least = std::min(least, distanceNow(arm, cloth));
      if (towel_.empty()) continue;
      Positions towel = towel_;
      for (std::size_t v = 0; v < towel.size(); ++v) towel[v] = poseThen(t) * towel[v] + along * tube + left[v];
      // It goes with the arm, tube included, and leaves it for what is nearer, the arm or the cloth.
      const auto [own, arms] = nearest(towel, arm);
      const auto [end, cloths] = nearest(towel, cloth);
      const Vec3 aim = (arms - own).norm() < (cloths - end).norm() ? Vec3(arms - own) : Vec3(cloths - end);
      for (std::size_t v = 0; v < towel.size(); ++v) {
        const Vec3 goes = aim.normalized() * (leaves_m_s_ * until_s / LOOKS);
        left[v] += goes;
        towel[v] += goes;
      }
      least = std::min({least, distanceNow(towel, cloth), distanceNow(towel, arm)});
    }
    return least;
  }

  /// When the first two can touch, however they use tubes and bounds: best where all of one goes straight for the
  /// other. By looks, so no sooner than the truth.
  double truth() const {
    const auto first = [](const std::function<double(double)>& distance, double tube_m, double rate_m_s) {
      constexpr int LOOKS = 100;
      double before = 0, least = SpeedBound::NONE;  // of what the path has passed by then
      const auto touches = [&](double t) { return std::min(least, distance(t)) <= tube_m + rate_m_s * t; };
      for (int i = 0; i <= LOOKS; ++i) {
        double t = horizon_s * i / LOOKS;
        if (!touches(t)) {
          least = std::min(least, distance(t));
          before = t;
          continue;
        }
        for (int halving = 0; halving < 12; ++halving) {
          const double middle = (before + t) / 2;
          (touches(middle) ? t : before) = middle;
        }
        return t;
      }
      return SpeedBound::NONE;
    };
    const auto placed = [&](Positions all, double t) {
      for (Vec3& p : all) p = pose(t) * p;
      return all;
    };
    const double tube = path_.deviation_m, rate = path_.deviation_rate_m_s + cloth_speed_;
    const double arms = first([&](double t) { return distanceNow(placed(arm_, t), cloth_); }, tube, rate);
    if (towel_.empty()) return arms;
    const double towels =
        first([&](double t) { return distanceNow(placed(towel_, t), cloth_); }, tube, rate + leaves_m_s_);
    return std::min({arms, towels, distanceNow(towel_, arm_) / leaves_m_s_});
  }

  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  double startsApart() const { return distanceNow(arm_, cloth_); }
  bool carries() const { return !towel_.empty(); }
  /// For the cloth, and turning.
  guard::Twist wanted() {
    const auto [from, to] = nearest(arm_, cloth_);
    guard::Twist twist;
    twist << ((to - from).normalized() + uniform(0, 1) * direction()) * uniform(0, 4), direction() * uniform(0, 4);
    return twist;
  }
  void drop() { towel_.clear(); }

  static constexpr double horizon_s = 1;

 private:
  static Options options() {
    Options options;
    options.clearance.wanted = true;
    options.clearance.max_m = 10;
    return options;
  }
  std::vector<SpeedBound> bounds() const {
    return {{SpeedBound::NONE}, {cloth_speed_, false}, {SpeedBound::NONE, false, 0, leaves_m_s_}};
  }
  Outcome outcome() const {
    History history;
    return detect(step_, options(), history);
  }
  Vec3 direction() {
    Vec3 some;
    do {
      some = Vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    } while (some.norm() > 1 || some.norm() < 0.1);
    return some.normalized();
  }
  Positions some(const Vec3& about) {
    Positions all;
    for (std::size_t i = 0; i < 3 * (1 + random_() % 3); ++i) all.push_back(about + 0.2 * direction());
    all.resize(all.size() / 3 * 3);
    return all;
  }
  Eigen::Isometry3d pose(double t) const {
    Eigen::Isometry3d at = Eigen::Isometry3d::Identity();
    at.translation() = way_ * t;
    if (turn_.norm() > 0) at.linear() = Eigen::AngleAxisd(turn_.norm() * t, turn_.normalized()).toRotationMatrix();
    return at;
  }
  static Body bodyOf(const std::string& name, const Positions& positions) {
    Body body;
    body.name = name;
    body.self_collision = false;
    std::vector<Face> faces;
    for (Index f = 0; f + 2 < positions.size(); f += 3) faces.push_back({f, f + 1, f + 2});
    body.topology = share(Topology::fromTriangles(positions.size(), faces));
    body.t0 = body.t1 = share(positions);
    return body;
  }
  static double distanceNow(const Positions& a, const Positions& b) {
    double least = SpeedBound::NONE;
    for (std::size_t i = 0; i < a.size(); i += 3)
      for (std::size_t j = 0; j < b.size(); j += 3)
        least = std::min(least, distanceOf({a[i], a[i + 1], a[i + 2]}, {b[j], b[j + 1], b[j + 2]}));
    return least;
  }
  /// Two vertices.
  static std::array<Vec3, 2> nearest(const Positions& a, const Positions& b) {
    std::array<Vec3, 2> best{a[0], b[0]};
    for (const Vec3& p : a)
      for (const Vec3& q : b)
        if ((p - q).norm() < (best[0] - best[1]).norm()) best = {p, q};
    return best;
  }

  std::mt19937_64 random_;
  Positions arm_, cloth_, towel_;
  double cloth_speed_ = 0, leaves_m_s_ = 0;
  Vec3 way_, turn_;
  IntendedPath path_;
  Step step_;
};

std::uint64_t motions() { return longRun() ? 100000 : 1500; }

TEST(PathAdversary, NothingTouchesBeforeItIsSaidTo) {
  std::size_t promised = 0, near = 0, carried = 0;
  for (std::uint64_t seed = 0; seed < motions(); ++seed) {
    Chase chase(seed);
    const AlongPath along = chase.ask(std::nullopt);
    ASSERT_EQ(along.unused, "") << seed;
    if (!along.rests_on_path) continue;
    ++promised;
    carried += chase.carries();
    const double until_s = along.until.seconds(), stops_s = chase.uniform(0, 1), pace = chase.uniform(0, 1);
    double least = SpeedBound::NONE;
    least = std::min(least, chase.leastUntil(until_s, [](double t) { return t; }));
    least = std::min(least, chase.leastUntil(until_s, [&](double t) { return pace * t; }));
    least = std::min(least, chase.leastUntil(until_s, [&](double t) { return std::min(t, stops_s); }));
    ASSERT_GT(least, 0) << "seed " << seed << ", promised " << until_s << " s";
    near += least < 0.3 * chase.startsApart();
  }
  EXPECT_GT(promised, motions() / 2);
  EXPECT_GT(near, promised / 10) << "they do come near";
  EXPECT_GT(carried, promised / 4);
}

// A body goes by a twist that is wanted towards the cloth, or turns, changed least so that it keeps to all half-spaces.
TEST(ApproachAdversary, ATwistThatKeepsToAllHalfSpacesTouchesNothingWithinTheHorizon) {
  std::size_t changed = 0, near = 0;
  const std::uint64_t twists = longRun() ? 100000 : 10000;
  for (std::uint64_t seed = 0; seed < twists; ++seed) {
    Chase chase(seed);
    chase.drop();
    const double horizon_s = chase.uniform(0.05, 0.5);
    const ApproachLimits limits = chase.limits(chase.uniform(0.2, 5), horizon_s);
    if (!limits.unknown.empty()) continue;
    ASSERT_EQ(limits.bodies, std::vector<std::uint16_t>{0}) << seed;
    std::vector<guard::Row> rows;
    for (const ApproachLimit& limit : limits.of) {
      for (const Vec3& corner : limit.corner)
        rows.push_back(guard::rowOf(corner, limit.normal, limit.speed_m_s, horizon_s, 0, Vec3::Zero(), {}));
    }
    const guard::Twist wanted = chase.wanted();
    bool is_found = false;
    guard::Twist twist = guard::nearest(rows, wanted, is_found);
    const double fastest = twist.head<3>().norm() + 0.2 * twist.tail<3>().norm();
    if (fastest > limits.most_speed_m_s) twist *= limits.most_speed_m_s / fastest;
    if (!is_found || !guard::obeys(rows, twist)) continue;
    changed += twist != wanted;
    const Vec3 turn = twist.tail<3>();
    const double least = chase.leastOf(
        horizon_s,
        [&](double t) {
          Eigen::Isometry3d at = Eigen::Isometry3d::Identity();
          at.translation() = twist.head<3>() * t;
          if (turn.norm() > 0) at.linear() = Eigen::AngleAxisd(turn.norm() * t, turn.normalized()).toRotationMatrix();
          return at;
        },
        0, 0);
    ASSERT_GT(least, 0) << "seed " << seed;
    near += least < 0.3 * chase.startsApart();
  }
  EXPECT_GT(changed, twists / 10);
  EXPECT_GT(near, twists / 20);
}

// The arm obeys: it goes on at the scale for the reaction time, and is then slower evenly until it stands. The cloth
// does not slow down.
TEST(PathAdversary, AnArmThatObeysStandsBeforeItTouches) {
  std::size_t slowed = 0, full = 0;
  for (std::uint64_t seed = 0; seed < motions(); ++seed) {
    Chase chase(seed);
    const SpeedLaw law{chase.uniform(0.02, 0.2), chase.uniform(0, 0.5), chase.uniform(0, 0.02)};
    const AlongPath along = chase.ask(law);
    const double s = along.scale.scale;
    if (s == 0 || along.contact != PathContact::FREE) continue;
    ++(s < 1 ? slowed : full);
    const double stands_s = law.reaction_time_s + s * law.stopping_time_s;
    const double least = chase.leastUntil(stands_s, [&](double t) {
      const double brakes_s = std::max(0.0, t - law.reaction_time_s);
      return s * t - (law.stopping_time_s > 0 ? brakes_s * brakes_s / law.stopping_time_s / 2 : 0);
    });
    ASSERT_GT(least, 0) << "seed " << seed << ", scale " << s;
  }
  EXPECT_GT(slowed, motions() / 20);
  EXPECT_GT(full, motions() / 20);
}

// Of those that can touch on the path at all.
TEST(PathAdversary, RandomPathsGetMostOfTheTime) {
  std::vector<double> shares;
  const std::uint64_t paths = longRun() ? 100000 : 2000;
  for (std::uint64_t seed = 0; seed < paths; ++seed) {
    Chase chase(seed);
    const double truth_s = chase.truth();
    if (!(truth_s <= Chase::horizon_s)) continue;
    const double until_s = chase.ask(std::nullopt).until.seconds();
    ASSERT_LE(until_s, truth_s * (1 + 1e-6)) << seed;
    shares.push_back(truth_s > 0 ? until_s / truth_s : 1);
  }
  ASSERT_GT(shares.size(), paths / 3);
  std::sort(shares.begin(), shares.end());
  const auto at = [&](double share) { return shares[static_cast<std::size_t>(share * (shares.size() - 1.0))]; };
  std::cout << shares.size() << " of " << paths << " paths: median " << at(0.5) << ", tenth " << at(0.1) << ", least "
            << at(0) << " of the true time\n";
  EXPECT_GE(at(0.5), 0.8);
  EXPECT_GE(at(1e-4), 0.5) << "nearly all of them";
}

// Straight for each other, as fast as tube and bound allow: the truth is a quotient.
TEST(PathAdversary, StraightOnesGetNearlyAllOfTheTime) {
  std::mt19937_64 random(7);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (std::uint64_t i = 0; i < motions() / 10; ++i) {
    const double gap = uniform(0.05, 0.4), speed = uniform(0.1, 1), cloth = uniform(0, 1), rate = uniform(0, 0.1),
                 deviation = uniform(0, 0.02);
    Step step;
    for (const double z : {0.0, gap}) {
      Body body;
      body.name = z == 0 ? "arm" : "cloth";
      body.self_collision = false;
      body.topology = share(Topology::fromTriangles(3, {{0, 1, 2}}));
      body.t0 = body.t1 = share(Positions{{0, 0, z}, {1, 0, z}, {0, 1, z}});
      step.bodies.push_back(body);
    }
    step.stamp_ns = 1;
    IntendedPath path;
    path.bodies = {{0, {}}};
    path.deviation_m = deviation;
    path.deviation_rate_m_s = rate;
    addPieces(
        [&](double t) {
          return std::vector<Eigen::Isometry3d>{Eigen::Isometry3d(Eigen::Translation3d(0, 0, speed * t))};
        },
        5, 0, 1, 1e-3, 20, path);
    Options options;
    options.clearance.wanted = true;
    History history;
    const Outcome outcome = detect(step, options, history);
    PathSearch search;
    const AlongPath along = search.run(outcome, options, {{SpeedBound::NONE}, {cloth}}, std::nullopt, path);
    const double truth_s = (gap - deviation) / (speed + rate + cloth);
    EXPECT_LE(along.until.seconds(), truth_s * (1 + 1e-12)) << i;
    EXPECT_GE(along.until.seconds(), 0.97 * truth_s - 0.001) << i << " gap " << gap;
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
