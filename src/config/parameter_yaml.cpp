// YAML to the values that rosparam would put on the parameter server, so that offline tools read the same files.
#include <yaml-cpp/yaml.h>

#include <fstream>
#include <iterator>

#include "config/monitor_config.h"

namespace dccd {

using XmlRpc::XmlRpcValue;

namespace {

XmlRpcValue scalar(const YAML::Node& node) {
  const std::string text = node.Scalar();
  if (node.Tag() == "!") return XmlRpcValue(text);  // quoted
  int integer = 0;
  double number = 0;
  bool truth = false;
  if (YAML::convert<int>::decode(node, integer)) return XmlRpcValue(integer);
  // YAML 1.1, which rosparam reads, has no number without a point.
  if (text.find('.') != std::string::npos && YAML::convert<double>::decode(node, number)) return XmlRpcValue(number);
  if (YAML::convert<bool>::decode(node, truth)) return XmlRpcValue(truth);
  return XmlRpcValue(text);
}

XmlRpcValue value(const YAML::Node& node) {
  if (node.IsScalar()) return scalar(node);
  XmlRpcValue result;
  if (node.IsSequence()) {
    result.setSize(static_cast<int>(node.size()));
    for (std::size_t i = 0; i < node.size(); ++i) result[static_cast<int>(i)] = value(node[i]);
  } else if (node.IsMap()) {
    for (const auto& member : node) result[member.first.as<std::string>()] = value(member.second);
  }
  return result;
}

}  // namespace

XmlRpcValue parseYaml(const std::string& text, const std::string& name) {
  try {
    const YAML::Node root = YAML::Load(text);
    if (root.IsDefined() && !root.IsNull() && !root.IsMap()) {
      throw ParameterError(name + ": parameters must be a map of names");
    }
    return value(root);
  } catch (const YAML::Exception& error) {
    throw ParameterError(name + ":" + std::to_string(error.mark.line + 1) + ": " + error.msg);
  }
}

XmlRpcValue readYaml(const std::string& file) {
  std::ifstream stream(file);
  if (!stream) throw ParameterError(file + " cannot be read");
  return parseYaml({std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()}, file);
}

}  // namespace dccd
