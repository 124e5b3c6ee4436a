// What may be said of the moment: what was shown, what was not, and whether anything touches (doc/guarantees.md).
#pragma once

#include <string>
#include <vector>

#include "dccd/export.h"
#include "dccd/outcome.h"

namespace dccd {

struct Assurance {
  bool proved = false;                 ///< all of the list was shown: what does not touch is known not to
  Touching touching = Touching::NONE;  ///< as far as known, where it is not proved
  std::vector<std::string> missing;    ///< what of the list was not shown, a sentence each; empty exactly when proved
  std::vector<std::string> excluded;   ///< what was left out by choice, a sentence each; takes nothing from `proved`
  std::vector<std::string> expected;   ///< which contacts are expected, a sentence each; nor does this

  /// What stands in the way besides; none changes nothing.
  DCCD_EXPORT void hinder(const std::vector<std::string>& faults);
  /// What simple clients ask for. An expected contact is a contact: where one is no reason to stop, ask for
  /// `touching` NONE or EXPECTED.
  bool clear() const { return proved && touching == Touching::NONE; }
};

/// The one place where a proof is judged: what the step itself had to show (Outcome::claim), that it has an answer at
/// all, and what else stands in the way now (`faults`: a frame without an answer, a publisher that fell silent, a reset
/// ...; a sentence each).
DCCD_EXPORT Assurance assuranceOf(const Outcome& outcome, const std::vector<std::string>& faults = {});

/// One line for people: "proved, nothing touches", "proved, what touches lasts", "not proved: ...; ...".
/// `touches` says, where something does, who whom and where.
DCCD_EXPORT std::string describe(const Assurance& assurance, const std::string& touches = {});

}  // namespace dccd
