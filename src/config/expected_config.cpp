// expected_contacts: which contacts a task brings about, and in which of its phases.
#include <algorithm>
#include <set>
#include <utility>

#include "config/body_config.h"

namespace dccd {
namespace {

/// A list of indices, or the name of a set, whose vertices are not known before the files are loaded.
void readVertices(ParameterReader& section, const std::string& name, ExpectedPartner& partner) {
  if (section.raw(name).kind == ParameterTree::Kind::TEXT) {
    partner.set = section.text(name);
    return;
  }
  partner.vertices = section.indices(name);
  if (partner.vertices.empty()) section.fail(name, "names no vertex; list some, or remove it for the whole body");
}

/// `vertices` of an entry: {cloth: hem, finger: [3, 4]}. Of a body with itself the body's own name stands for both
/// sides, unless `self` names the other one. Where a link has several bodies, the vertices are meant of each.
void readVerticesOf(ParameterReader& vertices, const MonitorConfig& config, Expectation& one) {
  const bool itself = one.partners[0].body == one.partners[1].body;
  for (std::size_t side = 0; side < 2; ++side) {
    ExpectedPartner& partner = one.partners[side];
    if (partner.body == OBSTACLE_BODY) continue;
    const BodyConfig& body = config.bodies[partner.body];
    const std::string name = itself && side == 1 && vertices.has("self") ? "self" : body.body.name;
    if (!vertices.has(name)) continue;
    if (body.isDepthImage()) vertices.fail(name, "has no meaning for a depth image; remove it");
    readVertices(vertices, name, partner);
  }
}

/// One entry: {between: [cloth, finger], vertices: {cloth: hem, finger: [3, 4]}, phase: carry}, which may name links
/// and groups.
void readExpectation(ParameterReader entry, std::size_t number, MonitorConfig& config) {
  const std::vector<Partners> pairs = readPartners(entry, config);
  ParameterReader vertices = entry.section("vertices");
  const std::string phase = entry.get("phase", std::string());
  config.expected_phases.push_back(phase);
  for (const Partners& bodies : pairs) {
    Expectation one;
    for (std::size_t side = 0; side < 2; ++side) one.partners[side].body = bodies[side];
    readVerticesOf(vertices, config, one);
    one.phase = phase;
    config.expected_contacts.push_back(std::move(one));
    config.expected_entry.push_back(number);
  }
  // An entry of links that are not there has no names to hold the vertices against.
  if (!pairs.empty()) vertices.finish();
  entry.finish();
}

}  // namespace

void readExpectedContacts(ParameterReader& reader, MonitorConfig& config) {
  std::size_t number = 0;
  for (const ParameterReader& entry : reader.sections("expected_contacts")) readExpectation(entry, number++, config);
  config.phase = reader.get("phase", std::string());
  const std::vector<std::string> known = config.phases();
  if (!config.phase.empty() && std::find(known.begin(), known.end(), config.phase) == known.end()) {
    reader.fail("phase", "is '" + config.phase + "', which expected_contacts does not name; " + config.phasesInWords());
  }
}

std::vector<std::string> MonitorConfig::phases() const {
  std::set<std::string> names(expected_phases.begin(), expected_phases.end());
  names.erase("");
  return {names.begin(), names.end()};
}

std::string MonitorConfig::phasesInWords() const {
  std::string text;
  for (const std::string& name : phases()) text += (text.empty() ? "'" : ", '") + name + "'";
  return "known phases are " + (text.empty() ? "'' for none alone" : text + ", and '' for none");
}

std::vector<Expectation> MonitorConfig::expectedIn(const std::string& some_phase) const {
  std::vector<Expectation> expected;
  for (const Expectation& one : expected_contacts) {
    if (one.phase.empty() || one.phase == some_phase) expected.push_back(one);
  }
  for (const Expectation& one : held()) expected.push_back(one);
  return expected;
}

std::vector<Expectation> MonitorConfig::held() const {
  std::vector<Expectation> held;
  for (const Hold& hold : holds) {
    if (hold.closed) held.insert(held.end(), hold.contacts.begin(), hold.contacts.end());
  }
  return held;
}

}  // namespace dccd
