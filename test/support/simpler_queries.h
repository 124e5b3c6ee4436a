// Pairs that are easier to read, for shrinking one that breaks a property.
#pragma once

#include <vector>

#include "oracle/query_file.h"

namespace dccd {
namespace test {

/// Simpler pairs in the order to try: points at rest or at the origin, fewer digits, coordinates of zero.
std::vector<Query> simplerQueries(const Query& query);

}  // namespace test
}  // namespace dccd
