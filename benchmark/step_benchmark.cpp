// step_benchmark: what a whole, proved answer costs, with start state and patches as in the node, against its parts and
// on one thread against two. The settings of a step run in turns, until the ratios are known; no time is written of a
// step whose contacts are not those of the truth, or that is not proved.
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "dccd/detect.h"
#include "dccd/monitor_extras.h"
#include "paper/known_contacts.h"
#include "support/data.h"
#include "support/scene_data.h"
#include "support/structured_pairs.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

constexpr std::size_t LEAST_ROUNDS = 9;
constexpr double NARROW = 0.02;  // the interval of a ratio is narrow enough within this of its median
constexpr int CELLS = 59;        // quads along a side of the sheets
constexpr const char *WHOLE = "whole", *WITHOUT_PATCHES = "without patches";
constexpr const char* REFERENCE = "crossing at t = 1/2";  // of the sheets

/// Of this process until now, without those that read a file.
double pageFaults() {
  rusage use{};
  getrusage(RUSAGE_SELF, &use);
  return static_cast<double>(use.ru_minflt);
}

/// One step, or two to and fro that take turns, each beginning where the other ends.
struct Case {
  std::string name;
  std::vector<Step> steps;
  const KnownContacts* truth = nullptr;  ///< of the first step; null: what the settings find must be the same
  bool stream() const { return steps.size() > 1; }
};

struct Setting {
  std::string name;
  Options options;
  History history;
  Outcome outcome;
  std::map<std::string, std::vector<double>> ms;  // by stage, a value a round
  std::vector<double> faults;                     // of pages, a value a round

  /// Every setting sees the same steps, and one step alone knows nothing of the one before.
  void run(const Case& of, std::size_t round) {
    if (!of.stream()) history.clear();
    const double faults_before = pageFaults();
    const Stopwatch watch;
    outcome = detect(of.steps[round % of.steps.size()], options, history);
    const double total_ms = watch.milliseconds();
    faults.push_back(pageFaults() - faults_before);
    for (std::size_t s = 0; s < outcome.stats.stages.size(); ++s) {
      ms[toString(static_cast<Stage>(s))].push_back(outcome.stats.stages[s].ms);
    }
    ms["patches"].push_back(outcome.stats[Effect::PATCHES].ms);
    ms["total"].push_back(total_ms);
  }
};

/// The whole is the first, contacts alone the second.
std::vector<Setting> settingsFor(const Case& of, int threads) {
  std::vector<Setting> settings;
  const auto add = [&](const std::string& name, const std::function<void(Options&)>& change) {
    Setting& setting = settings.emplace_back();
    setting.name = name;
    setting.options.num_threads = threads;
    setting.options.patches = true;
    setting.options.keep_bounds = of.stream();
    change(setting.options);
  };
  add(WHOLE, [](Options&) {});
  add("contacts alone", [](Options& o) { o.patches = o.check_start_state = false; });
  add(WITHOUT_PATCHES, [](Options& o) { o.patches = false; });
  add("first contact only", [](Options& o) {
    o.earliest_only = true;
    o.patches = false;  // as in the node
  });
  if (threads > 1) add("on one thread", [](Options& o) { o.num_threads = 1; });
  return settings;
}

MedianInterval ratioOf(const Setting& one, const Setting& to) {
  std::vector<double> ratios = one.ms.at("total");
  for (std::size_t i = 0; i < ratios.size(); ++i) ratios[i] /= to.ms.at("total")[i];
  return medianOf(std::move(ratios));
}

nlohmann::json toJson(const MedianInterval& interval) {
  return {{"low", interval.low}, {"median", interval.median}, {"high", interval.high}};
}

void fail(const Case& of, const Setting& setting, const std::string& what) {
  throw std::runtime_error(of.name + ", " + setting.name + ": " + what);
}

/// earliest: of those that all settings but the first contact's have found.
void check(const Case& of, const Setting& setting, const Setting& whole) {
  const Outcome& outcome = setting.outcome;
  if (setting.options.check_start_state && !assuranceOf(outcome).proved) fail(of, setting, "not proved");
  if (setting.options.earliest_only) {
    if (outcome.earliest_toc != whole.outcome.earliest_toc) fail(of, setting, "what is found alone is not found first");
    return;
  }
  if (outcome.contacts.size() != whole.outcome.contacts.size()) fail(of, setting, "contacts differ");
  if (!of.truth) return;
  const AccuracyErrors errors = errorsOf(outcome, *of.truth, *of.truth);
  if (errors.missed + errors.false_contacts > 0) fail(of, setting, "contacts are wrong");
}

nlohmann::json measure(const Case& of, int threads, std::size_t most) {
  std::vector<Setting> settings = settingsFor(of, threads);
  const Setting& whole = settings[0];
  for (std::size_t round = 0; round < most + 2; ++round) {
    for (std::size_t i = 0; i < settings.size(); ++i) settings[(round + i) % settings.size()].run(of, round);
    if (round == 0) {
      for (const Setting& setting : settings) check(of, setting, whole);
    }
    if (round == 1) {  // what is made once for the mesh is in neither
      for (Setting& setting : settings) setting.ms.clear(), setting.faults.clear();
    }
    if (round < LEAST_ROUNDS + 1) continue;
    const bool narrow = std::all_of(settings.begin() + 1, settings.end(), [&](const Setting& setting) {
      const MedianInterval ratio = ratioOf(whole, setting);
      return ratio.high <= ratio.median * (1 + NARROW) && ratio.low >= ratio.median * (1 - NARROW);
    });
    if (narrow) break;
  }
  nlohmann::json j{{"case", of.name},
                   {"threads", threads},
                   {"simd_target", simdTarget()},
                   {"contacts", whole.outcome.contacts.size()},
                   {"crossings", whole.outcome.intersections.size()},
                   {"rounds", whole.ms.at("total").size()},
                   {"calibration_ms", calibrationMs()}};
  for (const Setting& setting : settings) {
    nlohmann::json& row = j["settings"][setting.name];
    for (const auto& [stage, ms] : setting.ms) row["ms"][stage] = spread(ms);
    row["contacts"] = setting.outcome.contacts.size();
    row["page_faults"] = spread(setting.faults);
    if (&setting != &whole) row["whole_to_it"] = toJson(ratioOf(whole, setting));
    if (&setting != &whole) row["it_to_whole"] = toJson(ratioOf(setting, whole));
    if (setting.name == WITHOUT_PATCHES) row["to_contacts_alone"] = toJson(ratioOf(setting, settings[1]));
  }
  return j;
}

/// The step of a real scene, and the same to and fro.
std::vector<Case> realCases(const std::string& name, KnownContacts& truth) {
  const std::string folder = test::dataDir() + "/scenes/" + name;
  const test::PlyMesh begin = test::readPly(folder + "/frame_0.ply"), end = test::readPly(folder + "/frame_1.ply");
  Step step;
  step.bodies.resize(1);
  step.bodies[0].name = name;
  step.bodies[0].topology = share(Topology::fromTriangles(begin.vertices.size(), begin.faces));
  step.bodies[0].t0 = share(begin.vertices);
  step.bodies[0].t1 = share(end.vertices);
  Step back = step;
  std::swap(back.bodies[0].t0, back.bodies[0].t1);
  Outcome known;  // as far as KnownContacts reads it
  const test::SceneData data = test::readScene(name);
  const auto add = [&](PairKind kind, const std::vector<test::TruthPair>& pairs) {
    for (const test::TruthPair& pair : pairs) {
      if (!pair.contact) continue;
      Contact contact;
      contact.kind = kind;
      contact.vertex = pair.pair;
      known.contacts.push_back(contact);
    }
  };
  add(PairKind::VERTEX_FACE, data.vertex_face);
  add(PairKind::EDGE_EDGE, data.edge_edge);
  truth = KnownContacts::fromOutcome(known);
  return {{name, {step}, &truth}, {name + ", to and fro in a stream", {step, back}, nullptr}};
}

Case sheetsCase(const test::StructuredPairs& set) {
  const std::size_t n = CELLS + 1;
  const Topology grid = Topology::grid(n, n);
  Step step;
  step.bodies.resize(2);
  for (std::size_t b = 0; b < 2; ++b) {
    Body& body = step.bodies[b];
    body.name = b == 0 ? "one" : "other";
    body.topology = share(grid);
    Positions t0, t1;
    for (std::size_t v = b * n * n; v < (b + 1) * n * n; ++v) {
      t0.emplace_back(set.vertices[v].t0[0], set.vertices[v].t0[1], set.vertices[v].t0[2]);
      t1.emplace_back(set.vertices[v].t1[0], set.vertices[v].t1[1], set.vertices[v].t1[2]);
    }
    body.t0 = share(t0);
    body.t1 = share(t1);
  }
  return {set.family, {step}, nullptr};
}

/// Two sheets of CELLS x CELLS quads, of each family of ordinary structured input: whole steps in turns.
nlohmann::json measureSheets(int threads, std::size_t most) {
  std::vector<Case> cases;
  std::vector<Setting> whole;  // of each
  for (const test::StructuredPairs& set : test::structuredSheets(CELLS)) {
    cases.push_back(sheetsCase(set));
    whole.push_back(std::move(settingsFor(cases.back(), threads)[0]));
  }
  const std::size_t rounds = std::max(LEAST_ROUNDS, most / 3);
  for (std::size_t round = 0; round < rounds + 1; ++round) {
    for (std::size_t i = 0; i < cases.size(); ++i) {
      const std::size_t next = (round + i) % cases.size();
      whole[next].run(cases[next], round);
      if (!assuranceOf(whole[next].outcome).proved) fail(cases[next], whole[next], "not proved");
      if (round == 0) whole[next].ms.clear();
    }
  }
  const auto reference = std::find_if(cases.begin(), cases.end(), [](const Case& c) { return c.name == REFERENCE; });
  if (reference == cases.end()) throw std::runtime_error(std::string(REFERENCE) + ": no such family");
  nlohmann::json rows = nlohmann::json::array();
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const std::size_t contacts = whole[i].outcome.contacts.size();
    nlohmann::json row{
        {"case", cases[i].name},
        {"threads", threads},
        {"contacts", contacts},
        {"crossings", whole[i].outcome.intersections.size()},
        {"rounds", rounds},
        {"to_reference", toJson(ratioOf(whole[i], whole[static_cast<std::size_t>(reference - cases.begin())]))}};
    for (const auto& [stage, ms] : whole[i].ms) row["ms"][stage] = spread(ms);
    rows.push_back(row);
  }
  return rows;
}

int run(int argc, char** argv) {
  CLI::App app{"The whole answer to a step against its parts, in turns"};
  std::string out, simd = "auto";
  std::vector<int> threads{1, 2};
  std::vector<std::string> scenes;
  std::size_t rounds = 60;
  bool with_sheets = false;
  app.add_option("--out", out, "JSON file")->required();
  app.add_option("--scenes", scenes, "real scenes: cloth-ball, n-body");
  app.add_flag("--sheets", with_sheets, "every family of two sheets as people and simulators make them");
  app.add_option("--threads", threads, "numbers of threads, each measured by itself")->check(CLI::PositiveNumber);
  app.add_option("--simd", simd, "SIMD target, or auto")->capture_default_str();
  app.add_option("--rounds", rounds, "at most")->check(CLI::PositiveNumber)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  setSimdTarget(simd);
  nlohmann::json result{{"machine", machine()}, {"runs", nlohmann::json::array()}};
  const auto runAll = [&](const std::vector<Case>& cases) {
    for (const Case& of : cases) {
      for (const int count : threads) {
        result["runs"].push_back(measure(of, count, rounds));
        std::cerr << result["runs"].back()["case"] << ' ' << count << " done\n";
      }
    }
  };
  for (const std::string& scene : scenes) {
    KnownContacts truth;
    runAll(realCases(scene, truth));
  }
  for (const int count : with_sheets ? threads : std::vector<int>()) {
    for (nlohmann::json& row : measureSheets(count, rounds)) result["sheets"].push_back(std::move(row));
  }
  std::ofstream file(out);
  file << result.dump(1) << '\n';
  if (!file) throw std::runtime_error(out + ": cannot be written");
  return 0;
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  try {
    return dccd::benchmarks::run(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << "step_benchmark: " << e.what() << '\n';
    return 1;
  }
}
