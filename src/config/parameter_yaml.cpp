// YAML to the values that rosparam would put on the parameter server, so that every tool reads the same files alike.
#include <yaml-cpp/yaml.h>

#include <fstream>
#include <iterator>
#include <vector>

#include "base/decimal.h"
#include "base/regular_file.h"
#include "config/parameter_tree.h"

namespace dccd {

namespace {

constexpr std::uint64_t MAX_FILE_BYTES = std::uint64_t{16} << 20;

using Kind = ParameterTree::Kind;

// An anchor can name itself, and a few lines of anchors can stand for more values than there is memory.
constexpr int MAX_DEPTH = 64;
constexpr std::size_t MAX_VALUES = 4000000;

class YamlTree {
 public:
  explicit YamlTree(const std::string& name) : name_(name) {}

  ParameterTree value(const YAML::Node& node, int depth = 0) {
    if (depth > MAX_DEPTH || ++values_ > MAX_VALUES) {
      fail(node, "nests too deeply or repeats itself; write it without anchors");
    }
    const std::string& tag = node.Tag();  // "!" is that of quotes, "?" and none those of all else
    if (tag.size() > 1)
      fail(node, "the value has the tag " + tag + ", which is not read here; write the value without it");
    ParameterTree tree = node.IsScalar() ? scalar(node) : ParameterTree();
    tree.line = node.Mark().line + 1;
    if (node.IsSequence()) {
      tree.kind = Kind::LIST;
      for (const YAML::Node& item : node) tree.items.push_back(value(item, depth + 1));
    } else if (node.IsMap()) {
      tree.kind = Kind::SECTION;
      for (const auto& member : node) {
        const auto name = member.first.as<std::string>();
        // The server has no such value. Of two, rosparam takes the last one without a word.
        if (member.second.IsNull()) fail(member.first, name + " has no value; write one, or remove the line");
        const bool is_new = tree.members.emplace(name, value(member.second, depth + 1)).second;
        if (!is_new) fail(member.first, name + " stands twice");
      }
    }
    return tree;
  }

 private:
  [[noreturn]] void fail(const YAML::Node& node, const std::string& what) const {
    throw ParameterError(name_ + ":" + std::to_string(node.Mark().line + 1) + ": " + what);
  }

  static ParameterTree scalar(const YAML::Node& node) {
    const std::string text = node.Scalar();
    if (node.Tag() == "!") return text;  // quoted
    if (const auto integer = decimalInteger(text);
        integer && !looksOctal(text) && static_cast<int>(*integer) == *integer) {
      return static_cast<int>(*integer);
    }
    // YAML 1.1, which rosparam reads, has no number without a point; one without digits is .inf or .nan.
    if (text.find('.') != std::string::npos) {
      if (const auto number = decimalNumber(text)) return *number;
      double number = 0;
      const bool digits = text.find_first_of("0123456789") != std::string::npos;
      if (!digits && YAML::convert<double>::decode(node, number)) return number;
    }
    bool truth = false;
    if (YAML::convert<bool>::decode(node, truth)) return truth;
    return text;
  }

  const std::string& name_;
  std::size_t values_ = 0;
};

}  // namespace

ParameterTree parseYaml(const std::string& text, const std::string& name) {
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(text);
    if (documents.size() > 1) throw ParameterError(name + ": holds several documents; write one, without a line ---");
    const YAML::Node root = documents.empty() ? YAML::Node() : documents[0];
    if (root.IsDefined() && !root.IsNull() && !root.IsMap()) {
      throw ParameterError(name + ":" + std::to_string(root.Mark().line + 1) +
                           ": parameters must be a map of names: write `name: value` lines");
    }
    ParameterTree tree = YamlTree(name).value(root);
    tree.file = name;
    return tree;
  } catch (const YAML::Exception& error) {
    throw ParameterError(name + ":" + std::to_string(error.mark.line + 1) + ": not YAML: " + error.msg);
  }
}

std::string yamlText(const std::string& file, const std::string& what) {
  const std::string problem = regularFileProblem(file, MAX_FILE_BYTES);
  if (!problem.empty()) throw ParameterError(file + ": " + problem + "; name " + what);
  std::ifstream stream(file);
  if (!stream) throw ParameterError(file + ": cannot be read; name " + what);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

ParameterTree readYaml(const std::string& file) { return parseYaml(yamlText(file), file); }

std::string yamlBelow(const std::string& text, const std::string& name) {
  const YAML::Node node = YAML::Load(text)[name];
  if (!node.IsDefined()) return {};
  YAML::Emitter emitter;
  emitter << node;
  return emitter.c_str();
}

}  // namespace dccd
