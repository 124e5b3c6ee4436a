#include "config/parameter_reader.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <utility>

#include "input/short_text.h"

namespace dccd {

using Kind = ParameterTree::Kind;

namespace {

std::string shown(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

std::string range(double min, double max) { return "from " + shown(min) + " to " + shown(max); }
std::string range(int min, int max) { return "from " + std::to_string(min) + " to " + std::to_string(max); }

/// The text that stands where a number should.
std::string notThis(const ParameterTree& value) {
  return value.kind == Kind::TEXT ? ", not '" + value.text.substr(0, 60) + "'" : "";
}

/// What was typed if it came by the launch files, where their argument has another name than the node's parameter.
std::string argumentOf(const std::string& parameter) {
  static const std::map<std::string, std::string> ARGUMENTS = {{"~topic", "mesh"},
                                                               {"~octomap_topic", "octomap"},
                                                               {"~obstacle_cloud_topic", "obstacle_cloud"},
                                                               {"~topology/rows", "rows"},
                                                               {"~topology/cols", "cols"},
                                                               {"~topology/source", "topology"},
                                                               {"~robot/semantic", "semantic"},
                                                               {"~robot/description", "robot"}};
  const auto found = ARGUMENTS.find(parameter);
  return found == ARGUMENTS.end() ? "" : " (" + found->second + ":= of the launch files)";
}

}  // namespace

const char* kindName(const ParameterTree& value) {
  static const char* const NAMES[] = {"not set",  "a boolean", "an integer", "a number",
                                      "a string", "a list",    "a section",  "of a type that is not used here"};
  return NAMES[static_cast<std::size_t>(value.kind)];
}

ParameterReader::ParameterReader(ParameterTree tree, std::string path)
    : tree_(std::move(tree)), path_(std::move(path)) {
  if (tree_.isSet() && tree_.kind != Kind::SECTION) failKind("", tree_, "a section");
}

void ParameterReader::fail(const std::string& name, const std::string& what) const {
  const auto member = tree_.members.find(name);
  const bool is_there = member != tree_.members.end();
  const int line = is_there ? member->second.line : tree_.line;
  const bool is_option = is_there && line == 0;  // of a command line, put beside what the file says
  std::string full = path_ + name;
  if (name.empty() && !full.empty() && full.back() == '/') full.pop_back();
  const std::string where = tree_.file.empty() || is_option ? "parameter "
                            : line == 0                     ? tree_.file + ": "
                                                            : tree_.file + ":" + std::to_string(line) + ": ";
  throw ParameterError(where + full + argumentOf(full) + (full.empty() ? "" : " ") + what);
}

void ParameterReader::failKind(const std::string& name, const ParameterTree& value, const std::string& needed) const {
  fail(name, std::string("is ") + kindName(value) + ", " + needed + " is needed");
}

const ParameterTree& ParameterReader::raw(const std::string& name) {
  static const ParameterTree UNSET;
  known_.insert(name);
  all_known_->insert(path_ + name);
  const auto member = tree_.members.find(name);
  return member == tree_.members.end() ? UNSET : member->second;
}

const ParameterTree& ParameterReader::needed(const std::string& name, const std::string& what) {
  const ParameterTree& value = raw(name);
  if (!value.isSet()) fail(name, "is needed: " + what);
  return value;
}

bool ParameterReader::has(const std::string& name) { return raw(name).isSet(); }

double ParameterReader::numberOf(const ParameterTree& value, const std::string& name, double min, double max) const {
  if (value.kind != Kind::NUMBER && value.kind != Kind::INTEGER) {
    // YAML takes 1e-6 for text; only 1.0e-6 is a number there.
    const char* hint = value.kind == Kind::TEXT ? " (in YAML write 1.0e-6, not 1e-6)" : "";
    fail(name, std::string("is ") + kindName(value) + ", a number is needed" + notThis(value) + hint);
  }
  const double result = value.kind == Kind::NUMBER ? value.number : value.integer;
  if (!(result >= min && result <= max)) fail(name, "is " + shown(result) + ", it must be " + range(min, max));
  return result;
}

double ParameterReader::number(const std::string& name, double min, double max) {
  return numberOf(needed(name, "a number " + range(min, max)), name, min, max);
}

double ParameterReader::number(const std::string& name, double fallback, double min, double max) {
  const ParameterTree& value = raw(name);
  return value.isSet() ? numberOf(value, name, min, max) : fallback;
}

int ParameterReader::integerOf(const ParameterTree& value, const std::string& name, int min, int max) const {
  if (value.kind != Kind::INTEGER)
    fail(name, std::string("is ") + kindName(value) + ", an integer is needed" + notThis(value));
  if (value.integer < min || value.integer > max) {
    fail(name, "is " + std::to_string(value.integer) + ", it must be " + range(min, max));
  }
  return value.integer;
}

int ParameterReader::integer(const std::string& name, int min, int max) {
  return integerOf(needed(name, "an integer " + range(min, max)), name, min, max);
}

int ParameterReader::integer(const std::string& name, int fallback, int min, int max) {
  const ParameterTree& value = raw(name);
  return value.isSet() ? integerOf(value, name, min, max) : fallback;
}

std::size_t ParameterReader::integer(const std::string& name, std::size_t fallback, int min, int max) {
  return static_cast<std::size_t>(integer(name, static_cast<int>(fallback), min, max));
}

bool ParameterReader::get(const std::string& name, bool fallback) {
  const ParameterTree& value = raw(name);
  if (!value.isSet()) return fallback;
  if (value.kind != Kind::BOOLEAN) failKind(name, value, "true or false");
  return value.truth;
}

std::string ParameterReader::get(const std::string& name, const std::string& fallback) {
  const ParameterTree& value = raw(name);
  if (!value.isSet()) return fallback;
  if (value.kind != Kind::TEXT) failKind(name, value, "a string");
  return value.text;
}

std::string ParameterReader::text(const std::string& name) {
  needed(name, "a text");
  const std::string result = get(name, std::string());
  if (result.empty()) fail(name, "is empty, a text is needed");
  return result;
}

std::string ParameterReader::text(const std::string& name, const std::string& fallback) {
  return has(name) ? text(name) : fallback;
}

std::string ParameterReader::frame(const std::string& name) {
  const std::string given = get(name, std::string());
  if (given.empty()) return given;
  const std::string frame = given.substr(given[0] == '/' ? 1 : 0);
  const std::string problem = frameNameProblem(frame);
  if (!problem.empty()) fail(name, "is '" + shortText(given, MAX_NAME) + "', which is no frame's name: " + problem);
  return frame;
}

std::string ParameterReader::choice(const std::string& name, const std::string& fallback,
                                    const std::vector<std::string>& choices) {
  const ParameterTree& value = raw(name);
  if (!value.isSet()) return fallback;
  const std::string word = value.kind == Kind::BOOLEAN ? (value.truth ? "on" : "off") : get(name, fallback);
  if (std::find(choices.begin(), choices.end(), word) != choices.end()) return word;
  std::string all;
  for (const std::string& one : choices) all += (all.empty() ? "" : ", ") + one;
  fail(name, "is '" + word + "', it must be one of " + all + "; nearest is '" + nearestName(word, choices) + "'");
}

std::vector<double> ParameterReader::numbers(const ParameterTree& list, const std::string& name,
                                             std::size_t count) const {
  if (list.kind != Kind::LIST || list.items.size() != count) {
    fail(name, "must hold lists of " + std::to_string(count) + " numbers");
  }
  std::vector<double> result;
  for (const ParameterTree& item : list.items) {
    if (item.kind != Kind::NUMBER && item.kind != Kind::INTEGER) {
      fail(name, std::string("holds ") + kindName(item) + " where a number is needed");
    }
    result.push_back(item.kind == Kind::NUMBER ? item.number : item.integer);
    if (!std::isfinite(result.back())) fail(name, "holds a number that is not finite");
  }
  return result;
}

Vec3 ParameterReader::numbers(const std::string& name, std::size_t count, double min, double max) {
  const std::string what = "a list of " + std::to_string(count) + " numbers, such as [0, 0, 1]";
  const ParameterTree& list = needed(name, what);
  if (list.kind != Kind::LIST || list.items.size() != count) fail(name, "must be " + what);
  Vec3 result = Vec3::Zero();
  for (std::size_t i = 0; i < count; ++i) result[static_cast<int>(i)] = numberOf(list.items[i], name, min, max);
  return result;
}

Vec3 ParameterReader::vector(const std::string& name) { return numbers(name, 3, -1e6, 1e6); }

Vec3 ParameterReader::vector(const std::string& name, const Vec3& fallback) {
  return has(name) ? vector(name) : fallback;
}

std::vector<int> ParameterReader::integers(const std::string& name, int min, int max) {
  const ParameterTree& list = needed(name, "a list of integers, such as [0, 4]");
  if (list.kind != Kind::LIST || list.items.empty()) fail(name, "must be a list of integers, such as [0, 4]");
  std::vector<int> result;
  for (const ParameterTree& item : list.items) result.push_back(integerOf(item, name, min, max));
  return result;
}

std::vector<unsigned> ParameterReader::indices(const std::string& name) {
  std::vector<unsigned> result;
  for (const ParameterTree& item : list(name)) {
    if (item.kind != Kind::INTEGER || item.integer < 0) fail(name, "must hold vertex indices, integers from 0");
    result.push_back(static_cast<unsigned>(item.integer));
  }
  return result;
}

std::vector<ParameterTree> ParameterReader::list(const std::string& name) {
  const ParameterTree& value = raw(name);
  if (!value.isSet()) return {};
  if (value.kind != Kind::LIST) failKind(name, value, "a list");
  return value.items;
}

ParameterReader ParameterReader::below(const ParameterTree& tree, const std::string& name) const {
  ParameterTree section = tree;
  section.file = tree_.file;
  if (section.line == 0) section.line = tree_.line;
  ParameterReader reader(std::move(section), path_ + name + "/");
  reader.all_known_ = all_known_;
  return reader;
}

std::vector<ParameterReader> ParameterReader::sections(const std::string& name) {
  std::vector<ParameterReader> result;
  for (const ParameterTree& item : list(name)) {
    result.push_back(below(item, name + "[" + std::to_string(result.size()) + "]"));
  }
  return result;
}

ParameterReader ParameterReader::section(const std::string& name) { return below(raw(name), name); }

ParameterReader ParameterReader::neededSection(const std::string& name) {
  return below(needed(name, "a section, `key: value` lines"), name);
}

std::vector<std::string> ParameterReader::names() const {
  std::vector<std::string> result;
  for (const auto& member : tree_.members) result.push_back(member.first);
  return result;
}

/// One of that very name in a section below, else elsewhere, else the nearest at this level.
std::string ParameterReader::nearestTo(const std::string& name) const {
  for (const std::string& where : {path_, std::string()}) {
    for (const std::string& full : *all_known_) {
      const std::size_t begin = full.find_last_of("~/") + 1;  // 0 where there is neither
      if (full.compare(begin, std::string::npos, name) == 0 && full.compare(0, where.size(), where) == 0) return full;
    }
  }
  return path_ + nearestName(name, std::vector<std::string>(known_.begin(), known_.end()));
}

void ParameterReader::finish() const {
  for (const std::string& name : names()) {
    if (known_.count(name)) continue;
    fail(name, "is not known; nearest is " + nearestTo(name));
  }
}

}  // namespace dccd
