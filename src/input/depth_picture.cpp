#include "input/depth_picture.h"

#include <array>
#include <cmath>
#include <limits>
#include <sstream>

#include "input/short_text.h"

namespace dccd {

namespace {

constexpr std::size_t MOST_TOLD = 32;  // characters of an encoding
constexpr float NOTHING = std::numeric_limits<float>::quiet_NaN();

template <class T>
T numberAt(const std::uint8_t* at, bool big_endian) {
  std::uint8_t bytes[sizeof(T)];
  for (std::size_t i = 0; i < sizeof(T); ++i) bytes[i] = at[big_endian ? sizeof(T) - 1 - i : i];
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

}  // namespace

float DepthView::depth(std::size_t i) const {
  const std::uint8_t* at = data + (i / width) * row_step + (i % width) * (in_millimetres ? 2 : 4);
  if (in_millimetres) {
    const auto millimetres = numberAt<std::uint16_t>(at, big_endian);
    return millimetres == 0 ? NOTHING : 0.001f * millimetres;
  }
  const auto metres = numberAt<float>(at, big_endian);
  return metres > 0 ? metres : NOTHING;
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
  readHeader(wire);
  view.height = wire.read<std::uint32_t>("height");
  view.width = wire.read<std::uint32_t>("width");
  wire.readString("distortion_model");
  const WireSpan<double> distortion = wire.readArray<double>("D");
  const auto skipMatrix = [&](const char* name) { wire.skip(9 * sizeof(double), name); };
  skipMatrix("K");
  skipMatrix("R");
  std::array<double, 12> p{};
  for (double& value : p) value = wire.read<double>("P");
  const auto binning_x = wire.read<std::uint32_t>("binning_x"), binning_y = wire.read<std::uint32_t>("binning_y");
  const auto left = wire.read<std::uint32_t>("roi.x_offset"), top = wire.read<std::uint32_t>("roi.y_offset");
  wire.skip(2 * sizeof(std::uint32_t), "roi");
  wire.skip(1, "roi.do_rectify");
  view.fx = p[0], view.fy = p[5], view.cx = p[2], view.cy = p[6];
  std::ostringstream problem;
  for (std::size_t i = 0; i < distortion.size && problem.tellp() == 0; ++i) {
    if (distortion[i] == 0) continue;
    problem << "D[" << i << "] is " << distortion[i]
            << ": pictures with distortion are not rectified; take the driver's rectified depth, or its cloud";
  }
  const bool is_pinhole = view.fx > 0 && view.fy > 0 && std::isfinite(view.fx * view.fy * view.cx * view.cy) &&
                          p[1] == 0 && p[3] == 0 && p[4] == 0 && p[7] == 0;
  if (problem.tellp() == 0 && !is_pinhole) {
    problem << "P (" << p[0] << ' ' << p[1] << ' ' << p[2] << ' ' << p[3] << "; " << p[4] << ' ' << p[5] << ' ' << p[6]
            << ' ' << p[7] << "; ...) is no pinhole's projection";
  }
  if (problem.tellp() == 0 && (binning_x > 1 || binning_y > 1 || left != 0 || top != 0)) {
    problem << "binning " << binning_x << " x " << binning_y << " and a region at (" << left << ", " << top
            << ") are not read; publish the CameraInfo of the picture as it is sent";
  }
  view.problem = problem.str();
  return view;
}

}  // namespace dccd
