#include "report/report.h"

#include <algorithm>
#include <filesystem>
#include <iomanip>
#include <limits>

#include "base/contact_fields.h"
#include "dccd/assurance.h"
#include "report/words.h"

namespace dccd {
namespace {

/// What follows a field's name in the names of its columns, by its type.
template <class T>
std::vector<const char*> endsOf(const T&) {
  return {""};
}
std::vector<const char*> endsOf(const std::array<Index, 4>&) { return {"0", "1", "2", "3"}; }
std::vector<const char*> endsOf(const std::array<std::uint16_t, 2>&) { return {"_0", "_1"}; }
std::vector<const char*> endsOf(const VoxelKey&) { return {"_x", "_y", "_z"}; }
std::vector<const char*> endsOf(const Vec3&) { return {"_x", "_y", "_z"}; }
std::vector<const char*> endsOf(const Box&) { return {"_min_x", "_min_y", "_min_z", "_max_x", "_max_y", "_max_z"}; }

template <class T>
void writeNames(std::ostream& out, const std::string& member, const T& value) {
  const std::string name = member == "vertex" ? "v" : member == "id" ? "patch" : member;
  for (const char* end : endsOf(value)) out << ',' << name << end;
}

/// The cells of a row's fields, by their types.
struct Cells {
  std::ostream& out;
  const std::vector<Body>& bodies;
  bool on_map = false;  // else a voxel's cells stay empty

  template <class T>
  void operator()(const T& value) const {
    out << ',' << value;
  }
  void operator()(PairKind kind) const { out << ',' << factsOf(kind).short_name; }
  void operator()(Certainty certainty) const { out << (certainty == Certainty::CERTAIN ? ",certain" : ",undecided"); }
  void operator()(PatchBeginning beginning) const { out << ',' << toString(beginning); }
  void operator()(const std::array<std::uint16_t, 2>& partners) const {
    for (const std::uint16_t body : partners) out << ',' << csvField(bodyName(body, bodies));
  }
  void operator()(const std::array<Index, 4>& vertices) const {
    for (const Index v : vertices) writeIf(v != NO_INDEX, v);
  }
  void operator()(std::uint32_t voxel_size) const { writeIf(on_map, voxel_size); }
  void operator()(const VoxelKey& key) const {
    for (const std::uint16_t k : {key.x, key.y, key.z}) writeIf(on_map, k);
  }
  void operator()(const Vec3& v) const { out << ',' << v.x() << ',' << v.y() << ',' << v.z(); }
  void operator()(const Box& box) const {
    (*this)(box.min);
    (*this)(box.max);
  }
  void operator()(StampNs stamp_ns) const { writeIf(stamp_ns != UNKNOWN_NS, stamp_ns); }
  template <class T>
  void writeIf(bool is_there, const T& value) const {
    out << ',';
    if (is_there) out << value;
  }
};

}  // namespace

Report::Report(const std::string& folder) : folder_(folder), clearance_(folder + "/clearance.csv") {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  const auto open = [&](std::ofstream& file, const char* name) {
    file.open(folder_ + "/" + name);
    if (!file) throw std::runtime_error(folder_ + "/" + name + ": cannot be written");
    file << std::setprecision(17);
  };
  open(contacts_, "contacts.csv");
  open(steps_, "steps.csv");
  open(timing_, "timing.csv");
  open(patches_, "patches.csv");
  open(events_, "events.csv");
#define DCCD_NAME_COLUMNS(member, published) writeNames(contacts_, #member, Contact().member);
  contacts_ << "step,stamp_ns";
  DCCD_CONTACT_FIELDS(DCCD_NAME_COLUMNS)
#undef DCCD_NAME_COLUMNS
  contacts_ << ",time_s,point_x,point_y,point_z,normal_x,normal_y,normal_z,approach_speed_m_per_s\n";
  steps_
      << "step,start_ns,stamp_ns,status,reason,answered,start_state,clear,complete,contacts,undecided,initial,leaving,"
         "intersections,unchecked_vertices,unchecked_faces,earliest_toc,broad_phase_pairs,planar_pairs,"
         "elementary_pairs,obstacle_pairs,proved,told_ns,map_stamp_ns,map_came_ns,clock_body\n";
#define DCCD_NAME_COLUMNS(member, published) writeNames(patches_, #member, Patch().member);
  patches_ << "step,stamp_ns";
  DCCD_PUBLISHED_PATCH_FIELDS(DCCD_NAME_COLUMNS)
#undef DCCD_NAME_COLUMNS
  patches_ << '\n';
  events_ << "step,stamp_ns,event,patch,others,body_0,body_1,beginning,expected,earliest_s,latest_s\n";
  timing_ << "step,total_ms";
  for (std::size_t s = 0; s < stage_ms_.size(); ++s) timing_ << ',' << toString(static_cast<Stage>(s)) << "_ms";
  timing_ << '\n';
}

void Report::writeContacts(const Outcome& outcome, const std::vector<Body>& bodies) {
  for (const Contact& c : outcome.contacts) {
    const ContactGeometry g = contactGeometry(outcome, c);
    const Cells cells{contacts_, bodies, c.body[1] == OBSTACLE_BODY};
    contacts_ << outcome.sequence << ',' << outcome.stamp_ns;
#define DCCD_WRITE_CELLS(member, published) cells(c.member);
    DCCD_CONTACT_FIELDS(DCCD_WRITE_CELLS)
#undef DCCD_WRITE_CELLS
    cells(secondsBetween(origin_ns_, outcome.start_ns) + c.toc_lower * outcome.duration_s());
    cells(g.point);
    cells(g.normal);
    cells(g.approach_speed / std::max(outcome.duration_s(), 1e-9));
    contacts_ << '\n';
  }
}

void Report::writePatches(const Outcome& outcome, const std::vector<Body>& bodies) {
  const Cells cells{patches_, bodies}, event_cells{events_, bodies};
  for (const Patch& p : outcome.patches) {
    patches_ << outcome.sequence << ',' << outcome.stamp_ns;
#define DCCD_WRITE_CELLS(member, published) cells(p.member);
    DCCD_PUBLISHED_PATCH_FIELDS(DCCD_WRITE_CELLS)
#undef DCCD_WRITE_CELLS
    patches_ << '\n';
  }
  for (const PatchEvent& e : outcome.patch_events) {
    std::string others;
    for (const std::uint64_t id : e.others) others += (others.empty() ? "" : " ") + std::to_string(id);
    events_ << outcome.sequence << ',' << outcome.stamp_ns << ',' << toString(e.kind) << ',' << e.id << ',' << others;
    event_cells(e.body);
    event_cells(e.beginning);
    event_cells(e.expected);
    for (const StampNs when_ns : {e.from_ns, e.to_ns}) {
      event_cells.writeIf(when_ns != UNKNOWN_NS, secondsBetween(origin_ns_, when_ns));
    }
    events_ << '\n';
  }
}

void Report::writeStep(const Outcome& o, std::int64_t told_ns, const std::string& clock_body) {
  const StepStats& s = o.stats;
  const Assurance assurance = assuranceOf(o);
  // The status of a step that lacks nothing but its proof says nothing of why.
  std::string reason = o.reason;
  for (const std::string& missing : assurance.missing) {
    if (o.answered && o.reason.empty()) reason += (reason.empty() ? "" : "; ") + missing;
  }
  steps_ << o.sequence << ',' << o.start_ns << ',' << o.stamp_ns << ',' << toString(o.status) << ',' << csvField(reason)
         << ',' << o.answered << ',' << toString(o.start_state) << ',' << assurance.clear() << ',' << o.complete << ','
         << o.total_contacts << ',' << o.counts.undecided << ',' << o.counts.initial << ',' << o.counts.leaving << ','
         << o.intersections.size() << ',' << s.unchecked_vertices << ',' << s.unchecked_faces << ',';
  if (o.answered && o.earliest_toc <= 1) steps_ << o.earliest_toc;
  steps_ << ',' << s[Stage::BROAD_PHASE].out << ',' << s[Stage::PLANAR].out << ',' << s[Stage::ELEMENTARY].in << ','
         << s[Stage::OBSTACLE].in << ',' << assurance.proved << ',' << told_ns << ',';
  // Of several maps of one stamp the time at which it came tells which it was.
  const bool has_map = o.answered && o.step && o.step->map.surface;
  if (has_map) steps_ << o.step->map.stamp_ns;
  steps_ << ',';
  if (has_map) steps_ << o.step->map.arrival_ns;
  steps_ << ',' << csvField(clock_body) << '\n';
}

void Report::addHeat(const Outcome& outcome, const std::vector<Body>& bodies) {
  if (heat_.empty()) heat_.resize(bodies.size());
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    BodyHeat& heat = heat_[b];
    const auto& topology = outcome.step->bodies[b].topology;
    if (!topology || heat.contacts.size() == topology->vertexCount()) continue;
    // A body whose topology changed begins anew: its vertices are other ones.
    heat.name = bodies[b].name;
    heat.contacts.assign(topology->vertexCount(), 0);
    heat.first_s.assign(topology->vertexCount(), std::numeric_limits<double>::infinity());
  }
  const double start_s = secondsBetween(origin_ns_, outcome.start_ns);
  for (const Contact& c : outcome.contacts) {
    forContactVertices(c, [&](std::uint16_t body, Index v) {
      if (body >= heat_.size() || v >= heat_[body].contacts.size()) return;
      ++heat_[body].contacts[v];
      double& when = heat_[body].first_s[v];
      when = std::min(when, start_s + c.toc_lower * outcome.duration_s());
    });
  }
}

void Report::addFirstContact(const Outcome& o, const std::vector<Body>& bodies) {
  if (!first_contact_.empty()) return;
  // As of the lanes: what was there when its step began came before, at a time that nobody saw.
  const Contact* first = nullptr;
  for (const Contact& one : o.contacts) {
    if (one.expected) continue;
    if (one.initial) {
      if (first_initial_.empty()) first_initial_ = contactInWords(one, bodies);
    } else if (!first || one.toc_lower < first->toc_lower) {
      first = &one;
    }
  }
  if (!first) return;
  first_contact_s_ = secondsBetween(origin_ns_, o.start_ns) + first->toc_lower * o.duration_s();
  first_contact_ = contactInWords(*first, bodies);
}

void Report::addTimes(const Outcome& o) {
  timing_ << o.sequence << ',' << o.stats.total_ms;
  for (std::size_t i = 0; i < stage_ms_.size(); ++i) {
    timing_ << ',' << o.stats.stages[i].ms;
    stage_ms_[i].push_back(o.stats.stages[i].ms);
  }
  timing_ << '\n';
  sum_ += o.stats;
  total_ms_.push_back(o.stats.total_ms);
}

void Report::add(const Outcome& o, const std::vector<Body>& bodies, std::int64_t told_ns, const std::string& clock_body,
                 const std::optional<SpeedScales>& scales) {
  if (frames_ == 0) origin_ns_ = o.start_ns > 0 ? o.start_ns : o.stamp_ns;
  writeStep(o, told_ns, clock_body);
  addRow(o, scales);
  addProof(o);
  writePatches(o, bodies);  // a seam without an answer has events, too
  lanes_.add(o, bodies, origin_ns_);
  clearance_.add(o, bodies, origin_ns_);
  player_.add(o, bodies, origin_ns_, lanes_.addedFirst());
  if (!o.answered) return;
  ++answered_;
  with_contact_ += o.total_contacts > o.counts.expected;
  with_expected_ += o.counts.expected > 0;
  writeContacts(o, bodies);
  addHeat(o, bodies);
  addFirstContact(o, bodies);
  addTimes(o);
}

void Report::addProof(const Outcome& o) {
  ++frames_;
  if (o.answered && o.total_contacts == 0 && o.touching != Touching::NONE) {
    const std::string inside = insideInWords(o);
    ++lasting_[inside.empty() ? std::string("start ") + toString(o.start_state) : inside];
  }
  const Assurance assurance = assuranceOf(o);
  first_frames_ += o.status == StepStatus::FIRST_FRAME;
  if (assurance.proved || o.status == StepStatus::FIRST_FRAME) return;
  const bool is_ok = o.status == StepStatus::OK;
  const std::string kind = is_ok ? assurance.missing.front() : toString(o.status);
  const std::string reason = is_ok || o.reason.empty() ? kind : kind + ": " + o.reason;
  ++unproved_.emplace(kind, std::make_pair(reason, 0)).first->second.second;
}

void Report::setLookAhead(const LookAheadSummary& summary, double horizon_s) {
  look_ahead_ = summary;
  horizon_s_ = horizon_s;
}

}  // namespace dccd
