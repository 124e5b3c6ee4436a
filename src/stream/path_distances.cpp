#include "stream/path_distances.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "dccd/mesh_store.h"
#include "step/parts.h"
#include "stream/body_trees.h"
#include "stream/radii.h"

namespace dccd {
namespace {

constexpr double LARGEST_M = 1e100;  // [m] guard: squares stay finite
constexpr double ABOVE = 1 + 1e-12;  // [1] more than a few roundings take

double largestOf(const Vec3& v) { return v.cwiseAbs().maxCoeff(); }

/// A frame along which the points are spread: boxes are thin there around a sheet that lies across all axes.
Eigen::Isometry3d ownFrameOf(const Positions& positions) {
  Vec3 sum = Vec3::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (const Vec3& p : positions) {
    sum += p;
    squares += p * p.transpose();
  }
  const double count = static_cast<double>(positions.size());
  const Eigen::Matrix3d spread = squares - sum * sum.transpose() / count;
  Eigen::Isometry3d own_from_fixed = Eigen::Isometry3d::Identity();
  if (!spread.allFinite()) return own_from_fixed;
  Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors();
  constexpr double ALONG = 1 - 1e-5;  // [1] of the thinnest direction: its own frame would spare nothing
  if (axes.col(0).cwiseAbs().maxCoeff() > ALONG) return own_from_fixed;
  axes.col(0) = axes.col(1).cross(axes.col(2));
  own_from_fixed.linear() = Eigen::Quaterniond(axes).normalized().toRotationMatrix().transpose();
  return own_from_fixed;
}

}  // namespace

void PathDistances::begin(const Outcome& outcome, const IntendedPath& path, const Deadline& deadline) {
  outcome_ = &outcome;
  path_ = &path;
  deadline_ = deadline;
  questions_ = 0;
  shapes_.resize(outcome.step->bodies.size());
  for (Shape& shape : shapes_) shape.is_known = false;
  if (outcome.measured) map_.set(outcome.measured);
}

std::size_t PathDistances::lastPieceOf(const Stretch& stretch) const {
  std::size_t last = path_->pieceAt(stretch.from_s);
  while (path_->time_s[last + 1] < stretch.to_s) ++last;
  return last;
}

double PathDistances::cutOf(const Stretch& stretch) const {
  const std::size_t first = path_->pieceAt(stretch.from_s), last = lastPieceOf(stretch);
  return last > first ? path_->time_s[first + (last - first + 1) / 2]
                      : stretch.from_s + (stretch.to_s - stretch.from_s) / 2;
}

/// What holds of the mesh is learnt once, what holds of the path with each outcome.
PathDistances::Shape& PathDistances::known(std::uint16_t number) {
  Shape& one = shapes_[number];
  if (one.is_known) return one;
  const Body& body = outcome_->step->bodies[number];
  if (takesMesh(body, one.setup)) {
    one.moving.build(one.setup, *body.t1);
    one.still = one.moving;
  }
  one.is_known = true;
  const IntendedPath::Of* const of = path_->find(number);
  one.pose = of ? &of->pose : nullptr;
  one.own_from_fixed = of ? outcome_->step->bodies[of->frameOf()].pose_t1.inverse() : ownFrameOf(*body.t1);
  Eigen::AlignedBox3d box(Vec3::Zero());
  box.setEmpty();
  one.local.clear();
  one.rest.clear();
  one.reach_m = one.out_m = 0;
  for (const Index v : one.setup.slot_vertex) {
    const bool is_asked = one.setup.asked.empty() || one.setup.asked[v];
    const Vec3 p = is_asked ? Vec3(one.own_from_fixed * (*body.t1)[v]) : Vec3(Vec3::Zero());
    one.local.push_back(p);
    one.rest.push_back(atRestAt(p));
    if (is_asked) box.extend(p);
    one.reach_m = std::max(one.reach_m, p.norm());
  }
  one.corners = cornersOf(box);
  for (std::size_t k = 0; one.pose && k < one.pose->size(); ++k)
    one.out_m = std::max(one.out_m, largestOf((*one.pose)[k].translation()));
  one.radius_m = largestRadius(body);
  one.still.refit(one.rest.data());
  return one;
}

Eigen::Isometry3d PathDistances::poseAt(const Way& way, std::size_t piece, double time_s) const {
  const double share = path_->shareAt(piece, time_s);
  const auto at = [&](const Shape& shape) {
    return interpolate((*shape.pose)[piece], (*shape.pose)[piece + 1], share);
  };
  const Eigen::Isometry3d mover = at(shapes_[way.mover]);
  if (way.still == OBSTACLE_BODY) return outcome_->step->map.fromFixedAt(1) * mover;
  const Shape& still = shapes_[way.still];
  return (still.pose ? at(still).inverse() : still.own_from_fixed) * mover;
}

/// In a frame that turns evenly by w, and whose origin goes straight, a vertex that is x from that origin and has the
/// velocity v against it goes by its own acceleration - 2 w v + w w x, all per piece. Its own is angle^2 r. A way whose
/// second derivative is at most K along any direction leaves its chord by no more than K / 8.
PathDistances::Way PathDistances::wayOf(const std::array<std::uint16_t, 2>& body) {
  Way way;
  way.mover = body[0];
  way.still = body[1];
  const bool with_map = way.still == OBSTACLE_BODY;
  if (!with_map) {
    const Shape &first = known(way.mover), &second = known(way.still);
    if (!first.pose || (second.pose && second.reach_m < first.reach_m)) std::swap(way.mover, way.still);
  }
  const Shape& mover = known(way.mover);
  const Shape* const still = with_map ? nullptr : &known(way.still);
  const bool both = still && still->pose;
  way.bends = both ? 2 : 1;
  const double out_m = mover.reach_m + mover.out_m + (still ? still->reach_m + still->out_m : 0) +
                       (with_map ? largestOf(outcome_->step->map.fromFixedAt(1).translation()) : 0);
  way.rounding_m = out_m < LARGEST_M ? tolerance::CLEARANCE * out_m : SpeedBound::NONE;
  way.gone_m.push_back(0);
  way.pose.push_back(poseAt(way, 0, 0));
  for (std::size_t k = 0; k < path_->bend_m.size(); ++k) {
    way.pose.push_back(poseAt(way, k, path_->time_s[k + 1]));
    const auto from = [&](const Shape& shape) -> const Eigen::Isometry3d& { return (*shape.pose)[k]; };
    const auto to = [&](const Shape& shape) -> const Eigen::Isometry3d& { return (*shape.pose)[k + 1]; };
    const double turn = rotationAngle(from(mover), to(mover));
    double bends = turn * turn * mover.reach_m;
    if (both) {
      const double frame = rotationAngle(from(*still), to(*still));
      const Vec3 begin = from(mover).translation() - from(*still).translation(),
                 end = to(mover).translation() - to(*still).translation();
      bends += 2 * frame * ((end - begin).norm() + turn * mover.reach_m) +
               frame * frame * (std::max(begin.norm(), end.norm()) + mover.reach_m);
    }
    way.arc_m.push_back(bends / 8);
    double chord_m = 0;
    for (const Vec3& corner : mover.corners)
      chord_m = std::max(chord_m, (way.pose[k + 1] * corner - way.pose[k] * corner).norm());
    way.gone_m.push_back(way.gone_m.back() + chord_m);
  }
  return way;
}

double PathDistances::bendOf(const Way& way, const Stretch& stretch) const {
  if (!(stretch.from_s < stretch.to_s)) return 0;
  double most_m = 0;
  for (std::size_t k = path_->pieceAt(stretch.from_s), last = lastPieceOf(stretch); k <= last; ++k)
    most_m = std::max(most_m, path_->bend_m[k]);
  return way.bends * most_m;
}

double PathDistances::arcOf(const Way& way, const Stretch& stretch) const {
  double most_m = 0;
  for (std::size_t k = path_->pieceAt(stretch.from_s), last = lastPieceOf(stretch); k <= last; ++k) {
    const double share = path_->shareAt(k, stretch.to_s) - path_->shareAt(k, stretch.from_s);
    most_m = std::max(most_m, way.arc_m[k] * share * share);
  }
  return most_m * ABOVE + way.rounding_m;
}

/// Where a piece is gone in part only, the mover is off its chord.
double PathDistances::goneBy(const Way& way, const Stretch& stretch) const {
  const std::size_t first = path_->pieceAt(stretch.from_s), last = lastPieceOf(stretch);
  double arc_m = 0;
  for (std::size_t k = first; k <= last; ++k) arc_m = std::max(arc_m, way.arc_m[k]);
  const double parts = stretch.from_s > path_->time_s[first] ? 2 : 1;
  return (way.gone_m[last + 1] - way.gone_m[first] + parts * arc_m + 2 * way.rounding_m) * ABOVE;
}

/// Between two ends of pieces the way leaves its own chord by the arc, and that chord leaves the stretch's by no more
/// than its two ends do: a place is affine in the vertex, so of all vertices a corner of their box leaves it most.
/// Returns by how much [m].
double PathDistances::place(const Way& way, const Stretch& stretch) {
  Shape& mover = shapes_[way.mover];
  const std::size_t first = path_->pieceAt(stretch.from_s), last = lastPieceOf(stretch);
  const Eigen::Isometry3d from = poseAt(way, first, stretch.from_s), to = poseAt(way, last, stretch.to_s);
  double off_m = 0;
  for (std::size_t k = first + 1; k <= last; ++k) {
    const double u = (path_->time_s[k] - stretch.from_s) / (stretch.to_s - stretch.from_s);
    for (const Vec3& c : mover.corners)
      off_m = std::max(off_m, (way.pose[k] * c - ((1 - u) * (from * c) + u * (to * c))).norm());
  }
  mover.motion.resize(mover.local.size());
  for (std::size_t i = 0; i < mover.local.size(); ++i) {
    const Vec3 p = from * mover.local[i], q = to * mover.local[i];
    mover.motion[i] = {{p[0], p[1], p[2], 0}, {q[0], q[1], q[2], 0}};
  }
  mover.moving.refit(mover.motion.data());
  return off_m * ABOVE + arcOf(way, stretch);
}

double PathDistances::over(Way& way, const Stretch& stretch, double enough_m, double tolerance_m, bool only_whether) {
  const bool with_map = way.still == OBSTACLE_BODY;
  found_ = {};
  if (with_map && outcome_->measured && outcome_->measured->leafCount() == 0) return SpeedBound::NONE;
  const FeatureTree& tree = shapes_[way.mover].moving;
  const bool known = with_map ? outcome_->measured != nullptr : !shapes_[way.still].still.empty();
  if (!known || tree.empty() || !std::isfinite(way.rounding_m)) return 0;
  ++questions_;
  const double taken_m =
      place(way, stretch) + shapes_[way.mover].radius_m + (with_map ? 0 : shapes_[way.still].radius_m);
  NearestSearch::Goal goal{tolerance_m, (enough_m + taken_m) * ABOVE, false, deadline_};
  if (way.near) goal.near = &*way.near;
  if (only_whether) goal.gives_up_m = enough_m + taken_m;
  const auto never = [](std::uint32_t, std::uint32_t) { return true; };  // is asked of what is at the end alone
  const NearestSearch::AllPairs all;
  found_ = with_map ? search_.run(tree, map_, all, goal, {}, never)
                    : search_.run(tree, shapes_[way.still].still, all, goal, {}, never);
  if (std::isfinite(found_.upper_m)) way.near = found_.item;
  const double rest_m = found_.lower_m - taken_m - (ABOVE - 1) * found_.lower_m;
  return rest_m > 0 ? rest_m : 0;
}

Vec3 PathDistances::nearest(Way& way, double time_s) {
  over(way, {time_s, time_s}, LARGEST_M, 1e-6);
  if (!std::isfinite(found_.upper_m)) return Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
  const Vec3 between = (found_.point[0] + found_.point[1]) / 2;
  if (way.still == OBSTACLE_BODY) return outcome_->step->map.fromFixedAt(1).inverse() * between;
  const Shape& still = shapes_[way.still];
  if (!still.pose) return still.own_from_fixed.inverse() * between;
  const std::size_t piece = path_->pieceAt(time_s);
  return interpolate((*still.pose)[piece], (*still.pose)[piece + 1], path_->shareAt(piece, time_s)) * between;
}

}  // namespace dccd
