// Pairs of one kind, as the rungs and the kernels take them in batches.
#pragma once

#include <algorithm>
#include <vector>

#include "dccd/elementary.h"

namespace dccd {
namespace test {

struct PairList {
  PairKind kind;
  std::vector<VertexMotion> vertices;
  std::vector<Quad> pairs;

  explicit PairList(PairKind k = PairKind::VERTEX_FACE) : kind(k) {}
  std::size_t size() const { return pairs.size(); }
  /// A pair with vertices of its own.
  void add(const PairMotion& pair) {
    Quad quad;
    for (std::size_t i = 0; i < 4; ++i) {
      VertexMotion v{};
      std::copy_n(pair.x[0][i], 3, v.t0);
      std::copy_n(pair.x[1][i], 3, v.t1);
      quad[i] = static_cast<Index>(vertices.size());
      vertices.push_back(v);
    }
    pairs.push_back(quad);
  }
};

inline PairMotion motionOf(const PairList& list, std::size_t pair) {
  PairMotion motion;
  for (std::size_t i = 0; i < 4; ++i) {
    const VertexMotion& v = list.vertices[list.pairs[pair][i]];
    std::copy_n(v.t0, 3, motion.x[0][i]);
    std::copy_n(v.t1, 3, motion.x[1][i]);
  }
  return motion;
}

/// All of them. Shows the list's own memory.
inline PairBatch batchOf(const PairList& list) {
  PairBatch batch;
  batch.kind = list.kind;
  batch.vertices = list.vertices.data();
  batch.pairs = list.pairs.data();
  batch.count = list.size();
  return batch;
}

}  // namespace test
}  // namespace dccd
