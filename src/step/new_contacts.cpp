#include "dccd/new_contacts.h"

#include <algorithm>
#include <tuple>

namespace dccd {
namespace {

/// One for each pair of partners.
void take(const NewContact& one, std::vector<NewContact>& earliest) {
  const auto same = std::find_if(earliest.begin(), earliest.end(),
                                 [&](const NewContact& other) { return other.body == one.body; });
  if (same == earliest.end()) {
    earliest.push_back(one);
  } else if (one.contact.toc_lower < same->contact.toc_lower ||
             (one.contact.toc_lower == same->contact.toc_lower && canonicalLess(one.contact, same->contact))) {
    *same = one;
  }
}

}  // namespace

bool isNew(const Outcome& outcome, const Patch& patch) {
  if (patch.expected || patch.contacts == 0) return false;
  if (patch.id == 0) return true;
  return patch.beginning == PatchBeginning::NEW &&
         std::any_of(outcome.patch_events.begin(), outcome.patch_events.end(), [&](const PatchEvent& event) {
           return event.kind == PatchEventKind::BEGAN && event.id == patch.id;
         });
}

std::vector<NewContact> newContacts(const Outcome& outcome) {
  std::vector<NewContact> earliest;
  if (outcome.has_patches) {
    for (const Patch& patch : outcome.patches) {
      if (isNew(outcome, patch)) take({patch.body, patch.id, patch.earliest}, earliest);
    }
  } else {
    for (const Contact& contact : outcome.contacts) {
      const auto [low, high] = std::minmax(contact.body[0], contact.body[1]);
      if (!contact.expected) take({{low, high}, 0, contact}, earliest);
    }
  }
  std::sort(earliest.begin(), earliest.end(), [](const NewContact& a, const NewContact& b) {
    return a.contact.toc_lower != b.contact.toc_lower ? a.contact.toc_lower < b.contact.toc_lower
                                                       : canonicalLess(a.contact, b.contact);
  });
  return earliest;
}

}  // namespace dccd
