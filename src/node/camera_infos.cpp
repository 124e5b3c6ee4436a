#include "node/camera_infos.h"

#include <algorithm>

#include "input/transform_tracks.h"
#include "input/wire.h"

namespace dccd {
namespace {

// A picture may wait for tf or its turn while so many come after its own: 0.7 s at 90 Hz.
constexpr std::size_t MOST_KEPT = 64;

}  // namespace

std::string CameraInfos::add(const std::string& problem, const std::vector<std::uint8_t>& bytes) {
  PinholeView pinhole;
  try {
    if (!problem.empty()) throw WireError(problem);
    WireReader wire(bytes.data(), bytes.size());
    pinhole = readPinhole(wire);
  } catch (const WireError& error) {
    pinhole.problem = error.what();
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  const StampNs stamp_ns = pinhole.stamp_ns;
  const bool is_contradicted = std::any_of(used_.begin(), used_.end(), [&](const auto& one) {
    return stamp_ns != 0 && one.first == stamp_ns && one.second != pinhole.said;
  });
  came_.push_back(std::move(pinhole));
  if (came_.size() > MOST_KEPT) came_.pop_front();
  if (!is_contradicted) return "";
  return "the CameraInfo on " + topic_ + " of the picture at " + secondsOf(stamp_ns) +
         " came after that was used, and differs from those before";
}

std::optional<PinholeView> CameraInfos::find(StampNs stamp_ns, std::string& why_not) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto isOwn = [&](const PinholeView& one) { return stamp_ns != 0 && one.stamp_ns == stamp_ns; };
  const bool has_own = std::any_of(came_.begin(), came_.end(), isOwn);
  std::vector<const PinholeView*> fitting;
  for (const PinholeView& one : came_) {
    if (!has_own || isOwn(one)) fitting.push_back(&one);
  }
  if (fitting.empty()) {
    why_not = "no CameraInfo has come on " + topic_ +
              "; name its topic by camera_info in obstacle_cloud_topics, or take the camera's cloud";
    return std::nullopt;
  }
  const PinholeView& last = *fitting.back();
  for (const PinholeView* one : fitting) {
    if (one->said == last.said) continue;
    const PinholeView& unread = one->said.empty() ? *one : last;
    why_not = unread.said.empty() ? "the CameraInfo on " + topic_ + ": " + unread.problem
              : has_own           ? "two CameraInfos of its stamp on " + topic_ + " differ"
                                  : "no CameraInfo of its stamp has come on " + topic_ + ", and those around it differ";
    return std::nullopt;
  }
  used_.emplace_back(stamp_ns, last.said);
  if (used_.size() > MOST_KEPT) used_.pop_front();
  return last;
}

}  // namespace dccd
