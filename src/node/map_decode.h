// What all maps have in common, wherever their leaves come from.
#pragma once

#include <functional>
#include <string>

#include "input/mesh_views.h"
#include "node/map_memory.h"
#include "node/monitor_pipeline.h"

namespace dccd {

/// The frame that a header names, without a leading slash. Throws WireError for what is no frame's name.
std::string frameNameOf(const HeaderView& header);

/// The surface of what `decode` makes of the limits. Never throws: what that throws becomes LoadedMap::problem.
/// `memory`: what it must fit in; null: no limit but that of the message. `before`: the surface of an older map, from
/// which it is made faster; null: none.
void loadMap(const MonitorConfig& config, const MapMemory* memory, const VoxelSurface* before, LoadedMap& map,
             const std::function<DecodedOctomap(const OctomapLimits&)>& decode);

}  // namespace dccd
