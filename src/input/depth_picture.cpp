#include "input/depth_picture.h"

#include <array>
#include <cmath>
#include <limits>
#include <sstream>

#include "input/short_text.h"

namespace dccd {

namespace {

constexpr std::size_t MOST_TOLD = 32;       // characters of an encoding
constexpr std::size_t MOST_PINHOLE = 4096;  // bytes; ten times those of a CameraInfo with all distortion

template <class T>
T numberAt(const std::uint8_t* at, bool big_endian) {
  std::uint8_t bytes[sizeof(T)];
  for (std::size_t i = 0; i < sizeof(T); ++i) bytes[i] = at[big_endian ? sizeof(T) - 1 - i : i];
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

/// [m] The largest number says that there is none: drivers send it where nothing came back, or where a depth did not
/// fit.
float depthOf(std::uint16_t millimetres) {
  constexpr std::uint16_t LARGEST = std::numeric_limits<std::uint16_t>::max();
  return millimetres == LARGEST ? std::numeric_limits<float>::quiet_NaN() : 0.001f * millimetres;
}

}  // namespace

void DepthView::depthsInto(std::vector<float>& depths) const {
  depths.resize(size());
  float* out = depths.data();
  for (std::size_t row = 0; row < height; ++row) {
    const std::uint8_t* at = data + row * row_step;
    if (in_millimetres) {
      for (std::size_t i = 0; i < width; ++i) *out++ = depthOf(numberAt<std::uint16_t>(at + 2 * i, big_endian));
    } else {
      for (std::size_t i = 0; i < width; ++i) *out++ = numberAt<float>(at + 4 * i, big_endian);
    }
  }
}

DepthView readDepth(WireReader& wire) {
  DepthView view;
  view.header = readHeader(wire);
  view.height = wire.read<std::uint32_t>("height");
  view.width = wire.read<std::uint32_t>("width");
  const std::string_view encoding = wire.readString("encoding");
  if (encoding != "16UC1" && encoding != "32FC1") {
    throw WireError("encoding '" + shortText(encoding, MOST_TOLD) +
                    "' is no depth; 16UC1 (millimetres) or 32FC1 (metres) is needed");
  }
  view.in_millimetres = encoding == "16UC1";
  view.big_endian = wire.read<std::uint8_t>("is_bigendian") != 0;
  view.row_step = wire.read<std::uint32_t>("step");
  const WireSpan<std::uint8_t> data = wire.readArray<std::uint8_t>("data");
  view.data = data.data;
  const std::uint64_t row = static_cast<std::uint64_t>(view.width) * (view.in_millimetres ? 2 : 4);
  // All factors are 32 bits wide, so that products of two fit.
  const bool fits = view.height == 0 || (view.row_step >= row && row <= data.size &&
                                         (view.height - 1) * std::uint64_t{view.row_step} <= data.size - row);
  if (!fits) {
    throw WireError(std::to_string(view.height) + " x " + std::to_string(view.width) + " pixels of " +
                    std::string(encoding) + " in rows of " + std::to_string(view.row_step) +
                    " bytes do not fit into data of " + std::to_string(data.size));
  }
  return view;
}

PinholeView readPinhole(WireReader& wire) {
  PinholeView view;
  const HeaderView header = readHeader(wire);
  view.stamp_ns = header.stamp_ns;
  view.frame_id = shortText(header.frame_id);
  const std::size_t size = wire.left();
  if (size > MOST_PINHOLE) throw WireError("it has " + std::to_string(size) + " bytes, which no pinhole needs");
  view.said = view.frame_id + '\n' + std::string(wire.rest());
  view.height = wire.read<std::uint32_t>("height");
  view.width = wire.read<std::uint32_t>("width");
  wire.readString("distortion_model");
  const WireSpan<double> distortion = wire.readArray<double>("D");
  std::array<double, 9> k{};
  for (double& value : k) value = wire.read<double>("K");
  const auto tell = [&](const char* name, std::size_t i, double value, double rectified) {
    if (value == rectified || !view.unrectified.empty()) return;
    std::ostringstream text;
    text << name << '[' << i << "] is " << value;
    view.unrectified = text.str();
  };
  for (std::size_t i = 0; i < distortion.size; ++i) tell("D", i, distortion[i], 0);
  for (std::size_t i = 0; i < 9; ++i) tell("R", i, wire.read<double>("R"), i % 4 == 0 ? 1 : 0);
  std::array<double, 12> p{};
  for (double& value : p) value = wire.read<double>("P");
  for (const std::size_t i : {0u, 2u, 4u, 5u})  // without a focal length K tells nothing
    if (k[0] != 0) tell("K", i, k[i], p[i + i / 3]);
  const auto binning_x = wire.read<std::uint32_t>("binning_x"), binning_y = wire.read<std::uint32_t>("binning_y");
  const auto left = wire.read<std::uint32_t>("roi.x_offset"), top = wire.read<std::uint32_t>("roi.y_offset");
  wire.skip(2 * sizeof(std::uint32_t), "roi");
  wire.skip(1, "roi.do_rectify");
  view.fx = p[0], view.fy = p[5], view.cx = p[2], view.cy = p[6];
  std::ostringstream problem;
  const bool is_pinhole = view.fx > 0 && view.fy > 0 && std::isfinite(view.fx * view.fy * view.cx * view.cy) &&
                          p[1] == 0 && p[3] == 0 && p[4] == 0 && p[7] == 0;
  if (!is_pinhole) {
    problem << "P (" << p[0] << ' ' << p[1] << ' ' << p[2] << ' ' << p[3] << "; " << p[4] << ' ' << p[5] << ' ' << p[6]
            << ' ' << p[7] << "; ...) is no pinhole's projection";
  }
  if (is_pinhole && (binning_x > 1 || binning_y > 1 || left != 0 || top != 0)) {
    problem << "binning " << binning_x << " x " << binning_y << " and a region at (" << left << ", " << top
            << ") are not read; publish the CameraInfo of the picture as it is sent";
  }
  view.problem = problem.str();
  return view;
}

}  // namespace dccd
