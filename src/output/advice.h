// What to do about what went wrong, for the log and for diagnostics. The outcome's own reason says what happened.
#pragma once

#include <string>

#include "dccd/mesh_store.h"
#include "input/mesh_decoder.h"

namespace dccd {

/// One clause; empty when the reason already says all. `map_source` is the octomap's resolved topic or file.
std::string adviceFor(StepStatus status, const std::string& reason, const std::string& map_source);

/// Why the mesh may not be what it is taken for, so that a proof would be about something else: it is too large for
/// metres, its rows and columns look swapped, or its points shuffled. Empty: nothing says so. Linear in the number of
/// points; meant for the first frame of a topology.
std::string meshDoubt(const DecodedMesh& mesh, const MeshInputConfig& config);

/// What else looks like a mistake though the message is valid: no stamp, markers that are not read. Empty: nothing
/// does.
std::string meshHint(const DecodedMesh& mesh);

/// The doubt of a rigid body's mesh file: positions [m] after `scale`.
std::string rigidDoubt(const std::string& file, const Positions& positions, double scale);

/// Two clauses as one; either may be empty.
std::string joined(const std::string& a, const std::string& b);

}  // namespace dccd
