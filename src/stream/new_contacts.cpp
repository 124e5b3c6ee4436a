#include "dccd/monitor_extras.h"

#include <algorithm>

namespace dccd {
namespace {

bool isBefore(const NewContact& a, const NewContact& b) {
  return a.contact.toc_lower != b.contact.toc_lower ? a.contact.toc_lower < b.contact.toc_lower
                                                    : canonicalLess(a.contact, b.contact);
}

/// Keeps the earliest of each pair of partners.
void take(const NewContact& one, std::vector<NewContact>& earliest) {
  const auto same =
      std::find_if(earliest.begin(), earliest.end(), [&](const NewContact& other) { return other.body == one.body; });
  if (same == earliest.end()) {
    earliest.push_back(one);
  } else if (isBefore(one, *same)) {
    *same = one;
  }
}

}  // namespace

std::vector<NewContact> newContacts(const Outcome& outcome) {
  std::vector<NewContact> earliest;
  if (outcome.tracked) {
    for (const Patch& patch : outcome.patches) {
      const bool by_contact = patch.contacts > 0 && !patch.earliest.expected;
      if (patch.is_new && by_contact) take({patch.body, patch.id, patch.earliest}, earliest);
    }
  } else {
    for (const Contact& contact : outcome.contacts) {
      const auto [low, high] = std::minmax(contact.body[0], contact.body[1]);
      if (!contact.expected) take({{low, high}, 0, contact}, earliest);
    }
  }
  std::sort(earliest.begin(), earliest.end(), isBefore);
  return earliest;
}

double earliestNewToc(const Outcome& outcome) {
  if (!outcome.tracked) {
    const bool crosses = std::any_of(outcome.intersections.begin(), outcome.intersections.end(),
                                     [](const StartIntersection& start) { return !start.expected; });
    return crosses ? 0 : outcome.earliest_unexpected_toc;
  }
  double toc = outcome.unchecked_toc_lower;
  for (const Patch& patch : outcome.patches) {
    if (patch.is_new) toc = std::min(toc, newsTocLower(patch));
  }
  return toc;
}

}  // namespace dccd
