// Patches: which contacts of a step belong together, and which of them last from step to step (doc/algorithm.md,
// "Patches").
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "dccd/contact.h"
#include "dccd/export.h"
#include "dccd/types.h"

namespace dccd {

constexpr std::uint32_t NO_PATCH = std::numeric_limits<std::uint32_t>::max();
constexpr StampNs UNKNOWN_NS = std::numeric_limits<StampNs>::min();  ///< nobody knows when

/// How a patch came to be.
enum class PatchBeginning : std::uint8_t {
  NEW = 0,          ///< its first touch was in a step
  INITIAL = 1,      ///< it touched already when it was first looked at: when it began is not known
  MAP_CHANGED = 2,  ///< so it did, at a voxel that the map before did not have
};
DCCD_EXPORT const char* toString(PatchBeginning beginning);

/// All contacts, and edges through faces at t=0 (`crossings`), between the same two areas of two partners
/// (doc/algorithm.md, "Patches"). Of all that a step finds: also what max_contacts and suppress_initial keep out of the
/// list.
struct Patch {
  std::array<std::uint16_t, 2> body{0, 0};  ///< ascending; equal: with itself; [1] may be OBSTACLE_BODY
  std::size_t contacts = 0, certain = 0, initial = 0;
  std::size_t crossings = 0;
  std::size_t expected = 0;  ///< of its contacts and crossings, those that are expected (dccd/step.h)
  /// [0,1] of the step: the first touch of any of its contacts is in between, if any of them is certain. 0 and 0 where
  /// surfaces cross already.
  double toc_lower = 1, toc_upper = 1;
  /// Smallest toc_lower of those that are not expected or, where all are, of all; of equal ones the first in canonical
  /// order. Unset without contacts.
  Contact earliest;
  double area_m2 = 0;  ///< [m^2] of the side that has less; 0 with a rope
  Vec3 centroid =
      Vec3::Zero();  ///< [m] mean of the points of contact, fixed frame; of the crossings where nothing else touches
  Vec3 normal = Vec3::Zero();  ///< unit, mean at the step's start, from body[1] to body[0]; 0 where there is none
  Box box;                     ///< [m] of the same points

  // In a stream (dccd/stream.h). Patches that came apart less than patch_gap_s ago have the same.
  std::uint64_t id = 0;  ///< lasts from step to step; 0: none (of no stream; of a prediction: it would be a new one)
  PatchBeginning beginning = PatchBeginning::NEW;
  /// It began between these. from UNKNOWN_NS: before `to`, nobody knows when.
  StampNs began_from_ns = UNKNOWN_NS, began_to_ns = UNKNOWN_NS;
  /// It is an alarm. Something of it that is not expected touches in this step, or in this prediction, and nothing such
  /// did before: it began in it, or what touches was expected until now.
  bool is_new = false;

  bool isExpected() const { return expected == contacts + crossings; }
};

enum class PatchEventKind : std::uint8_t {
  BEGAN = 0,
  ENDED = 1,       ///< told when patch_gap_s is over
  SPLIT = 2,       ///< its parts have been apart for patch_gap_s; the largest keeps the identity
  MERGED = 3,      ///< the oldest identity stays
  UNEXPECTED = 4,  ///< all of it was expected, and now something is not; also where another phase expects less
};
DCCD_EXPORT const char* toString(PatchEventKind kind);

struct PatchEvent {
  PatchEventKind kind = PatchEventKind::BEGAN;
  std::uint64_t id = 0;
  std::vector<std::uint64_t> others;        ///< SPLIT: of the parts that came off; MERGED: that are part of it now
  std::array<std::uint16_t, 2> body{0, 0};  ///< as in Patch
  PatchBeginning beginning = PatchBeginning::NEW;  ///< of the patch `id`
  bool expected = false;                           ///< all of it was, as long as it lasted or until now
  /// Between which times it was. BEGAN, but not NEW: from is UNKNOWN_NS, at `to` it was there. ENDED by a seam: to is
  /// UNKNOWN_NS, at `from` it was still there.
  StampNs from_ns = UNKNOWN_NS, to_ns = UNKNOWN_NS;
  std::uint32_t patch = NO_PATCH;  ///< the first of Outcome::patches with this id; NO_PATCH: it does not touch
};

}  // namespace dccd
