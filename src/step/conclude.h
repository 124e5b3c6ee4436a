// From what the parts of a step say to what is said of the step.
#pragma once

#include <string>
#include <vector>

#include "dccd/detect.h"

namespace dccd {

/// toc of part i of n as a fraction of the whole step, not later.
double scaleDown(double toc, std::size_t i, std::size_t n);
double scaleUp(double toc, std::size_t i, std::size_t n);

/// A limit of what may be found, or else the deadline, left out what does not touch before toc.
void leaveOut(double toc, bool by_limit, Findings& found);
/// Appends a part's contacts, the start state of the first one, what nobody looked at, the statistics.
void addPart(std::size_t part, std::size_t parts, const std::vector<Gap>& gaps, Findings& result, Outcome& outcome);
/// Contacts of several parts into canonical order, a pair once.
void joinParts(std::vector<Contact>& contacts);
/// What of the raw contacts is reported, and what the step may be called.
void conclude(const Options& options, const Step& step, std::size_t needed_parts, Outcome& outcome);

/// Vertices that were sent but belong to no face and no edge, except masked ones, and those that are all through the
/// step where one that is looked at is. Beside a rigid body's surface, as mesh files may have them, they do not matter.
std::uint64_t looseVertices(const Body& body);

/// Throws std::invalid_argument unless the rung can hold a distance; `what` asks for one.
void checkHoldsDistance(const Options& options, const std::string& what);

}  // namespace dccd
