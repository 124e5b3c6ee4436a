#include "report/accuracy_study.h"
#include "stream/quantile.h"

#include <fstream>
#include <iomanip>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace dccd {
namespace {

constexpr double WORTH_IT = 0.9;  // of the reference's least time; what saves less may be the machine's noise

/// Of a row, by name: the columns of the CSV and the fields of the JSON, in order.
template <class Visit>
void forFields(const StudyRow& row, Visit visit) {
  visit("varied", row.varied);
  visit("setting", row.setting);
  visit("steps", row.steps);
  visit("ms_per_s", row.ms_per_s);
  const auto errors = [&](const std::string& of, const FirstErrors& e) {
    visit((of + "_touched").c_str(), e.touched);
    visit((of + "_missed").c_str(), e.missed);
    visit((of + "_invented").c_str(), e.invented);
    visit((of + "_median_ms").c_str(), e.median_ms);
    visit((of + "_p95_ms").c_str(), e.p95_ms);
    visit((of + "_early_ms").c_str(), e.early_ms);
    visit((of + "_late_ms").c_str(), e.late_ms);
  };
  errors("patches", row.errors.patches);
  visit("patches_joined", row.errors.joined);
  visit("patches_parted", row.errors.parted);
  errors("vertices", row.errors.vertices);
  visit("pairs_share", row.errors.pairs_share);
}

/// "8", "0.35": two digits are all that a time has.
std::string twoDigits(double value) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(value >= 9.95 ? 0 : value >= 0.995 ? 1 : 2) << value;
  return text.str();
}

std::string lateAndEarly(const FirstErrors& errors) {
  constexpr double NOTHING_MS = 0.005;
  if (errors.late_ms < NOTHING_MS && errors.early_ms > -NOTHING_MS) return "first contacts when they were";
  std::string text;
  if (errors.late_ms >= NOTHING_MS) text = "up to " + twoDigits(errors.late_ms) + " ms late";
  if (errors.early_ms > -NOTHING_MS) return "first contacts " + text;
  return "first contacts " + text + (text.empty() ? "" : ", ") + "up to " + twoDigits(-errors.early_ms) + " ms early";
}

}  // namespace

void AccuracyStudy::add(const std::string& varied, const std::string& setting, const RunRecord& run) {
  StudyRow row;
  row.varied = varied;
  row.setting = setting;
  row.steps = run.steps;
  row.ms_per_s = run.msPerSecond();
  row.errors = errorsOf(run, reference_);
  rows_.push_back(std::move(row));
}

std::vector<double> AccuracyStudy::referenceTimes() const {
  std::vector<double> ms_per_s;
  for (const StudyRow& row : rows_) {
    if (row.varied == REFERENCE) ms_per_s.push_back(row.ms_per_s);
  }
  return ms_per_s;
}

double AccuracyStudy::shareOfTime(const StudyRow& row) const {
  const std::vector<double> times = referenceTimes();
  const double sum = std::accumulate(times.begin(), times.end(), 0.0);
  return sum > 0 ? row.ms_per_s * static_cast<double>(times.size()) / sum : 1;
}

std::string AccuracyStudy::sentence() const {
  if (reference_.steps == 0) return "No step was answered: there is nothing to compare.";
  if (reference_.patches.empty()) return "Nothing touches in this recording: there is no first contact to compare.";
  const auto wrong = [](const StudyRow& row) { return row.errors.patches.missed + row.errors.patches.invented; };
  const double enough_ms = WORTH_IT * quantile(referenceTimes(), 0);
  const StudyRow* best = nullptr;
  for (const StudyRow& row : rows_) {
    if (row.varied == REFERENCE || row.ms_per_s > enough_ms) continue;
    if (!best || std::make_pair(wrong(row), row.ms_per_s) < std::make_pair(wrong(*best), best->ms_per_s)) best = &row;
  }
  if (!best) return "Nothing that was tried saves a tenth of the time.";
  const FirstErrors& patches = best->errors.patches;
  std::ostringstream text;
  text << best->varied << ' ' << best->setting << ": " << twoDigits(1 / shareOfTime(*best)) << " times as fast, ";
  if (wrong(*best) == 0) {
    text << "no patch of " << patches.touched << " missed or invented";
  } else {
    text << patches.missed << " of " << patches.touched << " patches missed and " << patches.invented << " invented";
  }
  if (patches.missed < patches.touched) {
    text << ", " << lateAndEarly(patches) << " (95 % within " << twoDigits(patches.p95_ms) << " ms)";
  }
  if (wrong(*best) > 0) text << "; nothing that was tried saves a tenth of the time and gets all of them right";
  text << '.';
  return text.str();
}

void AccuracyStudy::write(const std::string& csv) const {
  std::ofstream file(csv);
  file << std::setprecision(10);
  const auto line = [&](const StudyRow& row, bool head) {
    const char* separator = "";
    forFields(row, [&](const char* name, const auto& value) {
      file << separator;
      separator = ",";
      if (head) {
        file << name;
      } else {
        file << value;
      }
    });
    file << '\n';
  };
  line({}, true);
  for (const StudyRow& row : rows_) line(row, false);
  file.close();
  if (!file) throw std::runtime_error(csv + ": cannot be written");
}

nlohmann::json AccuracyStudy::json() const {
  nlohmann::json rows = nlohmann::json::array();
  for (const StudyRow& row : rows_) {
    nlohmann::json j;
    forFields(row, [&](const char* name, const auto& value) { j[name] = value; });
    j["share_of_time"] = shareOfTime(row);
    rows.push_back(std::move(j));
  }
  return {{"sentence", sentence()}, {"rows", std::move(rows)}};
}

}  // namespace dccd
