// Who touches whom and when: a lane a pair of partners, for the report.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "dccd/outcome.h"

namespace dccd {

/// Patches of a run as bars, their events as ticks, and each pair's first new contact. Keeps at most MOST_MARKS bars
/// and as many events a pair; what is beyond is counted.
class ContactLanes {
 public:
  static constexpr std::size_t MOST_MARKS = 5000;

  void add(const Outcome& outcome, const std::vector<Body>& bodies, StampNs origin_ns);
  /// A list: names, bars [id, from, to, expected], events [kind, time, id, expected], first new contact or null, left
  /// out. Times in seconds from the origin.
  nlohmann::json json() const;
  /// Whether the outcome holds a pair's first new contact.
  bool addedFirst() const { return added_first_; }

 private:
  struct Bar {
    double from_s, to_s;
    bool expected;
  };
  struct Lane {
    std::array<std::string, 2> names;
    std::vector<std::pair<std::uint64_t, Bar>> bars;
    std::map<std::uint64_t, std::size_t> bar_of;  // patch -> its bar
    nlohmann::json events = nlohmann::json::array();
    nlohmann::json first;  // of the new contacts that are not expected; null until there is one
    std::size_t left_out = 0;
  };
  using Partners = std::array<std::uint16_t, 2>;
  Lane& lane(const Partners& partners, const std::vector<Body>& bodies);
  void extend(Lane& lane, std::uint64_t id, const Bar& bar, double step_start_s);
  void addFirst(const Outcome& outcome, const std::vector<Body>& bodies, StampNs origin_ns);

  std::map<Partners, Lane> lanes_;
  bool added_first_ = false;
};

}  // namespace dccd
