// Signs of a pair's coplanarity cubic f at single times in double-double arithmetic (about 106 bits), with a proved
// bound: what certifies the TOC's cell where plain doubles know that there is a contact but not on which side of a grid
// point its root lies. No fused multiply-add is needed, so every machine computes the same bits.
#pragma once

#include <cstdint>

#include "deformable_ccd/elementary.h"

namespace deformable_ccd {
namespace exact {

/// An unevaluated sum.
struct DoubleDouble {
  double hi, lo;
};

/// f = (u x v).w with VF (p; a b c): u = b-a, v = c-a, w = p-a; EE (a b; c d): u = b-a, v = d-c, w = c-a.
class CoplanarityCubic {
 public:
  CoplanarityCubic(PairKind kind, const PairMotion& pair);

  /// f(t) at a multiple of 2^-52 in [0,1]; exact f differs by at most error().
  double valueAt(double t) const;
  double error() const { return error_; }

  /// Sign of f at a multiple of 2^-52 in [0,1]; 0 where the arithmetic cannot tell.
  int signAt(double t) const;

 private:
  double roughValueAt(double t) const;  // in plain double, within rough_error_

  DoubleDouble difference_[2][3][3];  // at t = 0 and 1; u, v, w; axis
  double error_;                      // infinite where the differences are too large or too small for the bound
  double rough_error_;
};

/// The cell k of the 2^-toc_bits grid that holds the only root of the pair's f in the open interval (lo, hi), at whose
/// ends f has opposite signs; lo < hi, both multiples of 2^-52 in [0,1]. -1 where the arithmetic cannot tell.
std::int64_t cellOfRoot(PairKind kind, const PairMotion& pair, double lo, double hi, int toc_bits);

}  // namespace exact
}  // namespace deformable_ccd
