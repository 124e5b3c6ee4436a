#include "dccd/range_log.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "dccd/regular_file.h"
#include "stream/patch_tracker.h"

namespace dccd {
namespace {

// A range is joined by the program that computed it, on a machine of its kind: fields are written as they lie in
// memory. What tells a file of another build apart:
constexpr std::uint64_t FORMAT = 2;
constexpr std::uint64_t LAYOUT = FORMAT << 48 | sizeof(Patch) << 32 | sizeof(PatchSpot) << 16 | sizeof(Contact);
constexpr std::uint64_t MOST = std::uint64_t{1} << 32;  // bytes of a list

// A record begins with its kind.
constexpr char MESHES = 'M', SEAM = 'S', FOLLOW = 'F', TELL = 'T', OBSERVE = 'O', PREDICT = 'P', SCORE = 'L';

template <class T>
void put(std::string& out, const T& value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}
template <class T>
void putAll(std::string& out, const std::vector<T>& values) {
  put(out, static_cast<std::uint64_t>(values.size()));
  if (!values.empty()) out.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}
void putHead(std::string& out, const Outcome& outcome) {
  put(out, outcome.sequence);
  put(out, outcome.start_ns);
  put(out, outcome.stamp_ns);
  put(out, outcome.status);
  for (const bool flag : {outcome.answered, outcome.complete, outcome.cut}) put(out, std::uint8_t{flag});
}

class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path) {
    if (const std::string problem = regularFileProblem(path); !problem.empty()) fail(problem);
    file_.open(path, std::ios::binary);
    if (!file_) fail("cannot be read");
    if (get<std::uint64_t>() != LAYOUT) fail("was written by another version of the program");
  }
  [[noreturn]] void fail(const std::string& what) const { throw std::runtime_error(path_ + ": " + what); }
  bool next(char& kind) { return static_cast<bool>(file_.get(kind)); }
  template <class T>
  T get() {
    T value{};
    bytes(&value, sizeof value);
    return value;
  }
  template <class T>
  void getAll(std::vector<T>& values) {
    const auto n = get<std::uint64_t>();
    if (n > MOST / sizeof(T)) fail("a list has " + std::to_string(n) + " entries");
    values.resize(static_cast<std::size_t>(n));
    bytes(values.data(), values.size() * sizeof(T));
  }
  void getHead(Outcome& outcome) {
    outcome.sequence = get<std::uint64_t>();
    outcome.start_ns = get<StampNs>();
    outcome.stamp_ns = get<StampNs>();
    outcome.status = get<StepStatus>();
    for (bool* flag : {&outcome.answered, &outcome.complete, &outcome.cut}) *flag = get<std::uint8_t>() != 0;
  }

 private:
  void bytes(void* out, std::size_t size) {
    if (size == 0) return;
    if (!file_.read(static_cast<char*>(out), static_cast<std::streamsize>(size)))
      fail("ends in the middle of a record");
  }
  std::string path_;
  std::ifstream file_;
};

}  // namespace

RangeLog::RangeLog(const std::string& path, StepRange range, double look_ahead_s)
    : path_(path), file_(path, std::ios::binary | std::ios::trunc), range_(range) {
  if (look_ahead_s > 0) score_.emplace(look_ahead_s);
  if (!file_) throw std::runtime_error(path + ": cannot be written");
  std::string head;
  put(head, LAYOUT);
  file_ << head;
}

void RangeLog::seam(std::size_t body) {
  waiting_ += SEAM;
  put(waiting_, static_cast<std::uint64_t>(body));
}

void RangeLog::follow(const std::vector<PatchSpot>& spots, const std::vector<PatchUnexpected>& unexpected,
                      const std::vector<std::uint8_t>& on_new_voxel, const Outcome& outcome) {
  if (!range_.holds(outcome.sequence)) return;
  std::vector<std::shared_ptr<const Topology>> topologies;
  for (const Body& body : outcome.step->bodies) topologies.push_back(body.topology);
  if (topologies != topologies_) {
    waiting_ += MESHES;
    put(waiting_, static_cast<std::uint64_t>(topologies.size()));
    for (const auto& topology : topologies) {
      put(waiting_, static_cast<std::uint64_t>(topology->vertexCount()));
      putAll(waiting_, topology->faces());
    }
    topologies_ = std::move(topologies);
  }
  waiting_ += FOLLOW;
  putAll(waiting_, outcome.patches);
  putAll(waiting_, spots);
  putAll(waiting_, unexpected);
  putAll(waiting_, on_new_voxel);
  putHead(waiting_, outcome);
}

void RangeLog::tell(const Outcome& outcome) {
  if (range_.holds(outcome.sequence)) {
    waiting_ += TELL;
    putHead(waiting_, outcome);
    file_ << waiting_;
  }
  waiting_.clear();
}

void RangeLog::contacts(char kind, const Outcome& outcome) {
  std::string record(1, kind);
  putHead(record, outcome);
  putAll(record, outcome.contacts);
  file_ << record;
}

void RangeLog::observe(const Outcome& outcome) {
  if (!score_) return;
  score_->observe(outcome);
  if (keeps_score_) return;
  contacts(OBSERVE, outcome);
  if (!outcome.answered) return;
  if (!begin_ns_) begin_ns_ = outcome.start_ns;
  // The horizon of all that was predicted before the range is over, as LookAheadScore sees it.
  keeps_score_ = secondsBetween(*begin_ns_, outcome.stamp_ns) > score_->horizon_s();
  if (keeps_score_) score_->beginPart();
}

void RangeLog::predict(const Outcome& prediction) {
  if (!score_) return;
  score_->predict(prediction);
  if (!keeps_score_) contacts(PREDICT, prediction);
}

void RangeLog::close() {
  if (keeps_score_) {
    const LookAheadScore::Part part = score_->part();
    std::string record(1, SCORE);
    putAll(record, part.errors_s);
    put(record, part.not_observed);
    put(record, part.not_predicted);
    putAll(record, part.touching);
    putAll(record, part.pending);
    file_ << record;
  }
  file_.close();
  if (!file_) throw std::runtime_error(path_ + ": could not be written completely");
}

struct RangeJoin::Impl {
  PatchTracker tracker;
  std::optional<LookAheadScore> score;
  double gap_s = 0;
  std::shared_ptr<Step> step;  // the meshes alone
  std::vector<PatchSpot> spots;
  std::vector<PatchUnexpected> unexpected;
  std::vector<std::uint8_t> on_new_voxel;

  void readMeshes(Reader& in) {
    const auto bodies = in.get<std::uint64_t>();
    if (bodies > OBSTACLE_BODY) in.fail("has " + std::to_string(bodies) + " bodies");
    const std::shared_ptr<Step> before = std::exchange(step, std::make_shared<Step>());
    for (std::uint64_t b = 0; b < bodies; ++b) {
      const auto vertices = static_cast<std::size_t>(in.get<std::uint64_t>());
      std::vector<Face> faces;
      in.getAll(faces);
      Body body;
      // What has no faces is a rope.
      body.topology = std::make_shared<const Topology>(faces.empty() ? Topology::polyline(vertices)
                                                                     : Topology::fromTriangles(vertices, faces));
      // The same object over the cut, or every step would compare the two.
      if (before && b < before->bodies.size() && *before->bodies[b].topology == *body.topology) {
        body.topology = before->bodies[b].topology;
      }
      step->bodies.push_back(std::move(body));
    }
  }

  void follow(Reader& in, Outcome& outcome) {
    in.getAll(outcome.patches);
    in.getAll(spots);
    in.getAll(unexpected);
    in.getAll(on_new_voxel);
    in.getHead(outcome);
    outcome.step = step;
    const std::size_t patches = outcome.patches.size();
    std::size_t vertices = 0;
    for (const Body& body : step ? step->bodies : std::vector<Body>()) vertices += body.topology->vertexCount();
    const auto isOfNoPatch = [&](const PatchSpot& spot) {
      return spot.patch >= patches || spot.vertex >= vertices || (spot.across != NO_INDEX && spot.across >= vertices);
    };
    if (!step || unexpected.size() != patches || (!on_new_voxel.empty() && on_new_voxel.size() != patches) ||
        std::any_of(spots.begin(), spots.end(), isOfNoPatch)) {
      in.fail("spots come without their meshes or patches");
    }
    tracker.follow(spots, unexpected, on_new_voxel, gap_s, outcome);
  }
};

RangeJoin::RangeJoin(double patch_gap_s, double look_ahead_s) : impl_(std::make_unique<Impl>()) {
  impl_->gap_s = patch_gap_s;
  if (look_ahead_s > 0) impl_->score.emplace(look_ahead_s);
}
RangeJoin::~RangeJoin() = default;

void RangeJoin::gap() {
  impl_->tracker.seam();
  if (!impl_->score) return;
  Outcome seam;
  seam.status = StepStatus::GAP;
  impl_->score->observe(seam);
}

std::optional<LookAheadSummary> RangeJoin::lookAhead() const {
  return impl_->score ? std::make_optional(impl_->score->summary()) : std::nullopt;
}

void RangeJoin::add(const std::string& path, const std::function<void(const Outcome&)>& sink) {
  Reader in(path);
  Outcome outcome, of_score;
  for (char kind = 0; in.next(kind);) {
    if (kind == MESHES) {
      impl_->readMeshes(in);
    } else if (kind == SEAM) {
      impl_->tracker.seam(static_cast<std::size_t>(in.get<std::uint64_t>()));
    } else if (kind == FOLLOW) {
      impl_->follow(in, outcome);
    } else if (kind == TELL) {
      in.getHead(outcome);
      impl_->tracker.tell(outcome);
      sink(outcome);
      outcome = Outcome();
    } else if (kind == OBSERVE || kind == PREDICT) {
      in.getHead(of_score);
      in.getAll(of_score.contacts);
      if (impl_->score) kind == OBSERVE ? impl_->score->observe(of_score) : impl_->score->predict(of_score);
    } else if (kind == SCORE) {
      LookAheadScore::Part part;
      in.getAll(part.errors_s);
      part.not_observed = in.get<std::size_t>();
      part.not_predicted = in.get<std::size_t>();
      in.getAll(part.touching);
      in.getAll(part.pending);
      if (impl_->score) impl_->score->add(part);
    } else {
      in.fail("has a record of unknown kind " + std::to_string(kind));
    }
  }
}

}  // namespace dccd
