#include "input/marker_names.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "input/short_text.h"

namespace dccd {
namespace {

constexpr std::size_t MOST_IDS = 64, MOST_SHOWN = 1024;  // that are remembered

/// A name may be as long as a message; its beginning tells markers apart.
std::string namespaceOf(const MarkerView& marker) { return std::string(marker.ns.substr(0, MAX_NAME)); }

}  // namespace

std::string nameOf(std::string_view ns, std::int32_t id) {
  return "('" + std::string(ns.substr(0, 32)) + "', " + std::to_string(id) + ")";
}

std::string nameOf(const MarkerView& marker) { return nameOf(marker.ns, marker.id); }

bool MarkerNames::has(const MarkerView& marker) const {
  return std::binary_search(namespaces_.begin(), namespaces_.end(), namespaceOf(marker));
}

bool MarkerNames::isOther(const MarkerView& marker) const {
  return !namespaces_.empty() && !(has(marker) && (!is_alone_ || marker.id == id_));
}

void MarkerNames::require(const std::vector<const MarkerView*>& taken) {
  const bool other_namespace =
      !namespaces_.empty() && std::none_of(taken.begin(), taken.end(), [&](const auto* one) { return has(*one); });
  const bool other_id = is_alone_ && taken[0]->is_message && taken[0]->id != id_ &&
                        std::find(ids_before_.begin(), ids_before_.end(), taken[0]->id) != ids_before_.end();
  if (conflict_.empty() && (other_namespace || other_id)) {
    conflict_ = "messages with marker " + example_ + " and with " + nameOf(*taken[0]) +
                " come in turn, so that it is not known which is the mesh; name it by " +
                (other_namespace ? "marker/namespace" : "marker/id") +
                ", or publish what belongs together in one MarkerArray (~reset forgets both)";
  }
  if (!conflict_.empty()) throw WireError(conflict_);
}

void MarkerNames::keep(const std::vector<const MarkerView*>& taken) {
  namespaces_.clear();
  for (const MarkerView* one : taken) namespaces_.push_back(namespaceOf(*one));
  std::sort(namespaces_.begin(), namespaces_.end());
  namespaces_.erase(std::unique(namespaces_.begin(), namespaces_.end()), namespaces_.end());
  example_ = nameOf(*taken[0]);
  if (is_alone_ && id_ != taken[0]->id) ids_before_.push_back(id_);
  if (ids_before_.size() > MOST_IDS) ids_before_.pop_front();
  is_alone_ = taken[0]->is_message;
  id_ = taken[0]->id;
}

void ShownMarkers::remove(const std::vector<MarkerView>& markers) {
  for (const MarkerView& marker : markers) {
    if (marker.action == MARKER_DELETE_ALL) shown_.clear();
    if (marker.action == MARKER_DELETE) shown_.erase({namespaceOf(marker), marker.id});
  }
}

ShownMarkers::Left ShownMarkers::show(const std::vector<const MarkerView*>& markers) {
  if (markers.empty()) return {};
  const StampNs now_ns = markers[0]->header.stamp_ns;
  const auto named = [](const auto& one) { return !one.second.is_renamed; };
  const auto before = static_cast<std::size_t>(std::count_if(shown_.begin(), shown_.end(), named));
  std::size_t stay = 0;
  for (const MarkerView* marker : markers) {
    const auto [one, is_other] = shown_.try_emplace({namespaceOf(*marker), marker->id});
    stay += !is_other;
    one->second = {now_ns, true, false};
    one->second.until_ns =
        marker->lifetime_ns > 0 ? marker->header.stamp_ns + marker->lifetime_ns : std::numeric_limits<StampNs>::max();
  }
  const bool all_are_renamed = may_rename_ && stay == 0 && before == markers.size();
  const bool is_known_to_rename = std::exchange(renames_, all_are_renamed) && all_are_renamed;
  Left left;
  for (auto one = shown_.begin(); one != shown_.end();) {
    const auto& [name, marker] = *one;
    const bool is_new = std::exchange(one->second.is_new, false);
    const bool goes = !is_new && (marker.until_ns < now_ns || shown_.size() > MOST_SHOWN + markers.size());
    if (!is_new) one->second.is_renamed = all_are_renamed;
    if (!is_new && !goes && !is_known_to_rename && left.count++ == 0) left.example = nameOf(name.first, name.second);
    one = goes ? shown_.erase(one) : std::next(one);
  }
  return left;
}

}  // namespace dccd
