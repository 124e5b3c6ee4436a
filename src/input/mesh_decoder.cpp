#include "input/mesh_decoder.h"

#include <algorithm>
#include <sstream>

#include "input/marker_ropes.h"
#include "input/short_text.h"
#include "input/transforms.h"

namespace dccd {

namespace {

// A tracker has fewer points than a quarter of the smallest depth camera has pixels.
constexpr std::size_t LEAST_PICTURE = 160 * 120;

std::size_t declaredBy(const CloudView& cloud) { return cloud.size(); }
std::size_t declaredBy(const IndexedView& mesh) { return mesh.size() + mesh.triangles.size + mesh.polygons.size(); }
std::size_t declaredBy(const std::vector<MarkerView>& markers) {
  std::size_t count = 0;
  for (const MarkerView& marker : markers) count += declaredBy(marker);
  return count;
}

void requireSomething(const PolygonFaces& faces) {
  if (!faces.faces.empty()) return;
  refuseMessage("there is nothing to check: " +
                (faces.ends.empty()
                     ? "the message has no triangle"
                     : "none of its " + std::to_string(faces.ends.size()) +
                           " faces can be used; they name a vertex twice, or are no polygons with an area"));
}

std::size_t faceCount(const IndexedView& mesh) {
  std::size_t count = mesh.triangles.size;
  for (const auto& polygon : mesh.polygons) count += polygon.size > 2 ? polygon.size - 2 : polygon.size > 0;
  return count;
}

/// All that it has, as polygons.
Polygons polygonsOf(const IndexedView& mesh) {
  Polygons polygons;
  polygons.corners.reserve(3 * mesh.triangles.size);
  polygons.ends.reserve(mesh.triangles.size + mesh.polygons.size());
  const auto end = [&] { polygons.ends.push_back(polygons.corners.size()); };
  for (std::size_t i = 0; i < mesh.triangles.size; ++i) {
    const auto t = mesh.triangles[i];
    polygons.corners.insert(polygons.corners.end(), t.begin(), t.end());
    end();
  }
  for (const auto& polygon : mesh.polygons) {
    for (std::size_t k = 0; k < polygon.size; ++k) polygons.corners.push_back(polygon[k]);
    end();
  }
  return polygons;
}

void requireVertices(const Polygons& polygons, std::size_t points) {
  for (const Index v : polygons.corners) {
    if (v < points) continue;
    refuseMessage("triangle index " + std::to_string(v) + ", but there are " + std::to_string(points) + " vertices");
  }
}

/// Empty: there is nothing to say.
std::string rowStepHint(const CloudView& cloud) {
  if (!cloud.wrong_row_step) return {};
  return "row_step " + std::to_string(*cloud.wrong_row_step) + " contradicts the data, which are just " +
         std::to_string(cloud.height) + " rows of " + std::to_string(cloud.width) + " points of " +
         std::to_string(cloud.point_step) + " bytes and are read so; publish row_step " +
         std::to_string(cloud.row_step);
}

}  // namespace

MeshDecoder::MeshDecoder(MeshInputConfig config) : config_(std::move(config)), shown_(!config_.is_static) {}

DecodedMesh MeshDecoder::decode(const std::string& datatype, WireSpan<std::uint8_t> bytes, const TypedMesh& object) {
  const MeshType* type = findMeshType(datatype);
  if (!type) refuseMessage(meshTypeProblem(datatype, {}));
  if (config_.type != "auto" && config_.type != type->name) {
    refuseMessage("type " + datatype + " arrives, but parameter type asks for " + config_.type);
  }
  try {
    WireReader wire(bytes.data, bytes.size);
    wire.limitEntries(config_.max_faces);
    const MeshView view =
        object.type ? type->view(object.message.get(), config_.noise_field) : type->read(wire, config_.noise_field);
    if (wire.left() > 0 && !object.type) {
      refuseMessage(std::to_string(wire.left()) + " bytes stand after a message of type " + datatype +
                    ": it is of another one");
    }
    if (config_.source == TopologySource::DEPTH_IMAGE && !std::holds_alternative<CloudView>(view)) {
      refuseMessage("topology/source depth_image is for the points of a depth camera, and " + datatype + " arrives");
    }
    DecodedMesh mesh = std::visit([this](const auto& one) { return decodeView(one); }, view);
    mesh.census.declare(std::visit([](const auto& one) { return declaredBy(one); }, view));
    mesh.dropped_faces += mesh.census.unchecked();
    return mesh;
  } catch (const WireError& error) {
    refuseMessage(datatype + ": " + error.what());
  } catch (const TopologyError& error) {
    refuseMessage(datatype + ": " + error.what());
  }
}

void MeshDecoder::addRadii(const CloudView* cloud, DecodedMesh& mesh, const std::vector<std::uint32_t>* pixel) const {
  const bool from_field = !config_.noise_field.empty();
  if (from_field && !(cloud && cloud->extra)) {
    refuseMessage("this type has no point fields, but parameter uncertainty/field names '" + config_.noise_field +
                  "'; send a point cloud, or write uncertainty/radius_m");
  }
  if (!from_field && !(config_.noise_radius_m > 0)) return;
  mesh.radius_m.assign(mesh.positions.size(), config_.noise_radius_m);
  if (!from_field) return;
  for (std::size_t i = 0; i < mesh.radius_m.size(); ++i) {
    if (!mesh.positions[i].allFinite()) continue;  // unchecked anyway, and trackers leave everything of it open
    const std::size_t point = pixel ? (*pixel)[i] : i;
    const double value = cloud->extraValue(point);
    mesh.radius_m[i] += value;
    if (!(value >= 0) || !(mesh.radius_m[i] <= MAX_NOISE_M)) {
      std::ostringstream text;
      text << "field '" << config_.noise_field << "' of point " << point << " is " << value
           << "; an uncertainty is not negative, and at most " << MAX_NOISE_M << " m with radius_m";
      refuseMessage(text.str());
    }
  }
}

void MeshDecoder::checkCount(std::size_t count) const {
  if (count > config_.max_vertices) {
    refuseMessage(std::to_string(count) + " vertices are more than a mesh may have, " +
                  std::to_string(config_.max_vertices));
  }
  if (count == 0) refuseMessage("there are no vertices");
}

void MeshDecoder::checkFaces(std::size_t count) const {
  if (count <= config_.max_faces) return;
  refuseMessage(std::to_string(count) + " triangles are more than the " + std::to_string(config_.max_faces) +
                " for which there is room; raise max_memory_mb");
}

void MeshDecoder::start(const HeaderView& header, DecodedMesh& mesh) const {
  mesh.stamp_ns = header.stamp_ns;
  std::string_view name = header.frame_id.empty() ? std::string_view(config_.frame_id) : header.frame_id;
  if (!name.empty() && name[0] == '/') name.remove_prefix(1);  // tf2 has no leading slashes
  if (name.empty()) refuseMessage("the message names no frame; set parameter frame_id");
  mesh.frame_id = std::string(name.substr(0, MAX_NAME + 1));
  if (!frameNameProblem(mesh.frame_id).empty()) {  // too long, or one more slash
    refuseMessage("frame_id '" + shortText(name, MAX_NAME) + "' is no frame's name");
  }
}

void MeshDecoder::takeFixed(std::size_t points, std::size_t grid_rows, std::size_t grid_cols, DecodedMesh& mesh) {
  const auto mismatch = [&](const std::string& what) {
    throw MeshError(StepStatus::VERTEX_COUNT, std::to_string(points) + " points, but " + what);
  };
  if (config_.source == TopologySource::FILE) {
    if (config_.file_topology->vertexCount() != points) {
      mismatch("the topology file has " + std::to_string(config_.file_topology->vertexCount()) + " vertices");
    }
    mesh.topology = config_.file_topology;
    mesh.dropped_faces = config_.file_dropped_faces;
    return;
  }
  const std::size_t rows = config_.rows ? config_.rows : grid_rows, cols = config_.cols ? config_.cols : grid_cols;
  if (rows * cols != points) {
    mismatch("topology/rows x topology/cols is " + std::to_string(rows) + " x " + std::to_string(cols) + " = " +
             std::to_string(rows * cols));
  }
  if (grid_rows > 1 && grid_cols > 1 && rows != grid_rows) {  // else a line after the other, of whatever shape
    mismatch("in " + std::to_string(grid_rows) + " rows of " + std::to_string(grid_cols) +
             ", and topology/rows x topology/cols is " + std::to_string(rows) + " x " + std::to_string(cols));
  }
  if (rows >= 2 && cols >= 2) checkFaces(2 * (rows - 1) * (cols - 1));
  // Two corners of no polygon stand for the grid's shape.
  const Polygons shape{{static_cast<Index>(rows), static_cast<Index>(cols)}, {}};
  if (!known_.topology || !(known_.sent == shape)) {
    known_ = {std::make_shared<const Topology>(Topology::grid(rows, cols)), shape, {}};
  }
  mesh.topology = known_.topology;
}

void MeshDecoder::takeLines(const std::vector<Edge>& edges, DecodedMesh& mesh) {
  Topology topology = Topology::fromEdges(mesh.positions.size(), edges);
  if (!known_.topology || *known_.topology != topology) {
    known_ = {std::make_shared<const Topology>(std::move(topology)), {}, {}};
  }
  mesh.topology = known_.topology;
}

void MeshDecoder::takePolylines(std::size_t length, DecodedMesh& mesh) {
  if (length < 2) {
    throw MeshError(StepStatus::VERTEX_COUNT, std::to_string(length) + " points, but a polyline needs 2");
  }
  std::vector<Edge> edges;
  for (std::size_t begin = 0; begin < mesh.positions.size(); begin += length) {
    addLine(mesh.positions, begin, begin + length, edges);
  }
  if (edges.empty()) refuseMessage("there is nothing to check: all points of a line are one");
  takeLines(edges, mesh);
}

void MeshDecoder::takeFaces(Polygons sent, DecodedMesh& mesh) {
  const std::size_t points = mesh.positions.size();
  const bool fits = known_.topology && known_.topology->vertexCount() == points;
  const bool same = fits && known_.sent == sent;
  if (!same || !known_.faces.unseen.empty()) {
    requireVertices(sent, points);
    PolygonFaces faces = facesOf(sent, mesh.positions, same ? &known_.faces : nullptr);
    requireSomething(faces);
    std::shared_ptr<const Topology> topology = known_.topology;
    if (!fits || faces.faces != known_.faces.faces) {
      topology = std::make_shared<const Topology>(Topology::fromTriangles(points, faces.faces));
    }
    known_ = {std::move(topology), std::move(sent), std::move(faces)};
  }
  mesh.topology = known_.topology;
  mesh.dropped_faces = known_.faces.unchecked.size();
}

DecodedMesh MeshDecoder::decodeDepthImage(const CloudView& cloud) const {
  if (cloud.height < 2) {
    refuseMessage("topology/source depth_image needs an organised PointCloud2, and this one has " +
                  std::to_string(cloud.height) + " rows; subscribe to the camera's cloud before it is filtered");
  }
  DecodedMesh mesh;
  start(cloud.header, mesh);
  mesh.row_step_hint = rowStepHint(cloud);
  const std::size_t pixels = keptPixels(cloud, config_.depth.stride);
  checkCount(pixels);
  checkFaces(2 * pixels);
  DepthSurface surface;
  try {
    surface = depthSurface(cloud, config_.depth);
  } catch (const DepthSurfaceError& error) {
    refuseMessage(error.what());
  }
  mesh.topology = std::make_shared<const Topology>(Topology::fromTriangles(surface.positions.size(), surface.faces));
  mesh.positions = std::move(surface.positions);
  mesh.no_measurement = surface.no_measurement;
  mesh.census.account(cloud.size());  // each is a vertex, no measurement, or between those of the stride
  addRadii(&cloud, mesh, &surface.pixel);
  return mesh;
}

bool MeshDecoder::hasFixedTopology() const {
  return config_.source == TopologySource::FILE || config_.source == TopologySource::GRID || config_.rows > 0;
}

bool MeshDecoder::isRope(const CloudView& cloud) const {
  return config_.source == TopologySource::POLYLINE ||
         (config_.source == TopologySource::AUTO && cloud.is_rope && !hasFixedTopology());
}

DecodedMesh MeshDecoder::decodeView(const CloudView& cloud) {
  if (config_.source == TopologySource::DEPTH_IMAGE) return decodeDepthImage(cloud);
  DecodedMesh mesh;
  start(cloud.header, mesh);
  mesh.row_step_hint = rowStepHint(cloud);
  checkCount(cloud.size());
  const bool organised = cloud.height > 1;
  if (config_.source == TopologySource::MESSAGE || config_.source == TopologySource::FIRST_FRAME_WELD) {
    refuseMessage("a point cloud has no triangles; set topology/source to grid (with rows, cols), polyline or file");
  }
  const bool is_rope = isRope(cloud);
  if (config_.source == TopologySource::AUTO && !is_rope && !organised && !config_.rows && !config_.cols) {
    refuseMessage(
        "an unorganised point cloud has no topology; set topology/rows and topology/cols for a grid, or "
        "topology/source to polyline or file (rows:=, cols:= and topology:= of the launch files)");
  }
  if (!is_rope) takeFixed(cloud.size(), cloud.height, cloud.width, mesh);
  if (!is_rope && !hasFixedTopology() && cloud.size() >= LEAST_PICTURE) {
    mesh.camera_hint = "a cloud of " + std::to_string(cloud.width) + " x " + std::to_string(cloud.height) +
                       " points is taken for a grid, whose points are the same ones in each frame; if it is a depth "
                       "camera's, name it as obstacle_cloud, or set topology/source: depth_image and motion: static";
  }
  mesh.positions.resize(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) mesh.positions[i] = cloud.point(i);
  mesh.census.account(mesh.positions.size());
  // Of a cloud of several rows and columns, each row is a rope.
  if (is_rope) takePolylines(cloud.width > 1 ? cloud.width : cloud.size(), mesh);
  addRadii(&cloud, mesh);
  return mesh;
}

DecodedMesh MeshDecoder::decodeView(const IndexedView& view) {
  DecodedMesh mesh;
  if (view.header && view.cloud && !view.header->frame_id.empty() && !view.cloud->header.frame_id.empty() &&
      view.header->frame_id != view.cloud->header.frame_id) {
    refuseMessage("header.frame_id is '" + shortText(view.header->frame_id, MAX_NAME) +
                  "', and cloud.header.frame_id '" + shortText(view.cloud->header.frame_id, MAX_NAME) +
                  "': name one frame");
  }
  start(view.header ? *view.header : HeaderView{}, mesh);
  const std::size_t count = view.size();
  checkCount(count);
  const bool carries_faces = view.triangles.size > 0 || !view.polygons.empty();
  if (config_.source == TopologySource::FIRST_FRAME_WELD) {
    refuseMessage("topology/source first_frame_weld is for triangle lists; this message has indices");
  }
  mesh.positions.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    if (view.cloud) {
      mesh.positions[i] = view.cloud->point(i);
    } else {
      const auto p = view.points[i];
      mesh.positions[i] = Vec3(p[0], p[1], p[2]);
    }
  }
  mesh.census.account(count);
  if (config_.source == TopologySource::MESSAGE || (config_.source == TopologySource::AUTO && carries_faces)) {
    if (!carries_faces) refuseMessage("the message has no triangles; set topology/source to grid, polyline or file");
    checkFaces(faceCount(view));
    Polygons sent = polygonsOf(view);
    mesh.census.account(sent.size());
    takeFaces(std::move(sent), mesh);
  } else if (config_.source == TopologySource::AUTO && !config_.rows && !config_.cols) {
    // A publisher may send the triangles once and vertices ever after. What of them could not be used is missing as
    // long.
    if (!known_.topology) {
      refuseMessage(
          "the message has no triangles and no topology is known yet; publish them once, or set topology/rows and "
          "topology/cols for a grid, or topology/source to polyline or file");
    }
    if (known_.topology->vertexCount() != count) {
      throw MeshError(StepStatus::VERTEX_COUNT, std::to_string(count) +
                                                    " vertices without triangles, but the last topology has " +
                                                    std::to_string(known_.topology->vertexCount()));
    }
    mesh.topology = known_.topology;
    mesh.dropped_faces = known_.faces.unchecked.size();
    if (!known_.faces.unseen.empty()) takeFaces(known_.sent, mesh);
  } else {
    mesh.census.account(view.triangles.size + view.polygons.size());  // the configuration has others
    if (config_.source == TopologySource::POLYLINE) {
      takePolylines(count, mesh);
    } else {
      takeFixed(count, 0, 0, mesh);
    }
  }
  if (view.cloud) mesh.row_step_hint = rowStepHint(*view.cloud);
  addRadii(view.cloud ? &*view.cloud : nullptr, mesh);
  return mesh;
}

}  // namespace dccd
