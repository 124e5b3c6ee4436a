// Positions out of numpy's files.
#pragma once

#include <string>
#include <vector>

#include "input/mesh_file.h"

namespace dccd {

/// The frames of an .npy of `frames x n x 3` numbers, or the one of `n x 3`: float32 or float64 of either byte order,
/// in C's or Fortran's order. A number that is not finite stays so. Throws MeshFileError naming the file and what is
/// wrong with it.
std::vector<Positions> loadNpyFrames(const std::string& path);

}  // namespace dccd
