#include "paper/primitive_bv.h"

#include <algorithm>

namespace dccd {

bool primitiveBvSeparated(PairKind kind, const PaperRecord* records, const Quad& pair) {
  const std::size_t first_count = kind == PairKind::VERTEX_FACE ? 1 : 2;
  for (std::size_t k = 0; k < PAPER_DIRECTIONS; ++k) {
    float lo[2] = {2, 2}, hi[2] = {-2, -2};  // stored values lie in [-1, 1]
    for (std::size_t i = 0; i < 4; ++i) {
      const PaperRecord& r = records[pair[i]];
      const std::size_t feature = i < first_count ? 0 : 1;
      lo[feature] = std::min(lo[feature], std::min(r.t0[k], r.t1[k]));
      hi[feature] = std::max(hi[feature], std::max(r.t0[k], r.t1[k]));
    }
    if (hi[0] < lo[1] || lo[0] > hi[1]) return true;
  }
  return false;
}

}  // namespace dccd
