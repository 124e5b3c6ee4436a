#include "scene/physics/yaml_map.h"

#include <cmath>
#include <sstream>
#include <utility>

namespace dccd::scene {

YamlMap::YamlMap(const YAML::Node& node, std::string file, std::string path)
    : node_(node), file_(std::move(file)), path_(std::move(path)) {
  if (!node_.IsMap()) fail("", "write `key: value` lines here");
}

void YamlMap::fail(const std::string& key, const std::string& what) const {
  const YAML::Node at = !key.empty() && node_.IsMap() && node_[key] ? node_[key] : node_;
  std::string name = path_ + key;
  while (!name.empty() && name.back() == '.') name.pop_back();
  std::ostringstream message;
  message << file_ << ":" << at.Mark().line + 1 << ": ";
  if (!name.empty()) message << name << ": ";
  throw SceneFileError(message.str() + what);
}

bool YamlMap::has(const std::string& key) {
  known_.insert(key);
  return node_[key].IsDefined();
}

YAML::Node YamlMap::required(const std::string& key, const std::string& what) {
  if (!has(key)) fail(key, "is missing; write " + what);
  return node_[key];
}

double YamlMap::readNumber(const YAML::Node& node, const std::string& key, double min, double max) const {
  double value = 0.0;
  if (node.IsScalar() && YAML::convert<double>::decode(node, value) && std::isfinite(value) && value >= min &&
      value <= max) {
    return value;
  }
  std::ostringstream what;
  what << "write a number from " << min << " to " << max;
  if (node.IsScalar()) what << ", not '" << node.Scalar() << "'";
  fail(key, what.str());
}

double YamlMap::number(const std::string& key, double min, double max) {
  return readNumber(required(key, "a number"), key, min, max);
}

double YamlMap::number(const std::string& key, double min, double max, double fallback) {
  return has(key) ? readNumber(node_[key], key, min, max) : fallback;
}

int YamlMap::integer(const std::string& key, int min, int max) {
  const double value = number(key, min, max);
  if (value != std::floor(value)) fail(key, "write a whole number");
  return static_cast<int>(value);
}

int YamlMap::integer(const std::string& key, int min, int max, int fallback) {
  return has(key) ? integer(key, min, max) : fallback;
}

bool YamlMap::boolean(const std::string& key, bool fallback) {
  bool value = fallback;
  if (has(key) && !YAML::convert<bool>::decode(node_[key], value)) fail(key, "write true or false");
  return value;
}

std::string YamlMap::text(const std::string& key) {
  const YAML::Node node = required(key, "a text");
  if (!node.IsScalar() || node.Scalar().empty()) fail(key, "write a text");
  return node.Scalar();
}

std::string YamlMap::text(const std::string& key, const std::string& fallback) {
  return has(key) ? text(key) : fallback;
}

Vec3 YamlMap::numbers(const std::string& key, int count, double min, double max) {
  const std::string what = "a list of " + std::to_string(count) + " numbers, such as [0, 0, 1]";
  const YAML::Node node = required(key, what);
  if (!node.IsSequence() || node.size() != static_cast<std::size_t>(count)) fail(key, "write " + what);
  Vec3 result = Vec3::Zero();
  for (int i = 0; i < count; ++i) result[i] = readNumber(node[i], key, min, max);
  return result;
}

Vec3 YamlMap::vector(const std::string& key) { return numbers(key, 3, -1e6, 1e6); }

Vec3 YamlMap::vector(const std::string& key, const Vec3& fallback) { return has(key) ? vector(key) : fallback; }

std::vector<int> YamlMap::integers(const std::string& key, int min, int max) {
  const YAML::Node node = required(key, "a list of whole numbers");
  if (!node.IsSequence() || node.size() == 0) fail(key, "write a list of whole numbers, such as [0, 4]");
  std::vector<int> result;
  for (const YAML::Node& item : node) {
    const double value = readNumber(item, key, min, max);
    if (value != std::floor(value)) fail(key, "write whole numbers");
    result.push_back(static_cast<int>(value));
  }
  return result;
}

std::vector<std::string> YamlMap::texts(const std::string& key, std::size_t count) {
  const std::string what = "a list of " + std::to_string(count) + " texts, such as [cloth, finger]";
  const YAML::Node node = required(key, what);
  if (!node.IsSequence() || node.size() != count) fail(key, "write " + what);
  std::vector<std::string> result;
  for (const YAML::Node& item : node) {
    if (!item.IsScalar()) fail(key, "write " + what);
    result.push_back(item.Scalar());
  }
  return result;
}

std::size_t YamlMap::choice(const std::string& key, const std::vector<std::string>& choices, std::size_t fallback) {
  if (!has(key)) return fallback;
  std::string all;
  for (std::size_t i = 0; i < choices.size(); ++i) {
    if (node_[key].IsScalar() && node_[key].Scalar() == choices[i]) return i;
    all += (i == 0 ? "" : ", ") + choices[i];
  }
  fail(key, "write one of " + all);
}

YamlMap YamlMap::map(const std::string& key) { return YamlMap(required(key, "a map"), file_, path_ + key + "."); }

std::optional<YamlMap> YamlMap::optionalMap(const std::string& key) {
  if (!has(key)) return std::nullopt;
  return map(key);
}

std::vector<YamlMap> YamlMap::list(const std::string& key) {
  std::vector<YamlMap> result;
  if (!has(key)) return result;
  if (!node_[key].IsSequence()) fail(key, "write a list, its items led by `- `");
  for (std::size_t i = 0; i < node_[key].size(); ++i) {
    result.emplace_back(node_[key][i], file_, path_ + key + "[" + std::to_string(i) + "].");
  }
  return result;
}

std::string YamlMap::raw(const std::string& key) {
  if (!has(key)) return {};
  YAML::Emitter emitter;
  emitter << node_[key];
  return emitter.c_str();
}

std::vector<std::string> YamlMap::keys() const {
  std::vector<std::string> names;
  for (const auto& item : node_) names.push_back(item.first.Scalar());
  return names;
}

void YamlMap::finish() const {
  for (const auto& item : node_) {
    const std::string key = item.first.Scalar();
    if (known_.count(key) != 0) continue;
    std::string all;
    for (const std::string& name : known_) all += (all.empty() ? "" : ", ") + name;
    fail(key, "is not a key here; known are " + all);
  }
}

}  // namespace dccd::scene
