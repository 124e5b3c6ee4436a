// Mesh.
#include <algorithm>

#include "module.h"

namespace dccd {
namespace python {

namespace {

template <class T>
py::array indicesOf(const TopologyPtr& mesh, const std::vector<T>& rows) {
  return sharedArray(std::shared_ptr<const std::vector<T>>(mesh, &rows), py::dtype::of<Index>(),
                     {static_cast<py::ssize_t>(rows.size()), static_cast<py::ssize_t>(T().size())});
}

const char* const MESH_DOC = R"(The connectivity of a body: triangles, or the edges of ropes.

Mesh(vertex_count, triangles=None, *, edges=None)

Parameters
----------
vertex_count : int
    How many vertices there are. Those of no triangle and no edge are never in contact.
triangles : (m, 3) integers
    Vertex indices from 0. A triangle given twice is kept once.
edges : (m, 2) integers, in place of triangles
    Vertex indices from 0. An edge given twice is kept once.

Raises
------
ValueError
    An index is out of range, or a triangle or an edge repeats a vertex.

A mesh never changes. Make it once where the same triangles are used in many steps: finding the edges of 100,000
triangles takes longer than a step does.)";

}  // namespace

TopologyPtr meshOf(std::size_t vertex_count, py::handle triangles, py::handle edges) {
  if (triangles.is_none() == edges.is_none()) throw py::type_error("expected either triangles or edges");
  const std::int64_t most = static_cast<std::int64_t>(std::min<std::size_t>(vertex_count, NO_INDEX)) - 1;
  const auto rowsOf = [most](py::handle value, const char* name, auto row) {
    const Integers array = integersOf(value, name, {ANY, static_cast<py::ssize_t>(row.size())}, most);
    std::vector<decltype(row)> rows(static_cast<std::size_t>(array.size()) / row.size());
    const std::int64_t* at = array.data();
    for (auto& indices : rows) {
      for (Index& index : indices) index = static_cast<Index>(*at++);
    }
    return rows;
  };
  return share(triangles.is_none() ? Topology::fromEdges(vertex_count, rowsOf(edges, "edges", Edge()))
                                   : Topology::fromTriangles(vertex_count, rowsOf(triangles, "triangles", Face())));
}

std::string textOf(const Topology& mesh) {
  return std::to_string(mesh.vertexCount()) + " vertices, " + std::to_string(mesh.faces().size()) + " triangles, " +
         std::to_string(mesh.edges().size()) + " edges";
}

void bindMesh(py::module_& m) {
  bindClass<Topology, std::shared_ptr<Topology>>(m, "Mesh", MESH_DOC)
      .def(py::init([](std::size_t vertex_count, py::object triangles, py::object edges) {
             return std::const_pointer_cast<Topology>(meshOf(vertex_count, triangles, edges));
           }),
           py::arg("vertex_count"), py::arg("triangles") = py::none(), py::kw_only(), py::arg("edges") = py::none(),
           "__init__(self, vertex_count, triangles=None, *, edges=None)\n--\n\nSee help(dccd.Mesh).")
      .def_static(
          "grid", [](std::size_t rows, std::size_t cols) { return Topology::grid(rows, cols); }, py::arg("rows"),
          py::arg("cols"), "grid(rows, cols)\n--\n\nA sheet of rows x cols vertices, row by row, two triangles a cell.")
      .def_static(
          "polyline", [](std::size_t vertex_count) { return Topology::polyline(vertex_count); },
          py::arg("vertex_count"), "polyline(vertex_count)\n--\n\nA rope: an edge between each vertex and the next.")
      .def_property_readonly("vertex_count", &Topology::vertexCount, "int: how many vertices there are")
      .def_property_readonly(
          "triangles", [](const std::shared_ptr<Topology>& mesh) { return indicesOf(mesh, mesh->faces()); },
          "(m, 3) uint32, read-only")
      .def_property_readonly(
          "edges", [](const std::shared_ptr<Topology>& mesh) { return indicesOf(mesh, mesh->edges()); },
          "(m, 2) uint32, read-only: each edge once, of the triangles too")
      .def_property_readonly("is_closed", &Topology::isClosed, "bool: a surface without a border, which has an inside")
      .def("__repr__", [](const Topology& mesh) { return "<dccd.Mesh: " + textOf(mesh) + ">"; });
}

}  // namespace python
}  // namespace dccd
