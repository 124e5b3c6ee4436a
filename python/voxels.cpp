// Voxels.
#include <algorithm>
#include <cmath>

#include "module.h"

namespace dccd {
namespace python {

namespace {

/// The key of the voxel that holds the coordinate; one on a shared plane is in the upper one.
std::int64_t keyOf(double coordinate_m, double resolution_m) {
  const double guess = std::floor(coordinate_m / resolution_m) + 32768;
  if (!(guess >= -1 && guess <= 65537)) return -1;
  std::int64_t key = static_cast<std::int64_t>(guess);
  while (voxelPlane(key + 1, resolution_m) <= coordinate_m) ++key;
  while (voxelPlane(key, resolution_m) > coordinate_m) --key;
  return key <= 65535 ? key : -1;
}

std::vector<OccupiedLeaf> leavesAt(py::handle centres, double resolution_m) {
  const Doubles points = doublesOf(centres, "centres", {ANY, 3});
  std::vector<VoxelKey> keys;
  for (py::ssize_t i = 0; i < points.shape(0); ++i) {
    std::int64_t key[3];
    for (int axis = 0; axis < 3; ++axis) {
      key[axis] = keyOf(points.at(i, axis), resolution_m);
      if (key[axis] >= 0) continue;
      throw py::value_error("centres[" + std::to_string(i) + ", " + std::to_string(axis) + "] is " +
                            std::to_string(points.at(i, axis)) +
                            "; a map reaches 32768 voxels to either side of its origin");
    }
    keys.push_back(
        {static_cast<std::uint16_t>(key[0]), static_cast<std::uint16_t>(key[1]), static_cast<std::uint16_t>(key[2])});
  }
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  std::vector<OccupiedLeaf> leaves;
  for (const VoxelKey& key : keys) leaves.push_back({key, 1});
  return leaves;
}

std::vector<OccupiedLeaf> leavesOf(py::handle keys, py::handle sizes) {
  const Integers at = integersOf(keys, "keys", {ANY, 3}, 65535);
  const py::ssize_t n = at.size() / 3;
  std::vector<OccupiedLeaf> leaves(static_cast<std::size_t>(n));
  const Integers wide = sizes.is_none() ? Integers(0) : integersOf(sizes, "sizes", {n}, 65536);
  for (py::ssize_t i = 0; i < n; ++i) {
    const std::int64_t* key = at.data() + 3 * i;
    leaves[static_cast<std::size_t>(i)] = {
        {static_cast<std::uint16_t>(key[0]), static_cast<std::uint16_t>(key[1]), static_cast<std::uint16_t>(key[2])},
        sizes.is_none() ? 1 : static_cast<std::uint32_t>(wide.data()[i])};
  }
  return leaves;
}

Voxels makeVoxels(double resolution_m, py::object centres, py::object keys, py::object sizes,
                  py::object map_from_fixed) {
  if (centres.is_none() == keys.is_none()) throw py::type_error("expected either centres or keys");
  if (keys.is_none() && !sizes.is_none()) throw py::type_error("sizes go with keys");
  VoxelSurface::build(resolution_m, {});  // throws where the resolution is none
  Voxels voxels;
  voxels.surface =
      VoxelSurface::build(resolution_m, keys.is_none() ? leavesAt(centres, resolution_m) : leavesOf(keys, sizes));
  if (!map_from_fixed.is_none()) voxels.map_from_fixed = poseOf(map_from_fixed, "map_from_fixed");
  return voxels;
}

const char* const VOXELS_DOC =
    R"(The occupied voxels of a map, as an octomap has them: solid cubes on a grid through the map's origin.

Voxels(resolution_m, centres=None, *, keys=None, sizes=None, map_from_fixed=None)

Parameters
----------
resolution_m : float
    Edge length of the finest voxels [m].
centres : (m, 3) float64 [m]
    Points in the map's frame. The voxel of each is occupied; several in one voxel count once.
keys : (m, 3) integers from 0 to 65535, in place of centres
    Voxel k spans [(k - 32768) * resolution_m, (k - 32767) * resolution_m] on each axis.
sizes : (m,) integers
    Edge length of each cube in finest voxels, a power of two, where keys are the smallest of larger cubes.
map_from_fixed : (4, 4) float64
    Pose of the bodies' frame in the map's; identity if it is left out.

Raises
------
ValueError
    The resolution is not above 0, cubes overlap, or a key is not a multiple of its cube's size.

Voxels never change. Make them once where a map is used in many steps.)";

}  // namespace

ObstacleMap mapOf(py::handle voxels) {
  ObstacleMap map;
  if (voxels.is_none()) return map;
  if (!py::isinstance<Voxels>(voxels)) throw py::type_error("voxels: expected dccd.Voxels or None");
  map.surface = voxels.cast<const Voxels&>().surface;
  map.map_from_fixed = voxels.cast<const Voxels&>().map_from_fixed;
  map.way = voxels.cast<const Voxels&>().way;
  return map;
}

void bindVoxels(py::module_& m) {
  using namespace py::literals;
  bindClass<Voxels>(m, "Voxels", VOXELS_DOC)
      .def(py::init(&makeVoxels), "resolution_m"_a, "centres"_a = py::none(), py::kw_only(), "keys"_a = py::none(),
           "sizes"_a = py::none(), "map_from_fixed"_a = py::none(),
           "__init__(self, resolution_m, centres=None, *, keys=None, sizes=None, map_from_fixed=None)\n--\n\n"
           "See help(dccd.Voxels).")
      .def_property_readonly(
          "resolution_m", [](const Voxels& v) { return v.surface->resolution(); },
          "float: edge length of the finest voxels [m]")
      .def_property_readonly(
          "keys",
          [](const Voxels& v) {
            const std::vector<OccupiedLeaf>& leaves = v.surface->leaves();
            py::array_t<std::uint16_t> keys({static_cast<py::ssize_t>(leaves.size()), py::ssize_t{3}});
            std::uint16_t* at = keys.mutable_data();
            for (const OccupiedLeaf& leaf : leaves) {
              for (const std::uint16_t key : {leaf.min.x, leaf.min.y, leaf.min.z}) *at++ = key;
            }
            return keys;
          },
          "(m, 3) uint16: smallest key of each cube, in the map's own order")
      .def_property_readonly(
          "sizes",
          [](const Voxels& v) {
            const std::vector<OccupiedLeaf>& leaves = v.surface->leaves();
            py::array_t<std::uint32_t> sizes(static_cast<py::ssize_t>(leaves.size()));
            std::transform(leaves.begin(), leaves.end(), sizes.mutable_data(),
                           [](const OccupiedLeaf& leaf) { return leaf.size; });
            return sizes;
          },
          "(m,) uint32: edge length of each cube in finest voxels")
      .def_property_readonly(
          "map_from_fixed", [](const Voxels& v) { return matrixOf(v.map_from_fixed); },
          "(4, 4) float64: pose of the bodies' frame in the map's")
      .def("__repr__",
           [](const Voxels& v) { return "<dccd.Voxels: " + std::to_string(v.surface->leafCount()) + " cubes>"; });
}

}  // namespace python
}  // namespace dccd
