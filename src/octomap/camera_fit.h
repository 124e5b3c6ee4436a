// Is an organised cloud the picture of a pinhole camera, and of which?
#pragma once

#include <optional>

#include <Eigen/Core>

#include "base/cloud_map.h"

namespace dccd {

struct FittedCamera {
  Pinhole lens;
  Eigen::Matrix3d camera_from_sensor;  ///< the cloud's frame may have its axes elsewhere; its origin is the camera's
  double off_px = 0;                   ///< so far at most is a point from its pixel
};

/// The camera in whose pictures each point of the view's rows lies within half a pixel of its own pixel; nothing where
/// there is none, and where there are too few points to tell. Points nearer than that and those that are not finite do
/// not count.
std::optional<FittedCamera> fitCamera(const SensorView& view, double nearest_m);

}  // namespace dccd
