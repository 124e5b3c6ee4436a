// Laws that slow an arm down, in the same simulated loop: the cloth that it carries touches nothing, and it is fast. Of
// the fixed threshold, of Servo's law and of the formula for speed and separation those numbers are taken that are the
// fastest among those without a contact.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
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
Candidate speedAndSeparation(double c_m) {
  std::ostringstream numbers;
  numbers << "a " << ClosedLoop::BRAKING_M_S2 << " m/s^2, T " << ClosedLoop::REACTION_S << " s, C " << c_m << " m";
  const double a = ClosedLoop::BRAKING_M_S2, t = ClosedLoop::REACTION_S;
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

/// Ends with the first contact where only those without are wanted.
nlohmann::json measure(const Candidate& candidate, int seeds, bool until_contact) {
  int contacts = 0, arrived = 0, done = 0;
  double speed_m_s = 0;
  for (int seed = 1; seed <= seeds && !(until_contact && contacts > 0); ++seed, ++done) {
    const test::ClosedLoopRun run = test::runClosedLoop(static_cast<std::uint64_t>(seed), candidate.scale);
    contacts += run.contact;
    arrived += run.arrived;
    speed_m_s += run.mean_speed_m_s;
  }
  return {{"law", candidate.law}, {"numbers", candidate.numbers}, {"seeds", done},
          {"contacts", contacts}, {"arrived", arrived},           {"mean_speed_m_s", speed_m_s / done}};
}

/// The fastest of them that has no contact over all seeds, found by a look at a few seeds first.
nlohmann::json fastestWithout(const std::vector<Candidate>& candidates, int seeds) {
  constexpr int A_FEW = 20;
  std::vector<std::pair<double, const Candidate*>> order;
  for (const Candidate& candidate : candidates) {
    const nlohmann::json looked = measure(candidate, std::min(A_FEW, seeds), true);
    if (looked["contacts"] == 0) order.emplace_back(-looked["mean_speed_m_s"].get<double>(), &candidate);
  }
  std::sort(order.begin(), order.end());
  for (const auto& one : order) {
    const nlohmann::json whole = measure(*one.second, seeds, true);
    if (whole["contacts"] == 0) return whole;
  }
  return {{"law", candidates.at(0).law},
          {"numbers", "none of " + std::to_string(candidates.size()) + " is without contact"}};
}

int run(const std::string& out, int seeds) {
  std::vector<Candidate> thresholds, servos, formulas;
  for (const double at_m : {0.1, 0.15, 0.2, 0.25}) {
    for (const double creep : {0.1, 0.15, 0.2, 0.3}) {
      for (const double stop_m : {0.02, 0.03, 0.04}) thresholds.push_back(threshold(at_m, creep, stop_m));
    }
  }
  for (const double d0_m : {0.15, 0.2, 0.3, 0.4, 0.5}) servos.push_back(servo(d0_m));
  for (const double c_m : {0.0, 0.01, 0.02, 0.03, 0.04, 0.05}) formulas.push_back(speedAndSeparation(c_m));
  nlohmann::json rows = {measure(ours(UNCERTAINTY_M), seeds, false)};
  for (const auto& candidates : {thresholds, servos, formulas}) {
    rows.push_back(candidates.size() == 1 ? measure(candidates[0], seeds, false) : fastestWithout(candidates, seeds));
  }
  std::ofstream(out) << nlohmann::json{{"seeds", seeds}, {"rows", rows}}.dump(1) << '\n';
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
