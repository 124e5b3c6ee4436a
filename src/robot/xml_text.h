// What the readers of URDF and SRDF share.
#pragma once

#include <string>

#include <tinyxml2.h>

namespace dccd {

/// The <robot> of the text. Throws RobotTextError with what is wrong, and the line.
tinyxml2::XMLElement& parseRobotXml(const std::string& text, tinyxml2::XMLDocument& document);
/// An attribute; empty where there is none.
std::string textOf(const tinyxml2::XMLElement& element, const char* attribute);
/// The same; throws RobotTextError where there is none or an empty one.
std::string neededText(const tinyxml2::XMLElement& element, const char* attribute);
/// "<group> of line 12".
std::string placeOf(const tinyxml2::XMLElement& element);

}  // namespace dccd
