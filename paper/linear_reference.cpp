#include "paper/linear_reference.h"

namespace dccd {
namespace {

/// -1: every `a` strictly below every `b`; +1: strictly above; 0: neither.
template <std::size_t NA, std::size_t NB>
int side(const float* const (&a)[NA], const float* const (&b)[NB], std::size_t k) {
  bool below = true, above = true;
  for (const float* x : a) {
    for (const float* y : b) {
      below = below && x[k] < y[k];
      above = above && x[k] > y[k];
    }
  }
  return below ? -1 : above ? 1 : 0;
}

template <std::size_t NA, std::size_t NB>
bool separated(const PaperRecord* const (&a)[NA], const PaperRecord* const (&b)[NB]) {
  const float *a0[NA], *a1[NA], *b0[NB], *b1[NB];
  for (std::size_t i = 0; i < NA; ++i) {
    a0[i] = a[i]->t0;
    a1[i] = a[i]->t1;
  }
  for (std::size_t i = 0; i < NB; ++i) {
    b0[i] = b[i]->t0;
    b1[i] = b[i]->t1;
  }
  for (std::size_t k = 0; k < PAPER_DIRECTIONS; ++k) {
    if (side(a0, b0, k) * side(a1, b1, k) == 1) return true;
  }
  return false;
}

}  // namespace

bool linearSeparatedVf(const PaperRecord& v, const PaperRecord& f0, const PaperRecord& f1, const PaperRecord& f2) {
  return separated<1, 3>({&v}, {&f0, &f1, &f2});
}

bool linearSeparatedEe(const PaperRecord& ea0, const PaperRecord& ea1, const PaperRecord& eb0, const PaperRecord& eb1) {
  return separated<2, 2>({&ea0, &ea1}, {&eb0, &eb1});
}

bool linearSeparated(PairKind kind, const PaperRecord* records, const Quad& pair) {
  const PaperRecord &p0 = records[pair[0]], &p1 = records[pair[1]], &p2 = records[pair[2]], &p3 = records[pair[3]];
  return kind == PairKind::VERTEX_FACE ? linearSeparatedVf(p0, p1, p2, p3) : linearSeparatedEe(p0, p1, p2, p3);
}

}  // namespace dccd
