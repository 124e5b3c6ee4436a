// Pieces of a recording that `rosbag record --split` cut: /tf_static and latched maps are in the first one alone.
#pragma once

#include <string>
#include <vector>

#include "node/bag_reading.h"

namespace dccd {

/// Pieces of one run together, first piece first; each other bag alone. By names, and by the times in their indices.
/// Groups are in the order in which their first bag was given.
std::vector<std::vector<std::string>> groupedByRun(const std::vector<std::string>& bags);

/// What is missing of the recordings that these bags are pieces of, a sentence each. `lacks_something`: transforms or a
/// map; then a name alone is enough to ask for the pieces before it.
std::vector<std::string> missingPieces(const std::vector<std::string>& bags, bool lacks_something);

/// Long pauses between bags, a sentence each. Throws std::runtime_error where two bags have one of the topics at the
/// same time: of meshes that overlap nobody could tell which frame is where.
std::vector<std::string> pausesOfOneRun(const OpenBags& bags, const std::vector<std::string>& mesh_topics);

}  // namespace dccd
