#include "report/words.h"

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

std::string contactInWords(const Contact& c, const std::vector<Body>& bodies) {
  std::string text = bodyName(c.body[0], bodies) + " meets " + bodyName(c.body[1], bodies) + " (" +
                     factsOf(c.kind).words + (c.vertex[1] == NO_INDEX ? ", vertex" : ", vertices");
  forContactVertices(c, [&](std::uint16_t, Index v) { text += ' ' + std::to_string(v); });
  return text + (c.certainty == Certainty::CERTAIN ? ", certain" : ", undecided") + (c.initial ? ", initial" : "") +
         ")";
}

}  // namespace dccd
