// Where few read a step's distances, fewer are measured: what these few are told must be the same, bit for bit.
#include "stream/read_distances.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "step/history.h"
#include "support/query_property.h"

namespace dccd {
namespace test {
namespace {

constexpr double WANDERERS_VOXEL_M = 0.1;

/// Some bodies of a few triangles that wander, perhaps a map, and a law and bounds with what is rare in them.
class Wanderers {
 public:
  explicit Wanderers(std::uint64_t seed) : random_(seed) {
    const bool are_many = seed % 16 == 0;  // so that one row stands for those that are far
    const std::size_t count = are_many ? 47 : 2 + random_() % 4;
    for (std::size_t b = 0; b < count; ++b) {
      Body body;
      body.name = "body " + std::to_string(b);
      const std::size_t triangles = are_many ? 1 : 1 + random_() % 20;
      std::vector<Face> faces;
      Positions places;
      for (std::size_t t = 0; t < triangles; ++t) {
        const auto first = static_cast<Index>(places.size());
        faces.push_back({first, first + 1, first + 2});
        for (int corner = 0; corner < 3; ++corner) places.push_back(somewhere(0.3));
      }
      body.topology = share(Topology::fromTriangles(places.size(), faces));
      body.self_collision = isRare();
      body.against_obstacle = !isRare();
      body.rigid = body.turns = isRare();
      body.pose_t1 = Eigen::Translation3d(somewhere(uniform(0.2, 3)));
      references_.push_back(places);
      body.t1 = share(moved(body.pose_t1, places));
      if (isRare()) body.radius_m = share(std::vector<double>(places.size(), 0.01));
      if (isRare()) body.minimum_separation_m = uniform(0, 0.2);
      step_.bodies.push_back(body);
      SpeedBound bound{isRare() ? (isRare() ? SpeedBound::NONE : 0) : uniform(0.05, 2), !isRare()};
      if (isRare()) bound.carrier = random_() % count, bound.relative_m_s = uniform(0, 0.5);
      bounds.push_back(bound);
    }
    if (random_() % 2 == 0) addMap();
    if (!isRare()) law = SpeedLaw{isRare() ? 0 : uniform(0, 0.5), isRare() ? 0 : uniform(0, 0.5), isRare() ? 0 : 0.05};
    if (isRare()) expected_.push_back({{ExpectedPartner{0, {}}, ExpectedPartner{1, {}}}});
  }

  Options options() const {
    Options options;
    options.clearance.wanted = true;
    options.clearance.max_m = 2;
    options.clearance.self_m = 0.3;
    options.expected = expected_;
    const auto isWider = [](const Body& body) { return body.radius_m || body.minimum_separation_m > 0; };
    if (std::any_of(step_.bodies.begin(), step_.bodies.end(), isWider)) options.accuracy.rung = Accuracy::CONSERVATIVE;
    return options;
  }

  const Step& next() {
    for (std::size_t b = 0; b < step_.bodies.size(); ++b) {
      Body& body = step_.bodies[b];
      body.t0 = body.t1;
      body.pose_t0 = body.pose_t1;
      body.pose_t1.pretranslate(somewhere(0.05));
      if (body.turns) body.pose_t1.rotate(Eigen::AngleAxisd(uniform(-0.3, 0.3), Vec3::UnitZ()));
      body.t1 = share(moved(body.pose_t1, references_[b]));
    }
    return step_;
  }

  std::vector<SpeedBound> bounds;
  std::optional<SpeedLaw> law;

 private:
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  bool isRare() { return random_() % 8 == 0; }
  Vec3 somewhere(double far_m) { return {uniform(-far_m, far_m), uniform(-far_m, far_m), uniform(-far_m, far_m)}; }
  static Positions moved(const Eigen::Isometry3d& pose, Positions places) {
    for (Vec3& p : places) p = pose * p;
    return places;
  }
  void addMap() {
    std::vector<OccupiedLeaf> leaves;
    const auto key = [](double x) { return static_cast<std::uint16_t>(32768 + std::floor(x / WANDERERS_VOXEL_M)); };
    for (int i = 0; i < 5; ++i) {
      const Vec3 at(1.2 * (i - 2) + uniform(-0.5, 0.5), uniform(-2, 2), uniform(-2, 2));
      leaves.push_back({{key(at.x()), key(at.y()), key(at.z())}, 1});
    }
    step_.map.surface = VoxelSurface::build(WANDERERS_VOXEL_M, std::move(leaves));
    if (isRare()) step_.map.map_from_fixed = Eigen::AngleAxisd(uniform(-3, 3), Vec3::UnitX());
  }

  std::mt19937_64 random_;
  Step step_;
  std::vector<Positions> references_;  // by body
  std::vector<Expectation> expected_;
};

std::string toldOf(const Outcome& outcome, const Wanderers& of) {
  std::ostringstream text;
  text << std::hexfloat;
  const SafeUntil until = safeUntil(outcome, of.bounds);
  text << until.until_ns << ' ' << until.others_until_ns << ' ' << until.limiting << ' ' << until.distance_m << ' '
       << until.closing_m_s << ' ' << until.reason;
  if (of.law) {
    const SpeedScale speed = speedScale(outcome, of.bounds, *of.law);
    text << "; " << speed.scale << ' ' << speed.limiting << ' ' << speed.distance_m << ' ' << speed.needed_m << ' '
         << speed.reason;
  }
  double lower_m = SpeedBound::NONE, upper_m = SpeedBound::NONE;
  std::size_t nearest = SafeUntil::NO_PAIR;
  for (std::size_t p = 0; p < outcome.clearances.size(); ++p) {
    const Clearance& pair = outcome.clearances[p];
    if (pair.expected || pair.body[0] == pair.body[1]) continue;
    upper_m = std::min(upper_m, pair.over_step.upper_m);
    const double its_m = pair.over_step.status == ClearanceStatus::UNKNOWN ? -1 : pair.over_step.lower_m;
    if (its_m < lower_m) lower_m = its_m, nearest = p;
  }
  text << "; " << nearest << ' ' << lower_m << ' ' << upper_m;
  return text.str();
}

TEST(ReadDistances, TellTheSameAsAllOfThem) {
  const int worlds = longRun() ? 20000 : 400;
  std::size_t spared = 0, pairs = 0;
  for (int world = 0; world < worlds; ++world) {
    Wanderers wanderers(propertySeed() + static_cast<std::uint64_t>(world));
    const Options options = wanderers.options();
    History all, few;
    for (int k = 0; k < 6; ++k) {
      const Step& step = wanderers.next();
      const Outcome whole = detect(step, options, all);
      ReadDistances readers(step, wanderers.bounds, wanderers.law);
      History::Impl::of(few).readers = &readers;
      const Outcome read = detect(step, options, few);
      ASSERT_EQ(toldOf(read, wanderers), toldOf(whole, wanderers)) << "world " << world << ", step " << k;
      ASSERT_EQ(read.clearances.size(), whole.clearances.size());
      for (std::size_t p = 0; p < whole.clearances.size(); ++p) {
        const ClearanceDistance &less = read.clearances[p].at_end, &more = whole.clearances[p].at_end;
        ++pairs;
        if (less.status == more.status && less.lower_m == more.lower_m && less.upper_m == more.upper_m) continue;
        ++spared;
        ASSERT_EQ(less.status, ClearanceStatus::FARTHER);
        ASSERT_LE(less.lower_m, more.lower_m + options.clearance.tolerance_m);
      }
    }
  }
  EXPECT_GT(spared, pairs / 50) << "of " << pairs;
}

}  // namespace
}  // namespace test
}  // namespace dccd
