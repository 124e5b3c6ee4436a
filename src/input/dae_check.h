// What assimp does not look at in a DAE: it takes the first of two things of one name, reads on behind the end of a
// list of numbers, makes 0 of a negative index, goes on without a geometry that it does not find, stretches what turns
// about an axis that is not of length 1, and leaves skins where they were before their bones were bound.
#pragma once

#include <string>

namespace dccd {

/// Why the text says something else than assimp would read; empty: it does not.
std::string daeProblem(const std::string& text);

}  // namespace dccd
