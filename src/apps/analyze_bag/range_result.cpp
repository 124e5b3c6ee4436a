#include "apps/analyze_bag/range_result.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <stdexcept>

#include "dccd/regular_file.h"

namespace dccd {
namespace {

using nlohmann::json;

constexpr int FORMAT = 2;
constexpr std::uint64_t MAX_FILE_BYTES = std::uint64_t{4} << 30;

std::string fileOf(const std::string& folder) { return folder + "/range.cbor"; }

json toJson(const FrameCounters& c) { return {c.received, c.receipt_stamps, c.by_status}; }
FrameCounters countersFrom(const json& j) {
  FrameCounters c;
  j.at(0).get_to(c.received);
  j.at(1).get_to(c.receipt_stamps);
  for (std::size_t s = 0; s < c.by_status.size(); ++s) j.at(2).at(s).get_to(c.by_status[s]);
  return c;
}

/// Of a summary, by name, what is JSON as it is.
template <class Summary, class Visit>
void forFields(Summary& s, Visit visit) {
  visit("mesh_topics", s.mesh_topics);
  visit("mesh_messages", s.mesh_messages);
  visit("maps", s.maps);
  visit("maps_refused", s.maps_refused);
  visit("fixed_frame", s.fixed_frame);
  visit("map_source", s.map_source);
  visit("complaints", s.complaints);
  visit("duration_s", s.duration_s);
  visit("origin_ns", s.origin_ns);
}

json toJson(const BagReplaySummary& s) {
  json j = {{"frames", toJson(s.frames)},
            {"told", toJson(s.told)},
            {"passed", toJson(s.passed)},
            {"left_out", json::array()}};
  forFields(s, [&](const char* name, const auto& value) { j[name] = value; });
  for (const LeftOutPair& pair : s.left_out) {
    j["left_out"].push_back({static_cast<int>(pair.kind), pair.body, pair.vertex});
  }
  return j;
}

BagReplaySummary summaryFrom(const json& j) {
  BagReplaySummary s;
  forFields(s, [&](const char* name, auto& value) { j.at(name).get_to(value); });
  s.frames = countersFrom(j.at("frames"));
  s.told = countersFrom(j.at("told"));
  s.passed = countersFrom(j.at("passed"));
  for (const json& one : j.at("left_out")) {
    LeftOutPair pair;
    const auto kind = one.at(0).get<std::int64_t>();
    if (kind < 0 || kind >= static_cast<std::int64_t>(std::size(PAIR_KINDS))) {
      throw std::runtime_error("left_out: " + std::to_string(kind) + " is no kind of pair");
    }
    pair.kind = static_cast<PairKind>(kind);
    one.at(1).get_to(pair.body);
    one.at(2).get_to(pair.vertex);
    s.left_out.push_back(pair);
  }
  return s;
}

}  // namespace

void writeRange(const RangeResult& range) {
  json j = {{"format", FORMAT},
            {"bag", range.bag_name},
            {"bag_bytes", range.bag_bytes},
            {"parameters", range.parameters},
            {"first", range.frames.first},
            {"last", range.frames.last},
            {"from_s", range.from_s},
            {"to_s", range.to_s},
            {"summary", toJson(range.summary)},
            {"effects", json::array()},
            {"report", range.report}};
  for (const EffectDecision& d : range.effects) j["effects"].push_back({d.name, d.running, d.reason});
  const std::string path = fileOf(range.folder), unfinished = path + ".part";
  {
    std::ofstream file(unfinished, std::ios::binary);
    json::to_cbor(j, nlohmann::detail::output_adapter<char>(file));
    file.close();
    if (!file) throw std::runtime_error(path + ": could not be written completely");
  }
  std::filesystem::rename(unfinished, path);
}

RangeResult readRange(const std::string& folder) {
  const std::string path = fileOf(folder);
  const std::string problem = regularFileProblem(path, MAX_FILE_BYTES);
  if (!problem.empty()) throw std::runtime_error(path + ": " + problem + "; it is no finished range of a bag");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  try {
    json j = json::from_cbor(file);
    if (j.at("format").get<int>() != FORMAT) throw std::runtime_error("written by another version of the program");
    RangeResult range;
    range.folder = folder;
    j.at("bag").get_to(range.bag_name);
    j.at("bag_bytes").get_to(range.bag_bytes);
    j.at("parameters").get_to(range.parameters);
    j.at("first").get_to(range.frames.first);
    j.at("last").get_to(range.frames.last);
    j.at("from_s").get_to(range.from_s);
    j.at("to_s").get_to(range.to_s);
    range.summary = summaryFrom(j.at("summary"));
    for (const json& d : j.at("effects")) {
      EffectDecision decision;
      d.at(0).get_to(decision.name);
      decision.running = d.at(1).get<bool>();
      d.at(2).get_to(decision.reason);
      range.effects.push_back(std::move(decision));
    }
    range.report = std::move(j.at("report"));
    return range;
  } catch (const std::exception& error) {
    throw std::runtime_error(path + ": " + error.what());
  }
}

std::vector<RangeResult> readRanges(const std::vector<std::string>& folders, const std::string& bag,
                                    std::uint64_t parameters) {
  const std::string name = std::filesystem::path(bag).filename();
  const std::uint64_t bytes = std::filesystem::file_size(bag);
  std::vector<RangeResult> ranges;
  for (const std::string& folder : folders) {
    ranges.push_back(readRange(folder));
    const RangeResult& range = ranges.back();
    if (range.bag_name != name || range.bag_bytes != bytes) {
      throw std::runtime_error(folder + ": is a range of " + range.bag_name + " with " +
                               std::to_string(range.bag_bytes) + " bytes, not of " + name + " with " +
                               std::to_string(bytes));
    }
    if (range.parameters != parameters) throw std::runtime_error(folder + ": was computed with other parameters");
  }
  std::stable_sort(ranges.begin(), ranges.end(), [](const RangeResult& a, const RangeResult& b) {
    return a.frames.first != b.frames.first ? a.frames.first < b.frames.first : a.isEmpty() > b.isEmpty();
  });
  for (std::size_t i = 1; i < ranges.size(); ++i) {
    if (ranges[i].isEmpty() || ranges[i].frames.first > ranges[i - 1].frames.last) continue;
    throw std::runtime_error(ranges[i].folder + ": holds frames that " + ranges[i - 1].folder + " holds, too");
  }
  return ranges;
}

BagReplaySummary joined(const std::vector<RangeResult>& ranges) {
  BagReplaySummary whole = ranges.back().summary;
  // Of what is before its range the last one knows what came, and not how it was answered.
  for (std::size_t s = 0; s < whole.frames.by_status.size(); ++s) {
    whole.frames.by_status[s] -= whole.passed.by_status[s];
    for (std::size_t i = 0; i + 1 < ranges.size(); ++i) {
      whole.frames.by_status[s] += ranges[i].summary.told.by_status[s];
    }
  }
  return whole;
}

}  // namespace dccd
