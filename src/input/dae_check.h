// What assimp does not look at in a DAE: it takes the first of two things of one name, reads on behind the end of a
// list of numbers, makes 0 of a negative index, and goes on without a geometry that it does not find.
#pragma once

#include <string>

namespace dccd {

/// Why the text says something else than assimp would read; empty: it does not.
std::string daeProblem(const std::string& text);

}  // namespace dccd
