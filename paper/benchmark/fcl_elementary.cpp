#include "paper/benchmark/fcl_elementary.h"

#include <fcl/narrowphase/detail/traversal/collision/intersect.h>

namespace dccd {
namespace benchmarks {
namespace {

using Fcl = fcl::detail::Intersect<double>;
using FclVector = fcl::Vector3<double>;

}  // namespace

std::size_t fclElementary(PairKind kind, const VertexMotion* vertices, const Quad* pairs, std::size_t count,
                          bool filtered) {
  std::size_t contacts = 0;
  double toc = 0;
  FclVector point;
  for (std::size_t i = 0; i < count; ++i) {
    FclVector x[2][4];
    for (std::size_t p = 0; p < 4; ++p) {
      const VertexMotion& v = vertices[pairs[i][p]];
      x[0][p] = FclVector(v.t0[0], v.t0[1], v.t0[2]);
      x[1][p] = FclVector(v.t1[0], v.t1[1], v.t1[2]);
    }
    bool hit;
    if (kind == PairKind::VERTEX_FACE) {  // FCL names the face first
      hit = (filtered ? Fcl::intersect_VF_filtered : Fcl::intersect_VF)(x[0][1], x[0][2], x[0][3], x[0][0], x[1][1],
                                                                        x[1][2], x[1][3], x[1][0], &toc, &point, true);
    } else {
      hit = (filtered ? Fcl::intersect_EE_filtered : Fcl::intersect_EE)(x[0][0], x[0][1], x[0][2], x[0][3], x[1][0],
                                                                        x[1][1], x[1][2], x[1][3], &toc, &point, true);
    }
    contacts += hit ? 1 : 0;
  }
  return contacts;
}

}  // namespace benchmarks
}  // namespace dccd
