// Inputs that lie at the bounds of the margins of tolerances.h, and what decides whether the code that uses a margin is
// right about them: exact arithmetic that shares nothing with it. test/property/margins_test.cpp holds that no answer
// is wrong; test/margins/cut_margins.cpp cuts each margin and shows which inputs go wrong then, and where from on.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "support/generators.h"

namespace dccd {
namespace test {

/// What a check looks at: some numbers, and which variant of it they belong to (kind of pair, say).
struct MarginInput {
  int variant = 0;
  std::vector<double> x;
};

/// Whether the answer is wrong, by the margins in force when it is called.
using IsWrong = std::function<bool()>;

struct MarginCheck {
  std::string margin;                                       ///< its name in tolerances.h
  std::function<MarginInput(RandomSource&)> make;           ///< an input that aims at the bound
  std::function<void(MarginInput&, RandomSource&)> change;  ///< to one beside it, for searching
  std::function<IsWrong(const MarginInput&)> judge;         ///< decides the truth once
  int inputs = 1000;                                        ///< made in each test
  double held_at = 0.1;  ///< the part of the margin at which an input goes wrong; where it is less, checks say why
};

const std::vector<MarginCheck>& marginChecks();

}  // namespace test
}  // namespace dccd
