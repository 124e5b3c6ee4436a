// The mesh vertices of a contact, each with its body.
#pragma once

#include "dccd/outcome.h"

namespace dccd {

/// Calls visit(body, vertex) for every vertex of the features that touch; of the map's features there are none.
template <class Visit>
void forContactVertices(const Contact& contact, Visit visit) {
  const int first = contact.kind == PairKind::VERTEX_FACE ? 1 : 2;
  for (int i = 0; i < 4 && contact.vertex[i] != NO_INDEX; ++i) {
    visit(contact.body[contact.body[1] == OBSTACLE_BODY || i < first ? 0 : 1], contact.vertex[i]);
  }
}

}  // namespace dccd
