// What must not change an answer about a pair: other names of its points, other axes, time backwards, another scale.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "oracle/query_file.h"

namespace dccd {
namespace test {

template <typename Change>
void forEachCoordinate(Query& query, Change change) {
  for (auto& points : query.motion.x) {
    for (auto& point : points) {
      for (double& value : point) change(value);
    }
  }
}

/// Orders of the four points that name the same pair: 6 for vertex-face, 8 for edge-edge; the first is the identity.
inline std::vector<std::array<int, 4>> vertexPermutations(PairKind kind) {
  if (kind == PairKind::VERTEX_FACE) {
    return {{0, 1, 2, 3}, {0, 1, 3, 2}, {0, 2, 1, 3}, {0, 2, 3, 1}, {0, 3, 1, 2}, {0, 3, 2, 1}};
  }
  return {{0, 1, 2, 3}, {1, 0, 2, 3}, {0, 1, 3, 2}, {1, 0, 3, 2},
          {2, 3, 0, 1}, {3, 2, 0, 1}, {2, 3, 1, 0}, {3, 2, 1, 0}};
}

/// One of the 48 signed permutations of the axes: new axis i is the old axis[i] times sign[i].
struct AxisPermutation {
  std::array<int, 3> axis;
  std::array<double, 3> sign;
};
inline std::vector<AxisPermutation> axisPermutations() {
  std::vector<AxisPermutation> result;
  std::array<int, 3> axis = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      AxisPermutation permutation{axis, {}};
      for (int i = 0; i < 3; ++i) permutation.sign[i] = (signs & (1 << i)) != 0 ? -1 : 1;
      result.push_back(permutation);
    }
  } while (std::next_permutation(axis.begin(), axis.end()));
  return result;
}

inline Query permuted(const Query& query, const std::array<int, 4>& order) {
  Query result = query;
  for (int time = 0; time < 2; ++time) {
    for (int i = 0; i < 4; ++i) std::copy_n(query.motion.x[time][order[i]], 3, result.motion.x[time][i]);
  }
  return result;
}

inline Query permuted(const Query& query, const AxisPermutation& axes) {
  Query result = query;
  for (int time = 0; time < 2; ++time) {
    for (int point = 0; point < 4; ++point) {
      for (int i = 0; i < 3; ++i) {
        result.motion.x[time][point][i] = axes.sign[i] * query.motion.x[time][point][axes.axis[i]];
      }
    }
  }
  return result;
}

inline Query timeReversed(const Query& query) {
  Query result = query;
  std::copy_n(&query.motion.x[0][0][0], 12, &result.motion.x[1][0][0]);
  std::copy_n(&query.motion.x[1][0][0], 12, &result.motion.x[0][0][0]);
  return result;
}

/// All coordinates times 2^exponent. False, and `scaled` undefined, where that is not exact.
inline bool scaledExactly(const Query& query, int exponent, Query& scaled) {
  scaled = query;
  bool exact = true;
  forEachCoordinate(scaled, [&](double& value) {
    const double result = std::ldexp(value, exponent);
    exact = exact && std::isfinite(result) && std::ldexp(result, -exponent) == value;
    value = result;
  });
  return exact;
}

}  // namespace test
}  // namespace dccd
