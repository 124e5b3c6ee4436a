// Query files: single feature pairs with exact coordinates and the true answer, in the format of the benchmark of
// Wang et al. 2021 ("A Large Scale Benchmark and an Inclusion-Based Algorithm for Continuous Collision Detection").
// Eight lines a query, seven integers a line: x, y and z each as numerator, denominator; last 1 or 0, the truth.
// Lines: VF v f0 f1 f2 at t=0, then at t=1; EE ea0 ea1 eb0 eb1 at t=0, then at t=1.
#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include "dccd/elementary.h"

namespace dccd {

/// One pair (VERTEX_FACE or EDGE_EDGE) and whether it meets during the step.
struct Query {
  PairKind kind = PairKind::VERTEX_FACE;
  PairMotion motion{};
  bool contact = false;
};

/// A file that findQueryFiles() found: FAMILY/{vertex-face,edge-edge}/NAME.csv.
struct QueryFileEntry {
  std::string path;
  std::string family;  ///< the folder of the kind folder, relative to where the search began
  PairKind kind = PairKind::VERTEX_FACE;
};

/// Reads every query. Nothing is rounded: a number that no finite double equals is an error. `name` is what errors call
/// the input. Empty lines and carriage returns are skipped.
/// Throws std::runtime_error naming the input, the line and the value.
std::vector<Query> readQueries(std::istream& in, PairKind kind, const std::string& name);

/// The same for a file. Throws std::runtime_error naming the file when it cannot be read.
std::vector<Query> readQueryFile(const std::string& path, PairKind kind);

/// Writes queries so that reading gives the same coordinates bit for bit (but -0, which becomes 0): reduced fractions
/// of integers of any size. Throws std::invalid_argument on a coordinate that is not finite.
void writeQueries(std::ostream& out, const std::vector<Query>& queries);

/// The same into a file; its folder is created. Throws std::runtime_error naming the file when it cannot be written.
void writeQueryFile(const std::string& path, const std::vector<Query>& queries);

/// All .csv files below `dir` that lie in a folder called vertex-face or edge-edge, sorted by path; `dir` may be the
/// root of many families, one family, or one kind folder. Throws std::runtime_error naming `dir` when it is no folder.
std::vector<QueryFileEntry> findQueryFiles(const std::string& dir);

/// The folder's name for a kind of query: "vertex-face" or "edge-edge".
const char* queryFolder(PairKind kind);

}  // namespace dccd
