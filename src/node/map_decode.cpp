// octomap_msgs/Octomap as bytes, and map files, to surfaces.
#include "node/map_decode.h"

#include <algorithm>
#include <exception>
#include <limits>
#include <new>

#include "base/next_surface.h"
#include "base/octomap_decode.h"
#include "dccd/known_space.h"
#include "dccd/tolerances.h"
#include "input/known_types.h"
#include "input/mesh_views.h"
#include "input/short_text.h"
#include "input/transforms.h"
#include "input/wire.h"
#include "node/map_loader.h"

namespace dccd {

namespace {

/// `unknown`: how many cubes of unknown space there is room for, where `memory` is what counts.
OctomapLimits limitsOf(const MonitorConfig& config, const MapMemory* memory, std::size_t& unknown) {
  OctomapLimits limits;
  limits.max_bytes = largestMapMessage(config);
  limits.free_leaves = config.needsKnownSpace();
  limits.log_odds = config.ownsVoxels();
  if (!memory) return limits;
  limits.max_leaves = std::numeric_limits<std::size_t>::max();
  limits.accept = [&unknown, memory](const OctomapCounts& counts) { unknown = memory->accept(counts); };
  return limits;
}

/// Each list ends before the next is made: what they take together is what MapMemory reckons with.
void build(DecodedOctomap decoded, const MonitorConfig& config, const MapMemory* memory, const VoxelSurface* before,
           std::size_t max_unknown, LoadedMap& map) {
  const auto counted = [memory](auto made) { return memory ? memory->counted(std::move(made)) : made; };
  // A map that has nothing free does not tell what it has seen: for own voxels, what is not occupied is free there. An
  // empty one has seen nothing: whoever made it began anew.
  if (config.unknown_space != UnknownSpace::FREE ||
      (config.needsKnownSpace() && (!decoded.free.empty() || decoded.occupied.empty()))) {
    std::vector<OccupiedLeaf> known;
    known.reserve(decoded.occupied.size() + decoded.free.size());
    known.assign(decoded.occupied.begin(), decoded.occupied.end());
    known.insert(known.end(), decoded.free.begin(), decoded.free.end());
    std::vector<OccupiedLeaf>().swap(decoded.free);
    map.known = counted(decoded.found ? KnownSpace::build(decoded.resolution_m, known, *std::move(decoded.found))
                                      : KnownSpace::build(decoded.resolution_m, known));
  }
  if (config.unknown_space == UnknownSpace::OCCUPIED) {
    const std::vector<OccupiedLeaf> unknown = map.known->unknownLeaves(config.unknown_box, max_unknown);
    decoded.occupied.insert(decoded.occupied.end(), unknown.begin(), unknown.end());
  }
  std::vector<OccupiedLeaf>& occupied = decoded.occupied;
  map.surface = counted(before ? nextSurface(decoded.resolution_m, std::move(occupied), *before)
                               : VoxelSurface::build(decoded.resolution_m, std::move(occupied)));
}

}  // namespace

std::string frameNameOf(const HeaderView& header) {
  std::string_view name = header.frame_id;
  if (!name.empty() && name[0] == '/') name.remove_prefix(1);
  const std::string frame(name.substr(0, MAX_NAME + 1));
  if (!name.empty() && !frameNameProblem(frame).empty()) {
    throw WireError("frame_id '" + shortText(name, MAX_NAME) + "' is no frame's name");
  }
  return frame;
}

void loadMap(const MonitorConfig& config, const MapMemory* memory, const VoxelSurface* before, LoadedMap& map,
             const std::function<DecodedOctomap(const OctomapLimits&)>& decode) {
  try {
    std::size_t max_unknown = tolerance::MAX_UNKNOWN_LEAVES;
    DecodedOctomap decoded = decode(limitsOf(config, memory, max_unknown));
    build(std::move(decoded), config, memory, before, std::min(max_unknown, tolerance::MAX_UNKNOWN_LEAVES), map);
  } catch (const std::bad_alloc&) {
    map.problem = "there is not enough memory for this map";
  } catch (const std::exception& error) {  // whatever a decoder meets, the node goes on without this map
    map.problem = shortText(error.what());
  }
  if (map.problem.empty()) return;
  map.surface = nullptr;
  map.known = nullptr;
}

std::string mapMessageProblem(const std::string& datatype, const std::string& md5, std::size_t size,
                              const MonitorConfig& config) {
  const std::string problem = config.takesClouds() ? cloudTypeProblem(datatype, md5) : mapTypeProblem(datatype, md5);
  if (!problem.empty() || size <= largestMapMessage(config)) return problem;
  return std::to_string(size) + " bytes are more than the eighth of max_map_mb " +
         std::to_string(config.max_map_bytes >> 20) + " that a message may have";
}

std::string whyRefused(const std::string& problem, const MonitorConfig& config) {
  for (const char* told : {"no transform", "no cloud ", "the newest cloud "}) {
    if (problem.rfind(told, 0) == 0) return problem;
  }
  return (config.takesClouds() ? "the cloud was refused: " : "the octomap was refused: ") + problem;
}

LoadedMap decodeMapMessage(const std::vector<std::uint8_t>& bytes, const MonitorConfig& config, const MapMemory* memory,
                           const VoxelSurface* before, MapOdds* odds) {
  LoadedMap map;
  loadMap(config, memory, before, map, [&](const OctomapLimits& limits) {
    WireReader wire(bytes.data(), bytes.size());
    const HeaderView header = readHeader(wire);
    map.stamp_ns = header.stamp_ns;
    map.frame_id = frameNameOf(header.frame_id.empty() ? HeaderView{0, config.octomap_frame} : header);
    OctomapFields fields;
    fields.binary = wire.read<std::uint8_t>("binary") != 0;
    fields.id = std::string(wire.readString("id"));
    fields.resolution = wire.read<double>("resolution");
    const WireSpan<std::uint8_t> data = wire.readArray<std::uint8_t>("data");
    fields.data = data.data;
    fields.size = data.size;
    DecodedOctomap decoded = decodeOctomap(fields, limits);
    if (odds) decoded.found = odds->foundIn(decoded, map.frame_id, map.stamp_ns);
    return decoded;
  });
  return map;
}

LoadedMap loadMapFile(const std::string& file, const MonitorConfig& config, const MapMemory* memory) {
  LoadedMap map;
  map.frame_id = config.octomap_frame;
  map.trusted = true;
  loadMap(config, memory, nullptr, map, [&](const OctomapLimits& limits) { return readOctomapFile(file, limits); });
  return map;
}

}  // namespace dccd
