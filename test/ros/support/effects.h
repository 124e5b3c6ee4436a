// What ~effects says of one effect.
#pragma once

#include <algorithm>
#include <string>

#include <diagnostic_msgs/DiagnosticArray.h>

namespace dccd {
namespace test {

struct EffectSaid {
  std::string reason;
  bool running = false;
};

inline EffectSaid effectIn(const diagnostic_msgs::DiagnosticArray& effects, const std::string& name) {
  EffectSaid said;
  for (const diagnostic_msgs::DiagnosticStatus& effect : effects.status) {
    if (effect.name != name) continue;
    said.reason = effect.message;
    said.running = std::any_of(effect.values.begin(), effect.values.end(), [](const diagnostic_msgs::KeyValue& value) {
      return value.key == "running" && value.value == "true";
    });
  }
  return said;
}

}  // namespace test
}  // namespace dccd
