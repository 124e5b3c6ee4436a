#include "step/clearance/map_boxes.h"

namespace dccd {

void MapBoxes::set(std::shared_ptr<const VoxelSurface> surface) {
  if (surface == surface_) return;
  surface_ = nullptr;  // until all boxes are made: memory may end
  const VoxelTree& tree = VoxelSurface::Impl::of(*surface).tree;
  const double resolution_m = surface->resolution();
  for (int level = 0; level < VoxelTree::LEVELS; ++level) {
    const std::vector<VoxelTree::Node>& nodes = tree.nodes(level);
    boxes_[level].resize(nodes.size());
    for (std::uint32_t number = 0; number < nodes.size(); ++number) {
      const VoxelTree::Node& node = nodes[number];
      StepBox box = StepBox::none();
      if (node.full != 0) {
        double lo[3], hi[3];
        for (int axis = 0; axis < 3; ++axis) {
          int first = 0, last = 3;
          while ((node.full & RANGE_MASKS[axis][first][first]) == 0) ++first;
          while ((node.full & RANGE_MASKS[axis][last][last]) == 0) --last;
          const std::int64_t origin = std::int64_t{tree.nodeCell(level, number)[axis]} << (2 * (level + 1));
          lo[axis] = voxelPlane(origin + (std::int64_t{first} << (2 * level)), resolution_m);
          hi[axis] = voxelPlane(origin + (std::int64_t{last + 1} << (2 * level)), resolution_m);
        }
        box = StepBox::still(lo, hi);
      }
      for (std::uint64_t children = node.child; children != 0; children &= children - 1) {
        box.add(boxes_[level - 1][node.childAt(lowestBit(children))]);
      }
      boxes_[level][number] = box;
    }
  }
  surface_ = std::move(surface);
}

}  // namespace dccd
