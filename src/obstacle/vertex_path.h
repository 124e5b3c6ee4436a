// A moving vertex against the exposed faces of one leaf: the clipped path of a point through a box, decided exactly.
#pragma once

#include "obstacle/axis_predicates.h"
#include "obstacle/voxel_exposure.h"
#include "obstacle/voxel_surface_impl.h"

namespace dccd {

struct FaceHit {
  bool hit = false;
  bool outward = false;  ///< the vertex was inside the leaf before and leaves through the face
  CrossingTime time;
};

/// The first time in [0,1] at which a vertex on the way from p0 to p1 touches an exposed face (bits of `faces`) of the
/// leaf. p0 must lie outside the closed box, both points be finite.
FaceHit firstFaceHit(const double* p0, const double* p1, const LeafBox& box, FeatureMask faces);

}  // namespace dccd
