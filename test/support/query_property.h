// Properties of hard pairs, checked by RapidCheck; a failure shrinks to a query file that run_queries can replay.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "oracle/query_file.h"

namespace dccd {
namespace test {

/// Whether the long run is asked for: the environment variable DEFORMABLE_CCD_LONG is set and not 0.
bool longRun();

/// Where the random numbers of a property begin: fixed, or the environment variable DEFORMABLE_CCD_SEED.
std::uint64_t propertySeed();

/// What a property says of a pair: empty where it holds, else what is wrong.
using QueryProperty = std::function<std::string(const Query&)>;

/// Checks the property on so many hard pairs; records a gtest failure that names the replay file, the simplest pair
/// found and the seed. An exception counts as a failure of the property.
void checkHardQueries(const std::string& name, int queries, const QueryProperty& property);

/// Writes the pair, with the oracle's verdict as its truth, where run_queries finds it:
/// TMP/deformable_ccd_failures/NAME/{vertex-face,edge-edge}/0.csv. Returns the folder to give to run_queries.
std::string writeReplayFile(const std::string& name, Query query);

}  // namespace test
}  // namespace dccd
