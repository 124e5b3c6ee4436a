// What the tests of the node's parameters share: parameters out of YAML, and the error that they lead to.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "config/monitor_config.h"
#include "support/said.h"

namespace dccd {
namespace test {

using XmlRpc::XmlRpcValue;

inline std::string errorOf(XmlRpcValue tree) {
  return said<ParameterError>([&] { readConfig(tree); });
}

/// What rosparam makes of the values of a YAML file.
inline XmlRpcValue onServer(const ParameterTree& tree) {
  XmlRpcValue value;
  switch (tree.kind) {
    case ParameterTree::Kind::BOOLEAN:
      return XmlRpcValue(tree.truth);
    case ParameterTree::Kind::INTEGER:
      return XmlRpcValue(tree.integer);
    case ParameterTree::Kind::NUMBER:
      return XmlRpcValue(tree.number);
    case ParameterTree::Kind::TEXT:
      return XmlRpcValue(tree.text);
    default:
      break;
  }
  for (std::size_t i = 0; i < tree.items.size(); ++i) value[static_cast<int>(i)] = onServer(tree.items[i]);
  for (const auto& [name, member] : tree.members) value[name] = onServer(member);
  return value;
}

/// The parameters in the braces of a YAML map.
inline XmlRpcValue parameters(const std::string& yaml) { return onServer(parseYaml("{" + yaml + "}", "p.yaml")); }

/// Of each case: what is said of the parameters.
inline void expectMistakes(const std::vector<std::pair<const char*, const char*>>& cases) {
  for (const auto& [yaml, said] : cases) {
    const std::string error = errorOf(parameters(yaml));
    EXPECT_TRUE(mentions(error, said)) << yaml << ": " << error;
  }
}

}  // namespace test
}  // namespace dccd
