// What to do about what went wrong, for the log and for diagnostics. The outcome's own reason says what happened.
#pragma once

#include <string>

#include "dccd/mesh_store.h"
#include "input/mesh_decoder.h"

namespace dccd {

/// One clause; empty when the reason already says all. `map_source` is the octomap's resolved topic or file.
std::string adviceFor(StepStatus status, const std::string& reason, const std::string& map_source);

/// What looks like a mistake though the message is valid: a mesh too large for metres, a grid whose rows and columns
/// are swapped, no stamp. Empty: nothing does. Linear in the number of points; meant for the first frame of a topology.
std::string meshHint(const DecodedMesh& mesh, const MeshInputConfig& config);

/// The same of a rigid body's mesh file: positions [m] after `scale`.
std::string rigidHint(const std::string& file, const Positions& positions, double scale);

/// Two clauses as one; either may be empty.
std::string joined(const std::string& a, const std::string& b);

}  // namespace dccd
