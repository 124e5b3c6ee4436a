#include "input/mesh_views.h"

#include <algorithm>
#include <utility>

namespace dccd {

HeaderView readHeader(WireReader& wire) {
  wire.skip(4, "header.seq");
  const auto seconds = wire.read<std::uint32_t>("header.stamp");
  const auto nanoseconds = wire.read<std::uint32_t>("header.stamp");
  if (nanoseconds >= 1000000000u) throw WireError("header.stamp has " + std::to_string(nanoseconds) + " nanoseconds");
  HeaderView header;
  header.stamp_ns = static_cast<StampNs>(seconds) * 1000000000 + nanoseconds;
  header.frame_id = wire.readString("header.frame_id");
  return header;
}

namespace {

constexpr std::uint8_t FLOAT32 = 7, FLOAT64 = 8;  // sensor_msgs/PointField
constexpr std::size_t MOST_TOLD = 64;             // characters of a cloud's fields

/// Bytes of a FLOAT32 or FLOAT64.
std::size_t sizeOf(const CloudView::Coordinate& coordinate) { return coordinate.is_double ? 8 : 4; }

template <typename T>
double numberAt(const std::uint8_t* at, bool big_endian) {
  std::uint8_t bytes[sizeof(T)];
  std::memcpy(bytes, at, sizeof(T));
  if (big_endian) std::reverse(bytes, bytes + sizeof(T));
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return static_cast<double>(value);
}

CloudView::Coordinate fieldOf(std::string_view name, std::size_t offset, std::uint8_t datatype) {
  if (datatype != FLOAT32 && datatype != FLOAT64) {
    throw WireError("field '" + std::string(name.substr(0, 32)) + "' has datatype " + std::to_string(datatype) +
                    "; FLOAT32 (7) or FLOAT64 (8) is needed");
  }
  return {offset, datatype == FLOAT64};
}

}  // namespace

void CloudFieldFinder::add(std::string_view name, std::size_t offset, std::uint8_t datatype, CloudView& cloud) {
  if (names_.size() < MOST_TOLD) names_.append(names_.empty() ? "" : ", ").append(name.substr(0, MOST_TOLD));
  if (!extra_field_.empty() && name == extra_field_) {
    if (cloud.extra) throw WireError("there are two fields '" + extra_field_ + "'");
    cloud.extra = fieldOf(name, offset, datatype);
  }
  const bool is_real = datatype == FLOAT32 || datatype == FLOAT64;
  if (is_real && name.size() == 4 && name.substr(0, 3) == "vp_" && name[3] >= 'x' && name[3] <= 'z') {
    viewpoint_[static_cast<std::size_t>(name[3] - 'x')] = fieldOf(name, offset, datatype);
  }
  if (name.size() != 1 || name[0] < 'x' || name[0] > 'z') return;
  const auto axis = static_cast<std::size_t>(name[0] - 'x');
  if (found_[axis]) throw WireError("there are two fields '" + std::string(name) + "'");
  cloud.xyz[axis] = fieldOf(name, offset, datatype);
  found_[axis] = true;
}

void CloudFieldFinder::finish(CloudView& cloud) const {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!found_[axis])
      throw WireError(std::string("there is no field '") + static_cast<char>('x' + axis) + "'" + there());
  }
  if (!extra_field_.empty() && !cloud.extra) {
    throw WireError("there is no field '" + extra_field_ + "', which parameter uncertainty/field names" + there());
  }
  const auto& [x, y, z] = viewpoint_;
  if (x && y && z) cloud.viewpoint = {*x, *y, *z};
}

std::string CloudFieldFinder::there() const { return names_.empty() ? "; there are none" : "; there are: " + names_; }

void checkStrides(CloudView& cloud, std::size_t bytes) {
  std::vector<CloudView::Coordinate> all(cloud.xyz.begin(), cloud.xyz.end());
  if (cloud.extra) all.push_back(*cloud.extra);
  if (cloud.viewpoint) all.insert(all.end(), cloud.viewpoint->begin(), cloud.viewpoint->end());
  for (const CloudView::Coordinate& coordinate : all) {
    if (coordinate.offset + sizeOf(coordinate) > cloud.point_step) {
      throw WireError("a coordinate's offset " + std::to_string(coordinate.offset) + " reaches past point_step " +
                      std::to_string(cloud.point_step));
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const CloudView::Coordinate &one = cloud.xyz[axis], &other = cloud.xyz[(axis + 1) % 3];
    if (one.offset < other.offset + sizeOf(other) && other.offset < one.offset + sizeOf(one)) {
      throw WireError(std::string("fields '") + "xyz"[axis] + "' and '" + "xyz"[(axis + 1) % 3] + "' have offsets " +
                      std::to_string(one.offset) + " and " + std::to_string(other.offset) + ", so that they overlap");
    }
  }
  if (cloud.size() == 0) return;
  // All factors are 32 bits wide, so that products of two fit; a single row need not state its stride.
  const std::uint64_t row = static_cast<std::uint64_t>(cloud.width) * cloud.point_step;
  const std::uint64_t stride = std::max<std::uint64_t>(cloud.row_step, 1);
  const bool fits = row <= bytes && cloud.height - 1 <= (bytes - row) / stride;
  if (cloud.height == 1 ? row <= bytes : fits && cloud.row_step >= row) return;
  if (cloud.height > 1 && bytes % row == 0 && bytes / row == cloud.height) {
    cloud.wrong_row_step = std::exchange(cloud.row_step, row);
    return;
  }
  throw WireError((cloud.height == 1 || cloud.row_step == row
                       ? ""
                       : "row_step " + std::to_string(cloud.row_step) + " is not width x point_step " +
                             std::to_string(row) + ", and ") +
                  std::to_string(cloud.height) + " x " + std::to_string(cloud.width) + " points of " +
                  std::to_string(cloud.point_step) + " bytes do not fit into data of " + std::to_string(bytes));
}

double CloudView::value(std::size_t i, const Coordinate& field) const {
  const std::uint8_t* at = data + (i / width) * (height > 1 ? row_step : 0) + (i % width) * point_step + field.offset;
  return field.is_double ? numberAt<double>(at, big_endian) : numberAt<float>(at, big_endian);
}

CloudView readCloud(WireReader& wire, const std::string& extra_field) {
  CloudView cloud;
  cloud.header = readHeader(wire);
  cloud.height = wire.read<std::uint32_t>("height");
  cloud.width = wire.read<std::uint32_t>("width");
  CloudFieldFinder finder(extra_field);
  const std::size_t count = wire.readCount("fields", 4 + 4 + 1 + 4);
  for (std::size_t i = 0; i < count; ++i) {
    const std::string_view name = wire.readString("fields.name");
    const std::size_t offset = wire.read<std::uint32_t>("fields.offset");
    const auto datatype = wire.read<std::uint8_t>("fields.datatype");
    wire.skip(4, "fields.count");
    finder.add(name, offset, datatype, cloud);
  }
  finder.finish(cloud);
  cloud.big_endian = wire.read<std::uint8_t>("is_bigendian") != 0;
  cloud.point_step = wire.read<std::uint32_t>("point_step");
  cloud.row_step = wire.read<std::uint32_t>("row_step");
  const WireSpan<std::uint8_t> data = wire.readArray<std::uint8_t>("data");
  wire.skip(1, "is_dense");
  cloud.data = data.data;
  checkStrides(cloud, data.size);
  return cloud;
}

}  // namespace dccd
