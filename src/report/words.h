// Bodies and contacts in words, for the tables of the report, and the vertices of a contact.
#pragma once

#include <string>
#include <vector>

#include "dccd/body.h"
#include "dccd/contact.h"
#include "dccd/outcome.h"

namespace dccd {

/// The body's name; "octomap" for the map.
std::string bodyName(std::uint16_t body, const std::vector<Body>& bodies);
/// A field of a table of comma-separated values: one that holds commas, quotes or line ends is quoted (RFC 4180).
std::string csvField(const std::string& text);
/// Calls visit(body, vertex) for every vertex of the features that touch; of the map's features there are none.
template <class Visit>
void forContactVertices(const Contact& contact, Visit visit) {
  for (std::size_t i = 0; i < 4 && contact.vertex[i] != NO_INDEX; ++i) visit(contact.bodyOf(i), contact.vertex[i]);
}
/// Which bodies lie inside of others when the step begins, and how large those are: no contact tells of them. "rope
/// lies inside of box, which is 400 m across: ...". Empty: none does.
std::string insideInWords(const Outcome& outcome);
/// "towel meets octomap (vertex against voxel face, vertex 12, certain)".
std::string contactInWords(const Contact& contact, const std::vector<Body>& bodies);

}  // namespace dccd
