// Laws that slow an arm down, in the same simulated loop: the cloth that it carries touches nothing, and it is fast.
// Each runs with an arm that goes on steadily, whose speed counts, and with one that creeps, rests and sets off again.
// Of the fixed threshold, of Servo's law and of the formula for speed and separation those numbers are taken that are
// the fastest among those without a contact in either.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>
#include <future>
#include <iostream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "dccd/monitor_extras.h"
#include "support/closed_loop.h"
#include "support/path_loop.h"

namespace dccd {
namespace benchmarks {
namespace {

using test::ArmManner;
using test::ClosedLoop;
using Law = std::function<double(const Outcome&)>;

constexpr double UNCERTAINTY_M = 0.025;  // Z of speed_scale: what gusts and the swinging cloth may take

struct Candidate {
  std::string law, numbers;
  Law scale;
};

double clamped(double scale) { return std::min(1.0, std::max(0.0, scale)); }

/// Full speed beyond the one distance, creeping within, and no speed within the other.
Candidate threshold(double at_m, double creep, double stop_m) {
  std::ostringstream numbers;
  numbers << "full speed beyond " << at_m << " m, " << creep << " of it beyond " << stop_m << " m";
  return {"fixed thresholds", numbers.str(), [=](const Outcome& o) {
            const double d = test::distanceToMap(o);
            return d > at_m ? 1 : d > stop_m ? creep : 0;
          }};
}

/// MoveIt Servo: exp(k (d - d0)) within d0, k such that it is 0.001 at 0.
Candidate servo(double d0_m) {
  std::ostringstream numbers;
  numbers << "d0 " << d0_m << " m";
  const double k = -std::log(0.001) / d0_m;
  return {"MoveIt Servo", numbers.str(),
          [=](const Outcome& o) { return clamped(std::exp(k * (test::distanceToMap(o) - d0_m))); }};
}

/// v = sqrt((a T)^2 + 2 a (d - C)) - a T.
Candidate speedAndSeparation(double latency_s, double c_m) {
  std::ostringstream numbers;
  numbers << "a " << ClosedLoop::BRAKING_M_S2 << " m/s^2, T " << latency_s << " s, C " << c_m << " m";
  const double a = ClosedLoop::BRAKING_M_S2, t = latency_s;
  return {"speed and separation", numbers.str(), [=](const Outcome& o) {
            const double under = a * t * a * t + 2 * a * (test::distanceToMap(o) - c_m);
            return under <= 0 ? 0 : clamped((std::sqrt(under) - a * t) / ClosedLoop::FULL_SPEED_M_S);
          }};
}

Candidate ours(double uncertainty_m) {
  const SpeedLaw law{ClosedLoop::REACTION_S, ClosedLoop::FULL_SPEED_M_S / (0.8 * ClosedLoop::BRAKING_M_S2),
                     uncertainty_m};
  std::ostringstream numbers;
  numbers << "T_r " << law.reaction_time_s << " s, T_s " << law.stopping_time_s << " s, Z " << law.uncertainty_m
          << " m";
  return {"speed_scale", numbers.str(),
          [=](const Outcome& o) { return speedScale(o, {{ClosedLoop::CLOTH_SPEED_M_S}}, law).scale; }};
}

/// The runs of a law: with each seed a steady arm, then with each one that restarts.
struct Runs {
  explicit Runs(std::size_t seeds) : speed_m_s(seeds) {}
  std::vector<double> speed_m_s;             // of the steady arm, by seed
  std::array<int, 2> contacts{}, arrived{};  // by manner
  double latency_s = 0, cloth_m_s = 0;       // the largest that were measured
  /// Number 0 to twice the seeds. False: with a contact.
  bool run(std::size_t number, const Law& law) {
    const std::size_t seeds = speed_m_s.size(), manner = number / seeds;
    const test::ClosedLoopRun one = test::runClosedLoop(1 + number % seeds, static_cast<ArmManner>(manner), law);
    if (manner == 0) speed_m_s[number] = one.mean_speed_m_s;
    contacts[manner] += one.contact;
    arrived[manner] += one.arrived;
    latency_s = std::max(latency_s, one.oldest_s);
    cloth_m_s = std::max(cloth_m_s, one.fastest_m_s);
    return !one.contact;
  }
  bool touches() const { return contacts[0] + contacts[1] > 0; }
};

Runs measure(const Candidate& candidate, std::size_t seeds) {
  Runs runs(seeds);
  for (std::size_t number = 0; number < 2 * seeds; ++number) runs.run(number, candidate.scale);
  return runs;
}

/// The mean, and to either side of it what holds its true value with 95 % [m/s].
std::array<double, 2> meanOf(const std::vector<double>& values) {
  const auto n = static_cast<double>(values.size());
  double mean = 0, squares = 0;
  for (const double v : values) mean += v / n;
  for (const double v : values) squares += (v - mean) * (v - mean);
  return {mean, n > 1 ? 1.96 * std::sqrt(squares / (n - 1) / n) : 0};
}

/// With how much slower it is than ours, seed by seed.
nlohmann::json row(const Candidate& candidate, const Runs& runs, const Runs& ours) {
  std::vector<double> less_m_s;
  for (std::size_t i = 0; i < runs.speed_m_s.size(); ++i) less_m_s.push_back(ours.speed_m_s[i] - runs.speed_m_s[i]);
  return {{"law", candidate.law},
          {"numbers", candidate.numbers},
          {"seeds", runs.speed_m_s.size()},
          {"contacts", runs.contacts},
          {"arrived", runs.arrived},
          {"mean_speed_m_s", meanOf(runs.speed_m_s)},
          {"ours_faster_by_m_s", meanOf(less_m_s)}};
}

/// Runs of laws one after another. Those in which a law touched come first, so that the next one that touches is soon
/// seen to.
class Search {
 public:
  explicit Search(std::size_t seeds) : order_(2 * seeds) { std::iota(order_.begin(), order_.end(), 0); }

  /// The first `count` runs, until one touches.
  Runs look(const Candidate& candidate, std::size_t count) {
    Runs runs(order_.size() / 2);
    for (std::size_t i = 0; i < std::min(count, order_.size()); ++i) {
      if (runs.run(order_[i], candidate.scale)) continue;
      const auto touching = order_.begin() + static_cast<std::ptrdiff_t>(i);
      std::rotate(order_.begin(), touching, touching + 1);
      break;
    }
    return runs;
  }
  Runs look(const Candidate& candidate) { return look(candidate, order_.size()); }

 private:
  std::vector<std::size_t> order_;
};

/// By their speeds over a few seeds, without those that touch there.
std::vector<Candidate> fastestFirst(const std::vector<Candidate>& candidates, std::size_t seeds) {
  constexpr std::size_t A_FEW = 10;
  Search search(seeds);
  std::vector<std::pair<double, const Candidate*>> by_speed;
  for (const Candidate& candidate : candidates) {
    const Runs few = search.look(candidate, A_FEW);
    if (few.touches()) continue;
    by_speed.emplace_back(-std::accumulate(few.speed_m_s.begin(), few.speed_m_s.end(), 0.0), &candidate);
  }
  std::stable_sort(by_speed.begin(), by_speed.end(), [](const auto& x, const auto& y) { return x.first < y.first; });
  std::vector<Candidate> sorted;
  for (const auto& [speed, candidate] : by_speed) sorted.push_back(*candidate);
  return sorted;
}

/// The first of them that has no contact in any run, and its runs.
std::optional<std::pair<Candidate, Runs>> firstWithout(const std::vector<Candidate>& candidates, std::size_t seeds) {
  Search search(seeds);
  for (const Candidate& candidate : candidates) {
    Runs whole = search.look(candidate);
    std::cerr << candidate.law + ", " + candidate.numbers + (whole.touches() ? ": a contact\n" : ": no contact\n");
    if (!whole.touches()) return std::pair(candidate, std::move(whole));
  }
  return std::nullopt;
}

/// A task that bounds alone do not let an arm do, with ~intended and without it.
nlohmann::json intendedRow(const std::string& task, const Vec3& way, double height_m, test::PathLoop::Cloth cloth,
                           std::size_t seeds) {
  nlohmann::json row{{"task", task}, {"seeds", seeds}};
  for (const bool with_path : {true, false}) {
    std::vector<double> speed_m_s, of_free;
    int contacts = 0, arrived = 0;
    for (std::size_t seed = 1; seed <= seeds; ++seed) {
      test::PathLoop loop(seed, way, height_m, cloth);
      const test::PathLoop::Run one = loop.run(with_path);
      speed_m_s.push_back(one.mean_m_s);
      of_free.push_back(one.mean_m_s / loop.freeSpeed());
      contacts += one.touched;
      arrived += one.arrived;
    }
    row[with_path ? "intended" : "bounds"] = {{"contacts", contacts},
                                              {"arrived", arrived},
                                              {"mean_speed_m_s", meanOf(speed_m_s)},
                                              {"share_of_free", meanOf(of_free)}};
  }
  return row;
}

nlohmann::json intendedRows(std::size_t seeds) {
  using Cloth = test::PathLoop::Cloth;
  return {intendedRow("retreat from a cloth that touches", {0.1, 0, 0.3}, 0, Cloth::LIES, seeds),
          intendedRow("along a table, 20 mm above it", {1, 0, 0}, 0.02, Cloth::NONE, seeds),
          intendedRow("laying a towel over an edge", test::PathLoop::LAYS, 0.06, Cloth::HANGS, seeds)};
}

int run(const std::string& out, std::size_t seeds, bool only_intended) {
  if (only_intended) {
    std::ofstream(out) << nlohmann::json{{"intended", intendedRows(seeds)}}.dump(1) << '\n';
    return 0;
  }
  std::vector<Candidate> thresholds, servos, formulas;
  for (const double at_m : {0.08, 0.1, 0.12, 0.15, 0.2, 0.25}) {
    for (const double creep : {0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5}) {
      for (const double stop_m : {0.01, 0.02, 0.03, 0.04}) thresholds.push_back(threshold(at_m, creep, stop_m));
    }
  }
  // Of these, as of the formulas, one with a larger number is slower at each distance.
  for (int i = 2; i <= 50; ++i) servos.push_back(servo(0.01 * i));
  auto threshold_found =
      std::async(std::launch::async, [&] { return firstWithout(fastestFirst(thresholds, seeds), seeds); });
  auto servo_found = std::async(std::launch::async, [&] { return firstWithout(servos, seeds); });
  const Candidate our_law = ours(UNCERTAINTY_M);
  const Runs our_runs = measure(our_law, seeds);
  std::cerr << our_law.law << ": contacts " << our_runs.contacts[0] << " and " << our_runs.contacts[1]
            << ", fastest point of the cloth " << our_runs.cloth_m_s << " m/s\n";
  for (int i = 0; i <= 24; ++i) formulas.push_back(speedAndSeparation(our_runs.latency_s, 0.0025 * i));
  nlohmann::json rows = {row(our_law, our_runs, our_runs)};
  const auto add = [&](const std::vector<Candidate>& tried, const std::optional<std::pair<Candidate, Runs>>& found) {
    rows.push_back(found ? row(found->first, found->second, our_runs) : nlohmann::json{{"law", tried.at(0).law}});
    rows.back()["tried"] = tried.size();
  };
  add(formulas, firstWithout(formulas, seeds));
  add(thresholds, threshold_found.get());
  add(servos, servo_found.get());
  std::ofstream(out) << nlohmann::json{{"seeds", seeds},
                                       {"latency_s", our_runs.latency_s},
                                       {"cloth_m_s", our_runs.cloth_m_s},
                                       {"rows", rows},
                                       {"intended", intendedRows(seeds)}}
                            .dump(1)
                     << '\n';
  return 0;
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  CLI::App app{"Laws that slow an arm down, in one simulated loop"};
  std::string out;
  std::size_t seeds = 1000;
  app.add_option("--out", out, "JSON")->required();
  app.add_option("--seeds", seeds, "runs of each law with either arm")->check(CLI::PositiveNumber);
  bool only_intended = false;
  app.add_flag("--only-intended", only_intended, "the tasks with ~intended alone, which take minutes");
  CLI11_PARSE(app, argc, argv);
  return dccd::benchmarks::run(out, seeds, only_intended);
}
