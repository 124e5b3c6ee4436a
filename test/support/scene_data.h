// The real scenes with exact truth (see the README of the data): one step of a simulation each.
#pragma once

#include <string>
#include <vector>

#include "dccd/elementary.h"
#include "dccd/types.h"

namespace dccd {
namespace test {

/// A triangle mesh as it stands in a binary PLY file (either byte order).
struct PlyMesh {
  Positions vertices;
  std::vector<Face> faces;
};

/// Throws std::runtime_error naming the file and what is wrong with it.
PlyMesh readPly(const std::string& path);

/// A pair with its exact verdict; indices as in PairBatch.
struct TruthPair {
  Quad pair;
  bool contact;
};

/// Reads vf.txt.gz or ee.txt.gz. Throws std::runtime_error naming the file (and the line).
std::vector<TruthPair> readTruthPairs(const std::string& path);

/// A pair in contact and its time of contact, found symbolically by others.
struct TruthTime {
  Quad pair;            ///< as in PairBatch
  std::string decimal;  ///< share of the step, 0 to 1, in decimal digits without an exponent
};

/// Reads toc_vf.txt.gz. Throws std::runtime_error naming the file (and the line).
std::vector<TruthTime> readTruthTimes(const std::string& path);

struct SceneData {
  std::vector<VertexMotion> vertices;
  std::vector<Face> faces;
  std::vector<TruthPair> vertex_face, edge_edge;
};

/// "cloth-ball" or "n-body" from dataDir(). Throws std::runtime_error where it cannot be read.
SceneData readScene(const std::string& name);

}  // namespace test
}  // namespace dccd
