// `fast`, a rival of the elementary test: the batched kernel of `exact` without its bounds. Floating point all the way:
// an answer near a tie may be wrong either way, and the TOC is approximate.
#pragma once

#include <memory>

#include "dccd/elementary.h"

namespace dccd {

/// Vertex against face and edge against edge, without a separation: run() throws std::invalid_argument for all else.
std::unique_ptr<Rung> makeFastRival();

}  // namespace dccd
