// Measures the paper's combinations of filters on one scene and writes JSON; scripts/benchmark makes the tables of it.
// The candidate set: all feature pairs, each once, of pairs of triangles with overlapping swept DOPs, but those that
// share a vertex. Every filter is checked against known contacts before a time is written.
#include <CLI/CLI.hpp>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "paper/benchmark/pipelines.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

struct Arguments {
  SceneRequest scene;
  std::string bounds = "dop18";
  std::vector<std::size_t> fractions{1};
  std::size_t repeat = 1;
  std::size_t elementary_every = 1;
  std::string out;
};

/// All that was measured with steps of one length.
struct Measurement {
  std::size_t fraction = 1;
  std::size_t steps = 0;
  std::uint64_t candidates = 0, true_contacts = 0, checked = 0;
  double enumeration_ms = 0;
  std::vector<std::vector<PipelineCount>> runs;  // one per repetition: sums over the steps
};

void add(std::vector<PipelineCount>& sum, const std::vector<PipelineCount>& counts) {
  if (sum.empty()) {
    sum = counts;
    return;
  }
  for (std::size_t p = 0; p < sum.size(); ++p) {
    for (std::size_t f = 0; f < sum[p].filters.size(); ++f) {
      sum[p].filters[f].in += counts[p].filters[f].in;
      sum[p].filters[f].out += counts[p].filters[f].out;
      sum[p].filters[f].seconds += counts[p].filters[f].seconds;
    }
    sum[p].survivors += counts[p].survivors;
    sum[p].tested += counts[p].tested;
    sum[p].called_colliding += counts[p].called_colliding;
    sum[p].test_seconds += counts[p].test_seconds;
  }
}

nlohmann::json toJson(const Measurement& m) {
  nlohmann::json out{{"fraction", m.fraction},
                     {"steps", m.steps},
                     {"candidates", m.candidates},
                     {"true_contacts", m.true_contacts},
                     {"contacts_checked", m.checked}};
  const double per_step = 1e3 / static_cast<double>(m.steps);  // seconds in all to milliseconds a step
  for (std::size_t p = 0; p < pipelines().size(); ++p) {
    const Pipeline& pipeline = pipelines()[p];
    const auto over_runs = [&](const auto& value) {
      std::vector<double> values;
      for (const auto& run : m.runs) values.push_back(per_step * value(run[p]));
      return spread(values);
    };
    const PipelineCount& last = m.runs.back()[p];
    nlohmann::json filters = nlohmann::json::array();
    for (std::size_t f = 0; f < pipeline.filters.size(); ++f) {
      filters.push_back({{"name", pipeline.filters[f].name()},
                         {"in", last.filters[f].in},
                         {"out", last.filters[f].out},
                         {"ms", over_runs([f](const PipelineCount& c) { return c.filters[f].seconds; })}});
    }
    out["pipelines"][pipeline.name] = {
        {"filters", filters},
        {"survivors", last.survivors},
        {"tested", last.tested},
        {"called_colliding", last.called_colliding},
        {"elementary_ms", over_runs([](const PipelineCount& c) { return c.elementarySeconds(); })},
        {"total_ms", over_runs([](const PipelineCount& c) { return c.seconds(); })}};
  }
  return out;
}

class SceneBenchmark {
 public:
  explicit SceneBenchmark(const Arguments& arguments) : arguments_(arguments) {
    for (std::size_t n : arguments.fractions) {
      measurements_.emplace_back();
      measurements_.back().fraction = n;
      measurements_.back().runs.resize(arguments.repeat);
    }
  }

  void run() {
    forEachStep(
        arguments_.scene,
        [this](const SceneBodies& scene, const Step& step) {
          triangles_ = scene.triangle_count;
          broad_phase_.setBodies(scene.bodies, step.vertices.data());
          cones_.setBodies(scene, step);
        },
        [this](const Step& step) {
          for (Measurement& m : measurements_) {
            for (std::size_t k = 0; k < m.fraction; ++k) measure(subStep(step, k, m.fraction), m);
          }
          std::cerr << '.' << std::flush;
        });
    std::cerr << '\n';
  }

  nlohmann::json result() const {
    nlohmann::json out{{"scene", arguments_.scene.name},
                       {"self", arguments_.scene.self},
                       {"bounds", arguments_.bounds},
                       {"triangles", triangles_},
                       {"elementary_every", arguments_.elementary_every},
                       {"machine", machine()}};
    for (const Measurement& m : measurements_) out["measurements"].push_back(toJson(m));
    return out;
  }

 private:
  void measure(const Step& step, Measurement& m) {
    records_.build(step.vertices.data(), step.vertices.size());
    cones_.certify(step);
    const SweptBounds bounds = arguments_.bounds == "dop16" ? SweptBounds::DOP16 : SweptBounds::DOP18;
    broad_phase_.refit(step.vertices.data(), records_, nullptr, 0, bounds);
    for (std::size_t r = 0; r < arguments_.repeat; ++r) {
      PipelineRunner runner(step, records_, cones_, arguments_.elementary_every);
      broad_phase_.enumerate(TrianglePairs::HIERARCHY, runner);
      runner.finish();
      add(m.runs[r], runner.counts());
      if (r > 0) continue;
      m.candidates += runner.candidates();
      check(step, runner, m);
    }
    ++m.steps;
  }

  /// Against the truth where there is one, else against the exact test on a sample of what the linear filter keeps.
  void check(const Step& step, const PipelineRunner& runner, Measurement& m) {
    std::vector<Quad> contacts[2];
    for (PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
      const std::size_t k = static_cast<std::size_t>(kind);
      contacts[k] = step.has_truth ? step.true_contacts[k] : exactContacts(step, kind, runner.sample(kind));
      if (step.has_truth) m.true_contacts += contacts[k].size();
    }
    const std::string lost = lostContacts(step, records_, cones_, contacts, m.checked);
    if (!lost.empty()) throw std::runtime_error("frame " + std::to_string(step.frame) + ": " + lost);
  }

  Arguments arguments_;
  std::vector<Measurement> measurements_;
  TriangleCandidates broad_phase_;
  NormalCones cones_;
  PaperRecords records_;
  std::size_t triangles_ = 0;
};

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  using namespace dccd::benchmarks;
  Arguments a;
  CLI::App app("Measures the paper's combinations of filters on one scene.");
  app.add_option("scene", a.scene.name, "cloth-ball, n-body (real); clothball, nbody, clothbone, dragon, lion")
      ->required();
  app.add_option("--out", a.out, "JSON file to write")->required();
  app.add_option("--self", a.scene.self, "pairs within a body, too (default true)");
  app.add_option("--bounds", a.bounds, "bounds of triangles")->check(CLI::IsMember({"dop16", "dop18"}));
  app.add_option("--steps", a.scene.steps, "steps of a generated sequence, spread over it; 0: all (default 16)");
  app.add_option("--first-frame", a.scene.first_frame, "of a generated sequence");
  app.add_option("--triangles", a.scene.options.triangles, "of a generated scene; 0: the paper's number");
  app.add_option("--seed", a.scene.options.seed, "of a generated scene");
  app.add_option("--fractions", a.fractions, "parts that each step is cut into")
      ->delimiter(',')
      ->check(CLI::PositiveNumber);
  app.add_option("--repeat", a.repeat, "repetitions of each step")->check(CLI::PositiveNumber);
  app.add_option("--elementary-every", a.elementary_every, "time the elementary test on every n-th chunk; 0: never");
  CLI11_PARSE(app, argc, argv);
  try {
    SceneBenchmark benchmark(a);
    benchmark.run();
    std::ofstream(a.out) << benchmark.result().dump(1) << '\n';
  } catch (const std::exception& e) {
    std::cerr << "paper_benchmark: " << e.what() << '\n';
    return 1;
  }
  return 0;
}
