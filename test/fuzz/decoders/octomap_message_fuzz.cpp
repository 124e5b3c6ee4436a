// Any bytes as an octomap_msgs/Octomap (first byte even) or as a .bt or .ot file: a surface, or a sentence why there is
// none.
#include <stdexcept>
#include <string>

#include "base/octomap_decode.h"
#include "fuzz/fuzz_target.h"
#include "node/map_loader.h"
#include "octomap/octomap_header.h"

namespace {

using namespace dccd;

/// The decoder alone, with what a message's other fields may say.
void stream(const std::uint8_t* data, std::size_t size) {
  static const char* const IDS[] = {"OcTree", "ColorOcTree", "OcTreeStamped", "Other"};
  OctomapFields fields;
  fields.id = IDS[data[0] >> 1 & 3];
  fields.binary = (data[0] & 8) != 0;
  fields.resolution = (data[0] & 16) != 0 ? 0.05 : 1e-3;
  fields.data = data + 1;
  fields.size = size - 1;
  OctomapLimits limits;
  limits.max_leaves = 100000;
  try {
    const DecodedOctomap map = decodeOctomap(fields, limits);
    if (map.occupied.size() + map.free.size() > limits.max_leaves)
      throw std::logic_error("more leaves than max_leaves");
    VoxelSurface::build(map.resolution_m, map.occupied);  // what is decoded can be built
  } catch (const OctomapError& error) {
    if (std::string(error.what()).empty()) throw std::logic_error("refused without a reason");
  }
}

void octomap_message(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return;
  if (data[0] % 2 != 0) return stream(data, size);
  static const MonitorConfig config = [] {
    MonitorConfig c;
    c.max_map_bytes = 1 << 20;
    c.unknown_space = UnknownSpace::OCCUPIED;
    c.unknown_box = Box{Vec3::Constant(-1), Vec3::Constant(1)};
    return c;
  }();
  const LoadedMap map = decodeMapMessage(std::vector<std::uint8_t>(data + 1, data + size), config);
  if ((map.surface == nullptr) == map.problem.empty()) throw std::logic_error("neither a map nor a reason, or both");
}

}  // namespace

DEFORMABLE_CCD_FUZZ_TARGET(octomap_message)
