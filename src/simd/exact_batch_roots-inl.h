// Second stage of the batched elementary test: see exact_batch-inl.h, which includes this.
HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {

constexpr int QUICK_STEPS = 4;     ///< Halley steps that settle nearly every root
constexpr int SPLIT_STEPS = 5;     ///< where one end is an extremum of f
constexpr int MORE_STEPS = 8;      ///< for most of the others
constexpr int PATIENT_STEPS = 20;  ///< for the rest

/// Two places that split [0,1] into pieces on which the Bernstein coefficients of f are monotone: the extrema of f, or
/// its inflection point where it has none. Any place is safe; these leave no piece uncertain without need.
HWY_INLINE void splits(V f0, V f1, V f2, V f3, V& first, V& second) {
  const V zero = hn::Zero(Tag()), one = constant(1), three = constant(3);
  const V a1 = hn::Sub(f1, hn::Mul(three, f0));
  const V a2 = hn::Add(hn::Sub(hn::Mul(three, f0), hn::Add(f1, f1)), f2);
  const V a3 = hn::Mul(three, hn::Add(hn::Sub(f3, f2), hn::Sub(f1, f0)));
  const V discriminant = hn::Sub(hn::Mul(a2, a2), hn::Mul(a3, a1));
  const V root = hn::Sqrt(choose(hn::Gt(discriminant, zero), discriminant, zero));
  const V q = hn::Neg(choose(hn::Lt(a2, zero), hn::Sub(a2, root), hn::Add(a2, root)));
  const V p1 = hn::Div(q, a3), p2 = hn::Div(a1, q);
  // Outside (0,1), NaN included: the end 0, which makes an empty piece.
  const V t1 = choose(hn::And(hn::Gt(p1, zero), hn::Lt(p1, one)), onGrid(p1), zero);
  const V t2 = choose(hn::And(hn::Gt(p2, zero), hn::Lt(p2, one)), onGrid(p2), zero);
  const M swap = hn::Gt(t1, t2);
  first = choose(swap, t2, t1);
  second = choose(swap, t1, t2);
}

/// Bernstein coefficients of f over [a, b] by de Casteljau's algorithm, from f0, f1, f2, f3 (not three times f1, f2).
HWY_INLINE void overPiece(V f0, V f1, V f2, V f3, V a, V b, V& c0, V& c1, V& c2, V& c3) {
  const V sa = hn::Sub(constant(1), a), sb = hn::Sub(constant(1), b);
  const V a0 = lerp(f0, f1, sa, a), a1 = lerp(f1, f2, sa, a), a2 = lerp(f2, f3, sa, a);
  const V b0 = lerp(f0, f1, sb, b), b1 = lerp(f1, f2, sb, b), b2 = lerp(f2, f3, sb, b);
  const V aa0 = lerp(a0, a1, sa, a), aa1 = lerp(a1, a2, sa, a);
  const V bb0 = lerp(b0, b1, sb, b), bb1 = lerp(b1, b2, sb, b);
  c0 = lerp(aa0, aa1, sa, a);
  c1 = lerp(aa0, aa1, sb, b);
  c2 = lerp(bb0, bb1, sa, a);
  c3 = lerp(bb0, bb1, sb, b);
}

/// What is certain of a piece with these coefficients. With BY_ENDS only the ends are looked at: pieces on which f is
/// monotone up to rounding, where nothing is to be proved.
template <bool CERTIFIED, bool BY_ENDS>
HWY_INLINE V pieceOf(V c0, V c1, V c2, V c3, V error) {
  const M p0 = isPositive<CERTIFIED>(c0, error), n0 = isNegative<CERTIFIED>(c0, error);
  const M p3 = isPositive<CERTIFIED>(c3, error), n3 = isNegative<CERTIFIED>(c3, error);
  if (BY_ENDS) {
    return choose(hn::Or(hn::And(p0, n3), hn::And(n0, p3)), constant(PIECE_ROOT), constant(PIECE_FREE));
  }
  const M plus = hn::And(isPositive<CERTIFIED>(c1, error), isPositive<CERTIFIED>(c2, error));
  const M minus = hn::And(isNegative<CERTIFIED>(c1, error), isNegative<CERTIFIED>(c2, error));
  const M free = hn::Or(hn::And(hn::And(p0, p3), plus), hn::And(hn::And(n0, n3), minus));
  const M one_root = hasOneRoot<CERTIFIED>(c0, c1, c2, c3, error, error);
  return choose(one_root, constant(PIECE_ROOT), choose(free, constant(PIECE_FREE), constant(PIECE_UNCERTAIN)));
}

/// The inside test at t = x, for every t within h of it: lanes that certainly touch there and lanes that certainly
/// do not. On the coordinate plane where n = u x v is largest; with B and C as below the closed features meet iff
///   VF  B/n, C/n and (n-B-C)/n >= 0 (barycentric coordinates),
///   EE  B/n, C/n, (n-B)/n and (n-C)/n >= 0 (line parameters of both edges).
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
  M all_inside = hn::And(isPositive<CERTIFIED>(b, error_b), isPositive<CERTIFIED>(c, error_c));
  M any_outside = hn::Or(isNegative<CERTIFIED>(b, error_b), isNegative<CERTIFIED>(c, error_c));
  if (KIND == BatchKind::VERTEX_FACE) {
    const V a = hn::Sub(hn::Sub(nn, b), c), error_a = hn::Add(hn::Add(error_n, error_b), error_c);
    all_inside = hn::And(all_inside, isPositive<CERTIFIED>(a, error_a));
    any_outside = hn::Or(any_outside, isNegative<CERTIFIED>(a, error_a));
  } else {
    const V nb = hn::Sub(nn, b), error_nb = hn::Add(error_n, error_b);
    const V nc = hn::Sub(nn, c), error_nc = hn::Add(error_n, error_c);
    all_inside = hn::And(all_inside, hn::And(isPositive<CERTIFIED>(nb, error_nb), isPositive<CERTIFIED>(nc, error_nc)));
    any_outside = hn::Or(any_outside, hn::Or(isNegative<CERTIFIED>(nb, error_nb), isNegative<CERTIFIED>(nc, error_nc)));
  }
  touches = hn::And(n_certain, all_inside);
  misses = hn::And(n_certain, any_outside);
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

/// One vector: approximates a root of each lane; it counts where the lane is pending. WHOLE: the root is the only one
/// in [0,1], and lo, hi, at_lo need not be set.
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
    insideTest<CERTIFIED, KIND>(roots, i, x, x, touches, misses);
    outcome = choose(touches, constant(ROOT_CONTACT), constant(ROOT_NO_CONTACT));
  } else {
    const V error = load(roots.error, i);
    const V flip = hn::And(at_lo, hn::SignBit(Tag()));
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

/// Copies one lane, but for what its next root will set.
inline void copyPair(const RootBlock& from, std::size_t i, RootBlock& to, std::size_t j) {
  for (int k = 0; k < MOTION_PLANES; ++k) to.motion[k][j] = from.motion[k][i];
  for (int k = 0; k < 4; ++k) to.coefficient[k][j] = from.coefficient[k][i];
  for (int k = 0; k < 3; ++k) to.size[k][j] = from.size[k][i];
  to.error[j] = from.error[i];
  to.pair[j] = from.pair[i];
}

/// What is done to every plane of a block that its next root does not set.
template <class Do>
HWY_INLINE void onPlanes(RootBlock& roots, const Do& act) {
  for (int k = 0; k < MOTION_PLANES; ++k) act(roots.motion[k]);
  for (int k = 0; k < 4; ++k) act(roots.coefficient[k]);
  for (int k = 0; k < 3; ++k) act(roots.size[k]);
  act(roots.error);
}
template <class Do>
HWY_INLINE void onPlanes(SplitBlock& roots, const Do& act) {
  onPlanes(static_cast<RootBlock&>(roots), act);
  for (int k = 0; k < 4; ++k) act(roots.end[k]);
  for (int k = 0; k < 3; ++k) act(roots.value[k]);
  for (int k = 0; k < 3; ++k) act(roots.piece[k]);
  act(roots.lo);
  act(roots.hi);
  act(roots.at_lo);
  act(roots.outcome);
  act(roots.current);
}

/// Copies of the last pair up to a whole vector.
struct FillUp {
  std::size_t count;
  HWY_INLINE void operator()(double* plane) const { hn::StoreU(constant(plane[count - 1]), Tag(), plane + count); }
};
template <class Block>
HWY_INLINE void fillUp(Block& roots) {
  if (roots.count % lanes() != 0) onPlanes(roots, FillUp{roots.count});
}

/// The lanes of the vector at `from` that `front` lists, to `to`, which is not behind it. A whole vector is written.
struct MoveTogether {
  decltype(hn::SetTableIndices(Tag(), FRONT_TABLE.row[0])) front;
  std::size_t from, to;
  HWY_INLINE void operator()(double* plane) const {
    hn::StoreU(hn::TableLookupLanes(load(plane, from), front), Tag(), plane + to);
  }
};

HWY_INLINE void writeOut(const RootBlock& roots, std::size_t j, double cells, const BatchOutput& out) {
  const std::size_t pair = roots.pair[j];
  out.verdict[pair] = static_cast<std::uint8_t>(roots.outcome[j]);
  out.lo[pair] = roots.root_lo[j];
  out.hi[pair] = roots.root_hi[j];
  const double lo = roots.root_lo[j];  // anything where there is no root in the step, and no cell then
  out.cell[pair] = lo >= 0 && lo <= 1 ? static_cast<std::uint64_t>(lo * cells) : 0;
}

/// Leaves a pair to subdivision, which starts afresh; solves what is there when the block is full.
template <BatchKind KIND>
void subdivideAll(RootBlock& hard, double cells, const BatchOutput& out);
template <BatchKind KIND>
HWY_INLINE void leave(const RootBlock& roots, std::size_t j, double cells, RootBlock& hard, const BatchOutput& out) {
  copyPair(roots, j, hard, hard.count++);
  if (hard.count == BATCH_BLOCK) subdivideAll<KIND>(hard, cells, out);
}

/// Pairs with certainly one root in the step that fewer steps did not bracket.
template <BatchKind KIND, int STEPS>
HWY_NOINLINE void solveStubborn(RootBlock& roots, double cells, RootBlock& hard, const BatchOutput& out);

/// Pairs with certainly one root in the step: with a few Halley steps, and more for those that these did not bring
/// close.
template <bool CERTIFIED, BatchKind KIND, int STEPS = QUICK_STEPS>
HWY_INLINE void solveSingle(RootBlock& roots, double cells, RootBlock& hard, const BatchOutput& out) {
  constexpr int NEXT_STEPS = STEPS < MORE_STEPS ? MORE_STEPS : PATIENT_STEPS;
  fillUp(roots);
  refine<CERTIFIED, KIND, true, STEPS>(roots, cells);
  std::size_t again = 0;
  for (std::size_t j = 0; j < roots.count; ++j) {
    if (CERTIFIED && STEPS < PATIENT_STEPS && roots.outcome[j] == ROOT_NOT_BRACKETED) {
      if (again != j) copyPair(roots, j, roots, again);
      ++again;
    } else if (CERTIFIED && (roots.outcome[j] == ROOT_UNCERTAIN || roots.outcome[j] == ROOT_NOT_BRACKETED)) {
      leave<KIND>(roots, j, cells, hard, out);
    } else {
      writeOut(roots, j, cells, out);
    }
  }
  roots.count = again;
  if constexpr (STEPS < PATIENT_STEPS) {
    if (again != 0) solveStubborn<KIND, NEXT_STEPS>(roots, cells, hard, out);
  }
  roots.count = 0;
}

template <BatchKind KIND, int STEPS>
void solveStubborn(RootBlock& roots, double cells, RootBlock& hard, const BatchOutput& out) {
  solveSingle<true, KIND, STEPS>(roots, cells, hard, out);
}

/// Where the last root was no contact, makes the next piece that is not free the current one, or settles the pair.
HWY_INLINE void selectPiece(SplitBlock& roots, std::size_t i) {
  const V previous = load(roots.outcome, i), last = load(roots.current, i);
  V current = constant(3), outcome = constant(ROOT_NO_CONTACT);
  V lo = hn::Zero(Tag()), hi = lo, at_lo = lo;
  for (int k = 2; k >= 0; --k) {
    const V piece = load(roots.piece[k], i);
    const M next = hn::And(hn::Gt(constant(k), last), hn::Gt(piece, constant(PIECE_FREE)));
    const M root = hn::Eq(piece, constant(PIECE_ROOT));
    current = choose(next, constant(k), current);
    outcome = choose(next, choose(root, constant(ROOT_PENDING), constant(ROOT_UNCERTAIN)), outcome);
    lo = choose(next, load(roots.end[k], i), lo);
    hi = choose(next, load(roots.end[k + 1], i), hi);
    at_lo = choose(next, load(roots.value[k], i), at_lo);
  }
  store(choose(hn::Eq(previous, constant(ROOT_NO_CONTACT)), outcome, previous), roots.outcome, i);
  store(current, roots.current, i);
  store(lo, roots.lo, i);
  store(hi, roots.hi, i);
  store(at_lo, roots.at_lo, i);
}

/// Splits the step of one vector of pairs at the extrema of f, and says what each piece holds.
template <bool CERTIFIED>
HWY_INLINE void split(SplitBlock& roots, std::size_t i) {
  const V third = constant(1.0 / 3);
  const V f0 = load(roots.coefficient[0], i), f3 = load(roots.coefficient[3], i);
  const V f1_times_3 = load(roots.coefficient[1], i), f2_times_3 = load(roots.coefficient[2], i);
  const V f1 = hn::Mul(f1_times_3, third), f2 = hn::Mul(f2_times_3, third);
  const V error = CERTIFIED ? load(roots.error, i) : hn::Zero(Tag());
  V t1, t2;
  splits(f0, f1_times_3, f2_times_3, f3, t1, t2);
  store(hn::Zero(Tag()), roots.end[0], i);
  store(t1, roots.end[1], i);
  store(t2, roots.end[2], i);
  store(constant(1), roots.end[3], i);
  for (int k = 0; k < 3; ++k) {
    V c0, c1, c2, c3;
    overPiece(f0, f1, f2, f3, load(roots.end[k], i), load(roots.end[k + 1], i), c0, c1, c2, c3);
    store(pieceOf<CERTIFIED, !CERTIFIED>(c0, c1, c2, c3, error), roots.piece[k], i);
    store(c0, roots.value[k], i);
  }
  store(constant(-1), roots.current, i);
  store(constant(ROOT_NO_CONTACT), roots.outcome, i);
}

/// Pairs with perhaps several roots: one after the other, until one is a contact or none is left.
template <bool CERTIFIED, BatchKind KIND>
HWY_INLINE void solveSeveral(SplitBlock& roots, double cells, RootBlock& hard, const BatchOutput& out) {
  if (roots.count == 0) return;
  fillUp(roots);
  for (std::size_t i = 0; i < roots.count; i += lanes()) split<CERTIFIED>(roots, i);
  while (roots.count != 0) {
    std::size_t pending = 0;
    for (std::size_t i = 0; i < roots.count; i += lanes()) {
      selectPiece(roots, i);
      const V outcome = load(roots.outcome, i);
      const unsigned all = roots.count - i < lanes() ? (1u << (roots.count - i)) - 1 : (1u << lanes()) - 1;
      const unsigned waiting = all & bitsOf(hn::Eq(outcome, constant(ROOT_PENDING)));
      const M left = hn::Or(hn::Eq(outcome, constant(ROOT_UNCERTAIN)), hn::Eq(outcome, constant(ROOT_NOT_BRACKETED)));
      const unsigned uncertain = CERTIFIED ? all & bitsOf(left) : 0;
      for (unsigned bits = uncertain; bits != 0; bits &= bits - 1) {
        leave<KIND>(roots, i + hwy::Num0BitsBelowLS1Bit_Nonzero32(bits), cells, hard, out);
      }
      for (unsigned bits = all & ~waiting & ~uncertain; bits != 0; bits &= bits - 1) {
        writeOut(roots, i + hwy::Num0BitsBelowLS1Bit_Nonzero32(bits), cells, out);
      }
      if (waiting == 0) continue;
      onPlanes(roots, MoveTogether{hn::SetTableIndices(Tag(), FRONT_TABLE.row[waiting]), i, pending});
      for (unsigned bits = waiting; bits != 0; bits &= bits - 1) {
        roots.pair[pending++] = roots.pair[i + hwy::Num0BitsBelowLS1Bit_Nonzero32(bits)];
      }
    }
    roots.count = pending;
    fillUp(roots);
    refine<CERTIFIED, KIND, false, SPLIT_STEPS>(roots, cells);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();
