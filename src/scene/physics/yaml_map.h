// A map of a YAML file, read strictly: an unknown key, a missing one or a value of the wrong type or range is an error
// with file, line, key and what to write instead.
#pragma once

#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "dccd/types.h"

namespace dccd::scene {

struct SceneFileError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class YamlMap {
 public:
  /// `path` leads the keys in messages, for example "bodies[0]." ; throws SceneFileError if `node` is no map.
  YamlMap(const YAML::Node& node, std::string file, std::string path);

  bool has(const std::string& key);
  double number(const std::string& key, double min, double max);
  double number(const std::string& key, double min, double max, double fallback);
  int integer(const std::string& key, int min, int max);
  int integer(const std::string& key, int min, int max, int fallback);
  bool boolean(const std::string& key, bool fallback);
  std::string text(const std::string& key);
  std::string text(const std::string& key, const std::string& fallback);
  Vec3 vector(const std::string& key);
  Vec3 vector(const std::string& key, const Vec3& fallback);
  /// The first `count` numbers of the list, which must hold exactly that many; the rest of the result is 0.
  Vec3 numbers(const std::string& key, int count, double min, double max);
  std::vector<int> integers(const std::string& key, int min, int max);
  /// A list of exactly `count` texts.
  std::vector<std::string> texts(const std::string& key, std::size_t count);
  /// One of the choices; its place among them.
  std::size_t choice(const std::string& key, const std::vector<std::string>& choices, std::size_t fallback);
  YamlMap map(const std::string& key);
  std::optional<YamlMap> optionalMap(const std::string& key);
  /// The maps of a list; empty when the key is absent.
  std::vector<YamlMap> list(const std::string& key);
  /// The value of a key as YAML text, unread; empty when the key is absent.
  std::string raw(const std::string& key);

  /// Keys of the map, in the order of the file.
  std::vector<std::string> keys() const;

  /// Refuses the first key that nobody asked for. To be called when all have been read.
  void finish() const;
  [[noreturn]] void fail(const std::string& key, const std::string& what) const;

 private:
  YAML::Node required(const std::string& key, const std::string& what);
  double readNumber(const YAML::Node& node, const std::string& key, double min, double max) const;

  YAML::Node node_;
  std::string file_;
  std::string path_;
  std::set<std::string> known_;
};

}  // namespace dccd::scene
