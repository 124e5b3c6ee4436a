#include "report/report.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iomanip>
#include <limits>
#include <sstream>
#include <tuple>

#include "dccd/assurance.h"
#include "report/contact_vertices.h"
#include "report/flat_layout.h"
#include "report/quantile.h"
#include "report/words.h"

namespace dccd {
namespace {

const char* const KINDS[] = {"VF", "EE", "vertex-voxel_face", "edge-voxel_edge", "face-voxel_corner"};

// Commas, quotes and line ends in a field are quoted (RFC 4180).
std::string csvField(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + '"';
}

// In the place of the rows of the steps, which are text already. No text has it inside: its quotes would be escaped.
const char* const ROWS = "@rows@";

// A name out of a message need not be UTF-8.
std::string toText(const nlohmann::json& json, int indent) {
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

nlohmann::json finiteOrNull(double x) { return std::isfinite(x) ? nlohmann::json(x) : nlohmann::json(); }

}  // namespace

Report::Report(const std::string& folder) : folder_(folder) {
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
  contacts_
      << "step,stamp_ns,kind,body_0,body_1,v0,v1,v2,v3,voxel_x,voxel_y,voxel_z,voxel_size,certainty,initial,leaving,"
         "toc_lower,toc_upper,time_s,point_x,point_y,point_z,normal_x,normal_y,normal_z,approach_speed_m_per_s,"
         "expected\n";
  steps_
      << "step,start_ns,stamp_ns,status,reason,answered,start_state,clear,complete,contacts,undecided,initial,leaving,"
         "intersections,unchecked_vertices,unchecked_faces,earliest_toc,broad_phase_pairs,planar_pairs,"
         "elementary_pairs,obstacle_pairs\n";
  patches_
      << "step,stamp_ns,patch,body_0,body_1,beginning,is_new,contacts,certain,initial,crossings,expected,toc_lower,"
         "toc_upper,area_m2,centroid_x,centroid_y,centroid_z,normal_x,normal_y,normal_z\n";
  events_ << "step,stamp_ns,event,patch,others,body_0,body_1,beginning,expected,earliest_s,latest_s\n";
  timing_ << "step,total_ms";
  for (std::size_t s = 0; s < stage_ms_.size(); ++s) timing_ << ',' << toString(static_cast<Stage>(s)) << "_ms";
  timing_ << '\n';
}

void Report::writeContacts(const Outcome& outcome, const std::vector<Body>& bodies) {
  for (const Contact& c : outcome.contacts) {
    const ContactGeometry g = contactGeometry(outcome, c);
    contacts_ << outcome.sequence << ',' << outcome.stamp_ns << ',' << KINDS[static_cast<int>(c.kind)] << ','
              << csvField(bodyName(c.body[0], bodies)) << ',' << csvField(bodyName(c.body[1], bodies));
    for (Index v : c.vertex) {
      contacts_ << ',';
      if (v != NO_INDEX) contacts_ << v;
    }
    if (c.body[1] == OBSTACLE_BODY) {
      contacts_ << ',' << c.voxel.x << ',' << c.voxel.y << ',' << c.voxel.z << ',' << c.voxel_size;
    } else {
      contacts_ << ",,,,";
    }
    contacts_ << ',' << (c.certainty == Certainty::CERTAIN ? "certain" : "undecided") << ',' << c.initial << ','
              << c.leaving << ',' << c.toc_lower << ',' << c.toc_upper << ','
              << static_cast<double>(outcome.start_ns - origin_ns_) * 1e-9 + c.toc_lower * outcome.duration_s() << ','
              << g.point.x() << ',' << g.point.y() << ',' << g.point.z() << ',' << g.normal.x() << ',' << g.normal.y()
              << ',' << g.normal.z() << ',' << g.approach_speed / std::max(outcome.duration_s(), 1e-9) << ','
              << c.expected << '\n';
  }
}

void Report::writePatches(const Outcome& outcome, const std::vector<Body>& bodies) {
  const auto place = [](std::ofstream& file, const Vec3& v) { file << ',' << v.x() << ',' << v.y() << ',' << v.z(); };
  for (const Patch& p : outcome.patches) {
    patches_ << outcome.sequence << ',' << outcome.stamp_ns << ',' << p.id << ','
             << csvField(bodyName(p.body[0], bodies)) << ',' << csvField(bodyName(p.body[1], bodies)) << ','
             << toString(p.beginning) << ',' << p.is_new << ',' << p.contacts << ',' << p.certain << ',' << p.initial
             << ',' << p.crossings << ',' << p.expected << ',' << p.toc_lower << ',' << p.toc_upper << ',' << p.area_m2;
    place(patches_, p.centroid);
    place(patches_, p.normal);
    patches_ << '\n';
  }
  for (const PatchEvent& e : outcome.patch_events) {
    std::string others;
    for (const std::uint64_t id : e.others) others += (others.empty() ? "" : " ") + std::to_string(id);
    events_ << outcome.sequence << ',' << outcome.stamp_ns << ',' << toString(e.kind) << ',' << e.id << ',' << others
            << ',' << csvField(bodyName(e.body[0], bodies)) << ',' << csvField(bodyName(e.body[1], bodies)) << ','
            << toString(e.beginning) << ',' << e.expected;
    for (const StampNs when_ns : {e.from_ns, e.to_ns}) {
      events_ << ',';
      if (when_ns != UNKNOWN_NS) events_ << static_cast<double>(when_ns - origin_ns_) * 1e-9;
    }
    events_ << '\n';
  }
}

void Report::addHeat(const Outcome& outcome, const std::vector<Body>& bodies) {
  if (heat_.empty()) heat_.resize(bodies.size());
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    BodyHeat& heat = heat_[b];
    const auto& topology = outcome.step->bodies[b].topology;
    if (!topology || (!heat.mesh.is_null() && heat.contacts.size() == topology->vertexCount())) continue;
    // A body whose topology changed begins anew: its vertices are other ones.
    heat.begun_anew = !heat.mesh.is_null();
    heat.mesh = {{"name", bodies[b].name}, {"flat", flatLayout(*outcome.step->bodies[b].t0)}};
    heat.mesh["faces"] = topology->faces();
    if (!topology->hasFaces()) heat.mesh["edges"] = topology->edges();
    heat.contacts.assign(topology->vertexCount(), 0);
    heat.first_s.assign(topology->vertexCount(), std::numeric_limits<double>::infinity());
  }
  const double start_s = static_cast<double>(outcome.start_ns - origin_ns_) * 1e-9;
  for (const Contact& c : outcome.contacts) {
    forContactVertices(c, [&](std::uint16_t body, Index v) {
      if (body >= heat_.size() || v >= heat_[body].contacts.size()) return;
      ++heat_[body].contacts[v];
      double& when = heat_[body].first_s[v];
      when = std::min(when, start_s + c.toc_lower * outcome.duration_s());
    });
  }
}

void Report::addRow(const Outcome& o) {
  const StepStats& s = o.stats;
  double earliest_new = std::numeric_limits<double>::infinity();
  for (const Contact& c : o.contacts) {
    if (!c.initial) earliest_new = std::min(earliest_new, c.toc_lower);
  }
  steps_ << o.sequence << ',' << o.start_ns << ',' << o.stamp_ns << ',' << toString(o.status) << ','
         << csvField(o.reason) << ',' << o.answered << ',' << toString(o.start_state) << ',' << assuranceOf(o).clear()
         << ',' << o.complete << ',' << o.total_contacts << ',' << o.counts.undecided << ',' << o.counts.initial << ','
         << o.counts.leaving << ',' << o.intersections.size() << ',' << s.unchecked_vertices << ',' << s.unchecked_faces
         << ',';
  if (o.answered && o.earliest_toc <= 1) steps_ << o.earliest_toc;
  steps_ << ',' << s[Stage::BROAD_PHASE].out << ',' << s[Stage::PLANAR].out << ',' << s[Stage::ELEMENTARY].in << ','
         << s[Stage::OBSTACLE].in << '\n';
  const double time_s = static_cast<double>(o.stamp_ns - origin_ns_) * 1e-9;
  const nlohmann::json row = {{"step", o.sequence},
                              {"t", time_s},
                              {"status", toString(o.status)},
                              {"reason", o.reason},
                              {"answered", o.answered},
                              {"start_state", toString(o.start_state)},
                              {"clear", assuranceOf(o).clear()},
                              {"contacts", o.total_contacts},
                              {"undecided", o.counts.undecided},
                              {"initial", o.counts.initial},
                              {"toc", o.answered ? finiteOrNull(o.earliest_toc) : nlohmann::json()},
                              {"toc_new", finiteOrNull(earliest_new)},
                              {"ms", s.total_ms}};
  addRows(toText(row, -1));
}

void Report::addRows(const std::string& rows) {
  if (!rows_.empty() && !rows.empty()) rows_ += ",\n";
  rows_ += rows;
}

void Report::addFirstContact(const Outcome& o, const std::vector<Body>& bodies) {
  if (!first_contact_.empty()) return;
  const auto first = std::min_element(o.contacts.begin(), o.contacts.end(), [](const auto& a, const auto& b) {
    return std::tie(a.expected, a.toc_lower) < std::tie(b.expected, b.toc_lower);
  });
  if (first == o.contacts.end() || first->expected) return;
  first_contact_s_ = static_cast<double>(o.start_ns - origin_ns_) * 1e-9 + first->toc_lower * o.duration_s();
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
  if (!std::isnan(o.unknown_fraction)) unknown_fraction_.push_back(o.unknown_fraction);  // there is one
  total_ms_.push_back(o.stats.total_ms);
  step_times_.add(o.stats.total_ms * 1e-3);
}

void Report::add(const Outcome& o, const std::vector<Body>& bodies) {
  if (!any_) setOrigin(o.start_ns > 0 ? o.start_ns : o.stamp_ns);
  addRow(o);
  addProof(o);
  writePatches(o, bodies);  // a seam without an answer has events, too
  lanes_.add(o, bodies, origin_ns_);
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

void Report::addPatches(const Outcome& o, const std::vector<Body>& bodies) {
  writePatches(o, bodies);
  lanes_.add(o, bodies, origin_ns_);
}

void Report::setOrigin(StampNs origin_ns) {
  origin_ns_ = origin_ns;
  any_ = true;
}

void Report::addProof(const Outcome& o) {
  ++frames_;
  if (o.answered && o.total_contacts == 0 && o.touching != Touching::NONE) {
    ++lasting_[o.suppressed > 0 ? "initial contacts suppressed" : std::string("start ") + toString(o.start_state)];
  }
  const Assurance assurance = assuranceOf(o);
  if (assurance.proved || o.status == StepStatus::FIRST_FRAME) return;
  const bool is_ok = o.status == StepStatus::OK;
  const std::string kind = is_ok ? assurance.missing.front() : toString(o.status);
  const std::string reason = is_ok || o.reason.empty() ? kind : kind + ": " + o.reason;
  ++unproved_.emplace(kind, std::make_pair(reason, 0)).first->second.second;
}

std::string Report::unproved() const {
  std::size_t frames = 0;
  std::string reasons;
  for (const auto& [kind, found] : unproved_) {
    frames += found.second;
    reasons += (reasons.empty() ? "" : ", ") + found.first + " (" + std::to_string(found.second) + ")";
  }
  if (frames > 0) reasons = std::to_string(frames) + " of " + std::to_string(frames_) + " frames: " + reasons;
  for (const std::string& what : missing_) reasons += (reasons.empty() ? "" : "; ") + what;
  if (!reasons.empty()) return reasons;
  return answered_ > 0 ? "" : frames_ > 0 ? "a first frame alone makes no step" : "no frame came";
}

std::string Report::headline() const {
  std::ostringstream text;
  text << std::fixed << std::setprecision(4);
  const bool proved = unproved().empty();
  if (!first_contact_.empty()) {
    text << "First contact " << first_contact_s_ << " s after the start: " << first_contact_ << "; contacts in "
         << with_contact_ << " of " << answered_ << " answered steps";
  } else if (answered_ == 0) {
    text << "No answer";
  } else {
    text << (with_expected_ > 0 ? "No unexpected contact " : "No contact ")
         << (proved && lasting_.empty() ? "in " : "found in ") << answered_ << " answered steps";
  }
  if (with_expected_ > 0) text << "; expected contacts in " << with_expected_ << " of them";
  const char* separator = "; surfaces touched from the start of a step (";
  for (const auto& [what, steps] : lasting_) {
    text << separator << what << ' ' << steps;
    separator = ", ";
  }
  if (!lasting_.empty()) text << ')';
  if (!proved) text << "; not proved: " << unproved();
  text << '.';
  return text.str();
}

nlohmann::json Report::heatJson() const {
  nlohmann::json bodies = nlohmann::json::array();
  for (const BodyHeat& h : heat_) {
    if (h.mesh.is_null()) continue;
    nlohmann::json body = h.mesh;
    body["first"] = nlohmann::json::array();
    body["count"] = h.contacts;
    for (double f : h.first_s) body["first"].push_back(finiteOrNull(f));
    bodies.push_back(std::move(body));
  }
  return bodies;
}

nlohmann::json Report::effectsJson() const {
  nlohmann::json effects = nlohmann::json::array();
  for (const EffectDecision& d : effects_) {
    nlohmann::json e = {{"name", d.name}, {"running", d.running}, {"reason", d.reason}};
    for (std::size_t i = 0; i < sum_.effects.size(); ++i) {
      if (d.name != toString(static_cast<Effect>(i))) continue;
      e["in"] = sum_.effects[i].in;
      e["out"] = sum_.effects[i].out;
      e["ms"] = sum_.effects[i].ms;
    }
    effects.push_back(std::move(e));
  }
  return effects;
}

nlohmann::json Report::lookAheadJson() const {
  if (!look_ahead_) return {};
  return {{"horizon_s", horizon_s_},
          {"compared", look_ahead_->compared},
          {"not_observed", look_ahead_->not_observed},
          {"not_predicted", look_ahead_->not_predicted},
          {"median_error_s", look_ahead_->median_error_s},
          {"p95_error_s", look_ahead_->p95_error_s},
          {"median_signed_error_s", look_ahead_->median_signed_error_s}};
}

void Report::setLookAhead(const LookAheadSummary& summary, double horizon_s) {
  look_ahead_ = summary;
  horizon_s_ = horizon_s;
}

void Report::setLeftOut(const std::vector<LeftOutPair>& pairs, const std::vector<Body>& bodies) {
  left_out_ = pairs.size();
  if (pairs.empty()) return;
  std::ofstream file(folder_ + "/left_out.csv");
  file << "kind,body,v0,v1,v2,v3\n";
  for (const LeftOutPair& pair : pairs) {
    file << KINDS[static_cast<int>(pair.kind)] << ',' << csvField(bodyName(pair.body, bodies));
    for (const Index v : pair.vertex) file << ',' << v;
    file << '\n';
  }
  file.close();
  if (!file) throw std::runtime_error(folder_ + "/left_out.csv: cannot be written");
}

nlohmann::json Report::json() const {
  nlohmann::json j;
  j["headline"] = headline();
  j["facts"] = nlohmann::json::array();
  for (const auto& [name, value] : facts_) j["facts"].push_back(nlohmann::json::array({name, value}));
  j["steps"] = ROWS;
  j["counters"] = {{"received", counters_.received},
                   {"processed", counters_.processed()},
                   {"started", counters_.started()},
                   {"skipped", counters_.skipped()},
                   {"waiting", counters_.waiting()}};
  for (std::size_t s = 0; s < counters_.by_status.size(); ++s) {
    j["counters"]["by_status"][toString(static_cast<StepStatus>(s))] = counters_.by_status[s];
  }
  j["stages"] = nlohmann::json::array();
  for (std::size_t s = 0; s < stage_ms_.size(); ++s) {
    j["stages"].push_back({{"name", toString(static_cast<Stage>(s))},
                           {"in", sum_.stages[s].in},
                           {"out", sum_.stages[s].out},
                           {"median_ms", quantile(stage_ms_[s], 0.5)},
                           {"p95_ms", quantile(stage_ms_[s], 0.95)}});
  }
  j["total"] = {{"median_ms", quantile(total_ms_, 0.5)},
                {"p95_ms", quantile(total_ms_, 0.95)},
                {"p99_ms", quantile(total_ms_, 0.99)},
                {"max_ms", quantile(total_ms_, 1)}};
  j["histogram"] = nlohmann::json::array();
  for (const LatencyHistogram::Bin& bin : step_times_.bins()) {
    j["histogram"].push_back({{"upper_ms", bin.upper_s * 1e3}, {"steps", bin.count}});
  }
  j["effects"] = effectsJson();
  j["bounds"] = {{"bodies_refitted", sum_.bodies_refitted}, {"bodies_kept", sum_.bodies_kept}};
  j["left_out"] = {{"pairs", left_out_}, {"met", sum_.left_out_met}};
  j["unknown_fraction"] = {{"median", quantile(unknown_fraction_, 0.5)}, {"max", quantile(unknown_fraction_, 1)}};
  j["look_ahead"] = lookAheadJson();
  for (std::size_t t = 0; t < sum_.tiers.settled.size(); ++t) {
    j["tiers"][toString(static_cast<Tier>(t))] = sum_.tiers.settled[t];
  }
  j["rungs"] = nlohmann::json::array();
  for (const RungCost& r : rungs_) {
    j["rungs"].push_back({{"rung", r.rung},
                          {"steps", r.steps},
                          {"contacts", r.contacts},
                          {"missed", r.missed},
                          {"false", r.false_contacts},
                          {"undecided", r.undecided},
                          {"median_ms", r.median_ms},
                          {"p95_ms", r.p95_ms},
                          {"max_toc_error", r.max_toc_error}});
  }
  j["study"] = study_;
  j["partners"] = lanes_.json();
  j["bodies"] = heatJson();
  return j;
}

std::string Report::dumped(const nlohmann::json& data, int indent) const {
  std::string text = toText(data, indent);
  const std::string mark = toText(ROWS, -1);
  return text.replace(text.find(mark), mark.size(), "[" + rows_ + "]");
}

void Report::finish() {
  const nlohmann::json data = json();
  std::ofstream json_file(folder_ + "/report.json"), page(folder_ + "/report.html");
  json_file << dumped(data, 1) << '\n';
  page << reportPage(dumped(data, -1), player_.json());
  close();
  for (std::ofstream* file : {&json_file, &page}) {
    file->close();
    if (!*file) throw std::runtime_error(folder_ + ": the report could not be written completely");
  }
}

void Report::close() {
  for (std::ofstream* file : {&contacts_, &steps_, &patches_, &events_, &timing_}) {
    if (file->is_open()) file->close();
    if (!*file) throw std::runtime_error(folder_ + ": the report could not be written completely");
  }
}

}  // namespace dccd
