// The filters in the paper's form against exact truth: no true contact is culled, and the candidate sets are those that
// the culling ratios are stated for.
#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>
#include <map>

#include "oracle/oracle.h"
#include "oracle/query_file.h"
#include "paper/paper_filters.h"
#include "paper/triangle_candidates.h"
#include "support/data.h"
#include "support/generators.h"
#include "support/scene_data.h"

namespace dccd {
namespace {

constexpr PaperFilter FILTERS[] = {PaperFilter::PRIMITIVE_BV,    PaperFilter::LINEAR,
                                   PaperFilter::NON_PENETRATION, PaperFilter::NON_PENETRATION_BATCHED,
                                   PaperFilter::PLANAR_PAPER,    PaperFilter::PLANAR_BRANCH_FREE};

/// One name per pair whatever the order of its vertices.
Quad canonical(PairKind kind, Quad q) {
  if (kind == PairKind::VERTEX_FACE) {
    std::sort(q.begin() + 1, q.end());
    return q;
  }
  if (q[0] > q[1]) std::swap(q[0], q[1]);
  if (q[2] > q[3]) std::swap(q[2], q[3]);
  if (std::tie(q[0], q[1]) > std::tie(q[2], q[3])) q = {q[2], q[3], q[0], q[1]};
  return q;
}

/// Swept axis-aligned boxes of the two features, on the exact coordinates.
bool boxesOverlap(PairKind kind, const VertexMotion* vertices, const Quad& q) {
  const int first = kind == PairKind::VERTEX_FACE ? 1 : 2;
  for (int k = 0; k < 3; ++k) {
    double lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < 4; ++i) {
      const VertexMotion& v = vertices[q[i]];
      const int f = i < first ? 0 : 1;
      lo[f] = std::min({lo[f], v.t0[k], v.t1[k]});
      hi[f] = std::max({hi[f], v.t0[k], v.t1[k]});
    }
    if (lo[0] > hi[1] || lo[1] > hi[0]) return false;
  }
  return true;
}

/// The true contacts of a scene, sorted, and how often each was seen among what passes by.
class TruthWatch {
 public:
  explicit TruthWatch(const test::SceneData& scene) {
    for (PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
      std::vector<Quad>& of_kind = contacts_[static_cast<std::size_t>(kind)];
      for (const test::TruthPair& t : kind == PairKind::VERTEX_FACE ? scene.vertex_face : scene.edge_edge) {
        if (t.contact) of_kind.push_back(canonical(kind, t.pair));
      }
      std::sort(of_kind.begin(), of_kind.end());
    }
    clear();
  }
  void clear() {
    for (int k = 0; k < 2; ++k) seen_[k].assign(contacts_[k].size(), 0);
  }
  void watch(PairKind kind, const Quad* pairs, std::size_t count) {
    const std::vector<Quad>& of_kind = contacts_[static_cast<std::size_t>(kind)];
    for (std::size_t i = 0; i < count; ++i) {
      const Quad q = canonical(kind, pairs[i]);
      const auto it = std::lower_bound(of_kind.begin(), of_kind.end(), q);
      if (it == of_kind.end() || *it != q) continue;
      ++seen_[static_cast<std::size_t>(kind)][static_cast<std::size_t>(it - of_kind.begin())];
    }
  }
  /// Names every contact that was not seen exactly once.
  void expectAll(const std::string& after) const {
    for (PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
      const std::size_t k = static_cast<std::size_t>(kind);
      for (std::size_t i = 0; i < seen_[k].size(); ++i) {
        const Quad& q = contacts_[k][i];
        EXPECT_EQ(seen_[k][i], 1) << after << ": " << toString(kind) << ' ' << testing::PrintToString(q);
      }
    }
  }
  std::size_t contacts() const { return contacts_[0].size() + contacts_[1].size(); }
  const std::vector<Quad>& contacts(PairKind kind) const { return contacts_[static_cast<std::size_t>(kind)]; }

 private:
  std::vector<Quad> contacts_[2];
  std::vector<int> seen_[2];
};

/// Counts what passes by: all candidates, those whose own boxes overlap, those that linear + planar keep.
struct CountingSink : PairSink {
  CountingSink(const test::SceneData& scene, const PaperRecords& records, TruthWatch& watch)
      : scene(scene), records(records), watch(watch) {}
  void take(PairKind kind, Quad* pairs, std::size_t count) override {
    candidates += count;
    watch.watch(kind, pairs, count);
    for (std::size_t i = 0; i < count; ++i) boxes += boxesOverlap(kind, scene.vertices.data(), pairs[i]);
    for (PaperFilter filter : {PaperFilter::LINEAR, PaperFilter::PLANAR_BRANCH_FREE}) {
      count = filterPairs(filter, kind, records, scene.vertices.data(), pairs, count, pairs);
    }
    kept += count;
  }
  const test::SceneData& scene;
  const PaperRecords& records;
  TruthWatch& watch;
  std::size_t candidates = 0, boxes = 0, kept = 0;
};

struct SceneFigures {
  const char* name;
  std::size_t candidates_dop18;  ///< feature pairs of triangle pairs with overlapping swept 18-DOPs
  std::size_t feature_boxes;     ///< pairs whose own swept boxes overlap
  double culled_of_false;        ///< share of the false candidates that linear + planar removes, at least
};

class SceneTruth : public ::testing::TestWithParam<SceneFigures> {};

TEST_P(SceneTruth, NoTrueContactIsCulled) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  const test::SceneData scene = test::readScene(GetParam().name);
  const TruthWatch truth(scene);
  PaperRecords records;
  records.build(scene.vertices.data(), scene.vertices.size());
  for (PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    const std::vector<Quad>& contacts = truth.contacts(kind);
    EXPECT_GT(contacts.size(), 9000u);
    for (PaperFilter filter : FILTERS) {
      std::vector<Quad> kept(contacts.size());
      kept.resize(
          filterPairs(filter, kind, records, scene.vertices.data(), contacts.data(), contacts.size(), kept.data()));
      std::vector<Quad> lost;
      std::set_difference(contacts.begin(), contacts.end(), kept.begin(), kept.end(), std::back_inserter(lost));
      EXPECT_EQ(lost.size(), 0u) << toString(filter) << ", first " << toString(kind) << ' '
                                 << testing::PrintToString(lost[0]);
    }
  }
}

TEST_P(SceneTruth, CandidatesHoldEveryContactOnceAndAreAsManyAsStated) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  const SceneFigures figures = GetParam();
  const test::SceneData scene = test::readScene(figures.name);
  TruthWatch truth(scene);
  const Topology topology = Topology::fromTriangles(scene.vertices.size(), scene.faces);
  PaperRecords records;
  records.build(scene.vertices.data(), scene.vertices.size());
  TriangleCandidates broad_phase;
  broad_phase.setBodies({{&topology, 0, true, true}}, scene.vertices.data());
  for (const SweptBounds bounds : {SweptBounds::BOX, SweptBounds::DOP16, SweptBounds::DOP18}) {
    broad_phase.refit(scene.vertices.data(), records, nullptr, 0, bounds);
    truth.clear();
    CountingSink sink(scene, records, truth);
    broad_phase.enumerate(TrianglePairs::HIERARCHY, sink);
    truth.expectAll("bounds " + std::to_string(static_cast<int>(bounds)));
    if (bounds == SweptBounds::BOX) {
      EXPECT_EQ(sink.boxes, figures.feature_boxes);
    }
    if (bounds != SweptBounds::DOP18) continue;
    EXPECT_EQ(sink.candidates, figures.candidates_dop18);
    const double culled =
        1 - static_cast<double>(sink.kept - truth.contacts()) / static_cast<double>(sink.candidates - truth.contacts());
    EXPECT_GE(culled, figures.culled_of_false);
    const double ceiling = 1 - static_cast<double>(truth.contacts()) / static_cast<double>(sink.candidates);
    std::cout << figures.name << ": linear + planar cull " << 100 * culled << " % of the false candidates; ceiling "
              << 100 * ceiling << " % of all\n";
  }
}

INSTANTIATE_TEST_SUITE_P(Data, SceneTruth,
                         ::testing::Values(SceneFigures{"cloth-ball", 8783793, 6852873, 0.983},
                                           SceneFigures{"n-body", 16517562, 31763261, 0.977}),
                         [](const auto& info) { return info.index == 0 ? "cloth_ball" : "n_body"; });

VertexMotion vertexOf(const PairMotion& pair, int i) {
  VertexMotion v{};
  for (int k = 0; k < 3; ++k) {
    v.t0[k] = pair.x[0][i][k];
    v.t1[k] = pair.x[1][i][k];
  }
  return v;
}

/// Filters that reject the pair formed by the vertices 4 * number to 4 * number + 3.
std::string rejectedBy(PairKind kind, const PaperRecords& records, const std::vector<VertexMotion>& vertices,
                       std::size_t number) {
  const Index first = static_cast<Index>(4 * number);
  const Quad pair{first, first + 1, first + 2, first + 3};
  std::string names;
  for (PaperFilter filter : FILTERS) {
    Quad kept;
    const std::string filter_name = toString(filter);
    if (filterPairs(filter, kind, records, vertices.data(), &pair, 1, &kept) == 0) names += filter_name + ' ';
    if (filterRejects(filter, kind, records, vertices.data(), pair)) names += filter_name + " (plain) ";
  }
  return names;
}

TEST(QueryTruth, NoTrueContactOfTheHardQueriesIsCulled) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  std::size_t contacts = 0, queries = 0, rejected = 0;
  for (const QueryFileEntry& file : findQueryFiles(test::dataDir() + "/ccd_queries")) {
    const std::vector<Query> all = readQueryFile(file.path, file.kind);
    // Each query by itself, and all of a file in one scene, where a pair is small beside the scene.
    std::vector<VertexMotion> together;
    for (const Query& q : all) {
      for (int i = 0; i < 4; ++i) together.push_back(vertexOf(q.motion, i));
    }
    PaperRecords shared;
    shared.build(together.data(), together.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
      const std::vector<VertexMotion> alone(together.begin() + static_cast<std::ptrdiff_t>(4 * i),
                                            together.begin() + static_cast<std::ptrdiff_t>(4 * i + 4));
      PaperRecords own;
      own.build(alone.data(), alone.size());
      const std::string by_own = rejectedBy(file.kind, own, alone, 0);
      const std::string by_shared = rejectedBy(file.kind, shared, together, i);
      if (all[i].contact) {
        EXPECT_EQ(by_own, "") << file.path << " query " << i;
        EXPECT_EQ(by_shared, "") << file.path << " query " << i << " in one scene with the others";
      }
      contacts += all[i].contact;
      rejected += !by_own.empty();
      ++queries;
    }
  }
  EXPECT_GT(queries, 4000u);
  EXPECT_GT(contacts, 200u);
  EXPECT_GT(rejected, 100u) << "filters that reject nothing would pass, too";
}

TEST(QueryTruth, NoTrueContactOfHardPairsMadeOnPurposeIsCulled) {
  test::RandomSource random(20260);
  std::map<test::Hardness, std::size_t> judged;
  std::size_t contacts = 0;
  for (int n = 0; n < 6000; ++n) {
    const auto hardness = static_cast<test::Hardness>(random() % static_cast<unsigned>(test::Hardness::COUNT));
    // Magnitudes beyond what a record can hold are kept by design; judging them exactly takes milliseconds each.
    if (hardness == test::Hardness::EXTREME || hardness == test::Hardness::MIXED_150) continue;
    const PairKind kind = n % 2 ? PairKind::EDGE_EDGE : PairKind::VERTEX_FACE;
    const Query q = test::hardQuery(random, kind, hardness);
    std::vector<VertexMotion> vertices;
    for (int i = 0; i < 4; ++i) vertices.push_back(vertexOf(q.motion, i));
    // Vertices elsewhere make the records coarse beside the pair.
    double largest = 0;
    for (const auto& time : q.motion.x) {
      for (const auto& point : time) {
        for (double x : point) largest = std::max(largest, std::abs(x));
      }
    }
    VertexMotion far{};
    far.t0[n % 3] = far.t1[(n + 1) % 3] = largest * std::ldexp(1.0, n % 20);
    vertices.push_back(far);
    PaperRecords records;
    records.build(vertices.data(), vertices.size());
    const std::string names = rejectedBy(kind, records, vertices, 0);
    if (names.empty()) continue;
    ++judged[hardness];
    const bool contact = test::firstContact(kind, q.motion).has_value();
    contacts += contact;
    EXPECT_FALSE(contact) << toString(hardness) << ' ' << toString(kind) << " rejected by " << names;
  }
  EXPECT_EQ(contacts, 0u);
  EXPECT_GT(judged.size(), 6u) << "filters that reject nothing would pass, too";
}

}  // namespace
}  // namespace dccd
