// OctoMap's streams to leaves: octomap_msgs/Octomap fields given as plain values, and .bt and .ot files. No OctoMap or
// ROS header is needed here.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "dccd/export.h"
#include "dccd/voxel_surface.h"

namespace dccd {

/// A map that cannot be read; the text names the field and the value, or the byte at which the stream goes wrong.
struct DCCD_EXPORT OctomapError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The fields of an octomap_msgs/Octomap message.
struct OctomapFields {
  std::string id;              ///< OcTree, ColorOcTree or OcTreeStamped
  double resolution = 0;       ///< [m], 1e-290 to 1e290
  bool binary = true;          ///< free/occupied in two bits a node; otherwise the full stream with log-odds
  const void* data = nullptr;  ///< with or without the header of a .bt or .ot file
  std::size_t size = 0;        ///< bytes of data; 0 is a valid, empty map
};

/// Leaves in Morton order, pruned leaves unexpanded. What is neither occupied nor free is unknown.
struct DecodedOctomap {
  double resolution_m = 0;
  std::string id;
  std::vector<OccupiedLeaf> occupied;
  std::vector<OccupiedLeaf> free;
  std::vector<float> log_odds;  ///< of what is occupied; empty: a binary stream, or they were not wanted
  /// Of what is occupied: where the sensor found something since the map before; nothing: nobody tells.
  std::optional<std::vector<OccupiedLeaf>> found;
};

/// What a stream holds: leaves, and the nodes of the trees that are built of the occupied ones and of all.
struct OctomapCounts {
  std::size_t occupied = 0, free = 0;
  std::size_t occupied_nodes = 0, known_nodes = 0;
};

/// What a map may cost. Counted before anything is allocated.
struct OctomapLimits {
  std::size_t max_bytes = std::size_t{256} << 20;
  std::size_t max_leaves = 20'000'000;  ///< occupied and free together; 12 bytes each
  bool free_leaves = true;              ///< false: they are counted and left out
  bool log_odds = false;                ///< they are wanted, 4 bytes each, and what was found
  /// Asked last, with what was counted; what it throws ends the decoding. Null: all is well.
  std::function<void(const OctomapCounts& counts)> accept = nullptr;
};

/// Throws OctomapError for an unknown id, a resolution out of range, a stream that ends early, goes deeper than 16
/// levels, holds a log-odds value that is not a number, or has bytes left over, a header that contradicts the fields,
/// and for limits exceeded. Time and memory are linear in the size of the data. A log-odds of 0 or more is occupied, as
/// in liboctomap by default. A root without children is a leaf, all of the octree's space: in a full stream what its
/// log-odds say; in a binary one, which does not tell, it is refused.
DCCD_EXPORT DecodedOctomap decodeOctomap(const OctomapFields& fields, const OctomapLimits& limits = {});

/// Reads a .bt or .ot file by its header. Throws OctomapError naming the file.
DCCD_EXPORT DecodedOctomap readOctomapFile(const std::string& path, const OctomapLimits& limits = {});

}  // namespace dccd
