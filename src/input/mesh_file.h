// Mesh files: what a reader makes of one, and what the readers share. doc/mesh_files.md has the grammar of each format.
#pragma once

#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dccd/types.h"
#include "input/census.h"
#include "input/polygons.h"

namespace dccd {

struct MeshFileError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Named parts of a mesh: ranges [first, last) of its faces.
using FaceGroups = std::map<std::string, std::vector<std::pair<std::size_t, std::size_t>>>;

struct MeshFile {
  Positions positions;                 ///< [m], in the file's frame; float or double coordinates are taken exactly
  std::vector<Face> faces;             ///< as facesOf() makes them of the file's polygons
  FaceGroups groups;                   ///< of an OBJ
  Polygons polygons;                   ///< as the file has them
  std::vector<std::size_t> unchecked;  ///< polygons that lie in no face
  Census census;                       ///< of the file's statements, or the rows of its elements
  std::vector<Edge> edges;             ///< of ropes: lines of an OBJ, edges of a PLY, which then have no faces
  std::vector<std::string> hints;      ///< sentences about what was skipped, for the user to see
  bool is_soup = false;                ///< vertices are corners of equal coordinates, not what the file numbers
  std::function<std::string(std::size_t)> polygon_name;  ///< where a polygon stands in the file, in words

  std::size_t uncheckedCount() const { return unchecked.size() + census.unchecked(); }
};

/// The small letters behind a path's last dot; empty where there is none.
std::string fileEnding(const std::string& path);
/// Throws MeshFileError unless the path is a regular file of at most 512 MiB that can be read: a pipe or a device would
/// never come to an end.
void requireReadable(const std::string& path);
/// The bytes of such a file. Throws MeshFileError.
std::string readWholeFile(const std::string& path);
/// Makes the mesh's faces of the polygons. Returns where each polygon ends among the faces.
std::vector<std::size_t> setPolygons(Polygons polygons, MeshFile& mesh);
/// A hint where polygons are unchecked. `name` becomes the mesh's.
void hintAtUnchecked(std::function<std::string(std::size_t)> name, MeshFile& mesh);
/// What stands behind the end of a binary file can hold no geometry: zeros, blanks and ends of lines.
bool isPadding(std::string_view bytes);
/// Three corners a triangle to a mesh: corners with equal coordinates become one vertex, in the order of their first
/// corners. Throws MeshFileError for a coordinate that is not finite.
MeshFile weldTriangles(const Positions& corners, const std::string& path);
/// The same of polygons, each of the corners up to its end.
MeshFile weldPolygons(const Positions& corners, std::vector<std::size_t> ends, const std::string& path);
/// Gives soups of the same polygons the same vertices: corners are one that are equal in each of them, as SoupWeld has
/// it. Returns how many vertices of the first one came apart.
std::size_t matchSoups(std::vector<MeshFile>& frames);

}  // namespace dccd
