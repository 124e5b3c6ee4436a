// The members of a contact and of a patch, a row each: tables (CSV), recordings, messages and numpy's arrays follow
// from the rows. A member without a row does not build.
#pragma once

#include <cstddef>
#include <type_traits>
#include <utility>

#include "dccd/contact.h"
#include "dccd/patch.h"

namespace dccd {

/// FIELD(member, what the message calls it), in the order of a recording.
#define DCCD_CONTACT_FIELDS(FIELD) \
  FIELD(kind, kind)                \
  FIELD(toc_lower, toc_lower)      \
  FIELD(toc_upper, toc_upper)      \
  FIELD(vertex, vertex)            \
  FIELD(body, body)                \
  FIELD(voxel, voxel_key)          \
  FIELD(voxel_size, voxel_size)    \
  FIELD(certainty, certainty)      \
  FIELD(initial, initial)          \
  FIELD(leaving, leaving)          \
  FIELD(expected, expected)

/// RECORDED: in recordings alone. STREAM: not in recordings, which are of one step.
#define DCCD_PATCH_FIELDS(FIELD, RECORDED, STREAM) \
  FIELD(body, bodies)                              \
  FIELD(contacts, contacts)                        \
  FIELD(certain, certain)                          \
  FIELD(initial, initial)                          \
  FIELD(crossings, crossings)                      \
  FIELD(expected, expected)                        \
  FIELD(toc_lower, toc_lower)                      \
  FIELD(toc_upper, toc_upper)                      \
  RECORDED(earliest, )                             \
  FIELD(area_m2, area)                             \
  FIELD(centroid, centroid)                        \
  FIELD(normal, normal)                            \
  FIELD(box, box_min)                              \
  STREAM(id, id)                                   \
  STREAM(beginning, beginning)                     \
  STREAM(began_from_ns, began_from)                \
  STREAM(began_to_ns, began_to)                    \
  STREAM(is_new, is_new)

#define DCCD_NO_FIELD(member, published)
/// Those that tables, messages and arrays have.
#define DCCD_PUBLISHED_PATCH_FIELDS(FIELD) DCCD_PATCH_FIELDS(FIELD, DCCD_NO_FIELD, FIELD)

namespace fields {

struct Anything {
  template <class T>
  operator T() const;
};
template <class T, class Places, class = void>
struct TakesSoMany : std::false_type {};
template <class T, std::size_t... PLACE>
struct TakesSoMany<T, std::index_sequence<PLACE...>, std::void_t<decltype(T{(void(PLACE), Anything())...})>>
    : std::true_type {};
/// Does an aggregate have so many members, and no more?
template <class T, std::size_t COUNT>
constexpr bool hasMembers() {
  return TakesSoMany<T, std::make_index_sequence<COUNT>>() && !TakesSoMany<T, std::make_index_sequence<COUNT + 1>>();
}

#define DCCD_COUNT_FIELD(member, published) +1
static_assert(hasMembers<Contact, DCCD_CONTACT_FIELDS(DCCD_COUNT_FIELD)>(), "each member of a contact has a row");
static_assert(hasMembers<Patch, DCCD_PATCH_FIELDS(DCCD_COUNT_FIELD, DCCD_COUNT_FIELD, DCCD_COUNT_FIELD)>(),
              "each member of a patch has a row");
#undef DCCD_COUNT_FIELD

}  // namespace fields
}  // namespace dccd
