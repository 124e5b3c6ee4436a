// What the tests of the node's parameters share: sections of parameters, and the error that a tree of them leads to.
#pragma once

#include <string>

#include "config/monitor_config.h"
#include "support/said.h"

namespace dccd {
namespace test {

using XmlRpc::XmlRpcValue;

inline std::string errorOf(XmlRpcValue tree) {
  return said<ParameterError>([&] { readConfig(tree); });
}

inline XmlRpcValue separationPair(const std::string& a, const std::string& b, double separation_m) {
  XmlRpcValue pair;
  pair["between"][0] = a;
  pair["between"][1] = b;
  pair["separation_m"] = separation_m;
  return pair;
}

/// A body `seen` that is a depth camera's cloud, and nothing else.
inline void depthImage(XmlRpcValue& tree) {
  tree["bodies"]["seen"]["motion"] = "static";
  tree["bodies"]["seen"]["topology"]["source"] = "depth_image";
}

}  // namespace test
}  // namespace dccd
