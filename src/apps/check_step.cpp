// check_step FRAME_0 FRAME_1: the contacts of one step between two mesh files of the same topology. Ends with 0 when
// what it says is proved (contacts or none), with 3 when it is not, with 1 on an error.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "dccd/detect.h"
#include "dccd/simd_target.h"
#include "input/mesh_file.h"

namespace {

using namespace dccd;

constexpr int NOT_PROVED = 3;  // CLI11 and this program's own errors have others

struct Arguments {
  std::string frame_0, frame_1, contacts, stats;
  std::string accuracy = "exact", broad_phase = "clustered", simd = "auto";
  double tolerance_m = 1e-6, budget_ms = 0;
  int toc_bits = 32, threads = 1, repeat = 1;
  bool no_start_state = false, earliest_only = false;
};

Arguments parse(int argc, char** argv, CLI::App& app) {
  Arguments a;
  app.add_option("FRAME_0", a.frame_0, "mesh at t=0 (.ply, .obj)")->required();
  app.add_option("FRAME_1", a.frame_1, "mesh at t=1, same faces")->required();
  app.add_option("--contacts", a.contacts, "write the contacts as CSV");
  app.add_option("--stats", a.stats, "write pairs and milliseconds per stage as JSON");
  app.add_option("--accuracy", a.accuracy, "screen, fast, conservative or exact; all: one after the other, as a table")
      ->capture_default_str();
  app.add_option("--tolerance", a.tolerance_m, "of conservative [m]")->capture_default_str();
  app.add_option("--toc-bits", a.toc_bits, "of exact: the TOC's cell is 2^-bits of the step, 10 to 52")
      ->capture_default_str();
  app.add_option("--broad-phase", a.broad_phase, "clustered or brute_force")
      ->check(CLI::IsMember({"clustered", "brute_force"}))
      ->capture_default_str();
  app.add_option("--budget", a.budget_ms, "step budget [ms], 0: none")->capture_default_str();
  app.add_option("--threads", a.threads, "worker threads")->capture_default_str();
  app.add_option("--repeat", a.repeat, "run the step this often for the times")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--simd", a.simd, "SIMD target, or auto")->capture_default_str();
  app.add_flag("--no-start-state", a.no_start_state, "leave out whether surfaces cross at t=0: then nothing is proved");
  app.add_flag("--earliest-only", a.earliest_only, "only the first contacts");
  app.parse(argc, argv);
  return a;
}

void writeContacts(const std::string& path, const Outcome& result) {
  std::ofstream out(path);
  out << "kind,v0,v1,v2,v3,toc_lower,toc_upper,certainty\n" << std::setprecision(17);
  // Rows sorted as integers: kind VF before EE, then the vertices. The detector's order is that already.
  for (const Contact& c : result.contacts) {
    out << (c.kind == PairKind::VERTEX_FACE ? "VF" : "EE");
    for (Index v : c.vertex) out << ',' << v;
    out << ',' << c.toc_lower << ',' << c.toc_upper << ','
        << (c.certainty == Certainty::CERTAIN ? "certain" : "undecided") << '\n';
  }
  if (!out) throw std::runtime_error(path + ": cannot be written");
}

struct Times {
  std::vector<double> ms;
  double best() const { return *std::min_element(ms.begin(), ms.end()); }
  double median() const {
    std::vector<double> sorted = ms;
    std::sort(sorted.begin(), sorted.end());
    return sorted[sorted.size() / 2];
  }
  nlohmann::json json() const { return {{"best", best()}, {"median", median()}}; }
};

struct Run {
  Outcome result;
  std::map<std::string, Times> times;
};

Run runStep(const Arguments& a, const std::string& accuracy, const std::shared_ptr<const Topology>& topology,
            const Positions& t0, const Positions& t1) {
  Options options;
  options.keep_bounds = false;  // the same step again and again
  options.accuracy.rung = accuracyFromString(accuracy.c_str());
  options.accuracy.tolerance_m = a.tolerance_m;
  options.accuracy.toc_bits = a.toc_bits;
  options.num_threads = a.threads;
  options.step_budget_ms = a.budget_ms;
  options.earliest_only = a.earliest_only;
  options.check_start_state = !a.no_start_state;
  options.broad_phase = a.broad_phase == "clustered" ? BroadPhase::CLUSTERED : BroadPhase::BRUTE_FORCE;
  Step step;
  step.bodies.resize(1);
  step.bodies[0].name = a.frame_0;
  step.bodies[0].topology = topology;
  step.bodies[0].t0 = share(t0);
  step.bodies[0].t1 = share(t1);
  History history;
  Run run;
  for (int i = 0; i < a.repeat; ++i) {
    run.result = detect(step, options, history);
    const StepStats& stats = run.result.stats;
    for (std::size_t s = 0; s < stats.stages.size(); ++s) {
      run.times[toString(static_cast<Stage>(s))].ms.push_back(stats.stages[s].ms);
    }
    run.times["total"].ms.push_back(stats.total_ms);
  }
  return run;
}

nlohmann::json statsJson(const Arguments& a, const std::string& accuracy, const Run& run) {
  nlohmann::json j;
  for (std::size_t s = 0; s < run.result.stats.stages.size(); ++s) {
    const StageStats& stage = run.result.stats.stages[s];
    j["pairs"][toString(static_cast<Stage>(s))] = {{"in", stage.in}, {"out", stage.out}};
  }
  for (const auto& [name, times] : run.times) j["ms"][name] = times.json();
  for (std::size_t t = 0; t < run.result.stats.tiers.settled.size(); ++t) {
    j["tiers"][toString(static_cast<Tier>(t))] = run.result.stats.tiers.settled[t];
  }
  j["threads"] = a.threads;
  j["simd_target"] = simdTarget();
  j["accuracy"] = accuracy;
  j["contacts"] = run.result.contacts.size();
  j["undecided"] = run.result.stats.undecided;
  j["unchecked_vertices"] = run.result.stats.unchecked_vertices;
  const Assurance assurance = assuranceOf(run.result);
  j["proved"] = assurance.proved;
  j["missing"] = assurance.missing;
  j["touching"] = toString(assurance.touching);
  j["complete"] = run.result.allPairs();
  j["start_state"] = toString(run.result.start_state);
  j["start_state_complete"] = run.result.start_state_complete;
  if (!run.result.allPairs()) j["unchecked_toc_lower"] = run.result.unchecked_toc_lower;
  return j;
}

void print(const std::string& accuracy, const Run& run, bool header) {
  if (header) {
    std::cout << std::left << std::setw(14) << "accuracy" << std::right << std::setw(10) << "contacts" << std::setw(11)
              << "undecided" << std::setw(14) << "earliest toc" << std::setw(11) << "best ms" << std::setw(11)
              << "median ms" << '\n';
  }
  const double earliest = run.result.earliest_toc;
  std::cout << std::left << std::setw(14) << accuracy << std::right << std::setw(10) << run.result.contacts.size()
            << std::setw(11) << run.result.stats.undecided << std::setw(14);
  if (earliest <= 1)
    std::cout << earliest;
  else
    std::cout << "none";
  std::cout << std::fixed << std::setprecision(2) << std::setw(11) << run.times.at("total").best() << std::setw(11)
            << run.times.at("total").median() << std::defaultfloat << std::setprecision(6) << '\n';
}

int checkStep(const Arguments& a) {
  setSimdTarget(a.simd);
  const MeshFile m0 = loadMeshFile(a.frame_0), m1 = loadMeshFile(a.frame_1);
  if (m0.positions.size() != m1.positions.size() || m0.faces != m1.faces) {
    throw std::runtime_error(a.frame_1 + ": not the topology of " + a.frame_0 + " (" +
                             std::to_string(m1.positions.size()) + " vertices and " + std::to_string(m1.faces.size()) +
                             " faces, expected " + std::to_string(m0.positions.size()) + " and " +
                             std::to_string(m0.faces.size()) + ", the same ones)");
  }
  const auto topology = std::make_shared<const Topology>(Topology::fromTriangles(m0.positions.size(), m0.faces));
  const std::vector<std::string> rungs = a.accuracy == "all"
                                             ? std::vector<std::string>{"screen", "fast", "conservative", "exact"}
                                             : std::vector<std::string>{a.accuracy};
  nlohmann::json all;
  std::string words;
  bool proved = false;
  for (std::size_t i = 0; i < rungs.size(); ++i) {
    const Run run = runStep(a, rungs[i], topology, m0.positions, m1.positions);
    print(rungs[i], run, i == 0);
    const Assurance assurance = assuranceOf(run.result);
    proved = assurance.proved;  // of several rungs the last and most accurate one's
    words += rungs[i] + ": " + describe(assurance) + '\n';
    const nlohmann::json j = statsJson(a, rungs[i], run);
    if (rungs.size() == 1)
      all = j;
    else
      all[rungs[i]] = j;
    // With all rungs the file holds the last and most accurate one's.
    if (!a.contacts.empty() && i + 1 == rungs.size()) writeContacts(a.contacts, run.result);
  }
  std::cout << words;
  if (!a.stats.empty()) {
    std::ofstream out(a.stats);
    out << all.dump(2) << '\n';
    if (!out) throw std::runtime_error(a.stats + ": cannot be written");
  }
  return proved ? 0 : NOT_PROVED;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Contacts of one step between two meshes of the same topology"};
  app.footer("Exit status: 0 when the answer is proved, with contacts or without; 3 when it is not; 1 on an error.");
  try {
    return checkStep(parse(argc, argv, app));
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 1;
  } catch (const std::exception& e) {
    std::cerr << "check_step: " << e.what() << '\n';
    return 1;
  }
}
