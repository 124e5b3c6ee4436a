// step_settings FRAME_0 FRAME_1: one step of a mesh with each setting of the accuracy ladder in turns, until the ratio
// of each one's time to the usual setting's is known; and what each gets wrong against the truth.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "dccd/detect.h"
#include "paper/known_contacts.h"
#include "support/scene_data.h"

namespace dccd {
namespace {

constexpr std::size_t LEAST_ROUNDS = 8;
constexpr double NARROW = 0.02;  // the interval of a ratio is narrow enough within this of its median
constexpr const char* USUAL = "exact 2^-32";

struct Setting {
  std::string name;
  Options options;
  History history;
  Outcome outcome;
  std::map<std::string, std::vector<double>> ms;  // by stage, a value a round

  void run(const Step& step) {
    outcome = detect(step, options, history);
    for (std::size_t s = 0; s < outcome.stats.stages.size(); ++s) {
      ms[toString(static_cast<Stage>(s))].push_back(outcome.stats.stages[s].ms);
    }
    ms["total"].push_back(outcome.stats.total_ms);
  }
};

/// The last is the finest. Surfaces that cross at the start are no matter of accuracy and not looked for.
std::vector<Setting> allSettings() {
  std::vector<Setting> settings;
  const auto add = [&](const std::string& name) -> AccuracyOptions& {
    settings.emplace_back();
    settings.back().name = name;
    settings.back().options.check_start_state = settings.back().options.keep_bounds = false;
    return settings.back().options.accuracy;
  };
  for (const char* tolerance : {"1e-3", "1e-6", "1e-9"}) {
    AccuracyOptions& accuracy = add(std::string("conservative ") + tolerance);
    accuracy.rung = Accuracy::CONSERVATIVE;
    accuracy.tolerance_m = std::stod(tolerance);
  }
  for (const int bits : {10, 32, 52}) add("exact 2^-" + std::to_string(bits)).toc_bits = bits;
  return settings;
}

/// Times of the same rounds, divided: what slows the machine down slows both.
MedianInterval ratioOf(const Setting& setting, const Setting& to) {
  std::vector<double> ratios = setting.ms.at("total");
  for (std::size_t i = 0; i < ratios.size(); ++i) ratios[i] /= to.ms.at("total")[i];
  return medianOf(std::move(ratios));
}

/// Each round begins with another setting.
void runInTurns(const Step& step, std::size_t most, std::vector<Setting>& settings, const Setting& usual) {
  for (std::size_t round = 0; round < most; ++round) {
    for (std::size_t i = 0; i < settings.size(); ++i) settings[(round + i) % settings.size()].run(step);
    const bool narrow = std::all_of(settings.begin(), settings.end(), [&](const Setting& setting) {
      const MedianInterval ratio = ratioOf(setting, usual);
      return ratio.high <= ratio.median * (1 + NARROW) && ratio.low >= ratio.median * (1 - NARROW);
    });
    if (round + 1 >= LEAST_ROUNDS && narrow) break;
  }
}

nlohmann::json resultOf(const Setting& setting, const Setting& usual, const AccuracyErrors& errors) {
  const MedianInterval ratio = ratioOf(setting, usual);
  nlohmann::json j = {
      {"contacts", setting.outcome.contacts.size()},
      {"missed", errors.missed},
      {"false", errors.false_contacts},
      {"undecided", errors.undecided},
      {"toc_error", errors.toc_error},
      {"rounds", setting.ms.at("total").size()},
      {"ratio", {{"to", usual.name}, {"low", ratio.low}, {"median", ratio.median}, {"high", ratio.high}}}};
  for (const auto& [stage, ms] : setting.ms) {
    j["ms"][stage] = {{"best", *std::min_element(ms.begin(), ms.end())}, {"median", medianOf(ms).median}};
  }
  return j;
}

int run(int argc, char** argv) {
  CLI::App app{"One step with each setting of the accuracy ladder: times in turns, and what is wrong"};
  std::vector<std::string> frames;
  std::string truth_file, stats_file;
  std::size_t rounds = 60;
  app.add_option("FRAME", frames, "two frames of a mesh (.ply)")->required()->expected(2);
  app.add_option("--truth", truth_file, "the contacts that there are, 'VF|EE v0 v1 v2 v3 [toc]' a line")->required();
  app.add_option("--stats", stats_file, "results as JSON")->required();
  app.add_option("--rounds", rounds, "at most")->check(CLI::PositiveNumber)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const test::PlyMesh begin = test::readPly(frames[0]), end = test::readPly(frames[1]);
  Step step;
  step.bodies.resize(1);
  step.bodies[0].name = frames[0];
  step.bodies[0].topology = share(Topology::fromTriangles(begin.vertices.size(), begin.faces));
  step.bodies[0].t0 = share(begin.vertices);
  step.bodies[0].t1 = share(end.vertices);
  std::vector<Setting> settings = allSettings();
  const Setting& usual = *std::find_if(settings.begin(), settings.end(), [](const auto& s) { return s.name == USUAL; });
  runInTurns(step, rounds, settings, usual);
  const KnownContacts truth = KnownContacts::fromFile(truth_file);
  const KnownContacts finest = KnownContacts::fromOutcome(settings.back().outcome);
  nlohmann::json all;
  for (const Setting& setting : settings) {
    const AccuracyErrors errors = errorsOf(setting.outcome, truth, finest);
    all[setting.name] = resultOf(setting, usual, errors);
    std::cout << '\n' << setting.name << ": " << all[setting.name].dump();
  }
  std::cout << '\n';
  std::ofstream out(stats_file);
  out << all.dump(2) << '\n';
  if (!out) throw std::runtime_error(stats_file + ": cannot be written");
  return 0;
}

}  // namespace
}  // namespace dccd

int main(int argc, char** argv) {
  try {
    return dccd::run(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << "step_settings: " << e.what() << '\n';
    return 1;
  }
}
