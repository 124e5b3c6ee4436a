#include "record/step_replay.h"

#include <algorithm>
#include <cstring>
#include <sstream>

namespace dccd {

namespace {

constexpr std::size_t MAX_DIFFERENCES = 10;

bool sameBits(double a, double b) { return std::memcmp(&a, &b, sizeof a) == 0; }

bool samePair(const Contact& a, const Contact& b) {
  return a.kind == b.kind && a.body == b.body && a.vertex == b.vertex && a.voxel == b.voxel &&
         a.voxel_size == b.voxel_size;
}

bool sameContact(const Contact& a, const Contact& b) {
  return samePair(a, b) && sameBits(a.toc_lower, b.toc_lower) && sameBits(a.toc_upper, b.toc_upper) &&
         a.certainty == b.certainty && a.initial == b.initial && a.leaving == b.leaving && a.expected == b.expected;
}

std::string pairText(const Contact& c) {
  std::ostringstream text;
  text.precision(17);
  text << toString(c.kind) << " of bodies " << c.body[0] << ", " << c.body[1] << ", vertices";
  for (const Index v : c.vertex) {
    if (v != NO_INDEX) text << ' ' << v;
  }
  if (c.body[1] == OBSTACLE_BODY) text << ", voxel " << c.voxel.x << ' ' << c.voxel.y << ' ' << c.voxel.z;
  text << ", toc [" << c.toc_lower << ", " << c.toc_upper << "]";
  return text.str();
}

bool samePatch(const Patch& a, const Patch& b) {
  const auto places = [](const Patch& p) {
    return std::array<double, 13>{p.area_m2,    p.centroid[0], p.centroid[1], p.centroid[2], p.normal[0],
                                  p.normal[1],  p.normal[2],   p.box.min[0],  p.box.min[1],  p.box.min[2],
                                  p.box.max[0], p.box.max[1],  p.box.max[2]};
  };
  const auto counts = [](const Patch& p) {
    return std::tie(p.body, p.contacts, p.certain, p.initial, p.crossings, p.expected);
  };
  const std::array<double, 13> x = places(a), y = places(b);
  return counts(a) == counts(b) && sameBits(a.toc_lower, b.toc_lower) && sameBits(a.toc_upper, b.toc_upper) &&
         sameContact(a.earliest, b.earliest) && std::equal(x.begin(), x.end(), y.begin(), sameBits);
}

class Differences {
 public:
  template <typename T>
  void field(const char* name, const T& recorded, const T& replayed) {
    if (recorded == replayed) return;
    std::ostringstream text;
    text << name << ": recorded " << recorded << ", replayed " << replayed;
    add(text.str());
  }
  void field(const char* name, double recorded, double replayed) {
    if (sameBits(recorded, replayed)) return;
    std::ostringstream text;
    text.precision(17);
    text << name << ": recorded " << recorded << ", replayed " << replayed;
    add(text.str());
  }
  void add(const std::string& text) {
    if (found_.size() < MAX_DIFFERENCES) found_.push_back(text);
  }
  std::vector<std::string> take() { return std::move(found_); }

 private:
  std::vector<std::string> found_;
};

void compareContacts(const Outcome& recorded, const Outcome& replayed, Differences& out) {
  out.field("number of contacts", recorded.contacts.size(), replayed.contacts.size());
  const std::size_t n = std::min(recorded.contacts.size(), replayed.contacts.size());
  for (std::size_t i = 0; i < n; ++i) {
    if (sameContact(recorded.contacts[i], replayed.contacts[i])) continue;
    out.add("contact " + std::to_string(i) + ": recorded " + pairText(recorded.contacts[i]) + "; replayed " +
            pairText(replayed.contacts[i]));
  }
}

/// The recorded step ended early: what it called certain must be among the replayed contacts.
void compareCertain(const Outcome& recorded, const Outcome& replayed, Differences& out) {
  for (const Contact& c : recorded.contacts) {
    if (c.certainty != Certainty::CERTAIN) continue;
    const bool found = std::any_of(replayed.contacts.begin(), replayed.contacts.end(),
                                   [&](const Contact& other) { return sameContact(c, other); });
    if (!found) out.add("recorded as certain, not replayed: " + pairText(c));
  }
}

}  // namespace

std::vector<std::string> compareAnswers(const Outcome& recorded, const Outcome& replayed) {
  Differences out;
  if (!recorded.answered || !recorded.complete) {
    if (recorded.answered) compareCertain(recorded, replayed, out);
    return out.take();
  }
  out.field("status", std::string(toString(recorded.status)), std::string(toString(replayed.status)));
  out.field("start state", std::string(toString(recorded.start_state)), std::string(toString(replayed.start_state)));
  out.field("contacts before the cut to max_contacts", recorded.total_contacts, replayed.total_contacts);
  out.field("suppressed contacts", recorded.suppressed, replayed.suppressed);
  out.field("excluded voxels", recorded.excluded_voxels, replayed.excluded_voxels);
  out.field("parts of the step", recorded.substeps, replayed.substeps);
  out.field("earliest toc", recorded.earliest_toc, replayed.earliest_toc);
  compareContacts(recorded, replayed, out);
  out.field("touching", std::string(toString(recorded.touching)), std::string(toString(replayed.touching)));
  if (recorded.unproved != replayed.unproved) out.add("what was not shown differs");
  out.field("earliest unexpected toc", recorded.earliest_unexpected_toc, replayed.earliest_unexpected_toc);
  const bool same_patches = std::equal(recorded.patches.begin(), recorded.patches.end(), replayed.patches.begin(),
                                       replayed.patches.end(), samePatch);
  if (!same_patches || recorded.patch_of != replayed.patch_of) out.add("the patches differ");
  const bool same =
      std::equal(recorded.intersections.begin(), recorded.intersections.end(), replayed.intersections.begin(),
                 replayed.intersections.end(), [](const StartIntersection& a, const StartIntersection& b) {
                   return a.body == b.body && a.vertex == b.vertex && a.expected == b.expected;
                 });
  if (!same) out.add("the intersections at t=0 differ");
  return out.take();
}

StepReplay replayStep(const StepRecording& recording, int threads) {
  Options options = recording.options;
  options.num_threads = threads;
  options.step_budget_ms = 0;
  options.max_compute_ms = 0;
  check(options);
  if (recording.step.bodies.empty()) throw std::invalid_argument("the recording has no body");
  StepReplay result;
  try {
    History history;
    result.answer = detect(recording.step, options, history);
  } catch (const std::invalid_argument& error) {
    result.answer.status = StepStatus::INTERNAL_ERROR;
    result.answer.reason = error.what();
  }
  if (recording.has_answer) result.differences = compareAnswers(recording.answer, result.answer);
  return result;
}

std::string describeContact(const Contact& c, const std::vector<Body>& bodies) {
  std::ostringstream text;
  const auto name = [&](std::uint16_t body) {
    return body < bodies.size()    ? bodies[body].name
           : body == OBSTACLE_BODY ? "octomap"
                                   : "body " + std::to_string(body);
  };
  const std::size_t first = factsOf(c.kind).vertices[0];
  text << toString(c.kind) << ' ' << name(c.body[0]);
  for (std::size_t i = 0; i < 4; ++i) {
    if (i == first && c.body[1] != OBSTACLE_BODY) text << " | " << name(c.body[1]);
    if (c.vertex[i] != NO_INDEX) text << ' ' << c.vertex[i];
  }
  if (c.body[1] == OBSTACLE_BODY) {
    text << " | voxel " << c.voxel.x << ' ' << c.voxel.y << ' ' << c.voxel.z << " of " << c.voxel_size;
  }
  return text.str();
}

}  // namespace dccd
