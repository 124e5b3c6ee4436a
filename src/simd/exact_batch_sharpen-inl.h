// f anew, in pairs of doubles: see exact_batch-inl.h, which includes this. What lies in a plane but for the rounding of
// its coordinates has an f that is about as large as the error of doubles, and yet certain signs and roots.
HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {

/// An unevaluated sum.
struct Twofold {
  V hi, lo;
};

HWY_INLINE Twofold twoSum(V a, V b) {
  const V sum = hn::Add(a, b), part = hn::Sub(sum, a);
  return {sum, hn::Add(hn::Sub(a, hn::Sub(sum, part)), hn::Sub(b, part))};
}
HWY_INLINE Twofold sum(const Twofold& a, const Twofold& b) {
  const Twofold leading = twoSum(a.hi, b.hi);
  return twoSum(leading.hi, hn::Add(hn::Add(a.lo, b.lo), leading.lo));
}
HWY_INLINE Twofold negative(const Twofold& a) { return {hn::Neg(a.hi), hn::Neg(a.lo)}; }

/// A factor of products: its leading part in two halves as well, whose products are exact.
struct Factor {
  Twofold value;
  V upper, lower;
  Factor() = default;
  HWY_INLINE explicit Factor(const Twofold& of) : value(of) {
    const V scaled = hn::Mul(constant(134217729.0), of.hi);  // 2^27 + 1
    upper = hn::Sub(scaled, hn::Sub(scaled, of.hi));
    lower = hn::Sub(of.hi, upper);
  }
};
HWY_INLINE Twofold product(const Factor& a, const Factor& b) {
  const V p = hn::Mul(a.value.hi, b.value.hi);
  const V across =
      hn::Add(hn::Add(hn::Sub(hn::Mul(a.upper, b.upper), p), hn::Mul(a.upper, b.lower)), hn::Mul(a.lower, b.upper));
  const V rest = hn::Add(across, hn::Mul(a.lower, b.lower));
  return {p, hn::Add(rest, hn::Add(hn::Mul(a.value.hi, b.value.lo), hn::Mul(a.value.lo, b.value.hi)))};
}
HWY_INLINE Twofold minor(const Factor& x, const Factor& y, const Factor& z, const Factor& w) {
  return sum(product(x, y), negative(product(z, w)));
}

/// The coefficients of one vector of pairs, and their error, from the differences and what rounding took from these.
HWY_INLINE void sharpenVector(RootBlock& pairs, const MotionBlock& rest, std::size_t i) {
  Factor u[2][3], v[2][3], w[2][3];
  for (int end = 0; end < 2; ++end) {
    const auto set = [&](int plane, Factor(&to)[3]) HWY_ATTR {
      for (int k = 0; k < 3; ++k) {
        const int at = plane + (end == 0 ? 0 : U_T1) + k;
        to[k] = Factor({load(pairs.motion[at], i), load(rest.motion[at], i)});
      }
    };
    set(U_T0, u[end]), set(V_T0, v[end]), set(W_T0, w[end]);
  }
  Twofold f[4];
  for (int k = 0; k < 3; ++k) {
    const int p = k == 2 ? 0 : k + 1, q = k == 0 ? 2 : k - 1;
    const Factor n0(minor(u[0][p], v[0][q], u[0][q], v[0][p])), n2(minor(u[1][p], v[1][q], u[1][q], v[1][p]));
    const Factor n1(sum(minor(u[0][p], v[1][q], u[0][q], v[1][p]), minor(u[1][p], v[0][q], u[1][q], v[0][p])));
    const Twofold terms[4] = {product(n0, w[0][k]), sum(product(n1, w[0][k]), product(n0, w[1][k])),
                              sum(product(n1, w[1][k]), product(n2, w[0][k])), product(n2, w[1][k])};
    for (int c = 0; c < 4; ++c) f[c] = k == 0 ? terms[c] : sum(f[c], terms[c]);
  }
  V largest = hn::Zero(Tag());
  for (int c = 0; c < 4; ++c) {
    store(f[c].hi, pairs.coefficient[c], i);
    largest = hn::Max(largest, hn::Abs(f[c].hi));
  }
  const V volume = hn::Mul(hn::Mul(load(pairs.size[0], i), load(pairs.size[1], i)), load(pairs.size[2], i));
  store(hn::Add(hn::Mul(constant(BATCH_SHARP_VALUE), volume), hn::Mul(constant(BATCH_SHARP), largest)), pairs.error, i);
}

/// What rounding takes from a difference.
struct RestOfDifference {
  HWY_INLINE V operator()(V to, V from) const { return twoSum(to, hn::Neg(from)).lo; }
  double operator()(double to, double from) const {
    const double sum = to - from, part = sum - to;
    return (to - (sum - part)) + (-from - part);
  }
};

template <BatchKind KIND>
HWY_INLINE void sharpen(HardBlock& pairs) {
  const auto pair_at = [&pairs](std::size_t j) -> std::size_t {
    return j < pairs.count ? pairs.pair[j] : pairs.input->count;
  };
  gather<KIND>(*pairs.input, pair_at, pairs.count, RestOfDifference(), pairs.rest);
  for (std::size_t i = 0; i < pairs.count; i += lanes()) sharpenVector(pairs, pairs.rest, i);
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();
