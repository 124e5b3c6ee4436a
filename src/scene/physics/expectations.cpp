#include "scene/physics/expectations.h"

#include <algorithm>
#include <sstream>

namespace dccd::scene {
namespace {

/// When a first contact may come: seconds from the first frame.
struct Window {
  double low_s = 0.0;
  double high_s = 0.0;
};

double lastFrame(const SceneSpec& spec) { return (spec.frames - 1) / spec.frame_rate_hz; }

Window readWindow(YamlMap& map, const SceneSpec& spec) {
  const Vec3 numbers = map.numbers("first_contact_s", 2, 0.0, lastFrame(spec));
  if (numbers[0] > numbers[1]) map.fail("first_contact_s", "write the earliest time first, then the latest");
  return {numbers[0], numbers[1]};
}

void checkNames(YamlMap& map, const SceneSpec& spec) {
  const std::vector<std::string> names = map.texts("names", 2);
  for (const std::string& name : names) {
    const auto same = [&name](const auto& body) { return body.name == name; };
    if (std::any_of(spec.bodies.begin(), spec.bodies.end(), same)) continue;
    if (std::any_of(spec.rigid_bodies.begin(), spec.rigid_bodies.end(), same)) continue;
    map.fail("names", "the scene has no body '" + name + "'; write two names of bodies or rigid_bodies");
  }
  if (names[0] == names[1]) map.fail("names", "write two different names; a body's contact with itself is `self`");
}

/// The expected first contact with one thing; nothing where none is expected.
std::optional<Window> readContact(YamlMap& expect, const std::string& what, const SceneSpec& spec) {
  if (!expect.has(what) || expect.raw(what) == "none") return std::nullopt;
  YamlMap map = expect.map(what);
  if (what == "octomap" && !spec.obstacle) expect.fail(what, "the scene has no obstacle; remove this line");
  if (what == "body") checkNames(map, spec);
  const Window window = readWindow(map, spec);
  map.integer("contacts_at_least", 1, 1000000000, 1);
  map.finish();
  return window;
}

void checkClear(YamlMap map, const std::vector<Window>& contacts, const SceneSpec& spec) {
  const double until_s = map.number("until_s", 0.0, lastFrame(spec), 0.0);
  const double again_s = map.number("again_s", until_s, lastFrame(spec), lastFrame(spec));
  map.number("share_at_least", 0.0, 1.0, 0.0);
  for (const Window& window : contacts) {
    std::ostringstream what;
    what << "contradicts first_contact_s: [" << window.low_s << ", " << window.high_s << "]; write ";
    if (until_s > window.low_s) map.fail("until_s", what.str() + "no later time than its first");
    if (map.has("again_s") && again_s < window.high_s) {
      map.fail("again_s", what.str() + "no earlier time than its last");
    }
  }
  map.finish();
}

}  // namespace

void checkExpectations(YamlMap map, const SceneSpec& spec) {
  std::vector<Window> contacts;
  for (const char* what : {"octomap", "self", "body"}) {
    if (const std::optional<Window> window = readContact(map, what, spec)) contacts.push_back(*window);
  }
  if (std::optional<YamlMap> clear = map.optionalMap("clear")) checkClear(*clear, contacts, spec);
  map.finish();
  if (map.keys().empty()) map.fail("", "write at least one fact, such as `self: none`");
}

}  // namespace dccd::scene
