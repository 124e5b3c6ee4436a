// Inputs that search has found for margins: test/margins/witnesses.txt.
#pragma once

#include <string>
#include <vector>

#include "support/margin_checks.h"

namespace dccd {
namespace test {

/// Inputs found by search that go wrong when a margin is cut: test/margins/witnesses.txt. A line is the margin's name,
/// the variant and the numbers in hexadecimal.
std::vector<MarginInput> marginWitnesses(const std::string& margin);

/// A line of that file.
std::string witnessLine(const std::string& margin, const MarginInput& input);

}  // namespace test
}  // namespace dccd
