// Any bytes as messages of any accepted mesh type: refused with a message that can be read, or decoded to a mesh that
// holds together. The first byte chooses the type, the second the configuration; the same message follows once more
// with other coordinates, so that welded and kept topologies are met, too.
#include <cmath>
#include <stdexcept>
#include <string>

#include "fuzz/fuzz_target.h"
#include "input/mesh_decoder.h"

namespace {

using namespace dccd;

MeshInputConfig configOf(std::uint8_t byte) {
  static const TopologySource SOURCES[] = {TopologySource::AUTO, TopologySource::MESSAGE, TopologySource::GRID,
                                           TopologySource::POLYLINE, TopologySource::FIRST_FRAME_WELD};
  MeshInputConfig config;
  config.source = SOURCES[byte % 5];
  if (config.source == TopologySource::FIRST_FRAME_WELD && (byte & 0x08) != 0) {
    config.source = TopologySource::DEPTH_IMAGE;
    config.depth.max_edge_m = 100;
    config.depth.stride = (byte & 0x04) != 0 ? 2 : 1;
    config.depth.median = (byte & 0x01) != 0 ? 3 : 1;
  }
  config.weld = (byte & 0x20) == 0;
  if ((byte & 0x40) != 0) config.rows = config.cols = 2;
  if ((byte & 0x80) != 0) config.frame_id = "world";
  // A field that clouds have, so that uncertainty is read from what was meant for something else.
  if ((byte & 0x10) != 0) config.noise_field = "z";
  config.max_vertices = 100000;
  return config;
}

void judge(const DecodedMesh& mesh) {
  if (!mesh.topology) throw std::logic_error("a mesh without topology");
  if (mesh.topology->vertexCount() != mesh.positions.size()) throw std::logic_error("topology and positions differ");
  for (const Edge& edge : mesh.topology->edges()) {
    if (edge[0] >= edge[1] || edge[1] >= mesh.positions.size()) throw std::logic_error("an edge that cannot be");
  }
  if (!mesh.radius_m.empty() && mesh.radius_m.size() != mesh.positions.size())
    throw std::logic_error("a radius too many");
  for (const double radius_m : mesh.radius_m) {
    if (!(radius_m >= 0 && std::isfinite(radius_m))) throw std::logic_error("an uncertainty that cannot be");
  }
  if (mesh.positions.size() > 100000) throw std::logic_error("more vertices than max_vertices");
}

bool feed(MeshDecoder& decoder, const std::string& type, const std::uint8_t* data, std::size_t size) {
  try {
    judge(decoder.decode(type, {data, size}));
    return true;
  } catch (const MeshError& error) {
    const std::string text = error.what();
    if (text.empty() || text.size() > 2000) throw std::logic_error("message: " + text);
    if (error.status != StepStatus::BAD_MESSAGE && error.status != StepStatus::VERTEX_COUNT) {
      throw std::logic_error("refused with another status");
    }
    return false;
  }
}

void mesh_message(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return;
  const std::string type = meshTypes()[data[0] % meshTypes().size()].datatype;
  MeshDecoder decoder(configOf(data[1]));
  std::vector<std::uint8_t> message(data + 2, data + size);
  const bool good = feed(decoder, type, message.data(), message.size());
  if (!message.empty()) message[message.size() / 2] ^= 0x15;
  feed(decoder, type, message.data(), message.size());
  if (good && !feed(decoder, type, data + 2, size - 2)) throw std::logic_error("taken once, refused afterwards");
}

}  // namespace

DEFORMABLE_CCD_FUZZ_TARGET(mesh_message)
