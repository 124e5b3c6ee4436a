// How far two partners are apart at least while those of them that are on an intended path go along a stretch of it: by
// the clearance's search. One of the two stands still, in its own frame: what both have in common is no motion, and of
// the other one boxes are made anew for each stretch.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "dccd/intended.h"
#include "step/clearance/feature_tree.h"
#include "step/clearance/map_boxes.h"
#include "step/clearance/nearest_search.h"

namespace dccd {

class DCCD_HIDDEN PathDistances {
 public:
  /// From one time of the path to a later one, or the same [s].
  struct Stretch {
    double from_s = 0, to_s = 0;
  };
  /// How one partner goes in the frame of the other one, which may be the map.
  struct Way {
    std::uint16_t mover = 0, still = 0;
    std::vector<Eigen::Isometry3d> pose;  // still_from_mover at the path's times
    std::vector<double> arc_m;            // of each piece: how far its way leaves its chord at most
    std::vector<double> gone_m;           // by chords, at each time
    double bends = 0;                     // how many of the two are on the path
    double rounding_m = 0;
    std::optional<std::array<std::uint32_t, 2>> near;  // items that were the nearest
  };

  /// `path`: from where the outcome's step has the bodies. Both must live until the last question.
  void begin(const Outcome& outcome, const IntendedPath& path, const Deadline& deadline);
  /// At least one of the two is on the path.
  Way wayOf(const std::array<std::uint16_t, 2>& body);

  /// A lower bound of the two surfaces' distance over the stretch, less their radii and by how much the path's pieces
  /// leave the straight ways through it [m]. Within the tolerance, but for these, of what is true where that is below
  /// enough_m, unless only that matters. 0: nobody knows.
  double over(Way& way, const Stretch& stretch, double enough_m, double tolerance_m, bool only_whether = false);
  /// Where the two are nearest at a time, between them, in the fixed frame; NaN: nobody knows.
  Vec3 nearest(Way& way, double time_s);
  /// How far any vertex of the mover comes from where it is when the stretch begins, at most [m].
  double goneBy(const Way& way, const Stretch& stretch) const;
  /// What over() takes off for turns within the pieces of the stretch [m].
  double arcOf(const Way& way, const Stretch& stretch) const;
  /// By how much what is meant may leave the pieces of the stretch, both together [m]; 0 of a single time.
  double bendOf(const Way& way, const Stretch& stretch) const;
  /// Where to halve the stretch: at an end of a piece, or within the one that it is in.
  double cutOf(const Stretch& stretch) const;
  /// When the piece that holds the time, or begins at it, ends.
  double pieceEnd(double time_s) const { return path_->time_s[path_->pieceAt(time_s) + 1]; }

  std::size_t questions() const { return questions_; }

 private:
  struct Shape {
    // Of its mesh.
    SceneBody setup;
    FeatureTree moving, still;
    // Of the outcome and its path.
    bool is_known = false;
    const std::vector<Eigen::Isometry3d>* pose = nullptr;  // at the path's times; null: it stands still
    Eigen::Isometry3d own_from_fixed;                      // at the path's begin
    Positions local;                                       // by slots, in its own frame
    std::array<Vec3, 8> corners;                           // of the box around these
    double reach_m = 0, out_m = 0, radius_m = 0;
    std::vector<VertexMotion> motion, rest;  // by slots
  };

  std::size_t lastPieceOf(const Stretch& stretch) const;
  Eigen::Isometry3d poseAt(const Way& way, std::size_t piece, double time_s) const;
  Shape& known(std::uint16_t body);
  double place(const Way& way, const Stretch& stretch);

  const Outcome* outcome_ = nullptr;
  const IntendedPath* path_ = nullptr;
  Deadline deadline_;
  std::vector<Shape> shapes_;
  MapBoxes map_;
  NearestSearch search_;
  FoundDistance found_;  // by the last question
  std::size_t questions_ = 0;
};

}  // namespace dccd
