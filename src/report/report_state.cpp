// What the report of a range of a recording hands on to that of the whole.
#include <algorithm>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "dccd/regular_file.h"
#include "report/report.h"

namespace dccd {
namespace {

using Json = nlohmann::json;

Json toJson(const StageStats& s) { return Json::array({s.in, s.out, s.ms}); }
StageStats stageFrom(const Json& j) {
  return {j.at(0).get<std::uint64_t>(), j.at(1).get<std::uint64_t>(), j.at(2).get<double>()};
}

Json toJson(const StepStats& sum) {
  Json j = {{"stages", Json::array()}, {"effects", Json::array()}, {"total_ms", sum.total_ms}};
  for (const StageStats& s : sum.stages) j["stages"].push_back(toJson(s));
  for (const StageStats& s : sum.effects) j["effects"].push_back(toJson(s));
  j["tiers"] = sum.tiers.settled;
  for (const StepCounter& counter : STEP_COUNTERS) j[counter.name] = sum.*counter.value;
  return j;
}

StepStats statsFrom(const Json& j) {
  StepStats sum;
  for (std::size_t i = 0; i < sum.stages.size(); ++i) sum.stages[i] = stageFrom(j.at("stages").at(i));
  for (std::size_t i = 0; i < sum.effects.size(); ++i) sum.effects[i] = stageFrom(j.at("effects").at(i));
  for (std::size_t i = 0; i < sum.tiers.settled.size(); ++i) j.at("tiers").at(i).get_to(sum.tiers.settled[i]);
  for (const StepCounter& counter : STEP_COUNTERS) j.at(counter.name).get_to(sum.*counter.value);
  sum.total_ms = j.at("total_ms").get<double>();
  return sum;
}

template <class T>
void addAll(const Json& from, std::vector<T>& to) {
  for (const Json& value : from) to.push_back(value.get<T>());
}

/// The table without its first line. In blocks: joining ranges is little more than this. That it could not be written,
/// close() says.
void copyRows(const std::string& path, std::ofstream& to) {
  const std::string problem = regularFileProblem(path);
  if (!problem.empty()) throw std::runtime_error(path + ": " + problem);
  std::ifstream from(path, std::ios::binary);
  from.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  if (!from) throw std::runtime_error(path + ": cannot be read");
  std::vector<char> block(std::size_t{1} << 17);
  while (to && (from.read(block.data(), static_cast<std::streamsize>(block.size())) || from.gcount() > 0)) {
    to.write(block.data(), from.gcount());
  }
  if (from.bad()) throw std::runtime_error(path + ": cannot be read to its end");
}

}  // namespace

Json Report::state() const {
  Json j = {{"lasting", lasting_},
            {"unproved", unproved_},
            {"frames", frames_},
            {"answered", answered_},
            {"with_contact", with_contact_},
            {"with_expected", with_expected_},
            {"first_contact_s", first_contact_s_},
            {"first_contact", first_contact_},
            {"rows", rows_},
            {"stage_ms", stage_ms_},
            {"sum", toJson(sum_)},
            {"total_ms", total_ms_},
            {"unknown_fraction", unknown_fraction_},
            {"lanes", lanes_.state()},
            {"heat", Json::array()}};
  for (const BodyHeat& h : heat_) {
    j["heat"].push_back(
        {{"mesh", h.mesh}, {"contacts", h.contacts}, {"first_s", h.first_s}, {"begun_anew", h.begun_anew}});
  }
  return j;
}

void Report::appendTables(const std::string& folder) {
  copyRows(folder + "/contacts.csv", contacts_);
  copyRows(folder + "/steps.csv", steps_);
  copyRows(folder + "/timing.csv", timing_);
}

void Report::append(const Json& j) {
  for (const auto& [what, steps] : j.at("lasting").items()) lasting_[what] += steps.get<std::size_t>();
  for (const auto& [kind, found] : j.at("unproved").items()) {
    const auto at = unproved_.emplace(kind, std::make_pair(found.at(0).get<std::string>(), std::size_t{0})).first;
    at->second.second += found.at(1).get<std::size_t>();
  }
  frames_ += j.at("frames").get<std::size_t>();
  answered_ += j.at("answered").get<std::size_t>();
  with_contact_ += j.at("with_contact").get<std::size_t>();
  with_expected_ += j.at("with_expected").get<std::size_t>();
  if (first_contact_.empty()) {
    j.at("first_contact").get_to(first_contact_);
    j.at("first_contact_s").get_to(first_contact_s_);
  }
  addRows(j.at("rows").get_ref<const std::string&>());
  for (std::size_t s = 0; s < stage_ms_.size(); ++s) addAll(j.at("stage_ms").at(s), stage_ms_[s]);
  sum_ += statsFrom(j.at("sum"));
  addAll(j.at("total_ms"), total_ms_);
  for (const Json& ms : j.at("total_ms")) step_times_.add(ms.get<double>() * 1e-3);
  addAll(j.at("unknown_fraction"), unknown_fraction_);
  lanes_.append(j.at("lanes"));
  heat_.resize(std::max(heat_.size(), j.at("heat").size()));
  for (std::size_t b = 0; b < j.at("heat").size(); ++b) {
    const Json& from = j.at("heat").at(b);
    BodyHeat& heat = heat_[b];
    if (from.at("mesh").is_null()) continue;
    const auto contacts = from.at("contacts").get<std::vector<std::uint32_t>>();
    const Json& first_s = from.at("first_s");
    if (heat.mesh.is_null() || from.at("begun_anew").get<bool>() || contacts.size() != heat.contacts.size()) {
      heat.mesh = from.at("mesh");
      heat.contacts.assign(contacts.size(), 0);
      heat.first_s.assign(contacts.size(), std::numeric_limits<double>::infinity());
    }
    for (std::size_t v = 0; v < contacts.size(); ++v) {
      heat.contacts[v] += contacts[v];
      heat.first_s[v] = std::min(heat.first_s[v], first_s.at(v).get<double>());
    }
  }
}

}  // namespace dccd
