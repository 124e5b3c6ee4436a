// Every pair of features tested, none looked for: what the search for pairs is held against.
#pragma once

#include "step/history.h"

namespace dccd {
namespace test {

inline Outcome bruteForce(const Step& step, Options options) {
  options.unfolded_test = false;  // nothing is left out
  History history;
  History::Impl::of(history).pairs.testAll();
  return detect(step, options, history);
}

}  // namespace test
}  // namespace dccd
