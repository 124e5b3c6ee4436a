// A configuration, read strictly: an unknown name, a missing one, or a value of the wrong type or range is an error
// that names the parameter, its file and line where it has them, and what to write. The node's parameters and scene
// files are read by this one reader.
#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "config/nearest_name.h"
#include "config/parameter_tree.h"
#include "dccd/types.h"

namespace dccd {

/// One section of the tree. Every get marks its name as known; finish() refuses what nobody asked for. A get with a
/// fallback gives it where nothing is set; one without refuses that.
class ParameterReader {
 public:
  /// `tree` may be unset (no parameters at all). `path` leads the names in messages, for example "~" or
  /// "~bodies/cloth/". Throws ParameterError when it is neither a section nor unset.
  ParameterReader(ParameterTree tree, std::string path);

  bool has(const std::string& name);
  /// Numbers in [min, max].
  double number(const std::string& name, double min, double max);
  double number(const std::string& name, double fallback, double min, double max);
  int integer(const std::string& name, int min, int max);
  int integer(const std::string& name, int fallback, int min, int max);
  std::size_t integer(const std::string& name, std::size_t fallback, int min, int max);
  bool get(const std::string& name, bool fallback);
  std::string get(const std::string& name, const std::string& fallback);
  /// A text that is not empty.
  std::string text(const std::string& name);
  std::string text(const std::string& name, const std::string& fallback);
  /// A tf frame; empty where it is not set. One slash in front of it is left out, as of messages.
  std::string frame(const std::string& name);
  /// One of the choices. YAML's on and off are booleans, so those are taken for the words where these are choices.
  std::string choice(const std::string& name, const std::string& fallback, const std::vector<std::string>& choices);

  /// Numbers of `list`, which must hold exactly `count` of them, all finite. `name` stands for it in messages.
  std::vector<double> numbers(const ParameterTree& list, const std::string& name, std::size_t count) const;
  /// The same of a parameter, each in [min, max]; the rest of the result is 0.
  Vec3 numbers(const std::string& name, std::size_t count, double min, double max);
  Vec3 vector(const std::string& name);  ///< three numbers
  Vec3 vector(const std::string& name, const Vec3& fallback);
  /// Not empty, each in [min, max].
  std::vector<int> integers(const std::string& name, int min, int max);
  /// Vertex indices; empty where nothing is set.
  std::vector<unsigned> indices(const std::string& name);
  /// The list's items, or none when it is not set.
  std::vector<ParameterTree> list(const std::string& name);
  /// The same where each item is a section.
  std::vector<ParameterReader> sections(const std::string& name);
  /// What is not set is an empty section.
  ParameterReader section(const std::string& name);
  /// Refuses what is not set.
  ParameterReader neededSection(const std::string& name);

  /// Names set at this level.
  std::vector<std::string> names() const;
  /// The value of a known name, marked as asked for.
  const ParameterTree& raw(const std::string& name);
  const std::string& path() const { return path_; }

  /// Throws ParameterError on the first name that is set but that no get asked for.
  void finish() const;
  /// "WHERE name what"; an empty name is this section itself.
  [[noreturn]] void fail(const std::string& name, const std::string& what) const;

 private:
  ParameterTree tree_;
  std::string path_;
  std::set<std::string> known_;
  // In full, here and in the sections around and below.
  std::shared_ptr<std::set<std::string>> all_known_ = std::make_shared<std::set<std::string>>();

  const ParameterTree& needed(const std::string& name, const std::string& what);
  std::string nearestTo(const std::string& name) const;
  [[noreturn]] void failKind(const std::string& name, const ParameterTree& value, const std::string& needed) const;
  double numberOf(const ParameterTree& value, const std::string& name, double min, double max) const;
  int integerOf(const ParameterTree& value, const std::string& name, int min, int max) const;
  ParameterReader below(const ParameterTree& tree, const std::string& name) const;
};

}  // namespace dccd
