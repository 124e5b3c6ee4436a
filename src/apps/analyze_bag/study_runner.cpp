#include "apps/analyze_bag/study_runner.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iomanip>
#include <iostream>
#include <limits>
#include <sstream>
#include <vector>

#include "apps/analyze_bag/thinned_mesh.h"
#include "base/accuracy.h"

namespace dccd {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t FRAMES[] = {2, 4, 8}, ROWS[] = {2, 4}, VOXELS[] = {2, 4, 8};
constexpr double NOISE_M[] = {0.001, 0.003};

struct Variant {
  std::string varied, setting;
  MonitorConfig config;
  Variation variation;
};

std::string ordinal(std::size_t n) { return std::to_string(n) + (n == 2 ? "nd" : n == 3 ? "rd" : "th"); }

/// Two digits.
std::string text(double value) {
  std::ostringstream out;
  if (value >= 10) {
    out << std::lround(value);
  } else {
    out << std::setprecision(2) << value;
  }
  return out.str();
}

struct AccuracySetting {
  std::string name;
  AccuracyOptions accuracy;
};

/// One for each rung and knob that makes a difference.
std::vector<AccuracySetting> accuracySettings() {
  std::vector<AccuracySetting> settings;
  for (const auto& [text, tolerance_m] : {std::pair("1e-3", 1e-3), {"1e-6", 1e-6}, {"1e-9", 1e-9}}) {
    settings.push_back({std::string("conservative ") + text, {}});
    settings.back().accuracy.rung = Accuracy::CONSERVATIVE;
    settings.back().accuracy.tolerance_m = tolerance_m;
  }
  for (const int bits : {10, 32, 52}) {
    settings.push_back({"exact 2^-" + std::to_string(bits), {}});
    settings.back().accuracy.toc_bits = bits;
  }
  return settings;
}

/// Every contact of the bag is wanted and nothing ends a step: no budget, no limit, no predictions.
MonitorConfig unlimited(MonitorConfig config) {
  Options& detector = config.monitor.detector;
  detector.step_budget_ms = detector.max_compute_ms = 0;
  detector.max_contacts = std::numeric_limits<std::size_t>::max();
  detector.max_found = detector.max_found_per_feature = 0;
  config.monitor.look_ahead_s = 0;
  config.effects.erase(Effect::LOOK_AHEAD);
  return config;
}

AccuracyOptions finest(const MonitorConfig& config) {
  AccuracyOptions accuracy = config.monitor.detector.accuracy;
  if (config.holdsDistance()) {
    accuracy.rung = Accuracy::CONSERVATIVE;
    accuracy.tolerance_m = std::min(accuracy.tolerance_m, 1e-9);
    return accuracy;
  }
  accuracy.rung = Accuracy::EXACT;
  accuracy.toc_bits = 52;
  return accuracy;
}

/// Each rung has a knob of its own at most.
bool isSame(const AccuracyOptions& a, const AccuracyOptions& b) {
  if (a.rung != b.rung) return false;
  return a.rung == Accuracy::EXACT ? a.toc_bits == b.toc_bits : a.tolerance_m == b.tolerance_m;
}

std::string nameOf(const AccuracyOptions& accuracy) {
  for (const AccuracySetting& setting : accuracySettings()) {
    if (isSame(setting.accuracy, accuracy)) return setting.name;
  }
  return toString(accuracy.rung) + (' ' + text(accuracy.tolerance_m)) + " m";
}

std::vector<Variant> coarserThings(const Variant& whole, const RunRecord& reference) {
  std::vector<Variant> variants{whole};
  variants.back().setting = "the same again";  // what the machine's noise is, and that answers do not change
  const auto add = [&](const std::string& varied, const std::string& setting) -> Variant& {
    variants.push_back(whole);
    variants.back().varied = varied;
    variants.back().setting = setting;
    return variants.back();
  };
  for (const std::size_t n : FRAMES) {
    Variant& one = add("frames", "every " + ordinal(n));
    one.variation.every_nth_frame = n;
    // Steps are as much longer, and none of them is to be taken for a gap.
    one.config.monitor.store.max_step_s *= static_cast<double>(n);
    one.config.monitor.store.max_vertex_step_m *= static_cast<double>(n);
  }
  std::vector<bool> thin;
  for (const BodyConfig& body : whole.config.bodies) thin.push_back(!body.isRigid() && !body.isDepthImage());
  for (const std::size_t n : ROWS) {
    add("mesh", "every " + ordinal(n) + " row and column").variation.topology = ThinnedMeshes(n, thin);
  }
  for (const std::size_t n : VOXELS) {
    if (reference.voxel_m > 0) add("map", std::to_string(n) + " times the voxel").variation.voxels = n;
  }
  for (const AccuracySetting& setting : accuracySettings()) {
    if (whole.config.holdsDistance() && !holdsDistance(setting.accuracy.rung)) continue;
    AccuracyOptions accuracy = whole.config.monitor.detector.accuracy;
    if (isSame(setting.accuracy, accuracy)) continue;
    accuracy.rung = setting.accuracy.rung;
    accuracy.toc_bits = setting.accuracy.toc_bits;
    accuracy.tolerance_m = setting.accuracy.tolerance_m;
    add("rung", setting.name).config.monitor.detector.accuracy = accuracy;
  }
  for (const double noise_m : NOISE_M) {
    Variant& one = add("tracker noise", text(1000 * noise_m) + " mm");
    for (BodyConfig& body : one.config.bodies) {
      if (!body.isRigid()) body.input.noise_radius_m += noise_m;
    }
    one.config.monitor.detector.accuracy.rung = Accuracy::CONSERVATIVE;
  }
  return variants;
}

class StudyRunner {
 public:
  StudyRunner(const std::vector<std::string>& bags, const BagReplayOptions& options) : bags_(bags), options_(options) {}

  /// `left`: how many come after it.
  RunRecord run(const Variant& variant, std::size_t left) {
    if (options_.show_progress) {
      std::cerr << "accuracy study: " << variant.varied << ' ' << variant.setting << timeLeft(left + 1) << '\n';
    }
    const Clock::time_point start = Clock::now();
    BagReplayOptions options = options_;
    options.variation = variant.variation;
    RunRecorder recorder;
    BagReplay(bags_, variant.config, options)
        .run([&](const Outcome& o, MonitorPipeline&, const BagReplaySummary&, const ros::Time&) { recorder.add(o); });
    spent_s_ += std::chrono::duration<double>(Clock::now() - start).count();
    ++runs_;
    return recorder.take();
  }

 private:
  std::string timeLeft(std::size_t runs) const {
    const std::string count = ", " + std::to_string(runs) + (runs == 1 ? " run left" : " runs left");
    if (runs_ == 0) return count;
    const double left_s = spent_s_ / static_cast<double>(runs_) * static_cast<double>(runs);
    return count + ", about " + std::to_string(std::lround(std::ceil(left_s))) + " s";
  }

  std::vector<std::string> bags_;
  BagReplayOptions options_;
  double spent_s_ = 0;
  std::size_t runs_ = 0;
};

}  // namespace

AccuracyStudy runStudy(const std::vector<std::string>& bags, const MonitorConfig& config,
                       const BagReplayOptions& options) {
  Variant whole{REFERENCE, "", unlimited(config), {}};
  Options& detector = whole.config.monitor.detector;
  detector.accuracy = finest(config);
  detector.patches = true;
  detector.suppress_initial = false;
  whole.setting = nameOf(detector.accuracy);
  StudyRunner runner(bags, options);
  constexpr std::size_t ABOUT = 16;  // how many runs there are is known once the reference is
  runner.run(whole, ABOUT);          // warms up: the first run of all is the slowest, whatever its setting
  AccuracyStudy study(runner.run(whole, ABOUT));
  study.add(whole.varied, whole.setting, study.reference());
  const std::vector<Variant> variants = coarserThings(whole, study.reference());
  for (std::size_t i = 0; i < variants.size(); ++i) {
    const Variant& one = variants[i];
    study.add(one.varied, one.setting, runner.run(one, variants.size() - 1 - i));
  }
  return study;
}

}  // namespace dccd
