// What a pipeline is made of before the first message: the files of its bodies, and the vertices that parameters name.
#include <algorithm>
#include <stdexcept>

#include "input/mesh_resource.h"
#include "node/monitor_pipeline.h"
#include "output/advice.h"

namespace dccd {

namespace {

/// What `load` makes of a file; its error as the parameter's.
template <typename Load>
auto loadFile(const BodyConfig& body, const std::string& parameter, const std::string& formats, Load load) {
  try {
    return load();
  } catch (const std::invalid_argument& error) {
    throw ParameterError("parameter " + parameter + " of body '" + body.body.name + "': " + error.what() +
                         "; write the path of " + formats + " mesh, or package://NAME/PATH");
  }
}

/// The groups of an OBJ are sets of the body; the vertices only of those that are wanted.
void addGroups(const MeshResource& mesh, const std::string& file, const std::set<std::string>& wanted,
               BodyConfig& body) {
  for (const auto& group : mesh.groups) {
    if (body.sets.count(group.first) > 0) {
      throw ParameterError("parameter topology/sets/" + group.first + " of body '" + body.body.name + "': " + file +
                           " has a group of this name, too; rename one of the two");
    }
    body.sets[group.first] = wanted.count(group.first) > 0 ? mesh.verticesOf(group.first) : std::vector<Index>();
  }
}

/// What of a file was skipped.
std::string hintsOf(const std::string& file, const MeshResource& mesh) {
  std::string text;
  for (const std::string& hint : mesh.hints) text = joined(text, file + ": " + hint);
  return text;
}

std::string setsOf(const BodyConfig& body) {
  std::string text;
  for (const auto& set : body.sets) text += (text.empty() ? "'" : ", '") + set.first + "'";
  return text.empty() ? "it has none; give them under topology/sets" : "it has " + text;
}

void checkGrid(const BodyConfig& body) {
  const std::size_t rows = body.input.rows, cols = body.input.cols, points = body.input.file_topology->vertexCount();
  if (rows == 0 || rows * cols == points) return;
  throw ParameterError("parameter topology/rows of body '" + body.body.name + "': " + std::to_string(rows) + " x " +
                       std::to_string(cols) + " = " + std::to_string(rows * cols) + ", but " + body.topology_file +
                       " has " + std::to_string(points) + " points; remove rows and cols, or file");
}

}  // namespace

void MonitorPipeline::loadFiles() {
  rigid_.resize(config_.bodies.size());
  for (std::size_t b = 0; b < config_.bodies.size(); ++b) {
    BodyConfig& body = config_.bodies[b];
    if (!body.topology_file.empty()) {
      const MeshResource file =
          loadFile(body, "topology/file", "an STL, OBJ or PLY", [&] { return loadTopologyFile(body.topology_file); });
      body.input.file_topology = file.topology;
      body.input.file_dropped_faces = file.dropped_faces;
      file_hints_[b] = hintsOf(body.topology_file, file);
      addGroups(file, body.topology_file, setsNamed(b), body);
      checkGrid(body);
    }
    if (!body.isRigid()) continue;
    if (body.link_mesh) {
      setRigid(b, *body.link_mesh);
      continue;
    }
    const MeshResource mesh = loadFile(body, "rigid/mesh", "an STL, OBJ, PLY or DAE",
                                       [&] { return loadMeshResource(body.mesh_file, body.mesh_scale); });
    addGroups(mesh, body.mesh_file, setsNamed(b), body);
    file_hints_[b] = hintsOf(body.mesh_file, mesh);
    doubts_[b] = rigidDoubt(body.mesh_file, mesh.positions, body.mesh_scale);
    hints_[b] = joined(file_hints_[b], doubts_[b]);
    setRigid(b, mesh);
  }
}

Rigid MonitorPipeline::rigidOf(const MeshResource& mesh) {
  Rigid rigid;
  rigid.mesh.topology = mesh.topology;
  rigid.reference = mesh.positions;
  rigid.mesh.dropped_faces = mesh.dropped_faces;
  rigid.mesh.rigid = true;
  return rigid;
}

void MonitorPipeline::setRigid(std::size_t body, const MeshResource& mesh) {
  const BodyConfig& config = config_.bodies[body];
  Rigid& rigid = rigid_[body].emplace(rigidOf(mesh));
  rigid.name = config.body.name;
  rigid.frame = config.tf_frame;
  rigid.may_be_lost = !config.body.link.empty();
  const double radius_m = config.input.noise_radius_m;
  if (radius_m > 0) rigid.mesh.radius_m.assign(rigid.reference.size(), radius_m);
}

std::string MonitorPipeline::expectedEntry(std::size_t expectation) const {
  return "expected_contacts[" + std::to_string(config_.expected_entry[expectation]) + "]";
}

std::set<std::string> MonitorPipeline::setsNamed(std::size_t body) const {
  std::set<std::string> names;
  for (const Expectation& one : config_.expected_contacts) {
    for (const ExpectedPartner& partner : one.partners) {
      if (partner.body == body && !partner.set.empty()) names.insert(partner.set);
    }
  }
  return names;
}

void MonitorPipeline::findSets() {
  for (std::size_t e = 0; e < config_.expected_contacts.size(); ++e) {
    for (ExpectedPartner& partner : config_.expected_contacts[e].partners) {
      if (partner.set.empty()) continue;
      const BodyConfig& body = config_.bodies[partner.body];
      const auto found = body.sets.find(partner.set);
      if (found == body.sets.end()) {
        throw ParameterError("parameter " + expectedEntry(e) + "/vertices names '" + partner.set +
                             "', which is no set of body '" + body.body.name + "'; " + setsOf(body));
      }
      if (found->second.empty()) {
        throw ParameterError("parameter " + expectedEntry(e) + "/vertices names '" + partner.set + "' of body '" +
                             body.body.name + "', a group without faces");
      }
      partner.vertices = found->second;
    }
  }
  for (std::size_t b = 0; b < config_.bodies.size(); ++b) {
    const Topology* known = rigid_[b] ? rigid_[b]->mesh.topology.get() : config_.bodies[b].input.file_topology.get();
    const std::string problem = known ? indexProblem(b, *known) : "";
    if (!problem.empty()) throw ParameterError(problem);
  }
}

std::string MonitorPipeline::indexProblem(std::size_t body, const Topology& topology) const {
  const auto problem = [&](const std::string& parameter, const std::vector<Index>& vertices) -> std::string {
    const auto largest = std::max_element(vertices.begin(), vertices.end());
    if (largest == vertices.end() || *largest < topology.vertexCount()) return {};
    return "parameter " + parameter + " of body '" + config_.bodies[body].body.name + "' names vertex " +
           std::to_string(*largest) + ", but the mesh has " + std::to_string(topology.vertexCount());
  };
  std::string found = problem("vertex_mask", config_.bodies[body].body.vertex_mask);
  for (std::size_t e = 0; e < config_.expected_contacts.size(); ++e) {
    for (const ExpectedPartner& partner : config_.expected_contacts[e].partners) {
      if (!found.empty() || partner.body != body) continue;
      const std::string set = partner.set.empty() ? "" : " (set '" + partner.set + "')";
      found = problem(expectedEntry(e) + "/vertices" + set, partner.vertices);
    }
  }
  return found;
}

}  // namespace dccd
