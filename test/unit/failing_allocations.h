// Attempts in which one allocation fails, one after the other.
#pragma once

#include <gtest/gtest.h>

#include <new>

#include "unit/allocations.h"

namespace dccd {
namespace test {

/// Attempts it with the allocation after `n` more failing. Whether it needs so many.
template <class Attempt>
bool failsAt(int n, bool lasts, const Attempt& attempt) {
  const AllocationFailure failure(n, lasts);
  try {
    attempt();
  } catch (const std::bad_alloc&) {  // not even that something failed could be told
  }
  return failure.met();
}

/// act(0), act(1) and so on, as long as it needs so many allocations. Returns how many there were.
template <class Act>
int failingEverywhere(const Act& act) {
  for (int n = 0;; ++n) {
    if (!act(n)) return n;
    if (testing::Test::HasFailure()) {
      ADD_FAILURE() << "allocation " << n;
      return n;
    }
  }
}

}  // namespace test
}  // namespace dccd
