// Bodies and contacts in words, for the tables of the report.
#pragma once

#include <string>
#include <vector>

#include "dccd/body.h"
#include "dccd/contact.h"

namespace dccd {

/// The body's name; "octomap" for the map.
std::string bodyName(std::uint16_t body, const std::vector<Body>& bodies);
/// A field of a table of comma-separated values: one that holds commas, quotes or line ends is quoted (RFC 4180).
std::string csvField(const std::string& text);
/// How many of the contact's vertices are set.
int meshPoints(const Contact& contact);
/// "towel meets octomap (vertex against voxel face, vertex 12, certain)".
std::string contactInWords(const Contact& contact, const std::vector<Body>& bodies);

}  // namespace dccd
