// The paper's broad phase against brute force over features: each pair once, none missing (every missing pair is
// named), whatever the bodies, their switches and their inactive vertices.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "paper/primitive_bv.h"
#include "paper/triangle_candidates.h"
#include "support/simd_targets.h"

namespace dccd {
namespace {

struct Candidates : PairSink {
  std::vector<Quad> vf, ee;
  std::size_t largest_chunk = 0;
  void take(PairKind kind, Quad* pairs, std::size_t count) override {
    std::vector<Quad>& to = kind == PairKind::VERTEX_FACE ? vf : ee;
    to.insert(to.end(), pairs, pairs + count);
    largest_chunk = std::max(largest_chunk, count);
    std::fill(pairs, pairs + count, Quad{});  // the array is the sink's to overwrite
  }
  void sort() {
    std::sort(vf.begin(), vf.end());
    std::sort(ee.begin(), ee.end());
  }
};

struct World {
  std::vector<Topology> topologies;
  std::vector<TriangleCandidates::Body> bodies;
  std::vector<VertexMotion> vertices;
  std::vector<std::uint8_t> active;

  void add(Topology topology, const std::vector<VertexMotion>& motion, bool self = true, bool against = true) {
    bodies.push_back({nullptr, static_cast<Index>(vertices.size()), self, against});
    topologies.push_back(std::move(topology));
    vertices.insert(vertices.end(), motion.begin(), motion.end());
    for (std::size_t i = 0; i < bodies.size(); ++i) bodies[i].topology = &topologies[i];
  }
};

/// A crumpled sheet: a grid with rough, moving heights, rolled up so that it meets itself.
std::vector<VertexMotion> crumpled(std::size_t rows, std::size_t cols, double shift, std::mt19937_64& random) {
  std::uniform_real_distribution<double> rough(-0.6, 0.6), motion(-0.4, 0.4);
  std::vector<VertexMotion> v;
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < cols; ++c) {
      VertexMotion m{};
      const double angle = 0.9 * static_cast<double>(r);
      const double p[3] = {std::cos(angle) * 2 + shift, std::sin(angle) * 2, static_cast<double>(c)};
      for (int k = 0; k < 3; ++k) {
        m.t0[k] = p[k] + rough(random);
        m.t1[k] = m.t0[k] + motion(random);
      }
      v.push_back(m);
    }
  }
  return v;
}

World mixedWorld(unsigned seed, bool switches = false) {
  std::mt19937_64 random(seed);
  World w;
  w.add(Topology::grid(7, 5), crumpled(7, 5, 0, random));
  w.add(Topology::grid(3, 3), crumpled(3, 3, 1, random), !switches, true);
  w.add(Topology::polyline(9), crumpled(3, 3, -1, random));
  // A body of loose triangles: many parts.
  w.add(Topology::fromTriangles(12, {{0, 1, 2}, {3, 4, 5}, {6, 7, 8}, {9, 10, 11}}), crumpled(3, 4, 0.5, random), true,
        !switches);
  return w;
}

/// Every pair of features that may be tested, by the definition: no shared vertex, switches, active vertices.
Candidates allFeaturePairs(const World& w) {
  Candidates all;
  const auto isActive = [&](Index v) { return w.active.empty() || w.active[v]; };
  for (std::size_t a = 0; a < w.bodies.size(); ++a) {
    for (std::size_t b = 0; b < w.bodies.size(); ++b) {
      const auto &ba = w.bodies[a], &bb = w.bodies[b];
      if (a == b ? !ba.self : !(ba.against && bb.against)) continue;
      for (Index v : w.topologies[a].usedVertices()) {
        for (const Face& f : w.topologies[b].faces()) {
          const Quad q{v + ba.vertex_offset, f[0] + bb.vertex_offset, f[1] + bb.vertex_offset, f[2] + bb.vertex_offset};
          if (q[0] == q[1] || q[0] == q[2] || q[0] == q[3]) continue;
          if (std::all_of(q.begin(), q.end(), isActive)) all.vf.push_back(q);
        }
      }
      for (const Edge& e : w.topologies[a].edges()) {
        for (const Edge& f : w.topologies[b].edges()) {
          const Quad q{e[0] + ba.vertex_offset, e[1] + ba.vertex_offset, f[0] + bb.vertex_offset,
                       f[1] + bb.vertex_offset};
          if (std::set<Index>(q.begin(), q.end()).size() < 4 || std::tie(q[0], q[1]) > std::tie(q[2], q[3])) continue;
          if (std::all_of(q.begin(), q.end(), isActive)) all.ee.push_back(q);
        }
      }
    }
  }
  all.sort();
  return all;
}

Candidates run(const World& w, TrianglePairs method, double separation_m = 0, SweptBounds bounds = SweptBounds::DOP16) {
  TriangleCandidates broad_phase;
  broad_phase.setBodies(w.bodies, w.vertices.data());
  PaperRecords records;
  const std::uint8_t* active = w.active.empty() ? nullptr : w.active.data();
  records.build(w.vertices.data(), w.vertices.size(), active);
  broad_phase.refit(w.vertices.data(), records, active, separation_m, bounds);
  Candidates found;
  broad_phase.enumerate(method, found);
  EXPECT_LE(found.largest_chunk, TriangleCandidates::CHUNK);
  found.sort();
  return found;
}

/// No pair twice, none that may not be tested, none missing of those whose own swept 16-DOPs overlap.
void expectComplete(const World& w, const Candidates& found) {
  const Candidates all = allFeaturePairs(w);
  PaperRecords records;
  records.build(w.vertices.data(), w.vertices.size(), w.active.empty() ? nullptr : w.active.data());
  const auto check = [&](PairKind kind, const std::vector<Quad>& got, const std::vector<Quad>& allowed) {
    EXPECT_EQ(std::adjacent_find(got.begin(), got.end()), got.end()) << "a pair occurs twice";
    for (const Quad& q : got) {
      EXPECT_TRUE(std::binary_search(allowed.begin(), allowed.end(), q))
          << toString(kind) << ' ' << testing::PrintToString(q) << " is no pair";
    }
    std::size_t required = 0;
    for (const Quad& q : allowed) {
      if (primitiveBvSeparated(kind, records.data(), q)) continue;
      ++required;
      EXPECT_TRUE(std::binary_search(got.begin(), got.end(), q))
          << toString(kind) << ' ' << testing::PrintToString(q) << " is missing";
    }
    EXPECT_GT(required, 0u);
  };
  check(PairKind::VERTEX_FACE, found.vf, all.vf);
  check(PairKind::EDGE_EDGE, found.ee, all.ee);
}

TEST(PaperCandidates, HierarchyAndBruteForceFindEachFeaturePairOnce) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const World w = mixedWorld(seed);
    const Candidates hierarchy = run(w, TrianglePairs::HIERARCHY), brute = run(w, TrianglePairs::BRUTE_FORCE);
    EXPECT_EQ(hierarchy.vf, brute.vf) << "seed " << seed;
    EXPECT_EQ(hierarchy.ee, brute.ee) << "seed " << seed;
    expectComplete(w, hierarchy);
    EXPECT_LT(hierarchy.vf.size(), allFeaturePairs(w).vf.size()) << "bounds that separate nothing would pass, too";
  }
}

TEST(PaperCandidates, SelfAndAgainstSwitchesAreObeyed) {
  const World w = mixedWorld(3, true);
  const Candidates hierarchy = run(w, TrianglePairs::HIERARCHY), brute = run(w, TrianglePairs::BRUTE_FORCE);
  EXPECT_EQ(hierarchy.vf, brute.vf);
  EXPECT_EQ(hierarchy.ee, brute.ee);
  expectComplete(w, hierarchy);
}

TEST(PaperCandidates, InactiveVerticesTakeTheirFeaturesAlongAndNoOthers) {
  World w = mixedWorld(4);
  w.active.assign(w.vertices.size(), 1);
  for (Index v : {Index{3}, Index{8}, Index{36}, Index{46}, Index{53}, Index{54}, Index{55}}) {
    w.active[v] = 0;
    w.vertices[v].t0[0] = std::numeric_limits<double>::quiet_NaN();
    w.vertices[v].t1[1] = -std::numeric_limits<double>::infinity();
  }
  const Candidates hierarchy = run(w, TrianglePairs::HIERARCHY), brute = run(w, TrianglePairs::BRUTE_FORCE);
  EXPECT_EQ(hierarchy.vf, brute.vf);
  EXPECT_EQ(hierarchy.ee, brute.ee);
  expectComplete(w, hierarchy);
}

TEST(PaperCandidates, OrphansOfAdjacentTrianglesAreCandidates) {
  // Two triangles and nothing else: what a scheme that skips adjacent triangles has no other pair for.
  World w;
  std::vector<VertexMotion> v(4, VertexMotion{});
  const double x[4][3] = {{0, 0, 0}, {1, 0, 0}, {0.5, 1, 0}, {0.5, 0.9, 0.1}};
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 3; ++k) v[i].t0[k] = v[i].t1[k] = x[i][k];
  }
  v[3].t1[2] = -0.1;  // folds through the other triangle
  w.add(Topology::fromTriangles(4, {{0, 1, 2}, {1, 0, 3}}), v);
  const Candidates found = run(w, TrianglePairs::HIERARCHY);
  EXPECT_EQ(found.vf, (std::vector<Quad>{{2, 1, 0, 3}, {3, 0, 1, 2}}));
  EXPECT_EQ(found.ee, (std::vector<Quad>{{0, 2, 1, 3}, {0, 3, 1, 2}}));
}

TEST(PaperCandidates, MoreDirectionsOnlyTakeAway) {
  const World w = mixedWorld(5);
  const Candidates box = run(w, TrianglePairs::HIERARCHY, 0, SweptBounds::BOX);
  const Candidates dop16 = run(w, TrianglePairs::HIERARCHY);
  const Candidates dop18 = run(w, TrianglePairs::HIERARCHY, 0, SweptBounds::DOP18);
  EXPECT_TRUE(std::includes(box.ee.begin(), box.ee.end(), dop16.ee.begin(), dop16.ee.end()));
  EXPECT_TRUE(std::includes(dop16.ee.begin(), dop16.ee.end(), dop18.ee.begin(), dop18.ee.end()));
  EXPECT_GT(box.ee.size(), dop16.ee.size());
  EXPECT_GT(dop16.ee.size(), dop18.ee.size());
}

TEST(PaperCandidates, SeparationBringsInWhatComesThatClose) {
  // Two triangles 1 m apart along a diagonal direction.
  World w;
  std::vector<VertexMotion> v(6, VertexMotion{});
  const double gap = std::sqrt(0.5);
  const double x[6][3] = {{0, 0, 0}, {1, -1, 0}, {0, 0, 1}, {gap, gap, 0}, {gap + 1, gap - 1, 0}, {gap, gap, 1}};
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 3; ++k) v[i].t0[k] = v[i].t1[k] = x[i][k];
  }
  w.add(Topology::fromTriangles(6, {{0, 1, 2}, {3, 4, 5}}), v);
  EXPECT_TRUE(run(w, TrianglePairs::HIERARCHY).ee.empty());
  EXPECT_TRUE(run(w, TrianglePairs::HIERARCHY, 0.99).ee.empty());
  for (const auto bounds : {SweptBounds::BOX, SweptBounds::DOP16, SweptBounds::DOP18}) {
    EXPECT_EQ(run(w, TrianglePairs::HIERARCHY, 1.0001, bounds).ee.size(), 9u);
    EXPECT_EQ(run(w, TrianglePairs::BRUTE_FORCE, 1.0001, bounds).vf.size(), 6u);
  }
}

TEST(PaperCandidates, EveryTargetGivesTheSameInTheSameOrder) {
  const World w = mixedWorld(6);
  std::vector<Quad> first;
  test::forEachTarget([&](const std::string& target) {
    TriangleCandidates broad_phase;
    broad_phase.setBodies(w.bodies, w.vertices.data());
    PaperRecords records;
    records.build(w.vertices.data(), w.vertices.size());
    broad_phase.refit(w.vertices.data(), records);
    Candidates found;
    broad_phase.enumerate(TrianglePairs::HIERARCHY, found);
    found.ee.insert(found.ee.end(), found.vf.begin(), found.vf.end());
    if (first.empty()) first = found.ee;
    EXPECT_EQ(found.ee, first) << target;
  });
}

TEST(PaperCandidates, FewOrNoPrimitives) {
  World none;
  EXPECT_TRUE(run(none, TrianglePairs::HIERARCHY).vf.empty());
  World one;
  one.add(Topology::fromTriangles(3, {{0, 1, 2}}), std::vector<VertexMotion>(3, VertexMotion{}));
  EXPECT_TRUE(run(one, TrianglePairs::HIERARCHY).ee.empty());
  EXPECT_TRUE(run(one, TrianglePairs::BRUTE_FORCE).ee.empty());
}

TEST(PaperCandidates, SurvivesARefitOfTheSameTreesForEveryStep) {
  std::mt19937_64 random(8);
  World w = mixedWorld(8);
  TriangleCandidates broad_phase;
  broad_phase.setBodies(w.bodies, w.vertices.data());
  PaperRecords records;
  for (int step = 0; step < 5; ++step) {
    for (VertexMotion& v : w.vertices) {
      for (int k = 0; k < 3; ++k) {
        v.t0[k] = v.t1[k];
        v.t1[k] += std::uniform_real_distribution<double>(-0.5, 0.5)(random);
      }
    }
    records.build(w.vertices.data(), w.vertices.size());
    broad_phase.refit(w.vertices.data(), records);
    Candidates hierarchy, brute;
    broad_phase.enumerate(TrianglePairs::HIERARCHY, hierarchy);
    const std::uint64_t pairs = broad_phase.primitivePairs();
    broad_phase.enumerate(TrianglePairs::BRUTE_FORCE, brute);
    EXPECT_EQ(pairs, broad_phase.primitivePairs());
    hierarchy.sort();
    brute.sort();
    EXPECT_EQ(hierarchy.vf, brute.vf);
    EXPECT_EQ(hierarchy.ee, brute.ee);
    expectComplete(w, hierarchy);
  }
}

}  // namespace
}  // namespace dccd
