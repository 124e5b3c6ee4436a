// A configuration as a tree of typed values: what the parameter server holds, or a YAML file, which keeps its lines.
#pragma once

#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace dccd {

/// One sentence that names the parameter, where it stands, and what to do.
struct ParameterError : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

struct ParameterTree {
  enum class Kind : std::uint8_t { UNSET, BOOLEAN, INTEGER, NUMBER, TEXT, LIST, SECTION, OTHER };

  Kind kind = Kind::UNSET;
  bool truth = false;                            ///< BOOLEAN
  int integer = 0;                               ///< INTEGER
  double number = 0;                             ///< NUMBER
  std::string text;                              ///< TEXT
  std::vector<ParameterTree> items;              ///< LIST
  std::map<std::string, ParameterTree> members;  ///< SECTION
  std::string file;                              ///< of the whole tree: where it was read from; empty: no file
  int line = 0;                                  ///< 0: stands in no file

  ParameterTree() = default;
  ParameterTree(bool value) : kind(Kind::BOOLEAN), truth(value) {}
  ParameterTree(int value) : kind(Kind::INTEGER), integer(value) {}
  ParameterTree(double value) : kind(Kind::NUMBER), number(value) {}
  ParameterTree(std::string value) : kind(Kind::TEXT), text(std::move(value)) {}
  ParameterTree(const char* value) : ParameterTree(std::string(value)) {}

  bool isSet() const { return kind != Kind::UNSET; }
  bool has(const std::string& name) const { return members.count(name) > 0; }
  /// Makes a section of what is not set.
  void put(const std::string& name, ParameterTree value) {
    if (!isSet()) kind = Kind::SECTION;
    members[name] = std::move(value);
  }
};

/// "an integer", "a list" and so on.
const char* kindName(const ParameterTree& value);

/// YAML text, typed as rosparam would; `name` stands for the text in messages. Throws ParameterError naming it and the
/// line, also for what nests or repeats itself without end.
ParameterTree parseYaml(const std::string& text, const std::string& name);
/// A whole file. `what` it should be is said where it cannot be read.
std::string yamlText(const std::string& file, const std::string& what = "a YAML file");
ParameterTree readYaml(const std::string& file);

/// The values below a name of the text's top level, as YAML, in the order and style of the text; empty: not there.
std::string yamlBelow(const std::string& text, const std::string& name);

}  // namespace dccd
