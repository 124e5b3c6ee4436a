// One body's messages, as bytes of any accepted type, to positions and topology in the message's own frame.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "dccd/mesh_store.h"
#include "input/census.h"
#include "input/depth_surface.h"
#include "input/marker_names.h"
#include "input/marker_ropes.h"
#include "input/message_type.h"
#include "input/polygons.h"
#include "input/soup_weld.h"

namespace dccd {

constexpr double MAX_NOISE_M = 1e9;  ///< of a vertex' uncertainty radius

enum class TopologySource : std::uint8_t { AUTO, MESSAGE, GRID, POLYLINE, FILE, FIRST_FRAME_WELD, DEPTH_IMAGE };

/// How a body's messages are to be read.
struct MeshInputConfig {
  std::string type = "auto";  ///< auto, or one of meshTypes()' short names
  std::string frame_id;       ///< used when the message has none; required for types without a header
  TopologySource source = TopologySource::AUTO;
  std::size_t rows = 0, cols = 0;  ///< grid; both 0: not given
  std::shared_ptr<const Topology> file_topology;
  std::uint64_t file_dropped_faces = 0;  ///< of the file that cannot be used
  DepthSurfaceOptions depth;             ///< of a depth image
  bool weld = true;                      ///< triangle soup: corners with equal coordinates are one vertex
  std::optional<std::string> marker_namespace;
  std::optional<int> marker_id;
  std::size_t max_vertices = 1000000;
  std::size_t max_faces = std::numeric_limits<std::size_t>::max();
  /// Uncertainty radius of each vertex [m]: noise_radius_m + the value of the point field, where one is named.
  std::string noise_field;
  double noise_radius_m = 0;
  bool is_static = false;  ///< its newest frame holds at all times
};

/// Why a message is refused; BAD_MESSAGE or VERTEX_COUNT. The text names the field and the value.
struct MeshError : std::runtime_error {
  MeshError(StepStatus why, const std::string& text) : std::runtime_error(text), status(why) {}
  StepStatus status;
};

[[noreturn]] inline void refuseMessage(const std::string& text) { throw MeshError(StepStatus::BAD_MESSAGE, text); }

/// A message of markers that are none of the mesh, by their names or because they only take others away: no frame, and
/// none is missing.
struct PassedOver : MeshError {
  PassedOver(const std::string& text, bool has_things)
      : MeshError(StepStatus::BAD_MESSAGE, text), may_be_things(has_things) {}
  bool may_be_things;  ///< some of them, other than arrows and texts
};

/// A frame in the coordinates of the message's own frame; stamp_ns is 0 where the message has none.
struct DecodedMesh : MeshFrame {
  std::string frame_id;
  Census census;                   ///< of what the message carries; what of it is unchecked is in dropped_faces
  std::size_t weld_changes = 0;    ///< welded vertices whose corners came apart
  bool is_joined_anew = false;     ///< of other markers, or of another number of corners, than the mesh before
  std::size_t unread_markers = 0;  ///< that are shown beside those that were taken, and not drawn of these
  std::string unread_marker;       ///< the first of them: its name, and what it is
  bool has_others = false;         ///< beside it came what may be things, by names that are not the wanted ones
  std::size_t no_measurement = 0;  ///< pixels of a depth image that are none
  std::string camera_hint;    ///< that it looks like a depth camera's picture, taken for a grid; empty: it does not
  std::string row_step_hint;  ///< what a cloud says that its data contradict; empty: nothing
};

/// Keeps the topology from message to message, so that an unchanged one is one object. Not thread-safe.
class MeshDecoder {
 public:
  explicit MeshDecoder(MeshInputConfig config);

  /// `datatype` as in the connection header, package/Name. `object`: in place of bytes, of a message that was never
  /// serialised. Throws MeshError, of a message that is to be passed over PassedOver; after one the decoder is as
  /// before, but for names of markers that contradict each other.
  DecodedMesh decode(const std::string& datatype, WireSpan<std::uint8_t> bytes, const TypedMesh& object = {});
  /// The next triangle soup is welded as a first one, and so are the ends of lines; markers may have other names.
  void forgetWeld() {
    forgetJoints();
    names_.forget();
    shown_.forget();
  }

 private:
  MeshInputConfig config_;
  /// Of the last triangles that were read. A message may be refused for something else after that: those that follow
  /// without triangles mean these.
  struct Known {
    std::shared_ptr<const Topology> topology;
    Polygons sent;       // as they came,
    PolygonFaces faces;  // and what they became then: of that the topology is made
  };
  Known known_;
  SoupWeld weld_;                      // of a triangle soup's corners, or of the ends of lines
  std::vector<RopeName> known_ropes_;  // of the last markers that were read
  MarkerNames names_;
  ShownMarkers shown_;

  bool hasJoints() const { return !known_ropes_.empty() || !weld_.vertexOfCorner().empty(); }
  void forgetJoints() {
    weld_.forget();
    known_ropes_.clear();
  }

  DecodedMesh decodeView(const CloudView& cloud);
  DecodedMesh decodeView(const IndexedView& mesh);
  DecodedMesh decodeView(const std::vector<MarkerView>& markers);
  DecodedMesh decodeDepthImage(const CloudView& cloud) const;
  DecodedMesh decodeSoup(const MarkerView& marker);
  DecodedMesh decodeRopes(std::vector<const MarkerView*> markers);  // in marker_ropes.cpp
  bool isRope(const CloudView& cloud) const;
  bool hasFixedTopology() const;
  /// Whether the marker is of a type that becomes a mesh here, and has the wanted name.
  bool isWanted(const MarkerView& marker) const;
  bool isReadable(const MarkerView& marker) const;
  /// Names and counts the markers that may be things of their own.
  void tellUnread(const std::vector<MarkerView>& markers, const std::vector<const MarkerView*>& taken,
                  DecodedMesh& mesh);
  /// Nothing of the message is the mesh, and the mesh is elsewhere: by the names of its markers.
  bool passesOver(const std::vector<MarkerView>& markers) const;
  void checkFaces(std::size_t count) const;
  void checkCount(std::size_t count) const;
  void start(const HeaderView& header, DecodedMesh& mesh) const;
  /// `pixel` has the number in the cloud of each vertex; null: they are the same.
  void addRadii(const CloudView* cloud, DecodedMesh& mesh, const std::vector<std::uint32_t>* pixel = nullptr) const;
  /// The topology that the configuration says.
  void takeFixed(std::size_t points, std::size_t grid_rows, std::size_t grid_cols, DecodedMesh& mesh);
  void takeLines(const std::vector<Edge>& edges, DecodedMesh& mesh);
  /// Ropes of so many points each, one after the other.
  void takePolylines(std::size_t length, DecodedMesh& mesh);
  /// Faces that a message brings, over mesh.positions.
  void takeFaces(Polygons sent, DecodedMesh& mesh);
};

}  // namespace dccd
