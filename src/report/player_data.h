// What the page's player shows: recorded frames, their contacts and patches, and the voxels near the bodies, in a
// bounded amount of memory.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "dccd/outcome.h"

namespace dccd {

/// Positions are whole multiples of a body's quantum, 1/16384 of its size in the first frame: good for display. Where
/// the frames take more than the budget, every second one of those that matter least is left out, again and again:
/// first frames without an event of a patch, then such with one; a pair's first new contact stays.
class PlayerData {
 public:
  static constexpr std::size_t BUDGET_BYTES = 15'000'000;  ///< of the page; 10 minutes of 600 vertices thin to this
  static constexpr std::size_t MOST_CONTACTS = 48, MOST_PATCHES = 32;  ///< a frame
  static constexpr std::size_t MOST_VOXELS = 8000;                     ///< of one map; of all maps ten times as many

  explicit PlayerData(std::size_t budget_bytes = BUDGET_BYTES) : budget_bytes_(budget_bytes) {}

  /// `keep`: this frame is never left out.
  void add(const Outcome& outcome, const std::vector<Body>& bodies, StampNs origin_ns, bool keep);
  /// JSON of all of it; at most about the budget, except for what may never be left out.
  std::string json();

  /// Coordinates in whole quanta, x y z a vertex.
  using Quanta = std::vector<std::int32_t>;
  /// That of a coordinate that is not finite.
  static constexpr std::int32_t NOT_FINITE = 1 << 29;

 private:
  enum Level { QUIET, EVENT, KEPT };
  struct Grid {
    double quantum_m;
    Vec3 origin_m;
  };
  struct Place {  // of one body in one frame
    std::shared_ptr<const Positions> source;
    std::shared_ptr<const Quanta> quanta;
    std::size_t shape = 0;  // in shapes_
  };
  struct Frame {
    double from_s, to_s;
    std::uint64_t step;
    Level level;
    std::uint64_t ordinal;      // among those of its level
    std::vector<Place> places;  // of each body; without quanta: not there
    std::string details;        // JSON: contacts and patches
    std::size_t bytes = 0;      // of the page
  };
  struct Shape {
    std::shared_ptr<const Topology> topology;
    std::string json;
  };
  struct Voxels {
    double from_s;
    double resolution_m;
    Eigen::Isometry3d fixed_from_map;
    std::vector<OccupiedLeaf> leaves, own, doubted;
    bool all;
  };

  Place placeOf(std::size_t body, const Body& what, bool at_start);
  std::size_t shapeOf(const std::shared_ptr<const Topology>& topology);
  std::string detailsOf(const Outcome& outcome, StampNs origin_ns) const;
  void addFrame(Frame frame);
  void addVoxels(const Outcome& outcome, double from_s);
  void thin();

  std::size_t budget_bytes_;
  std::size_t bytes_ = 0;
  std::size_t seen_ = 0;
  std::vector<std::string> names_;
  std::vector<std::optional<Grid>> grids_;  // of each body
  std::vector<Shape> shapes_;
  std::vector<Frame> frames_;
  std::vector<Place> last_places_;  // of the newest frame, kept or not
  std::uint64_t stride_[2] = {1, 1};
  std::uint64_t count_[3] = {0, 0, 0};
  std::optional<StampNs> end_ns_;  // of the newest step
  std::vector<Voxels> voxels_;
  std::size_t voxels_kept_ = 0, maps_left_out_ = 0;
  std::shared_ptr<const VoxelSurface> surface_;
  std::shared_ptr<const std::vector<OwnVoxel>> own_;  // of the same map
  Box looked_at_;                                     // of the surface, map frame
};

/// Differences of one body's coordinates to those before (null: to 0), zigzag, in groups of 7 bits, low ones first; a
/// set high bit says that more follow.
void appendDifferences(const PlayerData::Quanta& now, const PlayerData::Quanta* before, std::string& bytes);

}  // namespace dccd
