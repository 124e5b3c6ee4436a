#include "apps/analyze_bag/thinned_mesh.h"

#include <vtkCellArray.h>
#include <vtkDecimatePro.h>
#include <vtkIdTypeArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>

namespace dccd {
namespace {

/// Columns of a grid in Topology::grid's form; 0: it is none.
std::size_t gridColumns(const Topology& topology) {
  if (!topology.hasFaces()) return 0;
  const std::size_t cols = topology.faces().front()[1], vertices = topology.vertexCount();
  if (cols < 2 || vertices % cols != 0 || vertices / cols < 2) return 0;
  return Topology::grid(vertices / cols, cols) == topology ? cols : 0;
}

/// 0, n, 2n, ... and the last one.
std::vector<Index> everyNth(std::size_t count, std::size_t n) {
  std::vector<Index> kept;
  for (std::size_t i = 0; i + 1 < count; i += n) kept.push_back(static_cast<Index>(i));
  kept.push_back(static_cast<Index>(count - 1));
  return kept;
}

std::vector<Face> thinnedGrid(std::size_t rows, std::size_t cols, std::size_t n) {
  const std::vector<Index> kept_rows = everyNth(rows, n), kept_cols = everyNth(cols, n);
  std::vector<Face> faces = Topology::grid(kept_rows.size(), kept_cols.size()).faces();
  for (Face& face : faces) {
    for (Index& v : face)
      v = kept_rows[v / kept_cols.size()] * static_cast<Index>(cols) + kept_cols[v % kept_cols.size()];
  }
  return faces;
}

/// Features flatter than this may be cut off: with VTK's 15 degrees a coarse mesh keeps nearly all of its vertices.
constexpr double FEATURE_ANGLE_DEG = 60;

std::vector<Face> decimated(const Topology& topology, const Positions& positions, double share) {
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  vtkNew<vtkIdTypeArray> numbers;
  numbers->SetName("vertex");
  for (std::size_t v = 0; v < positions.size(); ++v) {
    const Vec3 at = positions[v].allFinite() ? positions[v] : Vec3::Zero().eval();
    points->InsertNextPoint(at.x(), at.y(), at.z());
    numbers->InsertNextValue(static_cast<vtkIdType>(v));
  }
  vtkNew<vtkCellArray> cells;
  for (const Face& face : topology.faces()) {
    const vtkIdType corners[] = {face[0], face[1], face[2]};
    cells->InsertNextCell(3, corners);
  }
  vtkNew<vtkPolyData> mesh;
  mesh->SetPoints(points);
  mesh->SetPolys(cells);
  mesh->GetPointData()->AddArray(numbers);
  vtkNew<vtkDecimatePro> decimate;
  decimate->SetInputData(mesh);
  decimate->SetTargetReduction(1 - share);
  decimate->PreserveTopologyOn();
  decimate->SplittingOff();
  decimate->SetFeatureAngle(FEATURE_ANGLE_DEG);
  decimate->Update();
  vtkPolyData* coarse = decimate->GetOutput();
  const auto* kept = vtkIdTypeArray::SafeDownCast(coarse->GetPointData()->GetArray("vertex"));
  std::vector<Face> faces;
  for (vtkIdType f = 0; kept && f < coarse->GetNumberOfCells(); ++f) {
    Face face{};
    for (int i = 0; i < 3; ++i) face[i] = static_cast<Index>(kept->GetValue(coarse->GetCell(f)->GetPointId(i)));
    if (face[0] != face[1] && face[1] != face[2] && face[2] != face[0]) faces.push_back(face);
  }
  return faces;
}

}  // namespace

std::shared_ptr<const Topology> thinned(const std::shared_ptr<const Topology>& topology, const Positions& positions,
                                        std::size_t every_nth) {
  if (!topology->hasFaces()) return topology;
  const std::size_t vertices = topology->vertexCount(), cols = gridColumns(*topology);
  const std::vector<Face> faces = cols > 0
                                      ? thinnedGrid(vertices / cols, cols, every_nth)
                                      : decimated(*topology, positions, 1 / static_cast<double>(every_nth * every_nth));
  return faces.empty() ? topology : std::make_shared<const Topology>(Topology::fromTriangles(vertices, faces));
}

std::shared_ptr<const Topology> ThinnedMeshes::operator()(std::size_t body,
                                                          const std::shared_ptr<const Topology>& topology,
                                                          const Positions& positions) {
  if (!thin_.at(body)) return topology;
  auto& [whole, thin] = last_[body];
  if (whole != topology) {
    whole = topology;
    thin = thinned(topology, positions, every_nth_);
  }
  return thin;
}

}  // namespace dccd
