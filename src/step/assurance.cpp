#include "dccd/assurance.h"

#include <algorithm>

namespace dccd {
namespace {

std::string joined(const std::vector<std::string>& sentences) {
  std::string text;
  for (const std::string& sentence : sentences) text += (text.empty() ? "" : "; ") + sentence;
  return text;
}

/// What is said of Touching (dccd/outcome.h): where patches are tracked, they tell what is new.
Touching touchingOf(const Outcome& outcome) {
  if (!outcome.tracked) return outcome.touching;
  const bool any_new =
      std::any_of(outcome.patches.begin(), outcome.patches.end(), [](const Patch& p) { return p.is_new; });
  if (any_new) return Touching::NEW;
  return outcome.touching == Touching::NEW ? Touching::LASTING : outcome.touching;
}

}  // namespace

void Assurance::hinder(const std::vector<std::string>& faults) {
  for (auto fault = faults.rbegin(); fault != faults.rend(); ++fault) {
    if (std::find(missing.begin(), missing.end(), *fault) == missing.end()) missing.insert(missing.begin(), *fault);
  }
  proved = proved && faults.empty();
}

Assurance assuranceOf(const Outcome& outcome, const std::vector<std::string>& faults) {
  Assurance assurance;
  assurance.touching = touchingOf(outcome);
  if (outcome.answered) {
    assurance.missing = outcome.missing();
    assurance.excluded = outcome.excluded;
    assurance.expected = outcome.expected;
  } else {
    assurance.missing.push_back(std::string("no answer, ") + toString(outcome.status) +
                                (outcome.reason.empty() ? "" : ": " + outcome.reason));
  }
  assurance.proved = outcome.answered && outcome.claim.holds();
  assurance.hinder(faults);
  return assurance;
}

std::string describe(const Assurance& assurance, const std::string& touches) {
  static const char* const TOUCHING[] = {"nothing touches", "what touches lasts", "something touches anew",
                                         "what touches is expected"};
  std::string text = assurance.proved ? "proved, " : "not proved: " + joined(assurance.missing);
  if (assurance.proved || assurance.touching != Touching::NONE) {
    text += (assurance.proved ? "" : "; ") + std::string(TOUCHING[static_cast<std::size_t>(assurance.touching)]);
    if (!touches.empty()) text += ": " + touches;
  }
  if (!assurance.expected.empty()) text += " (expected: " + joined(assurance.expected) + ")";
  if (!assurance.excluded.empty()) text += " (left out by choice: " + joined(assurance.excluded) + ")";
  return text;
}

const char* toString(Touching touching) {
  static const char* const NAMES[] = {"NONE", "LASTING", "NEW", "EXPECTED"};
  return NAMES[static_cast<std::size_t>(touching)];
}

}  // namespace dccd
