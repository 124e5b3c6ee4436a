#include "robot/urdf_text.h"

#include <mutex>

#include <console_bridge/console.h>
#include <tinyxml2.h>
#include <urdf_parser/urdf_parser.h>

#include "robot/xml_text.h"

namespace dccd {
namespace {

using tinyxml2::XMLElement;

/// What urdfdom says of its errors while this lives, instead of the console. One at a time: the handler is the
/// process's.
class HeardErrors : public console_bridge::OutputHandler {
 public:
  HeardErrors() : lock_(mutex()), before_(console_bridge::getOutputHandler()) {
    console_bridge::useOutputHandler(this);
  }
  ~HeardErrors() override { console_bridge::useOutputHandler(before_); }
  HeardErrors(const HeardErrors&) = delete;
  HeardErrors& operator=(const HeardErrors&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR) said_ += (said_.empty() ? "" : "; ") + text;
  }
  const std::string& said() const { return said_; }

 private:
  static std::mutex& mutex() {
    static std::mutex one;
    return one;
  }
  std::lock_guard<std::mutex> lock_;
  console_bridge::OutputHandler* before_;
  std::string said_;
};

/// The shapes where no URDF has one, as in a <Link>: nobody would read them. Simulators have shapes of their own, and
/// what a controller holds against each other is none of a link's surface. `owner`: the link in which they stand.
void listUnread(const XMLElement& at, const XMLElement& robot, std::string owner, UrdfText& urdf) {
  const std::string name = at.Name();
  if (name == "link" && at.Parent() == &robot) owner = textOf(at, "name");
  const XMLElement* link = at.Parent()->ToElement();
  const bool of_link = (name == "collision" || name == "visual") && link && std::string(link->Name()) == "link" &&
                       link->Parent() == &robot;
  for (const XMLElement* child = at.FirstChildElement(); child; child = child->NextSiblingElement()) {
    const std::string tag = child->Name();
    if (tag == "geometry" && !of_link) {
      urdf.unread.emplace_back(owner, "a <geometry> in " + placeOf(at) + ", where no URDF has one");
    } else if (tag != "gazebo" && tag != "self_collision_checking") {
      listUnread(*child, robot, owner, urdf);
    }
  }
}

/// What others say of a shape, as <drake:declare_convex/> does: an element of a namespace, with nothing in it.
bool isMark(const XMLElement& element) {
  return std::string(element.Name()).find(':') != std::string::npos && !element.FirstAttribute() &&
         element.NoChildren();
}

void dropMarks(XMLElement& collision) {
  XMLElement* geometry = collision.FirstChildElement("geometry");
  for (XMLElement *shape = geometry ? geometry->FirstChildElement() : nullptr, *next = nullptr; shape; shape = next) {
    next = shape->NextSiblingElement();
    if (isMark(*shape)) geometry->DeleteChild(shape);
  }
}

/// What is wrong with a collision element; empty: urdfdom knows it.
std::string problemOf(const XMLElement& collision) {
  for (const char* const single : {"origin", "geometry"}) {
    const XMLElement* first = collision.FirstChildElement(single);
    if (first && first->NextSiblingElement(single)) return std::string("has more than one <") + single + ">";
  }
  if (collision.FirstChildElement("pose")) {
    return "has a <pose>, which is a word of SDF that URDF readers pass over; write <origin>";
  }
  const XMLElement* origin = collision.FirstChildElement("origin");
  if (origin && origin->Attribute("quat_xyzw")) {
    return "has an origin with quat_xyzw, which URDF readers before urdfdom 5.1 pass over; write rpy";
  }
  const XMLElement* geometry = collision.FirstChildElement("geometry");
  const XMLElement* shape = geometry ? geometry->FirstChildElement() : nullptr;
  if (!shape) return "has no geometry";
  if (shape->NextSiblingElement()) return "has more than one shape; write a collision element for each";
  const std::string name = shape->Name();
  for (const char* known : {"box", "cylinder", "sphere", "mesh"}) {
    if (name == known) return "";
  }
  if (name == "capsule") {
    return "is a capsule, which URDF readers before urdfdom 5.1 do not know; write a cylinder and two spheres";
  }
  return "is <" + name + ">, which is no geometry; write box, cylinder, sphere or mesh";
}

/// Of a link that has no collision element its visuals become that: they have the same origin and geometry.
void takeVisuals(XMLElement& link) {
  if (link.FirstChildElement("collision")) return;
  while (XMLElement* visual = link.FirstChildElement("visual")) visual->SetName("collision");
}

/// Returns how many collision elements urdfdom is to read.
std::size_t reduceLink(XMLElement& link, UrdfText& urdf) {
  const std::string name = neededText(link, "name");
  bool seen = false;
  std::size_t number = 0, kept = 0;
  for (XMLElement *child = link.FirstChildElement(), *next = nullptr; child; child = next) {
    next = child->NextSiblingElement();
    const std::string tag = child->Name();
    seen = seen || tag == "visual";
    if (tag == "collision") dropMarks(*child);
    const std::string problem = tag == "collision" ? problemOf(*child) : "";
    if (tag == "collision") ++number;
    if (tag == "collision" && problem.empty()) ++kept;
    if (!problem.empty()) {
      urdf.refused[name].push_back("its collision element " + std::to_string(number) + " (line " +
                                   std::to_string(child->GetLineNum()) + ") " + problem);
    }
    if (tag != "collision" || !problem.empty()) link.DeleteChild(child);
  }
  urdf.collisions[name] = number;
  if (seen && number == 0) urdf.visual_only.insert(name);
  return kept;
}

/// How it moves is tf's matter; which links it joins is told of by groups.
void reduceJoint(XMLElement& joint) {
  neededText(joint, "name");
  joint.SetAttribute("type", "fixed");
  for (XMLElement *child = joint.FirstChildElement(), *next = nullptr; child; child = next) {
    next = child->NextSiblingElement();
    const std::string tag = child->Name();
    if (tag != "parent" && tag != "child") joint.DeleteChild(child);
  }
}

urdf::ModelInterfaceSharedPtr modelOf(const tinyxml2::XMLDocument& document, const HeardErrors& errors) {
  tinyxml2::XMLPrinter printer(nullptr, true);
  document.Print(&printer);
  urdf::ModelInterfaceSharedPtr model;
  try {
    model = urdf::parseURDF(printer.CStr());
  } catch (const std::exception& error) {
    throw RobotTextError(error.what());
  }
  if (!model) throw RobotTextError(errors.said().empty() ? "the URDF reader refuses it" : errors.said());
  return model;
}

}  // namespace

urdf::ModelInterfaceSharedPtr parseJoints(const std::string& text) {
  tinyxml2::XMLDocument document;
  XMLElement& robot = parseRobotXml(text, document);
  for (XMLElement *child = robot.FirstChildElement(), *next = nullptr; child; child = next) {
    next = child->NextSiblingElement();
    const std::string tag = child->Name();
    if (tag == "link") {
      child->DeleteChildren();
    } else if (tag != "joint") {
      robot.DeleteChild(child);
    }
  }
  const HeardErrors errors;
  return modelOf(document, errors);
}

UrdfText parseUrdf(const std::string& text, bool visuals) {
  UrdfText urdf;
  tinyxml2::XMLDocument document;
  XMLElement& robot = parseRobotXml(text, document);
  listUnread(robot, robot, "", urdf);
  std::map<std::string, std::size_t> elements;  // of each link
  for (XMLElement *child = robot.FirstChildElement(), *next = nullptr; child; child = next) {
    next = child->NextSiblingElement();
    const std::string tag = child->Name();
    if (tag == "link") {
      if (visuals) takeVisuals(*child);
      elements[textOf(*child, "name")] = reduceLink(*child, urdf);
    } else if (tag == "joint") {
      reduceJoint(*child);
    } else {
      robot.DeleteChild(child);
    }
  }
  const HeardErrors errors;
  urdf.model = modelOf(document, errors);
  // Of a link it drops an element that it cannot read, and all that follow, and goes on.
  for (const auto& [name, link] : urdf.model->links_) {
    if (link->collision_array.size() == elements[name]) continue;
    urdf.refused[name].push_back("of its " + std::to_string(elements[name]) + " collision elements " +
                                 std::to_string(link->collision_array.size()) + " could be read: " + errors.said());
  }
  return urdf;
}

}  // namespace dccd
