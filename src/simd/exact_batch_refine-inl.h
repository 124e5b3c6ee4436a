// One root of each pair, approximated, certified and tested for contact: see exact_batch-inl.h, which includes this.
HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {

constexpr int QUICK_STEPS = 4;     ///< Halley steps that settle nearly every root
constexpr int SPLIT_STEPS = 5;     ///< in pieces, where one end is an extremum of f
constexpr int MORE_STEPS = 8;      ///< for a single root that QUICK_STEPS left without a bracket
constexpr int PATIENT_STEPS = 20;  ///< for those that MORE_STEPS left, and in subdivision

/// The inside test at t = x, for every t within h of it: lanes that certainly touch there and lanes that certainly
/// do not. On the plane across the largest component n of u x v; with B that component of w x v, and C that of u x w
/// (VF) or of w x u (EE), the closed features meet iff
///   VF  B/n, C/n and (n-B-C)/n >= 0 (barycentric coordinates),
///   EE  B/n, C/n, (n-B)/n and (n-C)/n >= 0 (line parameters of both edges).
/// Where n may be 0, as of parallel edges, two of these of opposite signs exclude a contact, too: see apartAlong().
template <bool CERTIFIED, BatchKind KIND>
HWY_INLINE void insideTest(const RootBlock& roots, std::size_t i, V x, V h, M& touches, M& misses) {
  const V s = hn::Sub(constant(1), x);
  const auto& m = roots.motion;
  const V ux = lerp(load(m[U_T0], i), load(m[U_T1], i), s, x);
  const V uy = lerp(load(m[U_T0 + 1], i), load(m[U_T1 + 1], i), s, x);
  const V uz = lerp(load(m[U_T0 + 2], i), load(m[U_T1 + 2], i), s, x);
  const V vx = lerp(load(m[V_T0], i), load(m[V_T1], i), s, x);
  const V vy = lerp(load(m[V_T0 + 1], i), load(m[V_T1 + 1], i), s, x);
  const V vz = lerp(load(m[V_T0 + 2], i), load(m[V_T1 + 2], i), s, x);
  const V wx = lerp(load(m[W_T0], i), load(m[W_T1], i), s, x);
  const V wy = lerp(load(m[W_T0 + 1], i), load(m[W_T1 + 1], i), s, x);
  const V wz = lerp(load(m[W_T0 + 2], i), load(m[W_T1 + 2], i), s, x);
  const V nx = minor(uy, vz, uz, vy), ny = minor(uz, vx, ux, vz), nz = minor(ux, vy, uy, vx);
  const V ax = hn::Abs(nx), ay = hn::Abs(ny), az = hn::Abs(nz);
  const M on_x = hn::And(hn::Ge(ax, ay), hn::Ge(ax, az));
  const M on_y = hn::Ge(ay, az);  // where not on_x
  const V n = choose(on_x, nx, choose(on_y, ny, nz));
  const V u1 = choose(on_x, uy, choose(on_y, uz, ux));
  const V u2 = choose(on_x, uz, choose(on_y, ux, uy));
  const V v1 = choose(on_x, vy, choose(on_y, vz, vx));
  const V v2 = choose(on_x, vz, choose(on_y, vx, vy));
  const V w1 = choose(on_x, wy, choose(on_y, wz, wx));
  const V w2 = choose(on_x, wz, choose(on_y, wx, wy));
  const V flip = hn::And(n, hn::SignBit(Tag()));  // makes n positive
  const V nn = hn::Abs(n);
  const V b = hn::Xor(minor(w1, v2, w2, v1), flip);
  const V c = hn::Xor(KIND == BatchKind::VERTEX_FACE ? minor(u1, w2, u2, w1) : minor(w1, u2, w2, u1), flip);
  V error_n = hn::Zero(Tag()), error_b = error_n, error_c = error_n;
  if (CERTIFIED) {
    const V size_u = load(roots.size[0], i), size_v = load(roots.size[1], i), size_w = load(roots.size[2], i);
    const V relative = hn::Mul(constant(BATCH_MINOR), hn::Add(h, constant(BATCH_TIME)));
    error_n = hn::Mul(hn::Mul(size_u, size_v), relative);
    error_b = hn::Mul(hn::Mul(size_v, size_w), relative);
    error_c = hn::Mul(hn::Mul(size_u, size_w), relative);
  }
  const M n_certain = hn::Gt(nn, error_n);
  const M b_inside = isPositive<CERTIFIED>(b, error_b), c_inside = isPositive<CERTIFIED>(c, error_c);
  M all_inside = hn::And(b_inside, c_inside), any_inside = hn::Or(b_inside, c_inside);
  M any_outside = hn::Or(isNegative<CERTIFIED>(b, error_b), isNegative<CERTIFIED>(c, error_c));
  const auto take = [&](V value, V error) HWY_ATTR {
    const M inside = isPositive<CERTIFIED>(value, error);
    all_inside = hn::And(all_inside, inside);
    any_inside = hn::Or(any_inside, inside);
    any_outside = hn::Or(any_outside, isNegative<CERTIFIED>(value, error));
  };
  if (KIND == BatchKind::VERTEX_FACE) {
    take(hn::Sub(hn::Sub(nn, b), c), hn::Add(hn::Add(error_n, error_b), error_c));
  } else {
    take(hn::Sub(nn, b), hn::Add(error_n, error_b));
    take(hn::Sub(nn, c), hn::Add(error_n, error_c));
  }
  touches = hn::And(n_certain, all_inside);
  misses = hn::And(hn::Or(n_certain, any_inside), any_outside);
}

/// Approximate root in [lo, hi] by `steps` Halley steps that fall back to bisection; |f'| and |f''|/2 where
/// the last of them began.
HWY_INLINE V approximateRoot(V f0, V f1, V f2, V f3, V lo, V hi, V at_lo, int steps, V& slope, V& curvature) {
  const V three = constant(3), half = constant(0.5), sign_bit = hn::SignBit(Tag());
  const V a1 = hn::Sub(f1, hn::Mul(three, f0));
  const V a2 = hn::Add(hn::Sub(hn::Mul(three, f0), hn::Add(f1, f1)), f2);
  const V a3 = hn::Add(hn::Sub(f3, f2), hn::Sub(f1, f0));
  const V a3_times_3 = hn::Mul(three, a3);
  const V flip = hn::And(at_lo, sign_bit);  // makes f positive at lo
  const V zero = hn::Zero(Tag());
  V x = hn::Mul(half, hn::Add(lo, hi));
  V d = zero, c = zero;
  for (int step = 0; step < steps; ++step) {
    const V f = hn::Add(hn::Mul(hn::Add(hn::Mul(hn::Add(hn::Mul(a3, x), a2), x), a1), x), f0);
    c = hn::Add(hn::Mul(a3_times_3, x), a2);          // f''/2
    d = hn::Add(hn::Mul(hn::Add(c, a2), x), a1);      // f'
    const M before = hn::Gt(hn::Xor(f, flip), zero);  // the root lies beyond x
    lo = choose(before, x, lo);
    hi = choose(before, hi, x);
    const V next = hn::Sub(x, hn::Div(hn::Mul(f, d), hn::Sub(hn::Mul(d, d), hn::Mul(f, c))));
    const M inside = hn::And(hn::Ge(next, lo), hn::Le(next, hi));
    x = choose(inside, next, hn::Mul(half, hn::Add(lo, hi)));
  }
  slope = hn::Abs(d);
  curvature = hn::Abs(c);
  return onGrid(x);
}

/// One vector: approximates a root in each lane; the result means something in pending lanes alone. WHOLE: the root is
/// the only one in [0,1], and lo, hi, at_lo need not be set.
template <bool WHOLE, int STEPS>
HWY_INLINE void approximate(RootBlock& roots, std::size_t i) {
  const V f0 = load(roots.coefficient[0], i), f1 = load(roots.coefficient[1], i);
  const V f2 = load(roots.coefficient[2], i), f3 = load(roots.coefficient[3], i);
  const V lo = WHOLE ? hn::Zero(Tag()) : load(roots.lo, i), at_lo = WHOLE ? f0 : load(roots.at_lo, i);
  const V hi = WHOLE ? constant(1) : load(roots.hi, i);
  V slope, curvature;
  store(approximateRoot(f0, f1, f2, f3, lo, hi, at_lo, STEPS, slope, curvature), roots.root_lo, i);
  store(slope, roots.slope, i);
  store(curvature, roots.curvature, i);
}

/// One vector: certifies bracket and cell of what was approximated, and tests for contact.
template <bool CERTIFIED, BatchKind KIND, bool WHOLE, int STEPS>
HWY_INLINE void certify(RootBlock& roots, std::size_t i, double cells) {
  const V f0 = load(roots.coefficient[0], i), f1 = load(roots.coefficient[1], i);
  const V f2 = load(roots.coefficient[2], i), f3 = load(roots.coefficient[3], i);
  const V lo = WHOLE ? hn::Zero(Tag()) : load(roots.lo, i), at_lo = WHOLE ? f0 : load(roots.at_lo, i);
  const V hi = WHOLE ? constant(1) : load(roots.hi, i);
  const V x = load(roots.root_lo, i), slope = load(roots.slope, i);
  const V count = constant(cells), width = constant(1 / cells), one = constant(1);
  M touches, misses;
  V outcome = constant(ROOT_UNCERTAIN);
  V root_lo = x, root_hi = x;
  if (!CERTIFIED) {
    insideTest<CERTIFIED, KIND>(roots, i, x, hn::Zero(Tag()), touches, misses);
    outcome = choose(touches, constant(ROOT_CONTACT), constant(ROOT_NO_CONTACT));
  } else {
    const V error = load(roots.error, i);
    const V flip = hn::And(at_lo, hn::SignBit(Tag()));
    // Any reach is safe, for the signs below decide. error / slope is how far f's error moves the root; four times that
    // brackets nearly all. Later attempts take sixteen times, or four times what the curvature says where that is less.
    V reach = hn::Div(hn::Mul(constant(4), error), slope);
    if (STEPS >= MORE_STEPS) {  // near a double root the curvature bounds the reach better than the slope
      const V parabola = hn::Sqrt(hn::Div(hn::Mul(constant(16), error), load(roots.curvature, i)));
      reach = hn::Mul(constant(4), reach);
      reach = choose(hn::Lt(parabola, reach), parabola, reach);
    }
    reach = hn::Add(reach, constant(tolerance::BATCH_BRACKET));
    const V below = onGrid(hn::Sub(x, reach)), above = onGrid(hn::Add(x, reach));
    root_lo = choose(hn::Gt(below, lo), below, lo);
    root_hi = choose(hn::Lt(above, hi), above, hi);
    const M bracketed = hn::And(hn::Gt(hn::Xor(evaluate(f0, f1, f2, f3, root_lo), flip), error),
                                hn::Lt(hn::Xor(evaluate(f0, f1, f2, f3, root_hi), flip), hn::Neg(error)));
    const V h = hn::Max(hn::Sub(x, root_lo), hn::Sub(root_hi, x));
    insideTest<CERTIFIED, KIND>(roots, i, x, h, touches, misses);
    outcome = choose(misses, constant(ROOT_NO_CONTACT), outcome);
    outcome = choose(touches, constant(ROOT_CONTACT_NO_CELL), outcome);
    // At most one border between cells lies in the bracket unless cells are very fine; f's sign there tells the side.
    const V border = hn::Mul(hn::Add(floorOf(hn::Mul(root_lo, count)), one), width);
    const V at_border = hn::Xor(evaluate(f0, f1, f2, f3, border), flip);
    const M straddles = hn::Lt(border, root_hi);
    root_lo = choose(hn::And(straddles, hn::Gt(at_border, error)), border, root_lo);
    root_hi = choose(hn::And(straddles, hn::Lt(at_border, hn::Neg(error))), border, root_hi);
    const V end_of_cell = hn::Add(floorOf(hn::Mul(root_lo, count)), one);
    const M in_one_cell = hn::Le(hn::Mul(root_hi, count), end_of_cell);
    outcome = choose(hn::And(touches, in_one_cell), constant(ROOT_CONTACT), outcome);
    outcome = choose(bracketed, outcome, constant(ROOT_NOT_BRACKETED));
  }
  if (!WHOLE) {
    const V previous = load(roots.outcome, i);
    outcome = choose(hn::Eq(previous, constant(ROOT_PENDING)), outcome, previous);
  }
  store(outcome, roots.outcome, i);
  store(root_lo, roots.root_lo, i);
  store(root_hi, roots.root_hi, i);
}

/// Approximates the roots, certifies them and tests for contact. In two loops: each step of an approximation waits for
/// the step before, and a processor works on several vectors at once only if no other work lies between them.
template <bool CERTIFIED, BatchKind KIND, bool WHOLE, int STEPS>
HWY_INLINE void refine(RootBlock& roots, double cells) {
  for (std::size_t i = 0; i < roots.count; i += lanes()) approximate<WHOLE, STEPS>(roots, i);
  for (std::size_t i = 0; i < roots.count; i += lanes()) certify<CERTIFIED, KIND, WHOLE, STEPS>(roots, i, cells);
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();
