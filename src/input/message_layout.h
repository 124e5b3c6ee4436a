// How messages lie on the wire, by the text of their definition, which publishers and bags carry along.
#pragma once

#include <string>

namespace dccd {

/// The first field in which the two definitions of `datatype` differ, in words; empty: both have the same bytes.
/// Constants and comments, which change a definition's md5, are no bytes.
std::string layoutDifference(const std::string& datatype, const std::string& definition, const std::string& known);

}  // namespace dccd
