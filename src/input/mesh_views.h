// What messages say about a mesh, in one of three forms (points, triangles by index, triangle soup), as views into the
// message. Which message types there are is written in message_types/ alone.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "dccd/mesh_store.h"
#include "input/wire.h"

namespace dccd {

struct HeaderView {
  StampNs stamp_ns = 0;
  std::string_view frame_id;
};

/// std_msgs/Header. Throws WireError, also for a stamp with too many nanoseconds.
HeaderView readHeader(WireReader& wire);

/// A cloud of points. Fields are located by name and datatype; strides are held against the data.
struct CloudView {
  HeaderView header;
  std::size_t height = 0, width = 0, point_step = 0, row_step = 0;
  const std::uint8_t* data = nullptr;
  bool big_endian = false;
  bool is_rope = false;                       ///< of a type whose points make a line, unless the topology is given
  std::optional<std::size_t> wrong_row_step;  ///< what the message says, where its data contradict it
  struct Coordinate {
    std::size_t offset = 0;
    bool is_double = false;
  };
  std::array<Coordinate, 3> xyz;
  std::optional<Coordinate> extra;  ///< the further field that was asked for
  /// vp_x, vp_y, vp_z, where there are all three: where the point was seen from.
  std::optional<std::array<Coordinate, 3>> viewpoint;
  std::size_t size() const { return height * width; }
  Vec3 point(std::size_t i) const { return vector(i, xyz); }
  Vec3 vector(std::size_t i, const std::array<Coordinate, 3>& fields) const {
    return {value(i, fields[0]), value(i, fields[1]), value(i, fields[2])};
  }
  /// Value of the further field; only where there is one.
  double extraValue(std::size_t i) const { return value(i, *extra); }
  double value(std::size_t i, const Coordinate& field) const;
};
/// extra_field: name of a further FLOAT32 or FLOAT64 field that the cloud must have; empty: none.
CloudView readCloud(WireReader& wire, const std::string& extra_field);

/// Looks for the fields x, y and z of a cloud, and a further one if it is named, one after the other. Throws WireError
/// for a type that is no coordinate.
class CloudFieldFinder {
 public:
  explicit CloudFieldFinder(const std::string& extra_field) : extra_field_(extra_field) {}
  void add(std::string_view name, std::size_t offset, std::uint8_t datatype, CloudView& cloud);
  /// Throws WireError naming the field that is not there, and those that are.
  void finish(CloudView& cloud) const;

 private:
  const std::string& extra_field_;
  std::array<bool, 3> found_{};
  std::array<std::optional<CloudView::Coordinate>, 3> viewpoint_;
  std::string names_;  // of the fields, as far as they are told

  std::string there() const;
};
/// Throws WireError unless the coordinates lie side by side, those of every point within `bytes` of data. Corrects a
/// row_step that contradicts data that are exactly height x width x point_step.
void checkStrides(CloudView& cloud, std::size_t bytes);

using PointOnWire = std::array<double, 3>;
using TriangleOnWire = std::array<std::uint32_t, 3>;

/// Triangles or polygons by index.
struct IndexedView {
  std::optional<HeaderView> header;
  std::optional<CloudView> cloud;                 ///< the vertices, where they come as a cloud
  WireSpan<PointOnWire> points;                   ///< otherwise
  WireSpan<TriangleOnWire> triangles;             ///< triangles,
  std::vector<WireSpan<std::uint32_t>> polygons;  ///< or polygons
  std::size_t size() const { return cloud ? cloud->size() : points.size; }
};

/// One marker, of whatever type; a triangle list is a soup, lines are ropes.
struct MarkerView {
  HeaderView header;
  std::string_view ns;
  std::int32_t id = 0, type = 0, action = 0;
  bool is_message = false;       ///< of its own; else it came in an array, which is one
  std::array<double, 7> pose{};  ///< position x y z, quaternion x y z w
  std::array<double, 3> scale{};
  StampNs lifetime_ns = 0;  ///< how long it is shown; 0: until it is deleted
  WireSpan<PointOnWire> points;
};
constexpr std::int32_t MARKER_ARROW = 0, MARKER_LINE_STRIP = 4, MARKER_LINE_LIST = 5, MARKER_CUBE_LIST = 6,
                       MARKER_SPHERE_LIST = 7, MARKER_POINTS = 8, MARKER_TEXT = 9, MARKER_TRIANGLE_LIST = 11;
constexpr std::int32_t MARKER_ADD = 0, MARKER_DELETE = 2, MARKER_DELETE_ALL = 3;

using MeshView = std::variant<CloudView, IndexedView, std::vector<MarkerView>>;

}  // namespace dccd
