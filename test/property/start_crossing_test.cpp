// Edges that meet faces where a step begins: pairs in batches, and whole bodies, judged by the oracle on every SIMD
// target. Seeds are fixed; DEFORMABLE_CCD_LONG=1 runs 1e7 pairs and many more bodies.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <map>

#include "simd/face_filter.h"
#include "simd/segment_filter.h"
#include "step/start/segment_triangle.h"
#include "step/start/start_state.h"
#include "support/closed_meshes.h"
#include "support/query_property.h"
#include "support/step_truth.h"

namespace dccd {
namespace test {
namespace {

/// Pairs p q a b c in one array.
struct Batch {
  std::vector<VertexMotion> vertices;
  std::vector<std::array<std::uint32_t, 5>> pairs;

  void add(const std::array<Vec3, 5>& x) {
    std::array<std::uint32_t, 5> pair;
    for (std::size_t i = 0; i < 5; ++i) {
      pair[i] = static_cast<std::uint32_t>(vertices.size());
      VertexMotion v{};
      std::copy_n(x[i].data(), 3, v.t0);
      vertices.push_back(v);
    }
    pairs.push_back(pair);
  }
  Vec3 at(std::size_t pair, std::size_t i) const { return Eigen::Map<const Vec3>(vertices[pairs[pair][i]].t0); }
  bool truth(std::size_t i) const { return trulyMeet(at(i, 0), at(i, 1), at(i, 2), at(i, 3), at(i, 4)); }
  std::vector<std::uint8_t> meet() const {
    std::vector<std::uint8_t> result(pairs.size());
    segmentsMeetTriangles(vertices[0].t0, pairs.data(), pairs.size(), result.data());
    return result;
  }
  std::vector<std::uint8_t> filtered() const {
    std::vector<std::uint8_t> result(pairs.size());
    simd::segmentFilter(vertices[0].t0, pairs[0].data(), pairs.size(), result.data());
    return result;
  }
};

/// Through a face, an edge or a corner of a triangle, ending on it, along an edge or in its plane; then perhaps turned,
/// so that nothing is exact any more, moved by one bit, degenerate, and of any size from denormal numbers to 1e300.
std::array<Vec3, 5> closePair(const Draw& draw) {
  std::array<Vec3, 5> x;
  for (Vec3& point : x) point = Vec3(draw(-9, 9), draw(-9, 9), draw(-9, 9));
  if (draw(0, 2) == 0) {
    const int axis = draw(0, 2);
    for (Vec3& point : x) point[axis] = x[0][axis];
  }
  const int s = draw(0, 8), r = draw(0, 8 - s);
  const Vec3 at = x[2] + s / 8.0 * (x[3] - x[2]) + r / 8.0 * (x[4] - x[2]);
  const Vec3 along = draw(0, 3) == 0 ? Vec3(x[3] - x[2]) : x[1];
  if (draw(0, 5) > 0) x[0] = at - draw(0, 4) / 4.0 * along;
  if (draw(0, 5) > 0) x[1] = at + draw(0, 4) / 4.0 * along;
  if (draw(0, 9) == 0) x[4] = x[3];
  if (draw(0, 9) == 0) x[1] = x[0];
  if (draw(0, 1) == 0) {
    const double f = draw(1, 1000) / 999.0, g = draw(-1000, 1000) / 777.0;
    for (Vec3& point : x) point = Vec3(f * point[0] + g * point[1], f * point[1] - g * point[2], f * point[2] + g);
  }
  static constexpr double SCALES[] = {1, 1, 0.1, 1e-3, 1e6, 1e-300, 0x1p-1070, 1e300};
  const double scale = SCALES[draw(0, 7)];
  for (Vec3& point : x) point *= scale;
  if (draw(0, 1) == 0) {
    double& value = x[static_cast<std::size_t>(draw(0, 4))][draw(0, 2)];
    value = std::nextafter(value, draw(0, 1) == 0 ? -HUGE_VAL : HUGE_VAL);
  }
  return x;
}

TEST(StartCrossing, PairsOfEverySizeAreAsTheOracleSays) {
  const int blocks = longRun() ? 10000 : 8, size = 1000;
  std::size_t meeting = 0, undecided = 0;
  for (int block = 0; block < blocks; ++block) {
    const Draw draw = drawFrom(61000 + static_cast<std::uint64_t>(block));
    Batch batch;
    for (int i = 0; i < size; ++i) {
      const int style = draw(0, static_cast<int>(Coordinates::COUNT) * 4);
      if (style >= static_cast<int>(Coordinates::COUNT)) {
        batch.add(closePair(draw));
        continue;
      }
      const Positions x = randomPositions(draw, 5, static_cast<Coordinates>(style));
      batch.add({x[0], x[1], x[2], x[3], x[4]});
    }
    const std::vector<std::uint8_t> meet = batch.meet(), verdicts = batch.filtered();
    for (std::size_t i = 0; i < batch.pairs.size(); ++i) {
      ASSERT_EQ(meet[i] != 0, batch.truth(i)) << "block " << block << ", pair " << i;
      meeting += meet[i];
      undecided += verdicts[i] == simd::SEGMENT_UNDECIDED;
    }
    if (block % 100 != 0) continue;
    forEachSimdTarget([&](const std::string& target) {
      ASSERT_EQ(batch.meet(), meet) << target;
      ASSERT_EQ(batch.filtered(), verdicts) << target;
    });
  }
  const std::size_t all = static_cast<std::size_t>(blocks) * size;
  EXPECT_GT(meeting, all / 4);
  EXPECT_LT(meeting, all * 3 / 4);
  EXPECT_GT(undecided, all / 10) << "exact arithmetic has hardly been asked";
}

/// Pairs of faces in one array: face i is lane i % 16 of group i / 16, and meets the next one.
struct FaceBatch {
  std::vector<VertexMotion> vertices;
  std::vector<std::uint32_t> corners, slots;
  std::vector<std::uint8_t> edges;

  void add(const std::array<Vec3, 6>& x) {
    for (std::size_t i = 0; i < 6; ++i) {
      const std::size_t slot = edges.size(), lane = slot % simd::GROUP;
      corners.resize((slot / simd::GROUP + 1) * 3 * simd::GROUP);
      corners[slot / simd::GROUP * 3 * simd::GROUP + i % 3 * simd::GROUP + lane] =
          static_cast<std::uint32_t>(vertices.size());
      if (i % 3 == 2) {
        slots.push_back(static_cast<std::uint32_t>(slot));
        edges.push_back(7);
      }
      VertexMotion v{};
      std::copy_n(x[i].data(), 3, v.t0);
      vertices.push_back(v);
    }
  }
  Vec3 at(std::size_t i) const { return Eigen::Map<const Vec3>(vertices[i].t0); }
  /// Of each pair, all bits; asked: of the edges that are asked about alone.
  std::vector<std::uint32_t> bits(const std::vector<std::uint8_t>* asked = nullptr) const {
    double middle[4] = {}, largest = 0;
    for (int k = 0; k < 3; ++k) {
      const auto [low, high] =
          std::minmax_element(vertices.begin(), vertices.end(),
                              [k](const VertexMotion& v, const VertexMotion& w) { return v.t0[k] < w.t0[k]; });
      middle[k] = low->t0[k] / 2 + high->t0[k] / 2;
      largest = std::max({largest, high->t0[k] - middle[k], middle[k] - low->t0[k]});
    }
    std::vector<float> near(4 * vertices.size());
    simd::moveNear(vertices[0].t0, vertices.size(), middle, near.data());
    std::vector<std::uint32_t> left(slots.size() / 2 + simd::PAIRS_BEHIND), all(slots.size() / 2, 0);
    const simd::FacesView view{corners.data(), edges.data()};
    left.resize(simd::facePairFilter({near.data(), simd::largestNear(largest)}, view, view, slots.data(),
                                     asked ? asked->data() : nullptr, all.size(), left.data())
                    .left);
    for (const std::uint32_t pair : left) all[pair >> simd::PLACE_SHIFT] = pair & ((1u << simd::PLACE_SHIFT) - 1);
    return all;
  }
};

TEST(StartCrossing, EdgesOfPairsOfFacesAreAsTheOracleSays) {
  const int blocks = longRun() ? 1000 : 3, size = 1000;
  std::size_t apart = 0, meeting = 0;
  for (int block = 0; block < blocks; ++block) {
    const Draw draw = drawFrom(63000 + static_cast<std::uint64_t>(block));
    std::map<int, FaceBatch> by_size;  // a batch is rounded from its middle, as bodies are
    for (int i = 0; i < size; ++i) {
      const std::array<Vec3, 5> x = closePair(draw);
      double largest = 0;
      for (const Vec3& point : x) largest = std::max(largest, point.cwiseAbs().maxCoeff());
      const Vec3 along = draw(0, 3) == 0 ? Vec3(x[1] - x[0]) : Vec3(x[4][2], x[3][0], x[2][1]);
      const Vec3 third = x[0] + along / 4 + draw(-3, 3) / 4.0 * (x[3] - x[2]);
      by_size[largest == 0 ? 0 : std::ilogb(largest) / 4].add({x[0], x[1], third, x[2], x[3], x[4]});
    }
    for (const auto& [which, batch] : by_size) {
      const std::vector<std::uint32_t> bits = batch.bits();
      std::vector<std::uint8_t> asked(bits.size());
      for (std::uint8_t& edges : asked) edges = static_cast<std::uint8_t>(draw(0, 63));
      const std::vector<std::uint32_t> of_asked = batch.bits(&asked);
      for (std::size_t i = 0; i < bits.size(); ++i) {
        ASSERT_EQ(of_asked[i], bits[i] & (asked[i] | unsigned{asked[i]} << simd::MEETS_SHIFT));
      }
      for (std::size_t i = 0; i < bits.size(); ++i) {
        for (std::size_t edge = 0; edge < 6; ++edge) {
          const std::size_t a = 6 * i + (edge < 3 ? 0 : 3), b = 6 * i + (edge < 3 ? 3 : 0);
          const bool meet = trulyMeet(batch.at(a + edge % 3), batch.at(a + (edge + 1) % 3), batch.at(b),
                                      batch.at(b + 1), batch.at(b + 2));
          const bool may = bits[i] >> edge & 1, does = bits[i] >> (edge + simd::MEETS_SHIFT) & 1;
          ASSERT_TRUE(may || !meet) << "block " << block << ", size " << which << ", pair " << i << ", edge " << edge;
          ASSERT_TRUE(meet || !does) << "block " << block << ", size " << which << ", pair " << i << ", edge " << edge;
          apart += !may, meeting += does;
        }
      }
      forEachSimdTarget(
          [&](const std::string& target) { ASSERT_EQ(batch.bits(), bits) << target << ", size " << which; });
    }
  }
  EXPECT_GT(apart, 6u * size * static_cast<std::size_t>(blocks) / 4);
  EXPECT_GT(meeting, static_cast<std::size_t>(size) * static_cast<std::size_t>(blocks) / 8);
}

// In a plane across an axis doubles tell nearly all, also what meets: two sheets at rest in it are no hard case.
TEST(StartCrossing, DoublesTellWhatLiesInAPlaneAcrossAnAxis) {
  const Draw draw = drawFrom(7);
  Batch batch;
  for (int i = 0; i < 3000; ++i) {
    std::array<Vec3, 5> x;
    for (Vec3& point : x) point = Vec3(draw(-1000, 1000) / 777.0, draw(-1000, 1000) / 777.0, 0.1);
    for (Vec3& point : x) point = Vec3(point[i % 3], point[(i + 1) % 3], point[(i + 2) % 3]);
    batch.add(x);
  }
  const std::vector<std::uint8_t> verdicts = batch.filtered();
  std::size_t meeting = 0, undecided = 0;
  for (std::size_t i = 0; i < verdicts.size(); ++i) {
    undecided += verdicts[i] == simd::SEGMENT_UNDECIDED;
    meeting += verdicts[i] == simd::SEGMENT_MEETS;
    if (verdicts[i] != simd::SEGMENT_UNDECIDED) {
      ASSERT_EQ(verdicts[i] == simd::SEGMENT_MEETS, batch.truth(i)) << i;
    }
  }
  EXPECT_GT(meeting, 1000u);
  EXPECT_LT(undecided, 10u);
}

/// By a search of its own, on every target.
void expectListed(const TestStep& step, const std::vector<StartIntersection>& truth) {
  forEachSimdTarget([&](const std::string& target) {
    SceneArrays scene;
    scene.setBodies(step.motion().bodies);
    StepStats stats;
    scene.record(step.motion(), stats);
    scene.refit([](std::size_t n, const auto& f) { f(0, n); }, stats);
    StartStateSearch search;
    const std::vector<StartIntersection>& listed = search.run(scene, false, Deadline(), stats);
    EXPECT_TRUE(std::equal(listed.begin(), listed.end(), truth.begin(), truth.end(),
                           [](const StartIntersection& a, const StartIntersection& b) { return a == b; }))
        << target << ": " << listed.size() << " listed, " << truth.size() << " in truth";
  });
}

// All faces at a vertex turn the same way: around it once they are apart, twice they pass through each other.
TEST(StartCrossing, FacesThatLieAroundTheirVertexTwiceAreLookedAt) {
  const Draw draw = drawFrom(17);
  for (int seed = 0; seed < 30; ++seed) {
    const int axis = seed % 3, turns = 1 + seed / 3 % 2;
    StepBody body;
    body.topology = Topology::fromTriangles(6, {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}, {0, 5, 1}});
    for (int i = 0; i < 6; ++i) {
      const double angle = 2 * M_PI * turns * i / 5, out = i == 0 ? 0 : 1 + 0.01 * draw(0, 9);
      const Vec3 x(out * std::cos(angle), out * std::sin(angle), i == 0 ? 1 : 0.1 * draw(0, 9));
      body.t0.push_back(Vec3(x[axis], x[(axis + 1) % 3], x[(axis + 2) % 3]));
    }
    body.t1 = body.t0;
    TestStep step;
    step.bodies = {body};
    const std::vector<StartIntersection> truth = trueIntersections(step);
    SCOPED_TRACE(seed);
    EXPECT_EQ(truth.empty(), turns == 1);
    expectListed(step, truth);
  }
}

/// A ball that is rough, or folded, so that some of its fans lie around their vertices more than once, or not at all.
/// Where a vertex is far away, floats hardly tell the others from each other.
StepBody crumpledBall(const Draw& draw, int depth) {
  StepBody body = ball(Vec3(draw(-4, 4), draw(-4, 4), draw(-4, 4)) / 8.0, 1, depth);
  const int rough = draw(0, 2) == 0 ? 0 : draw(1, 12);
  const bool flat = draw(0, 5) == 0, folded = draw(0, 2) == 0, spiked = draw(0, 3) == 0;
  for (Vec3& x : body.t0) {
    x += Vec3(draw(-99, 99), draw(-99, 99), draw(-99, 99)) * (0.001 * rough);
    if (folded) x[2] = std::fabs(x[2]);
    if (flat) x[draw(0, 1)] = 0.25;
  }
  if (spiked) body.t0[0] *= std::ldexp(1.0, draw(8, 24));
  body.t1 = body.t0;
  return body;
}

TEST(StartCrossing, BodiesThatPassThroughThemselvesAreAsTheOracleSays) {
  const int rounds = longRun() ? 2000 : 40;
  std::size_t found = 0, within = 0;
  for (int seed = 0; seed < rounds; ++seed) {
    const Draw draw = drawFrom(62000 + static_cast<std::uint64_t>(seed));
    TestStep step;
    for (int b = draw(1, 2); b > 0; --b) step.bodies.push_back(crumpledBall(draw, 1));
    const std::vector<StartIntersection> truth = trueIntersections(step);
    found += truth.size();
    for (const StartIntersection& one : truth) within += one.body[0] == one.body[1];
    SCOPED_TRACE(seed);
    expectListed(step, truth);
  }
  EXPECT_GT(found, 10 * static_cast<std::size_t>(rounds));
  EXPECT_GT(within, static_cast<std::size_t>(rounds));
}

// Side by side, and cut at a limit, the same as on one thread.
TEST(StartCrossing, ThreadsListTheSame) {
  const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 4);
  TestStep step = crumpled(5, 2, 40);
  for (StepBody& body : step.bodies) body.t1 = body.t0;
  Options options;
  Outcome first = runOnce(step, options);
  ASSERT_GT(first.intersections.size(), 1000u);
  for (const std::size_t limit : {std::size_t{0}, std::size_t{500}}) {
    options.max_found = limit;
    options.num_threads = 1;
    first = runOnce(step, options);
    for (const int threads : {2, 3}) {
      options.num_threads = threads;
      const Outcome other = runOnce(step, options);
      EXPECT_TRUE(std::equal(first.intersections.begin(), first.intersections.end(), other.intersections.begin(),
                             other.intersections.end(),
                             [](const StartIntersection& a, const StartIntersection& b) { return a == b; }))
          << threads << " threads, limit " << limit << ": " << other.intersections.size() << " instead of "
          << first.intersections.size();
    }
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
