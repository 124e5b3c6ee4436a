// High-level culling of self-collision: normal cone and contour test over a whole body and a whole step.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "culling/scene_arrays.h"
#include "dccd/tolerances.h"

namespace dccd {

/// The plane that a surface is seen in: (u . x, w . x), for which the certificate holds with these very doubles.
struct ViewPlane {
  explicit ViewPlane(const Vec3& along) : u(along.normalized().unitOrthogonal()), w(along.normalized().cross(u)) {}
  std::array<double, 2> coordinates(const double* x) const {
    const Eigen::Map<const Vec3> p(x);
    return {u.dot(p), w.dot(p)};
  }
  /// What a coordinate is off by for points with |x| + |y| + |z| <= size: three products and two sums with components
  /// of at most 1 + 2^-50, below 4 * 2^-53 size.
  static double error(double size) { return tolerance::UNFOLDED_COORDINATE * size; }

  Vec3 u, w;
};

/// Certifies that a surface cannot touch itself during a step (Volino and Magnenat-Thalmann 1994, made continuous).
///
/// If the body is a disk and there is a direction V with n(t) . V > 0 for the normal n of every face at every t in
/// [0,1], the projection along V keeps the orientation of every face. If in addition the projected boundary never
/// meets itself, the projection is one to one at every t: a point away from the boundary's image has as many preimages
/// as the boundary winds around it, at most one, each counting +1; and two points of the surface with the same image
/// would give nearby points two preimages. So features without a common vertex never meet. doc/algorithm.md has the
/// proof with its rounding margins. A false answer says nothing.
class UnfoldedProof {
 public:
  /// Finds the boundary; the body cannot be certified unless it is a manifold disk with consistent orientation.
  explicit UnfoldedProof(const SceneBody& body);

  bool isDisk() const { return !loop_.empty(); }

  /// Whether the step is certified. The body must have no separation and no inactive vertex. Costs a look at about a
  /// thousand faces where the surface is folded, otherwise a pass over vertices and faces.
  bool run(const SceneBody& body, const VertexMotion* vertices);

 private:
  /// A vertex in the plane at both times [m].
  struct Planar {
    double x0, y0, x1, y1;
  };
  static constexpr int DIRECTIONS = 8;  ///< of the plane, 22.5 degrees apart
  /// An edge of the boundary, projected on the directions.
  struct Span {
    double low[2][DIRECTIONS], high[2][DIRECTIONS];  ///< at t=0 and t=1
    double sweep_low, sweep_high;
    std::size_t edge;  ///< from loop_[edge] to the next

    bool isApartFrom(const Span& other, double margin) const;
  };

  bool facesKeepOrientation(const SceneBody& body) const;
  bool contourIsSimple();
  bool turnsAt(const Planar& before, const Planar& at, const Planar& after) const;

  std::vector<Index> loop_;     ///< used vertices of the body along its boundary; empty: no disk
  std::vector<Planar> points_;  ///< per used vertex of the body
  std::vector<Span> spans_;
  double error_ = 0;          ///< of a projected coordinate
  double product_error_ = 0;  ///< of a cross or dot product of two differences
};

}  // namespace dccd
