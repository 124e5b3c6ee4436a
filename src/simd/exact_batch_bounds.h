// Rounding bounds of the batched elementary test (exact_batch-inl.h), with their derivation.
//
// Notation. eps = 2^-53; every operation is correctly rounded: fl(x op y) = (x op y)(1+d), |d| <= eps. "k factors"
// means a product of at most k such (1+d); (1+eps)^k - 1 <= k eps (1 + 2^-40) for the k <= 12 below. u, v, w are the
// pair's difference vectors, linear in t; f = det(u, v, w) = (u x v).w.
//   VF (p; a b c): u = b-a, v = c-a, w = p-a.     EE (a b; c d): u = b-a, v = d-c, w = c-a.
// U, V, W are the largest absolute values of the *rounded* difference components over both ends of the step. The true
// ones are at most U(1+2 eps); such second-order terms, the underflow terms and the rounding of the bounds' own
// evaluation (at most 5 factors) are covered by rounding each constant up by more than 0.5 %.
//
// Bernstein coefficients f0, f1, f2, f3 of f, kept as F0 = f0, F1 = 3 f1, F2 = 3 f2, F3 = f3:
//   a difference component                                   1 factor
//   n0 = u0 x v0, n2 = u1 x v1: fl(fl(a b) - fl(c d))        2 + 1 + 1 = 4 factors on each of the 2 products
//   m1 = fl(u0 x v1 + u1 x v0)                               5 factors on each of the 4 products
//   a dot product with w, fl(fl(x + y) + z)                  1 (w) + 1 (product) + 2 (sums) = 4 more
//   F0 = n0.w0, F3 = n2.w1:            6 products with 8 factors                  error <=  48 eps U V W
//   F1 = fl(m1.w0 + n0.w1):            12 products with 10, 6 with 9 factors      error <= 174 eps U V W
//   F2 = fl(m1.w1 + n2.w0):            the same
// Every product is at most U V W in absolute value.
//
// Values of f at t, and Bernstein coefficients of f over [a, b] inside [0, 1], are convex combinations of f0..f3:
//   f(t) = ((F0 s + F1 t) s + F2 t^2) s + F3 t^3, where s = 1-t is exact because t is a multiple of 2^-52:
//     at most 6 factors on each term (F0: 3 products, 3 sums), and the terms' absolute values sum to at most max|fi|;
//     the coefficients' errors contribute at most 174/3 = 58 eps U V W.
//   de Casteljau with f1 = fl(F1 fl(1/3)): 2 more factors on F1, so (12*12 + 6*11)/3 = 70 eps U V W from the
//     coefficients; three levels fl(fl(p s) + fl(q t)) give 6 factors on each.
// Each fi is a sum of six products' worth, |fi| <= 6 U V W (1 + 2^-40). So one bound, (70 + 6 * 6) eps U V W, serves
// both and the coefficients themselves. (Two terms, of U V W and of max |fi|, would be a third less where f is small;
// but each would stand in for the other where it matters, and no test could hold either.)
//
// f anew (exact_batch_sharpen-inl.h), where that error is too large. A difference D = h + l exactly, |l| <= eps |h|. "p
// + q exactly" is an error-free transform (two-sum, Dekker's product).
//   A product of pairs within X, Y: leading parts exactly, cross terms rounded, x.lo y.lo dropped: at most 8 eps^2 X Y,
//     its trailing part at most 3 eps X Y. A sum of pairs: leading parts exactly; trailing parts L in all, and that of
//     the leading parts' sum, at most eps S: eps (2 L + eps S); then the trailing part is at most eps S.
//   n0 = u0 x v0: 2 * 8 + 2 * 6 + 2 = 30 eps^2 U V, |n0| <= 2 U V; m1 = u0 x v1 + u1 x v0: 2 * 30 + 2 * 4 + 4 = 72.
//   F0 = n0.w0: 3 * (16 + 30) for the products, (2 * 12 + 4) + (2 * 10 + 6) for the sums: 192 eps^2 U V W; F3 likewise.
//   F1 = m1.w0 + n0.w1: twice that for m1 and its own errors, 3 * (32 + 72) + 2 * 54 = 420, 192, and 2 * 36 + 18 for
//     sums of both: 702; one coefficient f1 a third of it.
//   BATCH_SHARP_VALUE is 4096 eps^2. Each F is rounded to one double, and what is computed of them errs by at most 9
//   eps of the largest |fi|, as above; BATCH_SHARP is 32 eps of the largest |Fi|.
//
// The inside test evaluates, at one t = m, two-by-two minors q = x_i y_j - x_j y_i of vectors x, y out of {u, v, w}
// with absolute bounds X, Y, on one coordinate plane:
//   x(m) = fl(fl(x0 s) + fl(x1 m))                           1 + 1 + 1 = 3 factors, absolute value at most X
//   q = fl(fl(a b) - fl(c d))                                3 + 3 + 1 + 1 = 8 factors on 2 products: 16 eps X Y
//   over |t - m| <= h: |q(t) - q(m)| <= h max|q'|, |x'| = |x1 - x0| <= 2 X, so |q'| <= 8 X Y.
//   sums n - B - C of three minors round twice more: at most 2 eps (|n| + |B| + |C|) <= 4 eps (sum of the X Y).
// So each minor is known to (20 eps + 8 h) X Y = 8 (h + 2.5 eps) X Y, sums of minors to the sum of those: rounding is
// worth another 2.5 eps of time.
//
// The separation test takes the Bernstein coefficients q0, q1, q2 of the same minors over [a, b], from x(a), x(b):
//   q0 = x(a)_i y(a)_j - x(a)_j y(a)_i and q2 as above:     16 eps X Y
//   2 q1 = fl(minor(x(a), y(b)) + minor(x(b), y(a))):        9 factors on 4 products: 36 eps X Y, 18 on q1
//   sums of three: 2 eps (|n| + |B| + |C|) as above, twice that for 2 q1.
// So 22 eps X Y for each coefficient, sums of minors to the sum of those. On an axis a place is a sum of at most two
// components at a or b, each within 4 eps of its size, and a gap a difference of two: 6 eps (U + V + W) at most.
//
// Underflow: the guard demands 2^-150 <= U, V, W <= 2^150, so that U V W >= 2^-450, while each of fewer than 200
// operations that underflows errs by at most 2^-1075, multiplied later by at most one factor of U, V, W <= 2^150. No
// overflow: everything, squares of values of f included, stays below 2^910.
#pragma once

#include "dccd/tolerances.h"

namespace dccd {
namespace simd {

using tolerance::BATCH_MINOR, tolerance::BATCH_SEPARATION, tolerance::BATCH_SHARP, tolerance::BATCH_SHARP_VALUE,
    tolerance::BATCH_TIME, tolerance::BATCH_VALUE;
constexpr double BATCH_SMALLEST = tolerance::BATCH_SMALLEST_M, BATCH_LARGEST = tolerance::BATCH_LARGEST_M;

}  // namespace simd
}  // namespace dccd
