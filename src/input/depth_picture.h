// A depth camera's picture (sensor_msgs/Image), and the pinhole that it was taken through (sensor_msgs/CameraInfo), as
// views into their messages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "input/mesh_views.h"
#include "input/wire.h"

namespace dccd {

/// Depths along the optical axis, row by row.
struct DepthView {
  HeaderView header;
  std::size_t height = 0, width = 0, row_step = 0;
  const std::uint8_t* data = nullptr;
  bool in_millimetres = false;  ///< 16 bits, else floats [m]
  bool big_endian = false;
  std::size_t size() const { return height * width; }
  /// [m] Row by row, as they came: 0, or what is no number, is no measurement; infinity: nothing came back. The largest
  /// of 16 bits is no number.
  void depthsInto(std::vector<float>& depths) const;
};
/// Throws WireError for what is no depth, and for rows that are not there.
DepthView readDepth(WireReader& wire);

/// Where a pixel looks: through ((column - cx) / fx, (row - cy) / fy, 1) of the optical frame.
struct PinholeView {
  StampNs stamp_ns = 0;
  std::string frame_id;  ///< cut at MAX_TEXT
  std::string said;      ///< all of the message but its stamp, as it came: two are alike where it is; empty: it is none
  std::size_t height = 0, width = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::string unrectified;  ///< what tells a picture that is not rectified from one that is; empty: nothing
  std::string problem;      ///< why its pictures cannot be used; empty: they can
};
/// The projection of the rectified picture. Throws WireError for what is no CameraInfo.
PinholeView readPinhole(WireReader& wire);

}  // namespace dccd
