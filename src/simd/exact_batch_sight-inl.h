// The inside test where a root's bracket leaves the other one open: see exact_batch-inl.h, which includes this. A
// vertex comes over an edge to the last digits, or edges are parallel but for rounding and come to lie on one line:
// layers that slide in a plane. What is uncertain there, and changes as fast as ever, is 0 at the root but for 2^-53.
//
// Along a direction d across its change it hardly changes, and pairs of doubles tell its sign. A contact at a root is s
// u = w + r v (EE), or w = s u + r v (VF). With n = u x v, B = w x v, and C = w x u (EE), u x w (VF) that means B = s n
// and C = r n. So for any d the features are apart where one of B, C, n-B, n-C (EE), n-B-C (VF) has another sign along
// d than n; and they meet where for each of these there is a d along which it certainly has that of n.
//
// Rounding, in the notation of exact_batch_bounds.h; |d| is the sum of d's components, XY of n - B the sum of both, and
// so on. Values, from pairs of doubles:
//   x(m) = s D0 + t D1: 8 eps^2 X for both products, 7 for their sum; |x(m)| <= X, its trailing part at most eps X;
//   a minor: 30 eps^2 X Y as for n0, 2 * 2 * 15 from x(m) and y(m); sums of three: 12 more; |q| <= 2 X Y;
//   a product with d: 102 + 2 * 8, and 2 * 14 for sums: 146 eps^2 X Y |d|.
// Changes, |x1 - x0| <= 2 X, in doubles: a product 8 eps X Y, of which there are four; sums of them 16, of three
// vectors 16, the product with d 24: 88 eps X Y |d|; |q'| <= 8 X Y. The second derivative is at most 16 X Y |d|. So
// within h of m a value is off by at most h |q'| + (8 h^2 + 88 eps h + 146 eps^2) X Y |d|. 8 (h + BATCH_SHARP)^2 is
// used, 8 h^2 + 512 eps h + 8192 eps^2: it covers the rounding of the bound, and what underflows before the product
// with d; QUADRATIC_UNDERFLOW covers the rest. Where nothing changes d is no number, and nothing is certain.
//
// Of edges that stay parallel to the last digits, and in a plane, f tells nothing: it is 0. They are apart where B and
// n - B have opposite signs along some d all the while, as both are s n and (1 - s) n: where all Bernstein coefficients
// have. These are off by at most 72 eps^2 X Y, as above, and 24 for n - B; at most 4 X Y; so along d, a pair of
// doubles, by 72 + 24 + 8 * 4 + 2 * 28 = 184 eps^2 X Y |d|. BATCH_SHARP_VALUE is 4096 eps^2.
HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {

/// A component of a difference at the time in question, and by how much it changes over the step.
struct Moving {
  Factor at;
  V change;
};

/// A vector at that time in pairs of doubles, and its derivative.
struct MovingVector {
  Twofold at[3];
  V slope[3];
};

HWY_INLINE MovingVector crossOf(const Moving (&x)[3], const Moving (&y)[3]) {
  MovingVector result;
  for (int k = 0; k < 3; ++k) {
    const int p = k == 2 ? 0 : k + 1, q = k == 0 ? 2 : k - 1;
    result.at[k] = minor(x[p].at, y[q].at, x[q].at, y[p].at);
    result.slope[k] = hn::Add(minor(x[p].change, y[q].at.value.hi, x[q].change, y[p].at.value.hi),
                              minor(x[p].at.value.hi, y[q].change, x[q].at.value.hi, y[p].change));
  }
  return result;
}

HWY_INLINE MovingVector difference(const MovingVector& a, const MovingVector& b) {
  MovingVector result;
  for (int k = 0; k < 3; ++k) {
    result.at[k] = sum(a.at[k], negative(b.at[k]));
    result.slope[k] = hn::Sub(a.slope[k], b.slope[k]);
  }
  return result;
}

HWY_INLINE V dot(const V (&a)[3], const V (&b)[3]) { return dot(a[0], a[1], a[2], b[0], b[1], b[2]); }

/// q d, and where it is certainly not 0, nor of another sign within h.
HWY_INLINE V along(const MovingVector& q, const V (&d)[3], V h, V slack, M& certain) {
  const V zero = hn::Zero(Tag());
  Twofold value = product(Factor(q.at[0]), Factor({d[0], zero}));
  for (int k = 1; k < 3; ++k) value = sum(value, product(Factor(q.at[k]), Factor({d[k], zero})));
  const V error =
      hn::Add(hn::Mul(h, hn::Abs(dot(q.slope, d))), hn::Add(slack, constant(tolerance::QUADRATIC_UNDERFLOW)));
  certain = hn::And(certain, hn::Gt(hn::Abs(value.hi), error));
  return value.hi;
}

/// Lanes that certainly touch at every t within h of m, a multiple of 2^-52, at which f is 0; and that certainly do
/// not.
template <BatchKind KIND>
HWY_INLINE void directedInsideTest(const HardBlock& pairs, std::size_t i, V m, V h, M& touches, M& misses) {
  constexpr bool VF = KIND == BatchKind::VERTEX_FACE;
  const V zero = hn::Zero(Tag());
  const Factor before({hn::Sub(constant(1), m), zero}), after({m, zero});
  Moving u[3], v[3], w[3];
  const auto set = [&](int plane, Moving(&to)[3]) HWY_ATTR {
    for (int k = plane; k < plane + 3; ++k) {
      const V start = load(pairs.motion[k], i), end = load(pairs.motion[U_T1 + k], i);
      const Factor x0({start, load(pairs.rest.motion[k], i)}), x1({end, load(pairs.rest.motion[U_T1 + k], i)});
      to[k - plane] = {Factor(sum(product(x0, before), product(x1, after))), hn::Sub(end, start)};
    }
  };
  set(U_T0, u), set(V_T0, v), set(W_T0, w);
  const MovingVector n = crossOf(u, v), b = crossOf(w, v), c = VF ? crossOf(u, w) : crossOf(w, u);
  const V n_hi[3] = {n.at[0].hi, n.at[1].hi, n.at[2].hi};
  const V size_u = load(pairs.size[0], i), size_v = load(pairs.size[1], i), size_w = load(pairs.size[2], i);
  const V size_n = hn::Mul(size_u, size_v), size_b = hn::Mul(size_v, size_w), size_c = hn::Mul(size_u, size_w);
  const V wider = hn::Add(h, constant(BATCH_SHARP)), relative = hn::Mul(constant(8), hn::Mul(wider, wider));
  touches = hn::FirstN(Tag(), lanes()), misses = hn::FirstN(Tag(), 0);
  const auto take = [&](const MovingVector& q, V size_q) HWY_ATTR {
    const V share = hn::Div(dot(q.slope, n_hi), dot(q.slope, q.slope));
    V d[3], length = zero;
    for (int k = 0; k < 3; ++k) {
      d[k] = hn::Sub(n_hi[k], hn::Mul(q.slope[k], share));
      length = hn::Add(length, hn::Abs(d[k]));
    }
    M certain = hn::FirstN(Tag(), lanes());
    const V one = along(n, d, h, hn::Mul(hn::Mul(relative, size_n), length), certain),
            other = along(q, d, h, hn::Mul(hn::Mul(relative, size_q), length), certain);
    const M opposite = hn::Xor(hn::Gt(one, zero), hn::Gt(other, zero));
    touches = hn::And(touches, hn::AndNot(opposite, certain));
    misses = hn::Or(misses, hn::And(opposite, certain));
  };
  take(b, size_b), take(c, size_c);
  if (VF) {
    take(difference(difference(n, b), c), hn::Add(hn::Add(size_n, size_b), size_c));
  } else {
    take(difference(n, b), hn::Add(size_n, size_b)), take(difference(n, c), hn::Add(size_n, size_c));
  }
}

/// Asks the test above about one vector of certified brackets, in lanes that certify() left uncertain.
template <BatchKind KIND>
HWY_NOINLINE void settleDirected(HardBlock& pairs, std::size_t i, double cells) {
  const V lo = load(pairs.root_lo, i), hi = load(pairs.root_hi, i), outcome = load(pairs.outcome, i);
  const V middle = onGrid(hn::Mul(constant(0.5), hn::Add(lo, hi)));
  M touches, misses;
  directedInsideTest<KIND>(pairs, i, middle, hn::Max(hn::Sub(middle, lo), hn::Sub(hi, middle)), touches, misses);
  const V end_of_cell = hn::Add(floorOf(hn::Mul(lo, constant(cells))), constant(1));
  const M in_one_cell = hn::Le(hn::Mul(hi, constant(cells)), end_of_cell);
  const V contact = choose(in_one_cell, constant(ROOT_CONTACT), constant(ROOT_CONTACT_NO_CELL));
  const V settled = choose(misses, constant(ROOT_NO_CONTACT), choose(touches, contact, outcome));
  store(choose(hn::Eq(outcome, constant(ROOT_UNCERTAIN)), settled, outcome), pairs.outcome, i);
}

/// Coefficients of x x y over the step in pairs of doubles: at t = 0, twice the middle one, at t = 1.
HWY_INLINE void crossCoefficients(const Factor (&x)[2][3], const Factor (&y)[2][3], Twofold (&q)[3][3]) {
  for (int k = 0; k < 3; ++k) {
    const int i = k == 2 ? 0 : k + 1, j = k == 0 ? 2 : k - 1;
    q[0][k] = minor(x[0][i], y[0][j], x[0][j], y[0][i]);
    q[1][k] = sum(minor(x[0][i], y[1][j], x[0][j], y[1][i]), minor(x[1][i], y[0][j], x[1][j], y[0][i]));
    q[2][k] = minor(x[1][i], y[1][j], x[1][j], y[1][i]);
  }
}

HWY_INLINE Twofold dotOf(const Twofold (&a)[3], const Twofold (&b)[3]) {
  const Twofold two = sum(product(Factor(a[0]), Factor(b[0])), product(Factor(a[1]), Factor(b[1])));
  return sum(two, product(Factor(a[2]), Factor(b[2])));
}

/// Settles the lanes that are still uncertain whose edges are certainly apart. What is across the change of B to the
/// digits of a double alone would still change more than the heights of the edges above each other.
static HWY_NOINLINE void settleParallel(HardBlock& pairs, std::size_t i) {
  const V zero = hn::Zero(Tag());
  Factor u[2][3], v[2][3], w[2][3];
  const auto set = [&](int plane, Factor(&to)[2][3]) HWY_ATTR {
    for (int k = 0; k < 3; ++k) {
      for (int end = 0; end < 2; ++end) {
        const int at = plane + k + (end == 0 ? 0 : U_T1);
        to[end][k] = Factor({load(pairs.motion[at], i), load(pairs.rest.motion[at], i)});
      }
    }
  };
  set(U_T0, u), set(V_T0, v), set(W_T0, w);
  Twofold n[3][3], b[3][3], d[3];
  crossCoefficients(u, v, n), crossCoefficients(w, v, b);
  Twofold slope[3];
  for (int k = 0; k < 3; ++k) {
    d[k] = sum(sum(b[0][k], b[2][k]), b[1][k]);
    slope[k] = sum(b[2][k], negative(b[0][k]));
  }
  const V square = dot(slope[0].hi, slope[1].hi, slope[2].hi, slope[0].hi, slope[1].hi, slope[2].hi);
  for (int pass = 0; pass < 3; ++pass) {  // each takes the share that is left to 2^-53 of it
    const V share = hn::Div(hn::Neg(dotOf(slope, d).hi), square);
    for (int k = 0; k < 3; ++k) d[k] = sum(d[k], product(Factor(slope[k]), Factor({share, zero})));
  }
  V length = zero;
  for (int k = 0; k < 3; ++k) length = hn::Add(length, hn::Abs(d[k].hi));
  const V size_v = load(pairs.size[1], i), sizes = hn::Add(load(pairs.size[0], i), load(pairs.size[2], i));
  // The length is the last factor: of the others the product is 2^-394 or more, and all of it loses at most 2^-1075.
  const V error = hn::Add(hn::Mul(hn::Mul(constant(BATCH_SHARP_VALUE), hn::Mul(size_v, sizes)), length),
                          constant(tolerance::QUADRATIC_UNDERFLOW));
  M above = hn::FirstN(Tag(), lanes()), below = above;
  for (int c = 0; c < 3; ++c) {
    Twofold rest[3];
    for (int k = 0; k < 3; ++k) rest[k] = sum(n[c][k], negative(b[c][k]));
    const Twofold one = dotOf(b[c], d), other = dotOf(rest, d);
    above = hn::And(above, hn::And(hn::Gt(one.hi, error), hn::Lt(other.hi, hn::Neg(error))));
    below = hn::And(below, hn::And(hn::Lt(one.hi, hn::Neg(error)), hn::Gt(other.hi, error)));
  }
  const V outcome = load(pairs.outcome, i);
  const M apart = hn::And(hn::Or(above, below), hn::Eq(outcome, constant(ROOT_UNCERTAIN)));
  store(choose(apart, constant(ROOT_NO_CONTACT), outcome), pairs.outcome, i);
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();
