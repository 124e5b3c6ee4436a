// start_state_peer: which faces of a mesh cross, by CGAL's self_intersections with exact predicates and by our start
// state, in turns. Both are exact, so their pairs of faces are compared before a time is written.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "dccd/detect.h"
#include "paper/known_contacts.h"
#include "support/scene_data.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;
using FacePair = std::pair<std::size_t, std::size_t>;

/// Its faces have the numbers of the mesh's.
Surface surfaceOf(const test::PlyMesh& mesh) {
  Surface surface;
  std::vector<Surface::Vertex_index> vertices;
  for (const Vec3& x : mesh.vertices) vertices.push_back(surface.add_vertex(Kernel::Point_3(x[0], x[1], x[2])));
  for (const Face& f : mesh.faces) {
    const auto added = surface.add_face(vertices[f[0]], vertices[f[1]], vertices[f[2]]);
    if (added == Surface::null_face()) throw std::runtime_error("CGAL takes no mesh that is not manifold");
  }
  return surface;
}

std::vector<FacePair> sorted(std::vector<FacePair> pairs) {
  for (FacePair& pair : pairs) {
    if (pair.first > pair.second) std::swap(pair.first, pair.second);
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

/// An edge through a face is a crossing of that face with each that has the edge.
std::vector<FacePair> facesOf(const std::vector<StartIntersection>& crossings, const std::vector<Face>& faces) {
  std::map<Edge, std::vector<std::size_t>> at_edge;
  std::map<Face, std::size_t> number;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    Face face = faces[f];
    std::sort(face.begin(), face.end());
    number[face] = f;
    for (const Edge& edge : {Edge{face[0], face[1]}, Edge{face[0], face[2]}, Edge{face[1], face[2]}}) {
      at_edge[edge].push_back(f);
    }
  }
  std::vector<FacePair> pairs;
  for (const StartIntersection& one : crossings) {
    const auto& v = one.vertex;
    Face face{v[2], v[3], v[4]};
    std::sort(face.begin(), face.end());
    for (const std::size_t with : at_edge.at({std::min(v[0], v[1]), std::max(v[0], v[1])})) {
      pairs.emplace_back(with, number.at(face));
    }
  }
  return sorted(std::move(pairs));
}

int run(int argc, char** argv) {
  CLI::App app{"Which faces of a mesh cross: CGAL and the start state of a step, in turns"};
  std::string frame, next, out;
  std::size_t rounds = 11;
  app.add_option("FRAME", frame, "a mesh (.ply)")->required();
  app.add_option("NEXT", next, "where it is at the end of the step (.ply)")->required();
  app.add_option("--out", out, "JSON file")->required();
  app.add_option("--rounds", rounds)->check(CLI::PositiveNumber)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const test::PlyMesh mesh = test::readPly(frame), end = test::readPly(next);
  const Surface surface = surfaceOf(mesh);
  Step step;
  step.bodies.resize(1);
  step.bodies[0].name = frame;
  step.bodies[0].topology = share(Topology::fromTriangles(mesh.vertices.size(), mesh.faces));
  step.bodies[0].t0 = share(mesh.vertices);
  step.bodies[0].t1 = share(end.vertices);
  Options options;
  options.keep_bounds = false;
  History history;
  std::vector<double> cgal_ms, start_ms, ratios;
  std::vector<FacePair> by_cgal, ours;
  for (std::size_t round = 0; round < rounds + 1; ++round) {
    std::vector<std::pair<Surface::Face_index, Surface::Face_index>> crossing;
    const Stopwatch watch;
    CGAL::Polygon_mesh_processing::self_intersections(surface, std::back_inserter(crossing));
    const double ms = watch.milliseconds();
    history.clear();
    const Outcome outcome = detect(step, options, history);
    if (round == 0) {
      for (const auto& [one, other] : crossing) by_cgal.emplace_back(one.idx(), other.idx());
      by_cgal = sorted(std::move(by_cgal));
      ours = facesOf(outcome.intersections, mesh.faces);
      if (by_cgal != ours) {
        throw std::runtime_error("CGAL finds " + std::to_string(by_cgal.size()) + " pairs of faces that cross, we " +
                                 std::to_string(ours.size()));
      }
      continue;
    }
    cgal_ms.push_back(ms);
    start_ms.push_back(outcome.stats[Stage::START_STATE].ms);
    ratios.push_back(start_ms.back() / ms);
  }
  const MedianInterval ratio = medianOf(ratios);
  std::ofstream file(out);
  file << nlohmann::json{{"machine", machine()},
                         {"pairs_of_faces", by_cgal.size()},
                         {"cgal_ms", spread(cgal_ms)},
                         {"start_state_ms", spread(start_ms)},
                         {"ratio", {{"low", ratio.low}, {"median", ratio.median}, {"high", ratio.high}}}}
              .dump(1)
       << '\n';
  if (!file) throw std::runtime_error(out + ": cannot be written");
  return 0;
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  try {
    return dccd::benchmarks::run(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << "start_state_peer: " << e.what() << '\n';
    return 1;
  }
}
