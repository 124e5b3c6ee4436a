#include "robot/srdf_text.h"

#include <algorithm>
#include <set>

#include "robot/urdf_text.h"
#include "robot/xml_text.h"

namespace dccd {
namespace {

using tinyxml2::XMLElement;

constexpr std::size_t MOST_NESTED = 64;

class SrdfReader {
 public:
  SrdfReader(const XMLElement& robot, const urdf::ModelInterface& model) : robot_(robot), model_(model) {}

  SrdfText read() {
    forEach(robot_, "group", [&](const XMLElement& group) {
      if (elements_.try_emplace(neededText(group, "name"), &group).second) return;
      throw RobotTextError(placeOf(group) + " is named '" + textOf(group, "name") + "', as one before it is");
    });
    for (const auto& [name, element] : elements_) linksOf(name, *element);
    forEach(robot_, "end_effector", [&](const XMLElement& end) {
      const std::string name = neededText(end, "name");
      srdf_.groups.emplace(name, linksOf(neededText(end, "group"), end));
    });
    readCollisions();
    return std::move(srdf_);
  }

 private:
  const XMLElement& robot_;
  const urdf::ModelInterface& model_;
  std::map<std::string, const XMLElement*> elements_;
  std::set<std::string> open_;  // groups that are being read
  SrdfText srdf_;

  template <typename Take>
  static void forEach(const XMLElement& parent, const char* tag, Take take) {
    for (const XMLElement* one = parent.FirstChildElement(tag); one; one = one->NextSiblingElement(tag)) take(*one);
  }

  /// As MoveIt takes them: defaults of links, then pairs that meet all the same, and then those that never do.
  void readCollisions() {
    std::set<std::pair<std::string, std::string>> never;
    forEach(robot_, "disable_default_collisions", [&](const XMLElement& one) {
      const std::string name = neededText(one, "link");
      if (!isLink(name, one)) return;
      for (const auto& other : model_.links_) {
        if (other.first != name) never.insert(std::minmax(name, other.first));
      }
    });
    for (const char* tag : {"enable_collisions", "disable_collisions"}) {
      forEach(robot_, tag, [&](const XMLElement& pair) {
        const std::string first = neededText(pair, "link1"), second = neededText(pair, "link2");
        if (!isLink(first, pair) || !isLink(second, pair)) return;
        if (*tag == 'd') never.insert(std::minmax(first, second));
        if (*tag == 'e') never.erase(std::minmax(first, second));
      });
    }
    srdf_.never_meet.assign(never.begin(), never.end());
  }

  void leaveOut(const XMLElement& element, const std::string& what, const std::string& name) {
    srdf_.hints.push_back(placeOf(element) + " names the " + what + " '" + name +
                          "', which the robot does not have; it is left out");
  }

  bool isLink(const std::string& name, const XMLElement& element) {
    if (model_.getLink(name)) return true;
    leaveOut(element, "link", name);
    return false;
  }

  /// `asking` names the group.
  std::vector<std::string> linksOf(const std::string& group, const XMLElement& asking) {
    if (const auto known = srdf_.groups.find(group); known != srdf_.groups.end()) return known->second;
    const auto at = elements_.find(group);
    if (at == elements_.end())
      throw RobotTextError(placeOf(asking) + " names the group '" + group + "', which is none");
    if (!open_.insert(group).second) throw RobotTextError(placeOf(asking) + ": group '" + group + "' holds itself");
    if (open_.size() > MOST_NESTED) throw RobotTextError(placeOf(asking) + ": groups are nested too deeply");
    std::vector<std::string> links;
    const auto add = [&](const std::string& link) {
      if (std::find(links.begin(), links.end(), link) == links.end()) links.push_back(link);
    };
    const XMLElement& element = *at->second;
    forEach(element, "link", [&](const XMLElement& one) {
      const std::string name = neededText(one, "name");
      if (isLink(name, one)) add(name);
    });
    forEach(element, "joint", [&](const XMLElement& one) {
      const std::string name = neededText(one, "name");
      const urdf::JointConstSharedPtr joint = model_.getJoint(name);
      if (joint) add(joint->child_link_name);
      if (!joint && !isVirtual(name)) leaveOut(one, "joint", name);
    });
    forEach(element, "chain", [&](const XMLElement& one) {
      for (const std::string& link : chain(one)) add(link);
    });
    forEach(element, "group", [&](const XMLElement& one) {
      for (const std::string& link : linksOf(neededText(one, "name"), one)) add(link);
    });
    open_.erase(group);
    return srdf_.groups[group] = links;
  }

  /// One that the SRDF itself adds, between the robot and the world.
  bool isVirtual(const std::string& joint) const {
    bool found = false;
    forEach(robot_, "virtual_joint", [&](const XMLElement& one) { found = found || textOf(one, "name") == joint; });
    return found;
  }

  /// From the base to the tip, as MoveIt has it: without the base where the tip hangs from it, since no joint of the
  /// chain moves it; else over the nearest link from which both hang.
  std::vector<std::string> chain(const XMLElement& element) {
    const std::string base = neededText(element, "base_link"), tip = neededText(element, "tip_link");
    if (!isLink(base, element) || !isLink(tip, element)) return {};
    std::vector<std::string> links = upToRoot(base), other = upToRoot(tip);
    while (links.size() > 1 && other.size() > 1 && links[links.size() - 2] == other[other.size() - 2]) {
      links.pop_back();
      other.pop_back();
    }
    if (links.size() == 1 && other.size() > 1) links.clear();
    links.insert(links.end(), other.rbegin() + 1, other.rend());  // both end with the same
    return links;
  }

  std::vector<std::string> upToRoot(const std::string& link) const {
    std::vector<std::string> links{link};
    while (const urdf::JointSharedPtr joint = model_.getLink(links.back())->parent_joint) {
      links.push_back(joint->parent_link_name);
    }
    return links;
  }
};

}  // namespace

SrdfText parseSrdf(const std::string& text, const urdf::ModelInterface& model) {
  tinyxml2::XMLDocument document;
  return SrdfReader(parseRobotXml(text, document), model).read();
}

}  // namespace dccd
