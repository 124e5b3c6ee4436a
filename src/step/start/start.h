// What meets, or is inside of something, where a step begins: when it is looked for, for how long, and what is kept of
// it.
#pragma once

#include <vector>

#include "culling/unfolded.h"
#include "dccd/outcome.h"

namespace dccd {

struct Carried;
struct Part;
class Looked;

/// Crossings at t=0 will be looked for among all pairs, those of a body with itself included.
bool searchesStart(const Part& part, const Carried& carried);
/// After the contacts: of a budget too small for both they come first. all_known: no other pair of meshes touches in
/// the part. map_is_whole: all that crosses the map when it begins is known. The state is CLEAR from here on alone.
void findStartState(const Part& part, bool all_known, bool map_is_whole, const std::vector<Unfolded>& unfolded,
                    Carried& carried, Looked& looked, Findings& result);

}  // namespace dccd
