#include "record/step_replay.h"

#include <algorithm>
#include <sstream>

namespace dccd {

namespace {

constexpr std::size_t MAX_DIFFERENCES = 10;

bool isSame(const Contact& a, const Contact& b) { return recordedBytes(a) == recordedBytes(b); }

std::string pairText(const Contact& c) {
  std::ostringstream text;
  text.precision(17);
  text << describeContact(c, {}) << ", toc [" << c.toc_lower << ", " << c.toc_upper << "]";
  return text.str();
}

std::string summaryOf(const Outcome& answer) {
  std::ostringstream text;
  text.precision(17);
  text << toString(answer.status) << ", starts " << toString(answer.start_state) << ", touching "
       << toString(answer.touching) << ", " << answer.contacts.size() << " of " << answer.total_contacts
       << " contacts, earliest toc " << answer.earliest_toc << " (" << answer.earliest_unexpected_toc << " unexpected)";
  return text.str();
}

bool isOfSamePair(const Contact& a, const Contact& b) {
  return a.kind == b.kind && a.body == b.body && a.vertex == b.vertex && a.voxel == b.voxel &&
         a.voxel_size == b.voxel_size;
}

/// Of a contact in several places of a leaf, or in several parts of the step, the budget may have left the first
/// undecided: then it is certain within a longer time.
bool isConfirmedBy(const Contact& recorded, const Contact& replayed) {
  const bool longer = recorded.toc_lower < replayed.toc_lower || replayed.toc_upper < recorded.toc_upper;
  if (!longer) return isSame(recorded, replayed);
  return replayed.certainty == Certainty::CERTAIN && recorded.toc_lower <= replayed.toc_lower &&
         replayed.toc_upper <= recorded.toc_upper;
}

/// The recorded step ended early: what it called certain must be among the replayed contacts. It need not where a limit
/// cut these, too (which ones it leaves follows from where the bodies were when the clusters were made), or where they
/// are no more than the first ones.
std::vector<std::string> compareCertain(const Options& options, const Outcome& recorded, const Outcome& replayed) {
  const bool first_alone = options.earliest_only || replayed.contacts.size() < replayed.total_contacts;
  const double first = replayed.suppressed > 0 ? 0 : replayed.earliest_toc;
  std::vector<std::string> found;
  for (const Contact& c : recorded.contacts) {
    if (c.certainty != Certainty::CERTAIN) continue;
    const auto again = std::find_if(replayed.contacts.begin(), replayed.contacts.end(),
                                    [&](const Contact& other) { return isOfSamePair(c, other); });
    const bool may_lack = !replayed.complete || (first_alone && first <= c.toc_upper);
    if (again == replayed.contacts.end() ? may_lack : isConfirmedBy(c, *again)) continue;
    found.push_back("recorded as certain, not replayed: " + pairText(c));
  }
  return found;
}

/// An edge through a face comes before what lies inside; earliest_only lists the one that it comes to first, which
/// depends on the clusters, too, and so do the patches of it.
bool listsACrossing(const Outcome& answer) {
  return !answer.intersections.empty() && answer.intersections.front().vertex[4] != NO_INDEX;
}

std::vector<std::string> compareWhole(const Options& options, const Outcome& recorded, Outcome replayed) {
  if (options.earliest_only && listsACrossing(recorded) && listsACrossing(replayed)) {
    StartIntersection &is = replayed.intersections.front(), was = recorded.intersections.front();
    if (is.body != was.body || is.vertex != was.vertex) {
      replayed.patches = recorded.patches;
      replayed.patch_of = recorded.patch_of;
    }
    is = was;
  }
  replayed.reason = recorded.reason;      // words alone
  replayed.excluded = recorded.excluded;  // what was left out before the step was made, no recording knows
  if (recordedBytes(recorded) == recordedBytes(replayed)) return {};
  std::vector<std::string> found;
  const auto add = [&](const std::string& what, const std::string& was, const std::string& is) {
    found.push_back(what + ": recorded " + was + "; replayed " + is);
  };
  const std::string was = summaryOf(recorded), is = summaryOf(replayed);
  if (was != is) add("the answer", was, is);
  for (std::size_t i = 0; i < std::min(recorded.contacts.size(), replayed.contacts.size()); ++i) {
    const Contact &a = recorded.contacts[i], &b = replayed.contacts[i];
    if (!isSame(a, b)) add("contact " + std::to_string(i), pairText(a), pairText(b));
  }
  if (found.empty()) found.push_back("patches, crossings, what was not shown, or a count differ");
  return found;
}

}  // namespace

std::vector<std::string> compareAnswers(const Options& options, const Outcome& recorded, const Outcome& replayed) {
  if (!recorded.answered) return {};
  std::vector<std::string> found =
      recorded.complete ? compareWhole(options, recorded, replayed) : compareCertain(options, recorded, replayed);
  found.resize(std::min(found.size(), MAX_DIFFERENCES));
  return found;
}

StepReplay replayStep(const StepRecording& recording, int threads) {
  Options options = recording.options;
  options.num_threads = threads;
  options.step_budget_ms = 0;
  options.max_compute_ms = 0;
  check(options);
  if (recording.step.bodies.empty()) throw std::invalid_argument("the recording has no body");
  StepReplay result;
  try {
    History history;
    result.answer = detect(recording.step, options, history);
  } catch (const std::invalid_argument& error) {
    result.answer.status = StepStatus::INTERNAL_ERROR;
    result.answer.reason = error.what();
  }
  if (recording.has_answer) result.differences = compareAnswers(options, recording.answer, result.answer);
  return result;
}

std::string describeContact(const Contact& c, const std::vector<Body>& bodies) {
  std::ostringstream text;
  const auto name = [&](std::uint16_t body) {
    return body < bodies.size()    ? bodies[body].name
           : body == OBSTACLE_BODY ? "octomap"
                                   : "body " + std::to_string(body);
  };
  const std::size_t first = factsOf(c.kind).vertices[0];
  text << toString(c.kind) << ' ' << name(c.body[0]);
  for (std::size_t i = 0; i < 4; ++i) {
    if (i == first && c.body[1] != OBSTACLE_BODY) text << " | " << name(c.body[1]);
    if (c.vertex[i] != NO_INDEX) text << ' ' << c.vertex[i];
  }
  if (c.body[1] == OBSTACLE_BODY) {
    text << " | voxel " << c.voxel.x << ' ' << c.voxel.y << ' ' << c.voxel.z << " of " << c.voxel_size;
  }
  return text.str();
}

}  // namespace dccd
