// Of the cell of cell_publisher: what the monitor said of it, how late, and what that cost.
#pragma once

#include <deformable_ccd/SpeedScale.h>
#include <deformable_ccd/State.h>
#include <deformable_ccd/StepStats.h>
#include <ros/ros.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "cell/cell_world.h"

namespace dccd {
namespace benchmarks {

using nlohmann::json;

/// [s] of the processor that a process took so far.
inline double processorSeconds(const std::string& pid) {
  std::ifstream file("/proc/" + pid + "/stat");
  std::string text{std::istreambuf_iterator<char>(file), {}};
  std::istringstream rest(text.substr(text.rfind(')') + 2));
  std::vector<std::string> fields{std::istream_iterator<std::string>(rest), {}};
  if (fields.size() < 13) throw std::runtime_error("process " + pid + " has ended");
  return (std::stod(fields[11]) + std::stod(fields[12])) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

/// The same of all processes of the machine.
inline double machineSeconds() {
  std::ifstream file("/proc/stat");
  std::string cpu;
  double user = 0, nice = 0, system = 0, idle = 0, wait = 0, irq = 0, soft = 0;
  file >> cpu >> user >> nice >> system >> idle >> wait >> irq >> soft;
  return (user + nice + system + irq + soft) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

inline std::string withoutNumbers(const std::string& sentence) {
  std::string out;
  for (const char c : sentence) {
    const bool digit = std::isdigit(static_cast<unsigned char>(c)) != 0;
    if (!digit) out += c;
    if (digit && (out.empty() || out.back() != '#')) out += '#';
  }
  return out;
}

/// What the monitor says within the window, by the clock here: a state holds until the next one.
class Witness {
 public:
  Witness(ros::NodeHandle& node, const Settings& settings) : settings_(settings) {
    const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
    state_ = node.subscribe<deformable_ccd::State>(
        settings.monitor + "/state", 100, [this](const auto& m) { onState(*m); }, {}, hints);
    scale_ = node.subscribe<deformable_ccd::SpeedScale>(
        settings.monitor + "/speed_scale", 100, [this](const auto& m) { onScale(*m); }, {}, hints);
    stats_ = node.subscribe<deformable_ccd::StepStats>(
        settings.monitor + "/stats", 100, [this](const auto& m) { onStats(*m); }, {}, hints);
  }

  void begin() {
    const std::lock_guard<std::mutex> lock(mutex_);
    begun_s_ = state_since_s_ = scale_since_s_ = ros::WallTime::now().toSec();
    processor_ = seconds();
    is_open_ = true;
  }

  void end(json& out) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const double now_s = ros::WallTime::now().toSec(), window_s = now_s - begun_s_;
    passState(now_s);
    passScale(now_s);
    is_open_ = false;
    for (const auto& [name, used_s] : seconds()) out["share"][name] = (used_s - processor_.at(name)) / window_s;
    out["window_s"] = window_s;
    out["steps"] = answers_;
    out["proved"] = proved_;
    out["touching_expected"] = touching_expected_;
    out["touching_else"] = touching_else_;
    out["proved_share_of_time"] = proved_s_ / window_s;
    out["scale_above_0"] = moving_s_ / window_s;
    out["scale_said"] = scales_.size();
    out["scale"] = scales_;
    out["maps"] = map_stamps_.size();
    out["map_age_s"] = map_ages_;
    out["latency_ms"] = latencies_ms_;
    out["step_ms"] = steps_ms_;
    out["stages_ms"] = stages_ms_;
    out["reasons"] = reasons_;
    out["scale_reasons"] = scale_reasons_;
    out["last"] = last_;
  }

 private:
  const Settings& settings_;
  ros::Subscriber state_, scale_, stats_;
  std::mutex mutex_;
  bool is_open_ = false, is_proved_ = false, is_moving_ = false;
  double begun_s_ = 0, state_since_s_ = 0, scale_since_s_ = 0, proved_s_ = 0, moving_s_ = 0;
  std::map<std::string, double> processor_;
  std::size_t answers_ = 0, proved_ = 0, touching_expected_ = 0, touching_else_ = 0;
  ros::Time newest_;
  std::set<ros::Time> map_stamps_;
  std::vector<double> map_ages_, scales_, latencies_ms_, steps_ms_;
  std::map<std::string, std::vector<double>> stages_ms_;  // of each step; own_voxels: of a map, beside the steps
  std::map<std::string, std::size_t> reasons_, scale_reasons_;
  json last_;

  std::map<std::string, double> seconds() const {
    std::map<std::string, double> all{{"machine", machineSeconds()}, {"publisher", processorSeconds("self")}};
    for (const std::string& one : settings_.processes) {
      const std::size_t at = one.find('=');
      all[one.substr(0, at)] = processorSeconds(one.substr(at + 1));
    }
    return all;
  }
  void passState(double now_s) {
    if (is_proved_) proved_s_ += now_s - state_since_s_;
    state_since_s_ = now_s;
  }
  void passScale(double now_s) {
    if (is_moving_) moving_s_ += now_s - scale_since_s_;
    scale_since_s_ = now_s;
  }
  void onState(const deformable_ccd::State& m) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (is_open_) passState(ros::WallTime::now().toSec());
    is_proved_ = m.proved;
    if (!is_open_) return;
    for (const std::string& sentence : m.missing) ++reasons_[withoutNumbers(sentence)];
    if (m.holds_until == newest_) return;  // said between two answers
    newest_ = m.holds_until;
    ++answers_;
    proved_ += m.proved;
    touching_expected_ += m.touching == deformable_ccd::State::EXPECTED;
    touching_else_ += m.touching == deformable_ccd::State::LASTING || m.touching == deformable_ccd::State::NEW;
    if (m.checked_map) {
      map_stamps_.insert(m.map_stamp);
      map_ages_.push_back(m.map_age);
    }
  }
  void onScale(const deformable_ccd::SpeedScale& m) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (is_open_) passScale(ros::WallTime::now().toSec());
    is_moving_ = m.scale > 0;
    if (!is_open_) return;
    scales_.push_back(m.scale);
    if (m.scale == 0) ++scale_reasons_[withoutNumbers(m.reason)];
  }
  void onStats(const deformable_ccd::StepStats& m) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!is_open_ || !m.answered) return;
    latencies_ms_.push_back(1e3 * m.latency);
    steps_ms_.push_back(m.total_ms);
    for (const auto& stage : m.stages) stages_ms_[stage.name].push_back(stage.ms);
    last_ = {{"frames_received", m.frames_received}, {"frames_processed", m.frames_processed},
             {"frames_skipped", m.frames_skipped},   {"maps_received", m.maps_received},
             {"maps_refused", m.maps_refused},       {"map_leaves", m.map_leaves}};
  }
};

}  // namespace benchmarks
}  // namespace dccd
