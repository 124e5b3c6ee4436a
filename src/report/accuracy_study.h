// What accuracy costs a user: the runs of one recording, each with one thing coarser, as a table, a plot's data and a
// sentence (doc/accuracy.md).
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "report/first_contacts.h"

namespace dccd {

/// What is varied in the reference and in its repetition: nothing.
constexpr const char* REFERENCE = "reference";

struct StudyRow {
  std::string varied;   ///< "frames"
  std::string setting;  ///< "every 2nd"
  std::size_t steps = 0;
  double ms_per_s = 0;
  RunErrors errors;
};

class AccuracyStudy {
 public:
  explicit AccuracyStudy(RunRecord reference) : reference_(std::move(reference)) {}

  const RunRecord& reference() const { return reference_; }
  void add(const std::string& varied, const std::string& setting, const RunRecord& run);
  const std::vector<StudyRow>& rows() const { return rows_; }

  /// Of what saves a tenth of the time and more, that which gets the fewest patches wrong, and of these the fastest.
  std::string sentence() const;
  /// A line a row. Throws std::runtime_error naming the file.
  void write(const std::string& csv) const;
  nlohmann::json json() const;

 private:
  RunRecord reference_;
  std::vector<StudyRow> rows_;

  std::vector<double> referenceTimes() const;     // [ms per s]
  double shareOfTime(const StudyRow& row) const;  // of the mean of the reference's runs
};

}  // namespace dccd
