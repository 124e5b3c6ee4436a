#include "support/step_judge.h"

#include <algorithm>

#include "support/brute_force.h"

namespace dccd {
namespace test {
namespace {

std::string judgeContacts(const std::vector<Contact>& found, std::vector<TrueContact>& truth, int toc_bits) {
  const auto before = [](const Contact& a, const Contact& b) {
    return std::tie(a.kind, a.body, a.vertex) < std::tie(b.kind, b.body, b.vertex);
  };
  for (std::size_t i = 0; i < std::max(found.size(), truth.size()); ++i) {
    if (i == truth.size()) return "reported but not true: " + describe(found[i]);
    if (i == found.size()) return "true but not reported: " + describe(truth[i].contact);
    if (before(found[i], truth[i].contact)) return "reported but not true (or out of order): " + describe(found[i]);
    if (before(truth[i].contact, found[i])) return "true but not reported: " + describe(truth[i].contact);
    ElementaryResult result;
    result.verdict = found[i].certainty == Certainty::CERTAIN ? Verdict::CONTACT : Verdict::UNDECIDED;
    result.toc_lower = found[i].toc_lower;
    result.toc_upper = found[i].toc_upper;
    if (result.verdict != Verdict::CONTACT) return "undecided: " + describe(found[i]);
    if (!isCellOf(truth[i].toc, result, toc_bits)) return "the wrong cell of time: " + describe(found[i]);
  }
  return "";
}

std::string judgeStart(const Outcome& result, const std::vector<StartIntersection>& truth) {
  if (result.start_state != (truth.empty() ? StartState::CLEAR : StartState::INTERSECTING)) {
    return std::string("start state ") + toString(result.start_state) + " with " + std::to_string(truth.size()) +
           " pairs in truth";
  }
  const bool same = std::equal(result.intersections.begin(), result.intersections.end(), truth.begin(), truth.end(),
                               [](const auto& x, const auto& y) { return x == y; });
  return same ? ""
              : std::to_string(result.intersections.size()) + " intersections listed, " + std::to_string(truth.size()) +
                    " in truth, or in another order";
}

}  // namespace

std::string judgeStep(const TestStep& step) {
  std::vector<TrueContact> contacts = trueContacts(step);
  const std::vector<StartIntersection> start = trueStart(step);
  std::string finding;
  forEachSimdTarget([&](const std::string& target) {
    for (const bool sought : {true, false}) {
      const Options options;
      const Outcome result = sought ? runOnce(step, options) : bruteForce(step.motion(), options);
      std::string wrong = judgeContacts(result.contacts, contacts, options.accuracy.toc_bits);
      if (wrong.empty()) wrong = judgeStart(result, start);
      if (wrong.empty() && !result.claim.isCovered()) wrong = "it was not all looked at";
      if (wrong.empty() || !finding.empty()) continue;
      finding = (sought ? "clustered, " : "brute force, ") + target + ": " + wrong;
    }
  });
  return finding;
}

std::string judgeSequence(const std::vector<TestStep>& steps, int& carried_tests, int& full_tests) {
  Detector carrying, full;
  bool must_be_clear = false;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    Step motion = steps[i].motion();
    full.history().clear();
    const Outcome expected = full.run(motion);
    const Outcome result = carrying.run(motion);
    const std::string where = "step " + std::to_string(i) + ": ";
    if (i > 0) {
      carried_tests += static_cast<int>(result.stats[Stage::START_STATE].in);
      full_tests += static_cast<int>(expected.stats[Stage::START_STATE].in);
    }
    const std::string wrong = judgeStart(result, expected.intersections);
    if (!wrong.empty()) return where + "carried over: " + wrong;
    const std::string other = difference(result.contacts, expected.contacts);
    if (!other.empty()) return where + other;
    if (!result.claim.isCovered()) return where + "it was not all looked at";
    if (must_be_clear && result.start_state != StartState::CLEAR)
      return where + "INTERSECTING after CLEAR without contact";
    must_be_clear =
        result.start_state == StartState::CLEAR && result.contacts.empty() && result.stats.unchecked_vertices == 0;
  }
  return "";
}

}  // namespace test
}  // namespace dccd
