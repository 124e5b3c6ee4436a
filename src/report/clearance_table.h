// How far apart partners were: clearance.csv, and a curve for each two of them in the report.
#pragma once

#include <array>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "dccd/outcome.h"

namespace dccd {

/// A row a step and pair of partners. The curves are of the smallest distance of each step; where a run has more than
/// MOST_SAMPLES of them, neighbours become one, of the smaller bounds, which hold for both.
class ClearanceTable {
 public:
  static constexpr std::size_t MOST_SAMPLES = 2000, MOST_CURVES = 12;

  /// The file is made with the first row.
  explicit ClearanceTable(std::string file) : file_(std::move(file)) {}

  /// Throws std::runtime_error naming the file that cannot be made.
  void add(const Outcome& outcome, const std::vector<Body>& bodies, StampNs origin_ns);
  /// `curves`, those that come nearest: names, whether expected, samples [s from the origin, lower, upper] in metres,
  /// null where nothing is known; `left_out`: how many more there are.
  nlohmann::json json() const;
  /// Throws std::runtime_error if not all of it was written.
  void close();

 private:
  struct Sample {
    double t_s, lower_m, upper_m;  // NaN: unknown; infinite: there is none
    void join(const Sample& next);
  };
  struct Curve {
    std::array<std::string, 2> names;
    bool expected = true;  // in each step
    std::vector<Sample> samples;
    StampNs last_ns = 0;  // of the last step that has a row of the two
    std::size_t steps_each = 1, in_last = 0;
    void add(const Sample& sample);
    double nearest() const;
  };

  std::string file_;
  std::ofstream rows_;
  std::map<std::array<std::uint16_t, 2>, Curve> curves_;
};

}  // namespace dccd
