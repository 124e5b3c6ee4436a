#include "report/lanes.h"

#include <algorithm>
#include <cstdio>

#include "report/words.h"

namespace dccd {
namespace {

// Seconds with nine digits, exactly: a double does not hold the nanoseconds of today.
std::string stampText(StampNs ns) {
  char text[40];
  std::snprintf(text, sizeof text, "%lld.%09lld", static_cast<long long>(ns / 1000000000),
                static_cast<long long>(ns % 1000000000));
  return text;
}

}  // namespace

ContactLanes::Lane& ContactLanes::lane(const Partners& partners, const std::vector<Body>& bodies) {
  const auto [found, is_new] = lanes_.try_emplace(partners);
  if (is_new) found->second.names = {bodyName(partners[0], bodies), bodyName(partners[1], bodies)};
  return found->second;
}

void ContactLanes::extend(Lane& lane, std::uint64_t id, const Bar& bar, double step_start_s) {
  const auto known = lane.bar_of.find(id);
  if (known != lane.bar_of.end()) {
    Bar& last = lane.bars[known->second].second;
    // A patch that came back within patch_gap_s is the same one, but did not touch in between.
    if (last.to_s >= step_start_s - 1e-9 && last.expected == bar.expected) {
      last.to_s = std::max(last.to_s, bar.to_s);
      return;
    }
  }
  if (lane.bars.size() >= MOST_MARKS) {
    ++lane.left_out;
    return;
  }
  lane.bar_of[id] = lane.bars.size();
  lane.bars.emplace_back(id, bar);
}

void ContactLanes::addFirst(const Outcome& o, const std::vector<Body>& bodies, StampNs origin_ns) {
  std::map<Partners, const Contact*> earliest;
  for (const Contact& c : o.contacts) {
    if (c.initial || c.expected) continue;
    Partners partners{std::min(c.body[0], c.body[1]), std::max(c.body[0], c.body[1])};
    const Contact*& so_far = earliest[partners];
    if (!so_far || c.toc_lower < so_far->toc_lower) so_far = &c;
  }
  for (const auto& [partners, contact] : earliest) {
    Lane& of = lane(partners, bodies);
    if (!of.first.is_null()) continue;
    added_first_ = true;
    const StampNs at_ns =
        o.start_ns + static_cast<StampNs>(contact->toc_lower * static_cast<double>(o.stamp_ns - o.start_ns));
    const Vec3 where = contactGeometry(o, *contact).point;
    of.first = {{"text", contactInWords(*contact, bodies)},
                {"t", secondsBetween(origin_ns, at_ns)},
                {"stamp", stampText(at_ns)},
                {"where", {where.x(), where.y(), where.z()}},
                {"step", o.sequence}};
  }
}

void ContactLanes::add(const Outcome& o, const std::vector<Body>& bodies, StampNs origin_ns) {
  added_first_ = false;
  const double start_s = secondsBetween(origin_ns, o.start_ns), end_s = secondsBetween(origin_ns, o.stamp_ns);
  for (const PatchEvent& e : o.patch_events) {
    Lane& of = lane(e.body, bodies);
    if (of.events.size() >= MOST_MARKS) {
      ++of.left_out;
      continue;
    }
    const StampNs when_ns = e.to_ns != UNKNOWN_NS ? e.to_ns : e.from_ns != UNKNOWN_NS ? e.from_ns : o.stamp_ns;
    of.events.push_back({toString(e.kind), secondsBetween(origin_ns, when_ns), e.id, e.expected});
  }
  if (!o.answered) return;
  for (const Patch& p : o.patches) {
    const double from_s = p.is_new ? start_s + p.toc_lower * (end_s - start_s) : start_s;
    extend(lane(p.body, bodies), p.id, {from_s, end_s, p.isExpected()}, start_s);
  }
  if (o.patches.empty()) {  // without the effect: a bar for all that touches between two partners
    std::map<Partners, Bar> touching;
    for (const Contact& c : o.contacts) {
      Partners partners{std::min(c.body[0], c.body[1]), std::max(c.body[0], c.body[1])};
      const double from_s = start_s + c.toc_lower * (end_s - start_s);
      Bar& bar = touching.try_emplace(partners, Bar{from_s, end_s, true}).first->second;
      bar.from_s = std::min(bar.from_s, from_s);
      bar.expected = bar.expected && c.expected;
    }
    for (const auto& [partners, bar] : touching) extend(lane(partners, bodies), 0, bar, start_s);
  }
  addFirst(o, bodies, origin_ns);
}

nlohmann::json ContactLanes::json() const {
  nlohmann::json lanes = nlohmann::json::array();
  for (const auto& [partners, lane] : lanes_) {
    nlohmann::json bars = nlohmann::json::array();
    for (const auto& [id, bar] : lane.bars) bars.push_back({id, bar.from_s, bar.to_s, bar.expected});
    lanes.push_back({{"names", lane.names},
                     {"bars", std::move(bars)},
                     {"events", lane.events},
                     {"first", lane.first},
                     {"left_out", lane.left_out}});
  }
  return lanes;
}

}  // namespace dccd
