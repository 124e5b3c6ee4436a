#include "report/contact_log.h"
#include "stream/quantile.h"

#include <algorithm>
#include <tuple>

namespace dccd {

namespace {

constexpr std::size_t LEAVING = 4;  // place of that flag in the key of a contact

}  // namespace

void ContactLog::add(const Outcome& outcome) {
  if (!outcome.answered) return;
  ms_.push_back(outcome.stats.total_ms);
  auto& step = steps_[outcome.sequence];
  for (const Contact& c : outcome.contacts) {
    const Key key{std::uint64_t{static_cast<std::uint8_t>(c.kind)} << 32 | std::uint64_t{c.body[0]} << 16 | c.body[1],
                  std::uint64_t{c.vertex[0]} << 32 | c.vertex[1], std::uint64_t{c.vertex[2]} << 32 | c.vertex[3],
                  std::uint64_t{c.voxel.x} << 32 | std::uint64_t{c.voxel.y} << 16 | c.voxel.z,
                  std::uint64_t{c.leaving}};
    static_assert(std::tuple_size<Key>::value == LEAVING + 1, "the flag is the key's last word");
    step[key] = {{c.toc_lower, c.toc_upper}, c.certainty == Certainty::CERTAIN};
  }
}

// What is undecided may be on its way in or out: a rung that did not look for the time does not know.
bool ContactLog::covers(const std::map<Key, Entry>& found, Key key) {
  if (found.count(key) > 0) return true;
  key[LEAVING] ^= 1;
  const auto other = found.find(key);
  return other != found.end() && !other->second.certain;
}

RungCost ContactLog::against(const ContactLog& exact, const std::string& rung) const {
  RungCost cost;
  cost.rung = rung;
  cost.steps = steps_.size();
  cost.median_ms = quantile(ms_, 0.5);
  cost.p95_ms = quantile(ms_, 0.95);
  static const std::map<Key, Entry> NONE;
  for (const auto& [sequence, found] : steps_) {
    const auto other = exact.steps_.find(sequence);
    const auto& truth = other == exact.steps_.end() ? NONE : other->second;
    cost.contacts += found.size();
    for (const auto& [key, entry] : found) {
      const auto match = truth.find(key);
      cost.undecided += !entry.certain;
      if (match == truth.end()) {
        cost.false_contacts += entry.certain;
      } else if (entry.certain) {
        cost.max_toc_error = std::max(cost.max_toc_error, tocError(entry.cell, match->second.cell));
      }
    }
    for (const auto& [key, entry] : truth) cost.missed += !covers(found, key);
  }
  return cost;
}

}  // namespace dccd
