// Which corners of a triangle soup are one vertex.
#pragma once

#include <vector>

#include "dccd/types.h"

namespace dccd {

/// Holds from soup to soup of one publisher: the first one says which corners belong together, by exact coordinates,
/// and what comes apart later stays apart, since what touches then for the first time is contact, not mesh. A soup
/// with another number of corners begins anew. Not thread-safe.
class SoupWeld {
 public:
  /// Takes the next soup's corners. Returns how many vertices came apart.
  std::size_t weld(const Positions& corners);
  /// Makes each of `count` corners a vertex of its own.
  void keepApart(std::size_t count);
  /// The next soup is welded as a first one.
  void forget();

  const std::vector<Index>& vertexOfCorner() const { return vertex_; }
  /// One corner of each vertex, the first of them.
  const std::vector<Index>& cornerOfVertex() const { return corner_; }

 private:
  bool holds(const Positions& corners) const;
  std::size_t weldAnew(const Positions& corners, bool refine);

  std::vector<Index> vertex_, corner_;
};

}  // namespace dccd
