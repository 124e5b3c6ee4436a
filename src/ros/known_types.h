// Whether a connection's type is the one whose layout the readers know: name and md5.
#pragma once

#include <string>

namespace deformable_ccd {

/// Empty when messages of this type can be read; else one sentence.
std::string meshTypeProblem(const std::string& datatype, const std::string& md5);
std::string mapTypeProblem(const std::string& datatype, const std::string& md5);

}  // namespace deformable_ccd
