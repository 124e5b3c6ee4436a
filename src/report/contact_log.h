// The contacts of a run in a form that another run can be held against, and what a rung costs by that.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "dccd/outcome.h"
#include "report/accuracy_settings.h"

namespace dccd {

/// One rung over the whole run, for the table of what accuracy costs. Missed, false and the error of the time of
/// contact (tocError(), over what is certain) are against the run with `exact`.
struct RungCost {
  std::string rung;
  std::size_t steps = 0, contacts = 0, missed = 0, false_contacts = 0, undecided = 0;
  double median_ms = 0, p95_ms = 0, max_toc_error = 0;
};

/// Contacts of each step in a comparable form, so that the runs of two rungs can be held against each other.
class ContactLog {
 public:
  void add(const Outcome& outcome);
  /// Missed, false and TOC error of this run against the exact one.
  RungCost against(const ContactLog& exact, const std::string& rung) const;

 private:
  struct Entry {
    TimeCell cell;
    bool certain;
  };
  using Key = std::array<std::uint64_t, 5>;
  static bool covers(const std::map<Key, Entry>& found, Key key);
  std::map<std::uint64_t, std::map<Key, Entry>> steps_;
  std::vector<double> ms_;
};

}  // namespace dccd
