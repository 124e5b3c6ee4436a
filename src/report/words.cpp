#include "report/words.h"

#include <algorithm>
#include <set>
#include <sstream>

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

std::string insideInWords(const Outcome& outcome) {
  const auto isInside = [](const StartIntersection& one) {
    return one.vertex[1] == NO_INDEX && one.body[1] != OBSTACLE_BODY;
  };
  if (std::none_of(outcome.intersections.begin(), outcome.intersections.end(), isInside)) return "";  // of most steps
  std::set<std::array<std::uint16_t, 2>> told;
  std::ostringstream text;
  for (const StartIntersection& one : outcome.intersections) {
    if (!isInside(one) || !told.insert(one.body).second) continue;
    const std::vector<Body>& bodies = outcome.step->bodies;
    const Body& closed = bodies[one.body[1]];
    Box box;
    for (const Vec3& p : *closed.t0) {
      box.min = box.min.cwiseMin(p);
      box.max = box.max.cwiseMax(p);
    }
    text << (told.size() > 1 ? ", " : "") << bodies[one.body[0]].name << " lies inside of " << closed.name
         << ", which is " << (box.max - box.min).maxCoeff()
         << " m across: " << (closed.rigid ? "rigid/scale: 0.001 if its file is in millimetres, " : "")
         << "shell: true if it is a container";
  }
  return text.str();
}

std::string contactInWords(const Contact& c, const std::vector<Body>& bodies) {
  std::string text = bodyName(c.body[0], bodies) + " meets " + bodyName(c.body[1], bodies) + " (" +
                     factsOf(c.kind).words + (c.vertex[1] == NO_INDEX ? ", vertex" : ", vertices");
  forContactVertices(c, [&](std::uint16_t, Index v) { text += ' ' + std::to_string(v); });
  return text + (c.certainty == Certainty::CERTAIN ? ", certain" : ", undecided") + (c.initial ? ", initial" : "") +
         ")";
}

}  // namespace dccd
