// Nanoseconds per pair of each filter, over the candidates of a small generated scene: in the order in which the
// hierarchy finds them, and shuffled, since the order in memory matters more than the instruction set.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <random>

#include "paper/paper_filters.h"
#include "paper/triangle_candidates.h"
#include "simd/fused_filter.h"
#include "support/steps.h"

namespace dccd {
namespace benchmarks {
namespace {

/// Candidates of one step of a shattering body, and those that the linear filter keeps.
struct Candidates : PairSink {
  Candidates() {
    SceneRequest request;
    request.name = "lion";
    request.options.triangles = 60000;
    request.steps = 1;
    request.first_frame = 6;
    TriangleCandidates broad_phase;
    forEachStep(
        request,
        [&](const SceneBodies& scene, const Step& step) { broad_phase.setBodies(scene.bodies, step.vertices.data()); },
        [&](const Step& step) {
          vertices = step.vertices;
          records.build(vertices.data(), vertices.size());
          broad_phase.refit(vertices.data(), records);
          broad_phase.enumerate(TrianglePairs::HIERARCHY, *this);
        });
    for (int k = 0; k < 2; ++k) {
      linear[k].resize(all[k].size());
      linear[k].resize(filterPairs(PaperFilter::LINEAR, static_cast<PairKind>(k), records, vertices.data(),
                                   all[k].data(), all[k].size(), linear[k].data()));
      shuffled[k] = all[k];
      std::shuffle(shuffled[k].begin(), shuffled[k].end(), std::mt19937(1));
    }
  }
  void take(PairKind kind, Quad* pairs, std::size_t count) override {
    std::vector<Quad>& to = all[static_cast<std::size_t>(kind)];
    to.insert(to.end(), pairs, pairs + count);
  }
  static const Candidates& get() {
    static const Candidates candidates;
    return candidates;
  }
  std::vector<VertexMotion> vertices;
  PaperRecords records;
  std::vector<Quad> all[2], shuffled[2], linear[2];
};

enum Input { IN_ORDER, SHUFFLED, AFTER_LINEAR };

const std::vector<Quad>& pairsOf(Input input, PairKind kind) {
  const Candidates& c = Candidates::get();
  const std::size_t k = static_cast<std::size_t>(kind);
  return input == IN_ORDER ? c.all[k] : input == SHUFFLED ? c.shuffled[k] : c.linear[k];
}

void report(benchmark::State& state, std::size_t pairs, std::size_t kept) {
  state.counters["ns_per_pair"] = benchmark::Counter(
      static_cast<double>(pairs) * 1e-9, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.counters["culled_percent"] = pairs ? 100.0 * static_cast<double>(pairs - kept) / static_cast<double>(pairs) : 0;
}

void runFilter(benchmark::State& state, PaperFilter filter, Input input, PairKind kind) {
  const Candidates& c = Candidates::get();
  const std::vector<Quad>& pairs = pairsOf(input, kind);
  std::vector<Quad> kept(pairs.size());
  std::size_t n = 0;
  for (auto _ : state) {
    n = filterPairs(filter, kind, c.records, c.vertices.data(), pairs.data(), pairs.size(), kept.data());
    benchmark::DoNotOptimize(n);
  }
  report(state, pairs.size(), n);
}

void runFused(benchmark::State& state, PairKind kind) {
  const Candidates& c = Candidates::get();
  const std::vector<Quad>& pairs = pairsOf(AFTER_LINEAR, kind);
  std::vector<std::uint32_t> kept(pairs.size());
  std::size_t n = 0;
  for (auto _ : state) {
    n = simd::fusedFilter(c.vertices.data()->t0, pairs.data()->data(), pairs.size(), kind == PairKind::EDGE_EDGE,
                          simd::FusedPlanes::ALL, kept.data());
    benchmark::DoNotOptimize(n);
  }
  report(state, pairs.size(), n);
}

void runRecords(benchmark::State& state) {
  const Candidates& c = Candidates::get();
  PaperRecords records;
  for (auto _ : state) records.build(c.vertices.data(), c.vertices.size());
  state.counters["ns_per_vertex"] =
      benchmark::Counter(static_cast<double>(c.vertices.size()) * 1e-9,
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void registerAll() {
  constexpr const char* INPUT_NAMES[] = {"in_order", "shuffled", "after_linear"};
  for (PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    const std::string suffix = kind == PairKind::VERTEX_FACE ? "/vf" : "/ee";
    for (int f = 0; f < static_cast<int>(PaperFilter::COUNT); ++f) {
      const auto filter = static_cast<PaperFilter>(f);
      const bool planar = filter == PaperFilter::PLANAR_PAPER || filter == PaperFilter::PLANAR_BRANCH_FREE;
      for (Input input : {IN_ORDER, SHUFFLED, AFTER_LINEAR}) {
        if (planar != (input == AFTER_LINEAR)) continue;  // the planar filter never sees other candidates
        benchmark::RegisterBenchmark((std::string(toString(filter)) + '/' + INPUT_NAMES[input] + suffix).c_str(),
                                     [=](benchmark::State& s) { runFilter(s, filter, input, kind); });
      }
    }
    benchmark::RegisterBenchmark(("fused/after_linear" + suffix).c_str(),
                                 [=](benchmark::State& s) { runFused(s, kind); });
  }
  benchmark::RegisterBenchmark("records", runRecords);
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  dccd::benchmarks::registerAll();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
