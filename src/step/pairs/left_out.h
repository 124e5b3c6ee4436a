// Which pairs of a body's own features are closer than the minimum separation in its reference frame: neighbours on the
// mesh, that would otherwise be contacts in every step.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "culling/scene_arrays.h"

namespace dccd {

struct Options;
struct Prepared;
class PairSearch;

/// A pair of features by their ranks, the first one's << 32 | the second one's, and how far they are apart in the
/// reference frame [m].
struct LeftOutKey {
  std::uint64_t key;
  double distance_m;
  friend bool operator<(const LeftOutKey& a, const LeftOutKey& b) { return a.key < b.key; }
};

/// One body's pairs.
class LeftOutOfBody {
 public:
  /// keys: ascending, each once. first_rank, count: the ranks that first features of the kind can have.
  void set(PairKind kind, const std::vector<LeftOutKey>& keys, Index first_rank, std::size_t count);
  bool empty() const { return tables_[0].partners.empty() && tables_[1].partners.empty(); }

  /// The pair's distance in the reference frame, infinity when it is not listed. One search among the few partners of
  /// the first feature.
  double distance(PairKind kind, std::uint64_t key) const {
    const Table& table = tables_[static_cast<int>(kind)];
    if (table.partners.empty()) return std::numeric_limits<double>::infinity();
    const Index first = static_cast<Index>(key >> 32) - table.first_rank, partner = static_cast<Index>(key);
    for (std::uint32_t i = table.begin[first]; i < table.begin[first + 1]; ++i) {
      if (table.partners[i] == partner) return table.distances_m[i];
    }
    return std::numeric_limits<double>::infinity();
  }

 private:
  struct Table {
    Index first_rank = 0;
    std::vector<std::uint32_t> begin;  // of each first feature's partners
    std::vector<Index> partners;       // ranks, ascending for each first feature
    std::vector<double> distances_m;
  };
  Table tables_[2];  // by PairKind
};

/// All bodies' pairs.
struct LeftOut {
  std::vector<LeftOutOfBody> of_body;
  std::vector<LeftOutPair> list;    ///< the same, in the order of the bodies, kinds, features
  std::vector<double> distances_m;  ///< of each one of the list, in the reference frame

  /// Those that a step without motion in the reference frames calls contacts: exactly those that would be contacts for
  /// as long as the body keeps its shape. step: one of the bodies that the scene holds. The scene is left at rest.
  void find(const Step& step, const Prepared& prepared, SceneArrays& scene, PairSearch& pairs);
  /// Says of each body how many of its pairs are left out for its uncertainty alone: whether these come as near as that
  /// is not known.
  void sayForNoise(const Step& step, const Options& options, const SceneArrays& scene,
                   std::vector<std::string>& unproved) const;

 private:
  void add(std::size_t body, PairKind kind, const SceneArrays& scene, const PairSearch& pairs);
};

/// Distance of two features at rest [m], in double. Points as in Contact: VF vertex, face; EE edge, edge.
double restDistance(PairKind kind, const std::array<Vec3, 4>& points);

}  // namespace dccd
