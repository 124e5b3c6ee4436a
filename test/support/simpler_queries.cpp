#include "support/simpler_queries.h"

#include <algorithm>
#include <cmath>

#include "support/query_symmetries.h"

namespace dccd {
namespace test {
namespace {

/// The binary exponent of the largest coordinate; 0 where all are 0.
int largestExponent(const Query& query) {
  double largest = 0;
  const double* values = &query.motion.x[0][0][0];
  for (int i = 0; i < 24; ++i) largest = std::max(largest, std::abs(values[i]));
  return largest > 0 ? std::ilogb(largest) : 0;
}

int significantBits(double value) {
  int bits = 0, exponent = 0;
  for (double rest = std::frexp(std::abs(value), &exponent); rest != 0; rest = 2 * rest - std::floor(2 * rest)) ++bits;
  return bits;
}

/// How hard a query is to read: digits, coordinates that move, and a scale other than 1.
int costOf(const Query& query) {
  int cost = largestExponent(query) != 0;
  const double* values = &query.motion.x[0][0][0];
  for (int i = 0; i < 24; ++i) cost += 2 * significantBits(values[i]);  // more than what moves, so that zeros win
  for (int i = 0; i < 12; ++i) cost += values[i] != values[i + 12];
  return cost;
}

}  // namespace

std::vector<Query> simplerQueries(const Query& query) {
  std::vector<Query> candidates;
  for (int point = 0; point < 4; ++point) {
    candidates.push_back(query);
    std::copy_n(query.motion.x[0][point], 3, candidates.back().motion.x[1][point]);
  }
  const double* values = &query.motion.x[0][0][0];
  for (int i = 0; i < 24; ++i) {
    int exponent = 0;
    const double mantissa = std::frexp(values[i], &exponent);
    for (const int bits : {0, 1, 2, 4, 8, 16, 32}) {
      candidates.push_back(query);
      (&candidates.back().motion.x[0][0][0])[i] = std::ldexp(std::trunc(std::ldexp(mantissa, bits)), exponent - bits);
    }
  }
  Query unscaled;
  if (scaledExactly(query, -largestExponent(query), unscaled)) candidates.push_back(unscaled);
  // Each step must lower the cost, else shrinking would not end.
  const int cost = costOf(query);
  const auto not_simpler = [cost](const Query& candidate) { return costOf(candidate) >= cost; };
  candidates.erase(std::remove_if(candidates.begin(), candidates.end(), not_simpler), candidates.end());
  return candidates;
}

}  // namespace test
}  // namespace dccd
