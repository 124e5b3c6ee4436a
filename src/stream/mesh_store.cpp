#include "dccd/mesh_store.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <stdexcept>
#include <string>

#include "stream/radii.h"

namespace dccd {

namespace {

void check(const MeshStoreOptions& options) {
  // No step is too long for its nanoseconds to be counted.
  if (!(options.max_step_s > 0 && options.max_step_s <= 1e9)) {
    throw std::invalid_argument("max_step_s must be above 0 and at most 1e9, is " + std::to_string(options.max_step_s));
  }
  if (!(options.max_vertex_step_m >= 0)) {
    throw std::invalid_argument("max_vertex_step_m must be 0 (off) or more, is " +
                                std::to_string(options.max_vertex_step_m));
  }
  if (options.capacity < 2) throw std::invalid_argument("capacity must be 2 or more");
}

// A vertex that is lost or found (NaN at one end) does not say anything about the others.
bool teleports(const Positions& a, const Positions& b, double limit_m) {
  const double limit_sq = limit_m * limit_m;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if ((b[i] - a[i]).squaredNorm() > limit_sq && a[i].allFinite() && b[i].allFinite()) return true;
  }
  return false;
}

/// Bit for bit: a lost vertex is one once more.
template <class T>
bool sameBits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

bool isTheSame(const MeshFrame& a, const MeshFrame& b) {
  return (a.topology == b.topology || *a.topology == *b.topology) && sameBits(a.positions, b.positions) &&
         sameBits(a.radius_m, b.radius_m) && a.dropped_faces == b.dropped_faces && a.doubt == b.doubt;
}

double fraction(StampNs a, StampNs b, StampNs at) { return static_cast<double>(at - a) / static_cast<double>(b - a); }

}  // namespace

void interpolate(const Positions& a, const Positions& b, double u, Positions& out) {
  out.resize(a.size());
  if (u <= 0 || u >= 1) {
    std::copy((u <= 0 ? a : b).begin(), (u <= 0 ? a : b).end(), out.begin());
    return;
  }
  for (std::size_t i = 0; i < a.size(); ++i) out[i] = a[i] + u * (b[i] - a[i]);
}

Eigen::Isometry3d interpolate(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double u) {
  if (u == 0) return a;
  if (u == 1) return b;
  // By angle and axis, not by slerp, whose weights are not meant for u outside [0,1].
  const Eigen::AngleAxisd turn(Eigen::Quaterniond(a.linear().transpose() * b.linear()).normalized());
  double angle = turn.angle();
  if (angle > M_PI) angle -= 2 * M_PI;
  Eigen::Isometry3d out = Eigen::Isometry3d::Identity();
  out.linear() = a.linear() * Eigen::AngleAxisd(u * angle, turn.axis()).toRotationMatrix();
  out.translation() = a.translation() + u * (b.translation() - a.translation());
  return out;
}

MeshStore::MeshStore(const MeshStoreOptions& options) : options_(options) { check(options); }

void MeshStore::setOptions(const MeshStoreOptions& options) {
  check(options);
  options_ = options;
}

void MeshStore::clear() {
  frames_.clear();
  vertices_ = 0;
  seen_until_ns_ = NEVER_NS;
}

void MeshStore::forgetOldest() {
  vertices_ -= frames_.front().frame->positions.size();
  frames_.pop_front();
}

StepStatus MeshStore::classify(const MeshFrame& frame) const {
  if (!frame.topology || frame.positions.size() != frame.topology->vertexCount()) return StepStatus::VERTEX_COUNT;
  if (!frame.radius_m.empty() && frame.radius_m.size() != frame.positions.size()) return StepStatus::VERTEX_COUNT;
  if (frames_.empty()) return StepStatus::FIRST_FRAME;
  const MeshFrame& last = newest();
  if (frame.stamp_ns == last.stamp_ns) return StepStatus::DUPLICATE;
  if (frame.stamp_ns < last.stamp_ns) return StepStatus::TIME_JUMP;
  if (frame.topology != last.topology && *frame.topology != *last.topology) return StepStatus::TOPOLOGY_CHANGED;
  if (secondsBetween(last.stamp_ns, frame.stamp_ns) > options_.max_step_s) return StepStatus::GAP;
  if (options_.max_vertex_step_m > 0 && teleports(last.positions, frame.positions, options_.max_vertex_step_m)) {
    return StepStatus::TELEPORT;
  }
  return StepStatus::OK;
}

StepStatus MeshStore::push(MeshFrame frame) {
  came_ = frame.number > 0 ? frame.number : came_ + 1;  // whatever becomes of it
  const StepStatus status = classify(frame);
  if (status == StepStatus::DUPLICATE) comesAgain(frame);
  if (status == StepStatus::VERTEX_COUNT) why_ = toString(status);
  if (status == StepStatus::VERTEX_COUNT || status == StepStatus::DUPLICATE) return status;
  const bool begins = status != StepStatus::OK;
  if (!begins) frame.topology = newest().topology;  // equal; one object a run, so that pointers tell runs apart
  const std::size_t vertices = frame.positions.size();
  // What may throw comes first.
  std::string unknown;
  if (!begins) {
    unknown = unknownAfterNewest(frame.thinned + 1);
    if (unknown.empty()) unknown = frame.doubt;
  }
  const StampNs seen_until_ns = status == StepStatus::TIME_JUMP ? lateAfter(frame.stamp_ns) : seen_until_ns_;
  frames_.push_back({std::make_shared<const MeshFrame>(std::move(frame)), run_ + (begins ? 1 : 0), came_, {}});
  frames_.back().unknown = std::move(unknown);
  why_.clear();
  vertices_ += vertices;
  if (begins) {
    ++run_;
    run_reason_ = status;
  }
  seen_until_ns_ = seen_until_ns;
  // Stamps must ascend within the store: after a jump back nothing older can be of use. A fast stream of few vertices
  // may run far ahead of a clock body that comes late; large meshes may not fill the memory.
  const std::size_t most = status == StepStatus::TIME_JUMP ? 1 : options_.capacity;
  const auto full = [&] {
    const bool may_forget = frames_.size() > tolerance::FRAMES_ALWAYS_KEPT;
    return frames_.size() > most || (may_forget && vertices_ > options_.max_vertices);
  };
  while (full()) forgetOldest();
  return status;
}

/// The latest stamp that came before a frame that is late; NEVER_NS: it is not. Where stamps go back further, time
/// begins anew.
StampNs MeshStore::lateAfter(StampNs stamp_ns) const {
  const StampNs latest_ns = empty() ? seen_until_ns_ : std::max(seen_until_ns_, newest().stamp_ns);
  return isLate(stamp_ns, latest_ns) ? latest_ns : NEVER_NS;
}

void MeshStore::replace(const MeshStore& before, StampNs next_ns) { seen_until_ns_ = before.lateAfter(next_ns); }

void MeshStore::passOver(std::uint64_t count, std::string why) {
  came_ += count;
  why_ = std::move(why);
}

/// With the stamp of the newest one: if it is that one once more nothing is missed with it.
void MeshStore::comesAgain(const MeshFrame& frame) {
  Kept& last = frames_.back();
  if (isTheSame(*last.frame, frame)) {
    ++last.number;
    return;
  }
  last.unknown = "a second frame of the same stamp has the body elsewhere";
  why_ = "its stamp is that of the frame before, which has the body elsewhere";
}

/// Of those that came since, so many are accounted for.
std::string MeshStore::unknownAfterNewest(std::uint64_t accounted) const {
  const Kept& last = frames_.back();
  if (came_ <= last.number + accounted) return last.frame->doubt;
  const std::uint64_t missed = came_ - last.number - accounted;
  return std::to_string(missed) + (missed == 1 ? " frame of it that came was" : " frames of it that came were") +
         " not used: " + (why_.empty() ? "the queue was full (QUEUE_FULL), or memory ran out" : why_);
}

std::string MeshStore::unknownWithin(StampNs from_ns, StampNs to_ns) const {
  std::size_t i = firstAtOrAfter(from_ns + 1);
  const StampNs begin_ns = i > 0 ? frames_[i - 1].frame->stamp_ns : from_ns;
  if (begin_ns < seen_until_ns_) {
    return "its stamps went back, and what came before with later ones is not used";
  }
  for (; i < frames_.size() && (i == 0 || frames_[i - 1].frame->stamp_ns < to_ns); ++i) {
    if (!frames_[i].unknown.empty()) return frames_[i].unknown;
  }
  return i == frames_.size() && !empty() && newest().stamp_ns < to_ns ? unknownAfterNewest(0) : std::string();
}

std::uint64_t MeshStore::thinnedWithin(StampNs from_ns, StampNs to_ns) const {
  std::uint64_t sum = 0;
  for (std::size_t i = firstAtOrAfter(from_ns + 1);
       i < frames_.size() && (i == 0 || frames_[i - 1].frame->stamp_ns < to_ns); ++i) {
    sum += frames_[i].frame->thinned;
  }
  return sum;
}

std::shared_ptr<const MeshFrame> MeshStore::previous() const {
  const std::size_t n = frames_.size();
  return n >= 2 && frames_[n - 2].run == frames_[n - 1].run ? frames_[n - 2].frame : nullptr;
}

std::size_t MeshStore::firstAtOrAfter(StampNs stamp_ns) const {
  const auto isBefore = [](const Kept& kept, StampNs at) { return kept.frame->stamp_ns < at; };
  auto it = frames_.end();
  // Most questions are about the newest frames; the others lie anywhere in memory.
  for (int newest = 0; newest < 4 && it != frames_.begin() && !isBefore(*std::prev(it), stamp_ns); ++newest) --it;
  if (it != frames_.begin() && !isBefore(*std::prev(it), stamp_ns)) {
    it = std::lower_bound(frames_.begin(), it, stamp_ns, isBefore);
  }
  return static_cast<std::size_t>(it - frames_.begin());
}

Lookup MeshStore::lookup(StampNs stamp_ns, std::uint64_t* run) const {
  const std::size_t i = firstAtOrAfter(stamp_ns);
  if (i == frames_.size()) return Lookup::NOT_YET;
  const bool at_frame = frames_[i].frame->stamp_ns == stamp_ns;
  if (!at_frame && (i == 0 || frames_[i - 1].run != frames_[i].run)) return Lookup::TOO_OLD;
  if (run) *run = frames_[i].run;
  return Lookup::READY;
}

std::shared_ptr<const MeshFrame> MeshStore::frameAt(StampNs stamp_ns) const {
  const std::size_t i = firstAtOrAfter(stamp_ns);
  const MeshFrame& b = *frames_[i].frame;
  if (b.stamp_ns == stamp_ns) return frames_[i].frame;
  const MeshFrame& a = *frames_[i - 1].frame;
  MeshFrame at;
  at.stamp_ns = stamp_ns;
  at.topology = b.topology;
  at.rigid = b.rigid;
  at.radius_m = largerRadii(a.radius_m, b.radius_m);
  at.dropped_faces = std::max(a.dropped_faces, b.dropped_faces);
  const double u = fraction(a.stamp_ns, b.stamp_ns, stamp_ns);
  if (b.rigid) {
    at.pose = interpolate(a.pose, b.pose, u);
    const Eigen::Isometry3d moved = at.pose * b.pose.inverse();
    at.positions.reserve(b.positions.size());
    for (const Vec3& p : b.positions) at.positions.push_back(moved * p);
  } else {
    interpolate(a.positions, b.positions, u, at.positions);
  }
  return std::make_shared<const MeshFrame>(std::move(at));
}

std::vector<std::shared_ptr<const MeshFrame>> MeshStore::framesWithin(StampNs from_ns, StampNs to_ns) const {
  std::vector<std::shared_ptr<const MeshFrame>> within;
  const std::size_t end = firstAtOrAfter(to_ns);
  for (std::size_t i = firstAtOrAfter(from_ns + 1); i < end; ++i) within.push_back(frames_[i].frame);
  return within;
}

std::vector<MeshStore::Stretch> MeshStore::pathWithin(StampNs from_ns, StampNs to_ns) const {
  std::vector<Stretch> path;
  for (std::size_t i = frames_.size(); i-- > 0;) {
    const std::shared_ptr<const MeshFrame>& to = frames_[i].frame;
    const bool joined = i > 0 && frames_[i - 1].run == frames_[i].run;
    const bool goes_on = i + 1 < frames_.size() && frames_[i + 1].run == frames_[i].run;
    if (joined) {
      const std::shared_ptr<const MeshFrame>& from = frames_[i - 1].frame;
      if (from->stamp_ns > to_ns || to->stamp_ns < from_ns) continue;
      path.push_back({from, to, fraction(from->stamp_ns, to->stamp_ns, std::max(from_ns, from->stamp_ns)),
                      fraction(from->stamp_ns, to->stamp_ns, std::min(to_ns, to->stamp_ns))});
    } else if (!goes_on && to->stamp_ns >= from_ns && to->stamp_ns <= to_ns) {
      path.push_back({to, to, 0, 0});
    }
  }
  return path;
}

void MeshStore::forgetBefore(StampNs stamp_ns) {
  // The frame at or just before the stamp is still needed to interpolate, and the newest two to extrapolate.
  while (frames_.size() > 2 && frames_[1].frame->stamp_ns <= stamp_ns) forgetOldest();
}

}  // namespace dccd
