#include "output/advice.h"

#include <cmath>
#include <limits>
#include <sstream>

#include "dccd/tolerances.h"

namespace dccd {

namespace {

// LARGEST_PLAUSIBLE_M: a mesh that a robot handles is smaller, and one in millimetres is larger, whatever it is.
// SWAPPED_GRID_RATIO: a grid read with rows and columns swapped has neighbours several times as far apart; a cloth that
// is merely crumpled or sheared does not reach this.
using tolerance::LARGEST_PLAUSIBLE_M, tolerance::SHUFFLED_RATIO, tolerance::SWAPPED_GRID_RATIO;
constexpr std::size_t SHUFFLED_POINTS = 64, SHUFFLED_SAMPLES = 1024;

double extentOf(const Positions& positions) {
  Vec3 min = Vec3::Constant(std::numeric_limits<double>::infinity()), max = -min;
  for (const Vec3& p : positions) {
    if (!p.allFinite()) continue;
    min = min.cwiseMin(p);
    max = max.cwiseMax(p);
  }
  return (max.array() >= min.array()).all() ? (max - min).maxCoeff() : 0;
}

/// Mean distance of neighbours in a row-major grid [m]; 0 when no pair of them is finite.
double meanSpacing(const Positions& positions, std::size_t rows, std::size_t cols) {
  double sum = 0;
  std::size_t count = 0;
  const auto add = [&](std::size_t a, std::size_t b) {
    const double length = (positions[b] - positions[a]).norm();
    if (!std::isfinite(length)) return;
    sum += length;
    ++count;
  };
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < cols; ++c) {
      const std::size_t i = r * cols + c;
      if (c + 1 < cols) add(i, i + 1);
      if (r + 1 < rows) add(i, i + cols);
    }
  }
  return count ? sum / static_cast<double>(count) : 0;
}

/// `what` has the positions, `mend` is to be done about them.
std::string sizeHint(const std::string& what, const Positions& positions, const std::string& mend) {
  const double extent = extentOf(positions);
  if (extent <= LARGEST_PLAUSIBLE_M) return {};
  std::ostringstream text;
  text << what << " is " << extent << " m across; coordinates are in metres, are these millimetres? Then " << mend;
  return text.str();
}

std::string swappedHint(const DecodedMesh& mesh, const MeshInputConfig& config) {
  const bool grid = config.source == TopologySource::GRID || config.source == TopologySource::AUTO;
  const std::size_t rows = config.rows, cols = config.cols;
  if (!grid || rows == cols || rows * cols != mesh.positions.size()) return {};
  const double given = meanSpacing(mesh.positions, rows, cols), swapped = meanSpacing(mesh.positions, cols, rows);
  if (!(swapped < SWAPPED_GRID_RATIO * given)) return {};
  std::ostringstream text;
  text << "topology/rows and topology/cols look swapped: neighbours are " << given << " m apart as " << rows << " x "
       << cols << ", but " << swapped << " m as " << cols << " x " << rows << "; set rows: " << cols
       << ", cols: " << rows << " (rows:=" << cols << " cols:=" << rows << " of the launch files)";
  return text.str();
}

/// Neighbours on the mesh that are as far apart as any two of its points: a tracker that lists them in another order
/// each time, or in one that the topology does not know. Points are paired by fixed strides, which no order of a mesh
/// has.
std::string shuffledHint(const DecodedMesh& mesh) {
  const std::vector<Edge>& edges = mesh.topology->edges();
  const Positions& p = mesh.positions;
  if (p.size() < SHUFFLED_POINTS || edges.empty()) return {};
  double near_m = 0, any_m = 0;
  std::size_t near = 0, any = 0;
  const auto add = [&](Index a, Index b, double& sum, std::size_t& count) {
    const double length = (p[a] - p[b]).norm();
    if (!std::isfinite(length)) return;
    sum += length;
    ++count;
  };
  for (std::size_t i = 0; i < SHUFFLED_SAMPLES; ++i) {
    const Edge& edge = edges[i * edges.size() / SHUFFLED_SAMPLES];
    add(edge[0], edge[1], near_m, near);
    add(static_cast<Index>(i * 7919 % p.size()), static_cast<Index>((i * 104729 + p.size() / 2) % p.size()), any_m,
        any);
  }
  if (near == 0 || any == 0) return {};
  near_m /= static_cast<double>(near);
  any_m /= static_cast<double>(any);
  if (!(near_m > SHUFFLED_RATIO * any_m) || !(any_m > 0)) return {};
  std::ostringstream text;
  text << "the points look shuffled: neighbours on the mesh are " << near_m << " m apart on average, any two points "
       << any_m << " m; publish them in the order of the topology, the same in each frame";
  return text.str();
}

}  // namespace

std::string adviceFor(StepStatus status, const std::string& reason, const std::string& map_source) {
  // A map or a body is missing because it cannot be placed, because it was refused, or because none came.
  if ((status == StepStatus::NO_MAP || status == StepStatus::NO_BODY) && reason.compare(0, 12, "no transform") == 0)
    status = StepStatus::NO_TRANSFORM;
  switch (status) {
    case StepStatus::NO_TRANSFORM:
      return "publish it on /tf or /tf_static for these stamps (see rosrun tf2_tools echo.py), "
             "or set fixed_frame to a frame of the same tree";
    case StepStatus::NO_MAP:
      // One that came is no matter of its rate, and may be a file.
      if (reason.find(" was refused: ") != std::string::npos)
        return "correct the map of " + map_source + ", or do without with effects/octomap: off";
      return "see rostopic hz " + map_source + ", or do without with effects/octomap: off";
    case StepStatus::NO_BODY:
      return "see rostopic hz of its topic; one that comes late needs a larger sync_timeout_s";
    case StepStatus::GAP:
      return "a slower publisher needs a larger max_step_s";
    case StepStatus::TIME_JUMP:
      return "a bag that loops does that, and the next frame makes a step again";
    case StepStatus::TELEPORT:
      return "if that motion is real raise max_vertex_step_m; coordinates are in metres";
    case StepStatus::TOPOLOGY_CHANGED:
      return "a step needs the same vertices twice: use a tracker, or give topology/file";
    case StepStatus::DUPLICATE:
      if (reason.find("/clock") != std::string::npos) return "publish /clock first (rosbag play --clock)";
      return "the publisher must stamp every frame anew";
    case StepStatus::VERTEX_COUNT:
      if (reason.compare(0, 10, "parameter ") == 0) return "the vertices are numbered from 0";
      return (reason.find("topology/rows") != std::string::npos
                  ? "correct topology/rows and topology/cols (rows:= and cols:= of the launch files), and "
              : reason.find("topology file") != std::string::npos ? "give this mesh's own as topology/file, and "
                                                                  : "") +
             std::string("publish NaN for points that were lost");
    case StepStatus::PARTIAL:
      if (reason.find("not used: QUEUE_FULL") != std::string::npos) return adviceFor(StepStatus::QUEUE_FULL, "", "");
      if (reason.find("(no transform") == std::string::npos && reason.find("NO_TRANSFORM: ") == std::string::npos) {
        return {};
      }
      return "see whether its tf comes (rosrun tf2_tools echo.py; for a robot robot_state_publisher and its joint "
             "states); "
             "one that comes late needs a larger transform_timeout_s";
    case StepStatus::DEADLINE:
      return "raise step_budget_ms or num_threads, or send fewer vertices";
    case StepStatus::TRUNCATED:
      return "raise max_contacts to see all; where the work was cut, see what lies in one place, or raise "
             "max_memory_mb";
    case StepStatus::QUEUE_FULL:
      return "raise num_threads, send fewer vertices, or leave frames out by choice with queue_policy: thin";
    default:
      return {};
  }
}

std::string meshDoubt(const DecodedMesh& mesh, const MeshInputConfig& config) {
  // With rows and columns swapped any points look shuffled: the cure is said alone.
  const std::string swapped = swappedHint(mesh, config);
  return joined(sizeHint("the mesh", mesh.positions, "scale them in the publisher"),
                swapped.empty() ? shuffledHint(mesh) : swapped);
}

std::string meshHint(const DecodedMesh& mesh) {
  std::string text;
  const auto add = [&](const std::string& hint) { text = joined(text, hint); };
  if (mesh.unread_markers > 0) {
    add(std::to_string(mesh.unread_markers) + (mesh.unread_markers == 1 ? " marker" : " markers") +
        " beside the mesh, the first of which is " + mesh.unread_marker +
        ", may be things of their own and are not read, so that nothing is proved; name what is the mesh by "
        "marker/namespace and marker/id, delete what is no more, and publish what belongs together in one MarkerArray");
  }
  add(mesh.camera_hint);
  add(mesh.row_step_hint);
  if (mesh.stamp_ns == 0) {
    add("messages carry no stamp, so that the time of receipt stands in for it, with all its jitter; set header.stamp "
        "in the publisher");
  }
  return text;
}

std::string rigidDoubt(const std::string& file, const Positions& positions, double scale) {
  std::ostringstream mend;
  mend << "set rigid/scale: " << 0.001 * scale;
  return sizeHint("rigid/mesh " + file, positions, mend.str());
}

std::string joined(const std::string& a, const std::string& b) { return a + (a.empty() || b.empty() ? "" : "; ") + b; }

}  // namespace dccd
