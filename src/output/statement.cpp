#include "output/statement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>

#include "base/contact_fields.h"
#include "output/advice.h"
#include "output/patch_messages.h"
#include "report/words.h"

namespace dccd {

namespace {

/// Who touches whom, since when and where: "cloth and octomap for 2.07 s, 12 patches, the largest at 0.310 0.100
/// 0.750". Empty where nothing touches, and without patches.
std::string touchesInWords(const Outcome& outcome) {
  struct Touch {
    std::size_t patches = 0, expected = 0;
    const Patch* largest = nullptr;
    StampNs since_ns = UNKNOWN_NS;
    bool since_start = false;
  };
  std::map<std::array<std::uint16_t, 2>, Touch> touches;
  for (const Patch& patch : outcome.patches) {
    Touch& touch = touches[patch.body];
    ++touch.patches;
    touch.expected += patch.isExpected();
    if (!touch.largest || patch.contacts > touch.largest->contacts) touch.largest = &patch;
    if (patch.beginning == PatchBeginning::INITIAL || patch.began_to_ns == UNKNOWN_NS) touch.since_start = true;
    if (touch.since_ns == UNKNOWN_NS || patch.began_to_ns < touch.since_ns) touch.since_ns = patch.began_to_ns;
  }
  std::string text;
  for (const auto& [body, touch] : touches) {
    char words[120];
    const double for_s = touch.since_ns == UNKNOWN_NS ? 0 : secondsBetween(touch.since_ns, outcome.stamp_ns);
    std::snprintf(words, sizeof words, touch.since_start ? " since the first look" : " for %.2f s",
                  std::max(0.0, for_s));
    text += (text.empty() ? "" : ", ") + pairOf(body, outcome.step->bodies) + words;
    const Vec3& at = touch.largest->centroid;
    std::snprintf(words, sizeof words, ", %zu %s at %.3f %.3f %.3f", touch.patches,
                  touch.patches == 1 ? "patch" : "patches, the largest", at.x(), at.y(), at.z());
    text += words;
    if (touch.expected == touch.patches) text += " (expected)";
  }
  return text;
}

std::string nameOf(const Contact& contact, const std::vector<Body>& bodies) {
  static const char* const SIZED[] = {"", "vertex ", "edge ", "face "};
  const auto& size = factsOf(contact.kind).vertices;
  std::string text;
  std::size_t next = 0;
  for (std::size_t side = 0; side < 2; ++side) {
    if (side == 1) text += " and ";
    if (size[side] == 0) return text + "the map";
    text += SIZED[size[side]];
    for (std::size_t i = 0; i < size[side]; ++i) text += (i ? "-" : "") + std::to_string(contact.vertex[next++]);
    text += " of " + bodies.at(contact.body[side]).name;
  }
  return text;
}

/// What there is besides what is new.
std::string besides(const Outcome& outcome) {
  std::string text;
  const std::size_t lasting = lastingPatches(outcome);
  if (lasting > 0) text += std::to_string(lasting) + (lasting == 1 ? " patch lasts, " : " patches last, ");
  const std::size_t expected = outcome.counts.expected;
  if (expected > 0) text += std::to_string(expected) + (expected == 1 ? " expected contact, " : " expected contacts, ");
  return text;
}

/// "No contact" is said of clear steps alone; of others, what stands in the way of it.
std::string noContact(const Outcome& outcome) {
  const std::string start = std::string("starts ") + toString(outcome.start_state);
  const Assurance assurance = assuranceOf(outcome);
  if (assurance.clear()) return "no contact, " + start;
  // How it starts is no news then, and "INTERSECTING" sounds like an alarm.
  if (assurance.proved && assurance.touching == Touching::EXPECTED) {
    const std::string more = besides(outcome);
    return "only what is expected touches" + (more.empty() ? "" : ": " + more.substr(0, more.size() - 2));
  }
  std::string text = outcome.tracked && assurance.proved ? "no new contact, " : "no contact found, but ";
  if (outcome.status != StepStatus::OK) {
    text += toString(outcome.status) + (outcome.reason.empty() ? "" : " (" + outcome.reason + ")") + ", ";
  }
  for (const std::string& sentence : assurance.missing) {
    if (sentence != outcome.reason) text += sentence + ", ";
  }
  return text + besides(outcome) + start;
}

/// Is the alarm about edges through faces, of which no contact tells?
bool crossesAsNews(const Outcome& outcome) {
  const auto crosses = [](const Patch& patch) { return patch.is_new && patch.crossings > 0; };
  return outcome.tracked ? std::any_of(outcome.patches.begin(), outcome.patches.end(), crosses)
                         : outcome.unchecked_toc_lower > 0;
}

}  // namespace

Statement statementOf(const Outcome& outcome, const std::string& map_source, const std::string& broken,
                      std::vector<std::string> doubts) {
  const std::string touches = joined(touchesInWords(outcome), insideInWords(outcome));
  Statement said{assuranceOf(outcome), touches, adviceFor(outcome.status, outcome.reason, map_source), broken,
                 std::move(doubts)};
  // A mesh of which each part touches many others makes more work than there is time or memory for.
  const StepStatus status = outcome.status;
  const bool is_too_much = status == StepStatus::TRUNCATED || status == StepStatus::DEADLINE;
  said.is_doubts_fault = is_too_much && !said.doubts.empty();
  if (!said.is_doubts_fault) return said;
  said.hint.clear();
  if (!said.assurance.proved) said.assurance.hinder(said.doubts);
  return said;
}

std::string firstContactInWords(const Outcome& outcome, double toc, const Contact* first,
                                const std::vector<Body>& bodies) {
  if (!outcome.answered) return std::string("no answer: ") + toString(outcome.status);
  if (!std::isfinite(toc)) return noContact(outcome);
  const std::string more = besides(outcome);
  const std::string rest = (more.empty() ? ", " : ", besides " + more) + "starts " + toString(outcome.start_state);
  char when[64];
  std::snprintf(when, sizeof when, "%.6f s into the step", toc * outcome.duration_s());
  if (!first && toc == 0 && crossesAsNews(outcome)) return "surfaces cross since before the step began" + rest;
  if (!first) return std::string("not all was checked in time; what was not cannot touch before ") + when + rest;
  if (first->certainty != Certainty::CERTAIN) {
    return "perhaps a contact, not before " + std::string(when) + ": " + nameOf(*first, bodies) + rest;
  }
  return std::string(first->initial ? "in contact from the start" : "contact " + std::string(when)) + ": " +
         nameOf(*first, bodies) + rest;
}

}  // namespace dccd
