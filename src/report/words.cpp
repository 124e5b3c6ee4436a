#include "report/words.h"

#include <algorithm>

namespace dccd {

std::string bodyName(std::uint16_t body, const std::vector<Body>& bodies) {
  return body == OBSTACLE_BODY ? "octomap" : body < bodies.size() ? bodies[body].name : std::to_string(body);
}

std::string csvField(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + '"';
}

int meshPoints(const Contact& c) {
  return static_cast<int>(std::count_if(c.vertex.begin(), c.vertex.end(), [](Index v) { return v != NO_INDEX; }));
}

std::string contactInWords(const Contact& c, const std::vector<Body>& bodies) {
  std::string text = bodyName(c.body[0], bodies) + " meets " + bodyName(c.body[1], bodies) + " (" +
                     factsOf(c.kind).words + (meshPoints(c) == 1 ? ", vertex" : ", vertices");
  for (int i = 0; i < meshPoints(c); ++i) text += ' ' + std::to_string(c.vertex[i]);
  return text + (c.certainty == Certainty::CERTAIN ? ", certain" : ", undecided") + (c.initial ? ", initial" : "") +
         ")";
}

}  // namespace dccd
