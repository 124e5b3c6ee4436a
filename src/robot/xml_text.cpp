#include "robot/xml_text.h"

#include <cstring>

#include "robot/urdf_text.h"

namespace dccd {
namespace {

/// What waits for xacro says nothing yet, and would be passed over with all that is in it.
void requireExpanded(const tinyxml2::XMLElement& element) {
  if (std::strncmp(element.Name(), "xacro:", 6) == 0) {
    throw RobotTextError("has " + placeOf(element) + ", so that xacro has not expanded it yet");
  }
  for (auto* child = element.FirstChildElement(); child; child = child->NextSiblingElement()) requireExpanded(*child);
}

}  // namespace

tinyxml2::XMLElement& parseRobotXml(const std::string& text, tinyxml2::XMLDocument& document) {
  document.Parse(text.data(), text.size());
  if (document.Error()) {
    throw RobotTextError("is no XML: " + std::string(tinyxml2::XMLDocument::ErrorIDToName(document.ErrorID())) +
                         " in line " + std::to_string(document.ErrorLineNum()));
  }
  tinyxml2::XMLElement* root = document.RootElement();
  if (!root) throw RobotTextError("holds no XML element");
  if (std::string(root->Name()) != "robot") {
    throw RobotTextError("begins with " + placeOf(*root) + ", where <robot> is needed");
  }
  if (const tinyxml2::XMLElement* second = root->NextSiblingElement()) {
    throw RobotTextError("goes on with " + placeOf(*second) + " behind the end of <robot>");
  }
  requireExpanded(*root);
  return *root;
}

std::string textOf(const tinyxml2::XMLElement& element, const char* attribute) {
  const char* text = element.Attribute(attribute);
  return text ? text : "";
}

std::string neededText(const tinyxml2::XMLElement& element, const char* attribute) {
  const std::string text = textOf(element, attribute);
  if (text.empty()) throw RobotTextError(placeOf(element) + " needs the attribute " + attribute);
  return text;
}

std::string placeOf(const tinyxml2::XMLElement& element) {
  return "<" + std::string(element.Name()) + "> of line " + std::to_string(element.GetLineNum());
}

}  // namespace dccd
