// octomap_msgs/Octomap as bytes, and map files, to surfaces.
#include <exception>

#include "dccd/known_space.h"
#include "dccd/octomap_decode.h"
#include "input/known_types.h"
#include "input/mesh_views.h"
#include "input/wire.h"
#include "node/map_loader.h"
#include "ros/short_text.h"
#include "ros/transforms.h"

namespace dccd {

namespace {

OctomapLimits limitsOf(const MonitorConfig& config) {
  OctomapLimits limits;
  limits.max_bytes = config.max_map_bytes;
  return limits;
}

void build(DecodedOctomap decoded, const MonitorConfig& config, LoadedMap& map) {
  std::vector<OccupiedLeaf> known;
  if (config.unknown_space != UnknownSpace::FREE) {
    known = decoded.occupied;
    known.insert(known.end(), decoded.free.begin(), decoded.free.end());
    map.known = KnownSpace::build(decoded.resolution_m, known);
  }
  if (config.unknown_space == UnknownSpace::OCCUPIED) {
    const std::vector<OccupiedLeaf> unknown = map.known->unknownLeaves(config.unknown_box);
    decoded.occupied.insert(decoded.occupied.end(), unknown.begin(), unknown.end());
  }
  map.surface = VoxelSurface::build(decoded.resolution_m, std::move(decoded.occupied));
}

}  // namespace

std::string mapMessageProblem(const std::string& datatype, const std::string& md5, std::size_t size,
                              const MonitorConfig& config) {
  const std::string problem = mapTypeProblem(datatype, md5);
  if (!problem.empty() || size <= config.max_map_bytes) return problem;
  return std::to_string(size) + " bytes are more than max_map_mb";
}

LoadedMap decodeMapMessage(const std::vector<std::uint8_t>& bytes, const MonitorConfig& config) {
  LoadedMap map;
  try {
    WireReader wire(bytes.data(), bytes.size());
    const HeaderView header = readHeader(wire);
    map.stamp_ns = header.stamp_ns;
    std::string_view name = header.frame_id.empty() ? std::string_view(config.octomap_frame) : header.frame_id;
    if (!name.empty() && name[0] == '/') name.remove_prefix(1);
    map.frame_id = std::string(name.substr(0, MAX_NAME + 1));
    if (!name.empty() && !frameNameProblem(map.frame_id).empty()) {
      throw WireError("frame_id '" + shortText(name, MAX_NAME) + "' is no frame's name");
    }
    OctomapFields fields;
    fields.binary = wire.read<std::uint8_t>("binary") != 0;
    fields.id = std::string(wire.readString("id"));
    fields.resolution = wire.read<double>("resolution");
    const WireSpan<std::uint8_t> data = wire.readArray<std::uint8_t>("data");
    fields.data = data.data;
    fields.size = data.size;
    build(decodeOctomap(fields, limitsOf(config)), config, map);
  } catch (const std::exception& error) {  // whatever a decoder meets, the node goes on without this map
    map.surface = nullptr;
    map.problem = shortText(error.what());
  }
  return map;
}

LoadedMap loadMapFile(const std::string& file, const MonitorConfig& config) {
  LoadedMap map;
  map.frame_id = config.octomap_frame;
  try {
    build(readOctomapFile(file, limitsOf(config)), config, map);
  } catch (const std::exception& error) {
    map.surface = nullptr;
    map.problem = error.what();
  }
  return map;
}

}  // namespace dccd
