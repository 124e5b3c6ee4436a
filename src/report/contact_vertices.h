// The mesh vertices of a contact, each with its body.
#pragma once

#include "dccd/outcome.h"

namespace dccd {

/// Calls visit(body, vertex) for every vertex of the features that touch; of the map's features there are none.
template <class Visit>
void forContactVertices(const Contact& contact, Visit visit) {
  for (std::size_t i = 0; i < 4 && contact.vertex[i] != NO_INDEX; ++i) visit(contact.bodyOf(i), contact.vertex[i]);
}

}  // namespace dccd
