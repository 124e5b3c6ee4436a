#include "output/patch_messages.h"

#include <set>

#include "base/contact_fields.h"
#include "dccd/monitor_extras.h"
#include "output/output_messages.h"

namespace dccd {
namespace {

using EventMessage = deformable_ccd::PatchEvent;
using PatchMessage = deformable_ccd::Patch;

static_assert(static_cast<int>(PatchBeginning::MAP_CHANGED) == static_cast<int>(PatchMessage::MAP_CHANGED));
static_assert(static_cast<int>(PatchEventKind::ENDED) == static_cast<int>(EventMessage::ENDED));
static_assert(static_cast<int>(PatchEventKind::SPLIT) == static_cast<int>(EventMessage::SPLIT));
static_assert(static_cast<int>(PatchEventKind::UNEXPECTED) == static_cast<int>(EventMessage::UNEXPECTED));

ros::Time knownTime(StampNs stamp_ns) { return stamp_ns == UNKNOWN_NS ? ros::Time() : toRosTime(stamp_ns); }

PatchMessage toMessage(const Patch& patch, const std::vector<Body>& bodies) {
  PatchMessage out;
  const auto fill = [&](const auto& from, auto& to) {
    using To = std::decay_t<decltype(to)>;
    if constexpr (std::is_same_v<To, PatchMessage::_bodies_type>) {
      putNames(from, bodies, to);
    } else if constexpr (std::is_same_v<To, ros::Time>) {
      to = knownTime(from);
    } else if constexpr (std::is_same_v<std::decay_t<decltype(from)>, Box>) {
      if (!from.empty()) put(from.min, to);
    } else {
      put(from, to);
    }
  };
#define DCCD_FILL_PATCH(member, published) fill(patch.member, out.published);
  DCCD_PUBLISHED_PATCH_FIELDS(DCCD_FILL_PATCH)
#undef DCCD_FILL_PATCH
  if (!patch.box.empty()) put(patch.box.max, out.box_max);
  return out;
}

std::string listOf(const std::vector<std::uint64_t>& ids) {
  std::string text;
  for (const std::uint64_t id : ids) text += (text.empty() ? "" : ", ") + std::to_string(id);
  return text;
}

std::string summaryOf(const PatchEvent& event, const std::vector<Body>& bodies) {
  const std::string name = "patch " + std::to_string(event.id) + " of " + pairOf(event.body, bodies);
  switch (event.kind) {
    case PatchEventKind::BEGAN:
      if (event.beginning == PatchBeginning::INITIAL) return name + " touched already when it was first looked at";
      if (event.beginning == PatchBeginning::MAP_CHANGED) return name + " began where the map changed";
      return name + " began" + (event.expected ? ", as expected" : "");
    case PatchEventKind::ENDED:
      return name + (event.to_ns == UNKNOWN_NS ? " was lost sight of" : " ended");
    case PatchEventKind::SPLIT:
      return name + " split: " + listOf(event.others) + " came off";
    case PatchEventKind::MERGED:
      return name + " merged: " + listOf(event.others) + " went into it";
    case PatchEventKind::UNEXPECTED:
      return name + " is no longer as expected";
  }
  return name;
}

}  // namespace

std::string pairOf(const std::array<std::uint16_t, 2>& body, const std::vector<Body>& bodies) {
  return bodyName(body[0], bodies) + " and " + (body[0] == body[1] ? "itself" : bodyName(body[1], bodies));
}

deformable_ccd::PatchArray toPatchArray(const Outcome& outcome, const std::vector<Body>& bodies,
                                        const std::string& frame) {
  deformable_ccd::PatchArray out;
  out.header = headerOf(outcome.stamp_ns, frame);
  out.status = static_cast<std::uint8_t>(outcome.status);
  out.answered = outcome.answered;
  for (const Patch& patch : outcome.patches) out.patches.push_back(toMessage(patch, bodies));
  return out;
}

std::vector<EventMessage> toPatchEvents(const Outcome& outcome, const std::vector<Body>& bodies,
                                        const std::string& frame) {
  std::vector<EventMessage> all;
  for (const PatchEvent& event : outcome.patch_events) {
    EventMessage out;
    out.header = headerOf(outcome.stamp_ns, frame);
    out.kind = static_cast<std::uint8_t>(event.kind);
    out.id = event.id;
    out.others = event.others;
    putNames(event.body, bodies, out.bodies);
    out.expected = event.expected;
    out.beginning = static_cast<std::uint8_t>(event.beginning);
    out.earliest = knownTime(event.from_ns);
    out.latest = knownTime(event.to_ns);
    out.summary = summaryOf(event, bodies);
    all.push_back(std::move(out));
  }
  return all;
}

std::vector<deformable_ccd::PairContact> toPairContacts(const Outcome& outcome, const std::vector<Body>& bodies) {
  std::vector<deformable_ccd::PairContact> all;
  for (const NewContact& one : newContacts(outcome)) {
    deformable_ccd::PairContact out;
    putNames(one.body, bodies, out.bodies);
    out.patch = one.patch;
    out.contact = toContact(outcome, one.contact, one.patch);
    out.earliest = toRosTime(outcome.stampBefore(one.contact.toc_lower));
    out.latest = toRosTime(outcome.stampAfter(one.contact.toc_upper));
    all.push_back(std::move(out));
  }
  return all;
}

std::size_t lastingPatches(const Outcome& outcome) {
  std::set<std::uint64_t> ids;
  for (const Patch& patch : outcome.patches) {
    if (patch.id != 0 && !patch.isExpected() && !patch.is_new) ids.insert(patch.id);
  }
  return ids.size();
}

}  // namespace dccd
