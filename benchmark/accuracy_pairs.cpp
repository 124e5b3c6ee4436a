// accuracy_pairs: what each rung costs per pair and how wrong it is, with `fast` and FCL's elementary tests as rivals
// in the same run. Pairs: hard queries (DIR...) and what the filters leave of real steps (--scene FRAME_0 FRAME_1).
//
// Time: whole batches, several repeats; best and median nanoseconds per pair. Truth: for queries the truth column; for
// survivors the exact rung at 52 bits, which the tests hold against an oracle of their own and against the scenes'
// truth. The error of a TOC is that to the exact rung's 2^-52 cell.
#include <fcl/narrowphase/detail/traversal/collision/intersect.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "culling/cluster_pairs.h"
#include "culling/scene_arrays.h"
#include "dccd/elementary.h"
#include "oracle/query_file.h"
#include "paper/fast_rival.h"
#include "simd/fused_filter.h"
#include "support/detector.h"
#include "support/scene_data.h"

namespace dccd {
namespace {

struct PairSet {
  std::string source;
  PairKind kind = PairKind::VERTEX_FACE;
  std::vector<VertexMotion> own_vertices;  // queries bring their own
  const VertexMotion* vertices = nullptr;  // else the scene's
  std::vector<Quad> pairs;
  std::vector<ElementaryResult> truth;  // exact, 52 bits
  PairBatch batch() const {
    PairBatch b;
    b.kind = kind;
    b.vertices = vertices ? vertices : own_vertices.data();
    b.pairs = pairs.data();
    b.count = pairs.size();
    return b;
  }
};

struct TimedRung {
  std::string name;
  std::function<void(const PairBatch&, ElementaryResult*)> run;
};

using V = fcl::Vector3d;
V at(const PairBatch& b, std::size_t pair, int point, int time) {
  const VertexMotion& v = b.vertices[b.pairs[pair][point]];
  const double* x = time ? v.t1 : v.t0;
  return {x[0], x[1], x[2]};
}

void runFcl(const PairBatch& b, ElementaryResult* out) {
  using Intersect = fcl::detail::Intersect<double>;
  for (std::size_t i = 0; i < b.count; ++i) {
    double toc = 0;
    V point;
    const auto x = [&](int p, int t) { return at(b, i, p, t); };
    const bool hit = b.kind == PairKind::VERTEX_FACE
                         ? Intersect::intersect_VF_filtered(x(1, 0), x(2, 0), x(3, 0), x(0, 0), x(1, 1), x(2, 1),
                                                            x(3, 1), x(0, 1), &toc, &point)
                         : Intersect::intersect_EE_filtered(x(0, 0), x(1, 0), x(2, 0), x(3, 0), x(0, 1), x(1, 1),
                                                            x(2, 1), x(3, 1), &toc, &point);
    out[i].verdict = hit ? Verdict::CONTACT : Verdict::NO_CONTACT;
    out[i].toc_lower = out[i].toc_upper = toc;
  }
}

TimedRung timed(const std::string& name, std::shared_ptr<const Rung> test) {
  return {name, [test](const PairBatch& b, ElementaryResult* out) {
            TierCounters counters;
            test->run(b, out, counters);
          }};
}

std::vector<TimedRung> rungs() {
  std::vector<TimedRung> list;
  AccuracyOptions o;
  o.rung = Accuracy::CONSERVATIVE;
  for (const double tolerance : {1e-3, 1e-6, 1e-9}) {
    o.tolerance_m = tolerance;
    char name[32];
    std::snprintf(name, sizeof name, "conservative %.0e", tolerance);
    list.push_back(timed(name, makeRung(o)));
  }
  o.tolerance_m = 1e-6;
  o.rung = Accuracy::EXACT;
  for (const int bits : {10, 32, 52}) {
    o.toc_bits = bits;
    list.push_back(timed("exact " + std::to_string(bits), makeRung(o)));
  }
  list.push_back(timed("fast", makeFastRival()));
  list.push_back({"FCL", runFcl});
  return list;
}

void addQueries(const std::string& dir, std::vector<PairSet>& sets) {
  PairSet kinds[2];
  for (const QueryFileEntry& entry : findQueryFiles(dir)) {
    PairSet& set = kinds[static_cast<int>(entry.kind)];
    set.source = "hard queries";
    set.kind = entry.kind;
    for (const Query& q : readQueryFile(entry.path, entry.kind)) {
      const Index base = static_cast<Index>(set.own_vertices.size());
      for (int p = 0; p < 4; ++p) {
        VertexMotion v{};
        std::copy_n(q.motion.x[0][p], 3, v.t0);
        std::copy_n(q.motion.x[1][p], 3, v.t1);
        set.own_vertices.push_back(v);
      }
      set.pairs.push_back({base, base + 1, base + 2, base + 3});
    }
  }
  for (PairSet& set : kinds) {
    if (!set.pairs.empty()) sets.push_back(std::move(set));
  }
}

// What the filters of the step leave of a real step. The arrays of the scene must outlive the pairs.
void addSurvivors(const std::string& name, SceneArrays& scene, std::vector<PairSet>& sets) {
  const SceneBody& body = scene.bodies()[0];
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    const bool edges = kind == PairKind::EDGE_EDGE;
    const ClusterTree &a = body.tree(edges ? FeatureKind::EDGE : FeatureKind::VERTEX),
                      &b = body.tree(edges ? FeatureKind::EDGE : FeatureKind::FACE);
    PairSet set;
    set.source = name + " survivors";
    set.kind = kind;
    set.vertices = scene.vertices();
    const TreePair trees{&a, &b, edges, false};
    std::vector<std::uint32_t> groups, scratch, kept;
    std::vector<Quad> chunk;
    superclusterPairs(trees, groups, scratch);
    ClusterPairStream stream;
    stream.run(trees, groups.data(), groups.size() / 2, [&](const std::uint32_t* slots, std::size_t n) {
      chunk.clear();
      for (std::size_t i = 0; i < n; ++i) {
        const Index *x = a.feature(slots[2 * i]), *y = b.feature(slots[2 * i + 1]);
        const Quad q = edges ? Quad{x[0], x[1], y[0], y[1]} : Quad{x[0], y[0], y[1], y[2]};
        const bool shared = edges ? q[0] == q[2] || q[0] == q[3] || q[1] == q[2] || q[1] == q[3]
                                  : q[0] == q[1] || q[0] == q[2] || q[0] == q[3];
        if (!shared) chunk.push_back(q);
      }
      kept.resize(chunk.size());
      if (chunk.empty()) return true;
      const std::size_t left = simd::fusedFilter(scene.vertices()->t0, chunk[0].data(), chunk.size(), edges,
                                                 simd::FusedPlanes::ADAPTIVE, kept.data());
      for (std::size_t i = 0; i < left; ++i) set.pairs.push_back(chunk[kept[i]]);
      return true;
    });
    sets.push_back(std::move(set));
  }
}

void measure(const PairSet& set, const TimedRung& rung, int repeats) {
  std::vector<ElementaryResult> out(set.pairs.size());
  std::vector<double> ns;
  for (int r = 0; r < repeats; ++r) {
    const auto start = std::chrono::steady_clock::now();
    // Chunks of the step's size, so that the pairs are as near in memory as they are there.
    for (std::size_t first = 0; first < set.pairs.size(); first += 2048) {
      PairBatch b = set.batch();
      b.pairs += first;
      b.count = std::min<std::size_t>(2048, set.pairs.size() - first);
      rung.run(b, out.data() + first);
    }
    ns.push_back(std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start).count() /
                 static_cast<double>(set.pairs.size()));
  }
  std::sort(ns.begin(), ns.end());
  std::size_t contacts = 0, missed = 0, wrong = 0, undecided = 0;
  double toc_error = 0;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const bool truth = set.truth[i].verdict == Verdict::CONTACT;
    const bool hit = out[i].verdict != Verdict::NO_CONTACT;
    contacts += truth;
    missed += truth && !hit;
    undecided += out[i].verdict == Verdict::UNDECIDED;
    wrong += !truth && out[i].verdict == Verdict::CONTACT;
    if (truth && hit) toc_error = std::max(toc_error, std::abs(set.truth[i].toc_lower - out[i].toc_lower));
  }
  std::printf("%s,%s,%s,%zu,%zu,%zu,%zu,%zu,%.2f,%.2f,%.3g\n", set.source.c_str(),
              set.kind == PairKind::VERTEX_FACE ? "VF" : "EE", rung.name.c_str(), out.size(), contacts, missed, wrong,
              undecided, ns.front(), ns[ns.size() / 2], toc_error);
}

int run(int argc, char** argv) {
  CLI::App app{"Nanoseconds, wrong answers and TOC error of every rung, and of FCL, per pair"};
  std::vector<std::string> dirs, frames;
  int repeats = 9;
  app.add_option("DIR", dirs, "folders of query files");
  app.add_option("--scene", frames, "NAME FRAME_0 FRAME_1, repeatable")->type_size(3)->expected(-1);
  app.add_option("--repeat", repeats, "repeats of each batch")->check(CLI::PositiveNumber)->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  std::vector<PairSet> sets;
  for (const std::string& dir : dirs) addQueries(dir, sets);
  std::vector<std::unique_ptr<SceneArrays>> scenes;
  for (std::size_t i = 0; i + 2 < frames.size(); i += 3) {
    const test::PlyMesh m0 = test::readPly(frames[i + 1]), m1 = test::readPly(frames[i + 2]);
    Body body;
    body.name = frames[i];
    body.topology = std::make_shared<const Topology>(Topology::fromTriangles(m0.vertices.size(), m0.faces));
    scenes.push_back(std::make_unique<SceneArrays>());
    const Step step = test::stepOf(body, m0.vertices, m1.vertices);
    scenes.back()->setBodies(step.bodies);
    StepStats stats;
    scenes.back()->record(step, stats);
    scenes.back()->refit([](std::size_t n, const auto& f) { f(0, n); }, stats);
    addSurvivors(frames[i], *scenes.back(), sets);
  }
  AccuracyOptions finest;
  finest.toc_bits = 52;
  const std::unique_ptr<Rung> exact = makeRung(finest);
  std::printf("source,kind,rung,pairs,contacts,missed,false_contacts,undecided,best_ns,median_ns,max_toc_error\n");
  for (PairSet& set : sets) {
    TierCounters counters;
    set.truth.resize(set.pairs.size());
    exact->run(set.batch(), set.truth.data(), counters);
    for (const TimedRung& rung : rungs()) measure(set, rung, repeats);
  }
  return 0;
}

}  // namespace
}  // namespace dccd

int main(int argc, char** argv) {
  try {
    return dccd::run(argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "accuracy_pairs: %s\n", e.what());
    return 1;
  }
}
