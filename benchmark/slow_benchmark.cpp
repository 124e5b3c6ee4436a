// Laws that slow an arm down, in the same simulated loop: the cloth that it carries touches nothing, and it is fast. Of
// the fixed threshold, of Servo's law and of the formula for speed and separation those numbers are taken that are the
// fastest among those without a contact.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>
#include <iostream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <sstream>
#include <string>
#include <vector>

#include "dccd/safe_until.h"
#include "support/closed_loop.h"

namespace dccd {
namespace benchmarks {
namespace {

using test::ClosedLoop;
using Law = std::function<double(const Outcome&)>;

constexpr double UNCERTAINTY_M = 0.02;  // Z of speed_scale: what gusts and the swinging cloth may take

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

/// The runs of a law, by seed.
struct Runs {
  std::vector<double> speed_m_s;
  int contacts = 0, arrived = 0;
  double latency_s = 0;  // the largest that was measured
  void add(const test::ClosedLoopRun& run) {
    speed_m_s.push_back(run.mean_speed_m_s);
    contacts += run.contact;
    arrived += run.arrived;
    latency_s = std::max(latency_s, run.oldest_s);
  }
};

Runs measure(const Candidate& candidate, int seeds) {
  Runs runs;
  for (int seed = 1; seed <= seeds; ++seed)
    runs.add(test::runClosedLoop(static_cast<std::uint64_t>(seed), candidate.scale));
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

/// The fastest of them that has no contact over all seeds. By their speeds over a few seeds they are tried in order;
/// the seeds at which another one touched come first, so that one that touches is soon seen to.
nlohmann::json fastestWithout(const std::vector<Candidate>& candidates, const Runs& ours) {
  constexpr std::size_t A_FEW = 20;
  const std::size_t seeds = ours.speed_m_s.size();
  std::vector<std::size_t> order(seeds);  // of seeds
  std::iota(order.begin(), order.end(), 1);
  const auto look = [&](const Candidate& candidate, std::size_t count) {
    Runs runs;
    runs.speed_m_s.assign(seeds, 0);
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t seed = order[i];
      Runs one;
      one.add(test::runClosedLoop(seed, candidate.scale));
      runs.speed_m_s[seed - 1] = one.speed_m_s[0];
      runs.arrived += one.arrived;
      runs.contacts += one.contacts;
      if (one.contacts == 0) continue;
      std::rotate(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(i),
                  order.begin() + static_cast<std::ptrdiff_t>(i) + 1);
      break;
    }
    return runs;
  };
  std::vector<std::pair<double, const Candidate*>> by_speed;
  for (const Candidate& candidate : candidates) {
    const Runs few = look(candidate, std::min(A_FEW, seeds));
    if (few.contacts > 0) continue;
    by_speed.emplace_back(-std::accumulate(few.speed_m_s.begin(), few.speed_m_s.end(), 0.0), &candidate);
  }
  std::stable_sort(by_speed.begin(), by_speed.end(), [](const auto& x, const auto& y) { return x.first < y.first; });
  for (const auto& [speed, candidate] : by_speed) {
    const Runs whole = look(*candidate, seeds);
    std::cerr << candidate->law << ", " << candidate->numbers << ": " << whole.contacts << " contact\n";
    if (whole.contacts > 0) continue;
    nlohmann::json best = row(*candidate, whole, ours);
    best["tried"] = candidates.size();
    return best;
  }
  return {{"law", candidates.at(0).law}, {"tried", candidates.size()}};
}

int run(const std::string& out, int seeds) {
  const Candidate our_law = ours(UNCERTAINTY_M);
  const Runs our_runs = measure(our_law, seeds);
  std::vector<Candidate> thresholds, servos, formulas;
  for (const double at_m : {0.08, 0.1, 0.12, 0.15, 0.2, 0.25}) {
    for (const double creep : {0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5}) {
      for (const double stop_m : {0.01, 0.02, 0.03, 0.04}) thresholds.push_back(threshold(at_m, creep, stop_m));
    }
  }
  for (int i = 2; i <= 50; ++i) servos.push_back(servo(0.01 * i));
  for (int i = 0; i <= 24; ++i) formulas.push_back(speedAndSeparation(our_runs.latency_s, 0.0025 * i));
  nlohmann::json rows = {row(our_law, our_runs, our_runs)};
  for (const auto& candidates : {thresholds, servos, formulas}) rows.push_back(fastestWithout(candidates, our_runs));
  std::ofstream(out) << nlohmann::json{{"seeds", seeds}, {"latency_s", our_runs.latency_s}, {"rows", rows}}.dump(1)
                     << '\n';
  return 0;
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  CLI::App app{"Laws that slow an arm down, in one simulated loop"};
  std::string out;
  int seeds = 1000;
  app.add_option("--out", out, "JSON")->required();
  app.add_option("--seeds", seeds, "runs of each law")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  return dccd::benchmarks::run(out, seeds);
}
