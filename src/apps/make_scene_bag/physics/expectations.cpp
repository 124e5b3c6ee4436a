#include "apps/make_scene_bag/physics/expectations.h"

#include <algorithm>
#include <sstream>

namespace dccd::scene {
namespace {

/// When something may come: seconds from the first frame.
struct Window {
  double low_s = 0.0;
  double high_s = 0.0;
};

double lastFrame(const SceneSpec& spec) { return (spec.frames - 1) / spec.frame_rate_hz; }

Window readWindow(ParameterReader& map, const std::string& name, const SceneSpec& spec) {
  const Vec3 numbers = map.numbers(name, 2, 0.0, lastFrame(spec));
  if (numbers[0] > numbers[1]) map.fail(name, "must be the earliest time, then the latest");
  return {numbers[0], numbers[1]};
}

/// What becomes of the patches: when the last one ends, or that one lasts to the end.
void readEnd(ParameterReader& map, const Window& begin, const SceneSpec& spec) {
  const bool lasts = map.get("lasts", false);
  if (!map.has("ends_s")) return;
  if (lasts) map.fail("lasts", "contradicts ends_s; remove one of the two");
  if (readWindow(map, "ends_s", spec).high_s < begin.low_s) map.fail("ends_s", "is before first_contact_s");
}

void checkNames(ParameterReader& map, SceneSpec& spec) {
  const std::vector<std::string> names = map.texts("names", 2);
  for (const std::string& name : names) {
    const auto same = [&name](const auto& body) { return body.name == name; };
    if (std::any_of(spec.bodies.begin(), spec.bodies.end(), same)) continue;
    if (std::any_of(spec.rigid_bodies.begin(), spec.rigid_bodies.end(), same)) continue;
    if (spec.robot) {
      spec.robot->named_links.push_back(name);
      continue;
    }
    map.fail("names", "has '" + name + "', which is no body of the scene; write two names of bodies or rigid_bodies");
  }
  if (names[0] == names[1]) map.fail("names", "has one name twice; a body's contact with itself is `self`");
}

/// The expected first contact of one kind; nothing where none is expected.
std::optional<Window> readContact(ParameterReader map, const SceneSpec& spec) {
  if (map.has("first_contact_s") && map.raw("first_contact_s").text == "none") {
    map.finish();
    return std::nullopt;
  }
  const Window window = readWindow(map, "first_contact_s", spec);
  readEnd(map, window, spec);
  map.integer("contacts_at_least", 1, 1, 1000000000);
  map.finish();
  return window;
}

/// Those with one thing, or of `body` of each pair of names.
std::vector<Window> readContacts(ParameterReader& expect, const std::string& what, SceneSpec& spec) {
  if (!expect.has(what) || expect.raw(what).text == "none") return {};
  if (what == "octomap" && !spec.obstacle) expect.fail(what, "has no meaning without an obstacle; remove this line");
  const bool several = what == "body" && expect.raw(what).kind == ParameterTree::Kind::LIST;
  std::vector<Window> contacts;
  for (ParameterReader& map : several ? expect.sections(what) : std::vector{expect.section(what)}) {
    if (what == "body") checkNames(map, spec);
    if (const std::optional<Window> window = readContact(map, spec)) contacts.push_back(*window);
  }
  return contacts;
}

void checkClear(ParameterReader map, const std::vector<Window>& contacts, const SceneSpec& spec) {
  const double until_s = map.number("until_s", 0.0, 0.0, lastFrame(spec));
  const double again_s = map.number("again_s", lastFrame(spec), until_s, lastFrame(spec));
  map.number("share_at_least", 0.0, 0.0, 1.0);
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

void checkExpectations(ParameterReader map, SceneSpec& spec) {
  std::vector<Window> contacts;
  for (const char* what : {"octomap", "self", "body"}) {
    for (const Window& window : readContacts(map, what, spec)) contacts.push_back(window);
  }
  if (map.has("clear")) checkClear(map.section("clear"), contacts, spec);
  map.finish();
  if (map.names().empty()) map.fail("", "needs at least one fact, such as `self: none`");
}

}  // namespace dccd::scene
