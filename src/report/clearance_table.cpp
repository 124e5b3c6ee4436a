#include "report/clearance_table.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <stdexcept>

#include "report/words.h"

namespace dccd {
namespace {

constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN(), INFINITE = std::numeric_limits<double>::infinity();

nlohmann::json orNull(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(); }

void writeNames(std::ostream& out, const std::string& of) {
  for (const char* name :
       {"status", "lower_m", "upper_m", "t",    "x0",   "y0",   "z0",      "x1",      "y1",      "z1",
        "v0_0",   "v0_1",    "v0_2",    "v1_0", "v1_1", "v1_2", "voxel_x", "voxel_y", "voxel_z", "voxel_size"}) {
    out << ',' << of << '_' << name;
  }
}

/// What is not there is an empty cell.
void writeCells(std::ostream& out, const ClearanceDistance& d) {
  const auto cell = [&](bool is_there, const auto& value) {
    out << ',';
    if (is_there) out << value;
  };
  const bool known = d.status != ClearanceStatus::UNKNOWN, taken = known && std::isfinite(d.upper_m);
  out << ',' << toString(d.status);
  cell(known, d.lower_m);
  cell(taken, d.upper_m);
  cell(taken, d.t);
  for (const Vec3& point : d.point) {
    for (int axis = 0; axis < 3; ++axis) cell(std::isfinite(point[axis]), point[axis]);
  }
  for (const auto& vertices : d.vertex) {
    for (const Index v : vertices) cell(v != NO_INDEX, v);
  }
  for (const std::uint16_t k : {d.voxel.x, d.voxel.y, d.voxel.z}) cell(d.voxel_size > 0, k);
  cell(d.voxel_size > 0, d.voxel_size);
}

}  // namespace

void ClearanceTable::Sample::join(const Sample& next) {
  if (!(lower_m <= next.lower_m)) lower_m = std::isnan(lower_m) ? lower_m : next.lower_m;
  upper_m = std::min(upper_m, next.upper_m);
}

void ClearanceTable::Curve::add(const Sample& sample) {
  if (!samples.empty() && in_last < steps_each) {
    samples.back().join(sample);
    ++in_last;
    return;
  }
  if (samples.size() == MOST_SAMPLES) {
    for (std::size_t i = 0; i < MOST_SAMPLES / 2; ++i) {
      samples[i] = samples[2 * i];
      samples[i].join(samples[2 * i + 1]);
    }
    samples.resize(MOST_SAMPLES / 2);
    steps_each *= 2;
  }
  samples.push_back(sample);
  in_last = 1;
}

double ClearanceTable::Curve::nearest() const {
  double nearest_m = INFINITE;
  for (const Sample& sample : samples) nearest_m = std::min(nearest_m, sample.lower_m);  // NaN never is the smaller one
  return nearest_m;
}

void ClearanceTable::add(const Outcome& o, const std::vector<Body>& bodies, StampNs origin_ns) {
  const double t_s = secondsBetween(origin_ns, o.stamp_ns);
  if (!o.answered) {
    for (auto& [partners, curve] : curves_) curve.add({t_s, UNKNOWN, INFINITE});
  }
  if (!o.clearances.empty() && !rows_.is_open()) {
    rows_.open(file_);
    if (!rows_) throw std::runtime_error(file_ + ": cannot be written");
    rows_ << std::setprecision(17) << "step,stamp_ns,body_0,body_1,expected";
    writeNames(rows_, "end");
    writeNames(rows_, "step");
    rows_ << '\n';
  }
  double farther_m = UNKNOWN;
  for (const Clearance& c : o.clearances) {
    rows_ << o.sequence << ',' << o.stamp_ns << ',' << csvField(bodyName(c.body[0], bodies)) << ','
          << csvField(bodyName(c.body[1], bodies)) << ',' << c.expected;
    writeCells(rows_, c.at_end);
    writeCells(rows_, c.over_step);
    rows_ << '\n';
    Curve& curve = curves_[c.body];
    curve.names = {bodyName(c.body[0], bodies), bodyName(c.body[1], bodies)};
    curve.expected = curve.expected && c.expected;
    curve.last_ns = o.stamp_ns;
    const bool known = c.over_step.status != ClearanceStatus::UNKNOWN;
    curve.add({t_s, known ? c.over_step.lower_m : UNKNOWN, known ? c.over_step.upper_m : INFINITE});
    if (c.over_step.status == ClearanceStatus::FARTHER && c.body[0] != c.body[1]) farther_m = c.over_step.lower_m;
  }
  if (o.clearances.size() >= o.stats[Effect::CLEARANCE].in) return;
  for (auto& [partners, curve] : curves_) {  // what has no row is farther apart than that
    if (curve.last_ns != o.stamp_ns && partners[0] != partners[1]) curve.add({t_s, farther_m, INFINITE});
  }
}

nlohmann::json ClearanceTable::json() const {
  std::vector<const Curve*> shown;
  for (const auto& [partners, curve] : curves_) shown.push_back(&curve);
  const auto nearer = [](const Curve* a, const Curve* b) { return a->nearest() < b->nearest(); };
  std::stable_sort(shown.begin(), shown.end(), nearer);
  const std::size_t left_out = shown.size() - std::min(shown.size(), MOST_CURVES);
  shown.resize(shown.size() - left_out);
  nlohmann::json curves = nlohmann::json::array();
  for (const Curve* curve : shown) {
    nlohmann::json samples = nlohmann::json::array();
    for (const Sample& s : curve->samples) samples.push_back({s.t_s, orNull(s.lower_m), orNull(s.upper_m)});
    curves.push_back({{"names", curve->names}, {"expected", curve->expected}, {"samples", std::move(samples)}});
  }
  return {{"curves", std::move(curves)}, {"left_out", left_out}};
}

void ClearanceTable::close() {
  if (!rows_.is_open()) return;
  rows_.close();
  if (!rows_) throw std::runtime_error(file_ + ": could not be written completely");
}

}  // namespace dccd
