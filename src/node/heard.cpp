#include "node/heard.h"

#include <utility>

#include "input/short_text.h"

namespace dccd {

void OtherMarkers::add(const PassedOver& message) {
  ++messages;
  newest = shortText(message.what());
  may_be_things = may_be_things || message.may_be_things;
}

double Source::hear(const DecodedMesh& mesh, const MeshMessage& message) {
  const StampNs before_ns = std::exchange(stamp_ns, mesh.stamp_ns);
  if (before_ns > mesh.stamp_ns) lead = {};
  lead.add(mesh.stamp_ns, message.receipt_ns);
  senders.hear(message.sender);
  if (frame != mesh.frame_id) frame = mesh.frame_id;
  const std::size_t before = std::exchange(vertices, mesh.positions.size());
  const bool has_others = before != 0 && before != vertices;
  is_renumbered = is_renumbered || has_others || mesh.weld_changes > 0 || mesh.is_joined_anew;
  return secondsBetween(mesh.stamp_ns, before_ns);
}

void Senders::hear(const std::string& sender) {
  if (sender.empty() || sender == last || in_turn) return;
  constexpr std::size_t MOST_GONE = 64;  // a publisher may come each time under another name
  in_turn = gone.count(sender) > 0;
  if (gone.size() >= MOST_GONE) gone.clear();
  before = std::exchange(last, sender);
  gone.insert(before);
}

std::string Senders::problem(const std::string& what) const {
  if (!in_turn) return "";
  return what + " came in turn from two publishers, " + shortText(before) + " and " + shortText(last) +
         ": which of them shows it is not known (~reset forgets both)";
}

}  // namespace dccd
