// Why a frame does not continue the one before it, for people.
#pragma once

#include <string>

#include "dccd/mesh_store.h"

namespace dccd {

/// One sentence with the figures that decided, for what MeshStore::push said of `after`; empty for OK and FIRST_FRAME.
std::string seamReason(StepStatus status, const MeshFrame& before, const MeshFrame& after,
                       const MeshStoreOptions& options);

}  // namespace dccd
