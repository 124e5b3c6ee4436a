#include "octomap/map_builder.h"

#include <sstream>
#include <stdexcept>
#include <string>

#include <octomap/OcTree.h>

namespace dccd {

std::vector<std::int8_t> serialized(const octomap::OcTree& tree, bool binary) {
  std::ostringstream stream;
  const bool written =
      binary ? static_cast<bool>(tree.writeBinaryData(stream)) : static_cast<bool>(tree.writeData(stream));
  if (!written) throw std::runtime_error("octomap: the tree could not be serialized");
  const std::string bytes = stream.str();
  return std::vector<std::int8_t>(bytes.begin(), bytes.end());
}

std::vector<std::int8_t> buildOctomap(double resolution_m, const Box& bounds,
                                      const std::function<bool(const Vec3& center_m)>& occupied, bool binary) {
  octomap::OcTree tree(resolution_m);
  if (!bounds.empty()) {
    octomap::OcTreeKey low, high;
    // Both corners lie in their voxels' closed boxes; one voxel more on each side costs little and misses none.
    const Vec3 min = bounds.min.array() - resolution_m, max = bounds.max.array() + resolution_m;
    // OctoMap's own check casts to int before it looks.
    const double half_span_m = 32768 * resolution_m;
    const bool inside = (min.array() >= -half_span_m).all() && (max.array() <= half_span_m).all();
    if (!inside || !tree.coordToKeyChecked(octomap::point3d(min[0], min[1], min[2]), low) ||
        !tree.coordToKeyChecked(octomap::point3d(max[0], max[1], max[2]), high)) {
      throw std::invalid_argument("octomap: the shapes reach beyond the 65536 voxels that a map can span");
    }
    octomap::OcTreeKey key;
    for (unsigned x = low[0]; x <= high[0]; ++x) {
      for (unsigned y = low[1]; y <= high[1]; ++y) {
        for (unsigned z = low[2]; z <= high[2]; ++z) {
          key = octomap::OcTreeKey(x, y, z);
          const Vec3 center(tree.keyToCoord(key[0]), tree.keyToCoord(key[1]), tree.keyToCoord(key[2]));
          if (occupied(center)) tree.updateNode(key, true, true);
        }
      }
    }
    tree.updateInnerOccupancy();
  }
  if (binary) {
    tree.toMaxLikelihood();
    tree.prune();
  }
  return serialized(tree, binary);
}

}  // namespace dccd
