// The detector's answer for a whole step, judged by the oracle. Free of any test framework: the property tests and the
// fuzz target share it.
#pragma once

#include <string>

#include "support/step_truth.h"

namespace dccd {
namespace test {

/// Runs the step with the exact rung, clustered and by brute force, on every SIMD target, and compares contacts, cells
/// of time and start state with the truth. What is wrong, in words; empty where nothing is.
std::string judgeStep(const TestStep& step);

/// Runs the steps one after the other, each continuing the one before, with a detector that carries the start state
/// over and one that never does. What differs, or contradicts "CLEAR and no contact ends CLEAR"; else empty.
/// steps[i + 1] must begin where steps[i] ends.
std::string judgeSequence(const std::vector<TestStep>& steps, int& carried_tests, int& full_tests);

}  // namespace test
}  // namespace dccd
