// The report of a run: CSV and JSON for programs, one self-contained HTML page for people. Free of ROS.
#pragma once

#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/effect_plan.h"
#include "dccd/stream.h"
#include "report/clearance_table.h"
#include "report/lanes.h"
#include "report/look_ahead_score.h"
#include "report/player_data.h"

namespace dccd {

/// What ~speed_scale said, and would have said without ~intended.
struct SpeedScales {
  double said = 0, by_bounds = 0;
};

/// Writes into a folder: contacts.csv, steps.csv, patches.csv and events.csv (the same bytes for any number of
/// threads), timing.csv, clearance.csv (distances, where they were asked for), report.json and report.html. Outcomes
/// are added in order; kept are their summaries and, in a bounded amount of memory, what the page's player shows.
class Report {
 public:
  /// Creates the folder. Throws std::runtime_error naming the file that cannot be written.
  explicit Report(const std::string& folder);

  /// told_ns: when it was answered, by the clock of the receipts; 0: nobody knows.
  void add(const Outcome& outcome, const std::vector<Body>& bodies, std::int64_t told_ns = 0,
           const std::string& clock_body = {}, const std::optional<SpeedScales>& scales = std::nullopt);
  void setEffects(std::vector<EffectDecision> decisions) { effects_ = std::move(decisions); }
  /// What became of the promises of ~safe_until, in words; empty: there were none.
  void setPromises(std::string in_words) { promises_ = std::move(in_words); }
  void setLookAhead(const LookAheadSummary& summary, double horizon_s);
  /// AccuracyStudy::json().
  void setStudy(nlohmann::json study) { study_ = std::move(study); }
  /// Facts for the head of the page: name -> value, in the order given.
  void setFacts(std::vector<std::pair<std::string, std::string>> facts) { facts_ = std::move(facts); }
  void setCounters(const FrameCounters& counters) { counters_ = counters; }
  /// What the run did not look at, a sentence each: it stands beside what was found.
  void setNotLookedAt(std::vector<std::string> sentences) { not_looked_at_ = std::move(sentences); }

  /// Why what was looked at may be something else, a sentence each: it stands beside the proof.
  void setDoubts(std::vector<std::string> sentences) { doubts_ = std::move(sentences); }

  /// Why not all of the recording was looked at, which ends the proof of the whole; empty: all was.
  void setUnansweredEnd(std::string sentence) { unanswered_end_ = std::move(sentence); }

  /// Writes the page and report.json, closes the files. Again with what was set since then. Throws std::runtime_error
  /// naming the file.
  void finish();
  /// One sentence: the first contact, or that there was none, or that there was no answer; whether all of it is proved,
  /// with `reasons` also why not; what is in doubt; and what was not looked at.
  std::string headline(bool reasons = true) const;
  /// What stands in the way of a proof: "3 of 40 frames: NO_MAP: no octomap has been received yet (3)". Empty: every
  /// frame but a first one, of which there is nothing to say, has an answer that is proved, there is one, and the
  /// recording does not go on after the last.
  std::string unproved() const;

 private:
  struct BodyHeat {
    std::string name;
    std::vector<std::uint32_t> contacts;  // per vertex
    std::vector<double> first_s;          // per vertex, first contact since the start; infinity
  };
  void addProof(const Outcome& outcome);
  std::size_t unprovedFrames() const;
  void addHeat(const Outcome& outcome, const std::vector<Body>& bodies);
  void addRow(const Outcome& outcome, const std::optional<SpeedScales>& scales);
  void addFirstContact(const Outcome& outcome, const std::vector<Body>& bodies);
  void addTimes(const Outcome& outcome);
  void writeStep(const Outcome& outcome, std::int64_t told_ns, const std::string& clock_body);
  void writeContacts(const Outcome& outcome, const std::vector<Body>& bodies);
  void writePatches(const Outcome& outcome, const std::vector<Body>& bodies);
  nlohmann::json heatJson() const;
  nlohmann::json effectsJson() const;
  nlohmann::json lookAheadJson() const;
  nlohmann::json json() const;
  std::string dumped(const nlohmann::json& data, int indent) const;

  std::string folder_;
  std::ofstream contacts_, steps_, patches_, events_, timing_;
  StampNs origin_ns_ = 0;
  std::map<std::string, std::size_t> lasting_;  // steps without a contact in which something touched, by what it was
  /// Frames that are not proved, by status, or by the first sentence of what an OK one lacks: the reason of the first
  /// of them, and how many.
  std::map<std::string, std::pair<std::string, std::size_t>> unproved_;
  std::size_t frames_ = 0, first_frames_ = 0, answered_ = 0;
  std::size_t with_contact_ = 0,
              with_expected_ = 0;  // steps; with contacts that are not expected, and with such that are
  double first_contact_s_ = 0;
  std::string first_contact_, first_initial_;  // of those that are not expected: a new one, one that was there before
  std::string rows_;                           // of the steps, as JSON, a line each
  std::vector<BodyHeat> heat_;
  std::array<std::vector<double>, static_cast<std::size_t>(Stage::COUNT)> stage_ms_;
  StepStats sum_;
  std::vector<double> total_ms_;
  std::optional<LookAheadSummary> look_ahead_;
  double horizon_s_ = 0;
  std::vector<EffectDecision> effects_;
  ContactLanes lanes_;
  ClearanceTable clearance_;
  std::string promises_;
  PlayerData player_;
  nlohmann::json study_;
  std::vector<std::pair<std::string, std::string>> facts_;
  std::vector<std::string> not_looked_at_, doubts_;
  std::string unanswered_end_;
  FrameCounters counters_;
};

/// The page with `data` and `player` (JSON) inside; opens from disk, loads nothing.
std::string reportPage(std::string data, std::string player);

}  // namespace dccd
