// An ordinary cell for benchmarks: an arm of seven links over a table that a depth camera sees, and a cloth in its
// hand.
#pragma once

#include <memory>
#include <vector>

#include "dccd/step.h"
#include "support/generated_shapes.h"

namespace dccd {
namespace benchmarks {

class RobotCell {
 public:
  static constexpr std::size_t LINKS = 7;
  static constexpr double PERIOD_S = 1 / 30.0;  ///< of frames; a map is in use for two steps

  /// The links are the meshes of ../shared's ur5e or, where these are not there, of about as many triangles.
  /// against_links: those links meet each other that its SRDF lets meet.
  explicit RobotCell(bool against_links);

  /// From frame k to the next one. Ask in order.
  Step step(int k);
  bool hasRealMeshes() const { return real_; }
  std::size_t triangles() const;  ///< of all links

 private:
  struct Frame {
    std::vector<std::shared_ptr<const Positions>> positions;  // of the cloth, then of the links
    std::vector<Eigen::Isometry3d> poses;                     // of the links
  };
  Frame frameAt(int k) const;
  std::shared_ptr<const VoxelSurface> mapAt(int k) const;

  bool real_ = false;
  std::vector<test::TriangleShape> shapes_;
  std::vector<Body> bodies_;  // the cloth, then the links
  int next_ = -1;             // the frame that is known
  Frame known_;
  std::shared_ptr<const VoxelSurface> map_;
};

}  // namespace benchmarks
}  // namespace dccd
