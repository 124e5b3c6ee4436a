// The voxels that single rays cross, as bits of blocks of 4^3.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "octomap/octree_update.h"

namespace dccd {

class PassedVoxels {
 public:
  void clear(std::size_t most_bytes);
  /// From the sensor to where the ray ends, both in voxels from the corner of key 0; voxels beyond the map are left
  /// out.
  void add(const Eigen::Vector3d& sensor, const Eigen::Vector3d& end);
  /// Once all rays are there.
  void sort();
  std::size_t memoryBytes() const;
  /// There was no room for all rays.
  bool isFull() const { return full_; }

  Seen look(const OctreeCube& cube);
  bool crosses(const OctreeCube&) const { return false; }  // look() knows

 private:
  struct Block {
    std::uint64_t code = 0, bits = 0;  // of its first voxel; in Morton order
  };
  /// Open addressing: where no bits are set, there is none.
  struct Slot {
    std::uint64_t block = 0, bits = 0;
  };
  std::vector<Slot> table_;
  std::size_t used_ = 0, most_bytes_ = 0;
  bool full_ = false;
  std::vector<Block> blocks_, other_;
  std::size_t next_ = 0;

  void mark(std::uint64_t block, std::uint64_t bits);
};

}  // namespace dccd
