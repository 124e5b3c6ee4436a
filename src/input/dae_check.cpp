#include "input/dae_check.h"

#include <tinyxml2.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "dccd/decimal.h"
#include "dccd/tolerances.h"

namespace dccd {

namespace {

using tinyxml2::XMLElement;

[[noreturn]] void refuse(const XMLElement& at, const std::string& what) {
  throw std::invalid_argument("line " + std::to_string(at.GetLineNum()) + ": <" + at.Name() + "> " + what);
}

std::string attribute(const XMLElement& at, const char* name) {
  const char* value = at.Attribute(name);
  return value ? value : "";
}

/// Calls `see` with each word of the element's text; returns how many there are.
template <class See>
std::size_t forEachWord(const XMLElement& at, const See& see) {
  constexpr const char* BLANKS = " \t\r\n";
  if (at.FirstChild() != at.LastChild()) refuse(at, "has something beside its text, as a comment");
  std::string_view text = at.GetText() ? at.GetText() : "";
  std::size_t words = 0;
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(BLANKS), text.size()));
    if (text.empty()) return words;
    const std::size_t end = std::min(text.find_first_of(BLANKS), text.size());
    see(text.substr(0, end));
    ++words;
    text.remove_prefix(end);
  }
}

std::vector<double> numbersOf(const XMLElement& at) {
  std::vector<double> numbers;
  forEachWord(at, [&](std::string_view word) {
    const auto number = decimalNumber(word);
    if (!number) refuse(at, "has '" + std::string(word) + "', which is no decimal number");
    numbers.push_back(*number);
  });
  return numbers;
}

/// An attribute that counts; without it `otherwise`.
std::uint64_t countOf(const XMLElement& at, const char* name, std::uint64_t otherwise) {
  const std::string word = attribute(at, name);
  if (word.empty()) return otherwise;
  const auto count = decimalInteger(word);
  if (!count || *count < 0 || *count > std::int64_t{1} << 31)
    refuse(at, std::string("has a ") + name + " of '" + word + "'");
  return static_cast<std::uint64_t>(*count);
}

/// One of a node, with all of its numbers.
void checkTransform(const XMLElement& at, std::string_view name) {
  static const std::map<std::string_view, std::size_t> TRANSFORMS{
      {"translate", 3}, {"rotate", 4}, {"scale", 3}, {"matrix", 16}};
  if (name == "skew" || name == "lookat") refuse(at, "is not read; write the node with a <matrix>");
  const auto transform = TRANSFORMS.find(name);
  if (transform == TRANSFORMS.end()) return;
  const std::vector<double> n = numbersOf(at);
  if (n.size() != transform->second) refuse(at, "must have " + std::to_string(transform->second) + " numbers");
  if (name == "rotate" && n[3] != 0 && !(std::abs(std::hypot(n[0], n[1], n[2]) - 1) <= tolerance::DAE_AXIS)) {
    refuse(at, "has an axis whose length is not 1");
  }
  if (name == "matrix" && std::vector<double>(n.end() - 4, n.end()) != std::vector<double>{0, 0, 0, 1}) {
    refuse(at, "must end with 0 0 0 1");
  }
}

class Check : public tinyxml2::XMLVisitor {
 public:
  bool VisitEnter(const XMLElement& at, const tinyxml2::XMLAttribute*) override {
    const std::string_view name = at.Name();
    const XMLElement* const parent = at.Parent()->ToElement();
    const bool in_node = parent && std::string_view(parent->Name()) == "node";
    if (name == "geometry" || name == "source" || name == "float_array" || name == "node") {
      const std::string id = attribute(at, "id");
      const bool is_first = id.empty() || ids_[std::string(name)].insert(id).second;
      // A node's matters where another one refers to it alone; some programs give the same to several.
      if (!is_first && name == "node") {
        repeated_nodes_.insert(id);
      } else if (!is_first) {
        refuse(at, "has the id '" + id + "', as another one before it");
      }
    }
    if (name == "mesh" && parent) meshes_.insert(attribute(*parent, "id"));
    if (name == "mesh") ++in_mesh_;
    if (name == "unit" && parent && std::string_view(parent->Name()) == "asset") readUnit(at, *parent);
    if (in_node) {
      checkTransform(at, name);
      if (name == "instance_controller") refuse(at, "is not read; write the mesh where its skin or morph puts it");
      if (name == "instance_geometry" || name == "instance_node") uses_.push_back(&at);
    }
    if (in_mesh_ > 0) readMesh(at, name);
    return true;
  }
  bool VisitExit(const XMLElement& at) override {
    if (std::string_view(at.Name()) == "mesh") --in_mesh_;
    return true;
  }
  /// To be called at the end: what is used may come later.
  void resolve() {
    for (const XMLElement* use : uses_) {
      const std::string url = attribute(*use, "url"), kind = std::string(use->Name()).substr(9);
      const std::set<std::string>& known = kind == "geometry" ? meshes_ : ids_[kind];
      if (url.empty() || url[0] != '#' || known.count(url.substr(1)) == 0) {
        refuse(*use, "has the url '" + url + "', and the file has no " + kind + " of that id" +
                         (kind == "geometry" ? " with a <mesh>" : ""));
      }
      if (kind == "node" && repeated_nodes_.count(url.substr(1)) > 0) {
        refuse(*use, "has the url '" + url + "', of several");
      }
    }
    for (const XMLElement* accessor : accessors_) {
      requireNamesOfPositions(*accessor);
      const auto numbers = arrays_.find(attribute(*accessor, "source"));
      if (numbers == arrays_.end()) continue;  // of names
      std::uint64_t params = 0;
      for (auto* p = accessor->FirstChildElement("param"); p; p = p->NextSiblingElement("param")) ++params;
      const std::uint64_t count = countOf(*accessor, "count", 0), stride = countOf(*accessor, "stride", 1);
      if (stride < params) refuse(*accessor, "has more <param> than its stride of " + std::to_string(stride));
      if (count > 0 && countOf(*accessor, "offset", 0) + (count - 1) * stride + params > numbers->second) {
        refuse(*accessor,
               "goes beyond the " + std::to_string(numbers->second) + " numbers of '" + numbers->first + "'");
      }
    }
  }

 private:
  /// That of the file holds for all of it, if the format has it otherwise.
  void readUnit(const XMLElement& at, const XMLElement& asset) {
    const auto metres = decimalNumber(attribute(at, "meter").empty() ? "1" : attribute(at, "meter"));
    if (!metres || !(*metres > 0)) refuse(at, "has a meter of '" + attribute(at, "meter") + "'");
    if (asset.Parent() == at.GetDocument()->RootElement()) {
      metres_ = *metres;
    } else if (*metres != metres_) {
      refuse(at, "is another one than the file's, which alone is read");
    }
  }
  /// Coordinates are found by these names: where one is missing, the first number is taken.
  void requireNamesOfPositions(const XMLElement& accessor) const {
    const XMLElement* const source = accessor.Parent()->Parent()->ToElement();
    if (!source || positions_.count("#" + attribute(*source, "id")) == 0) return;
    std::multiset<std::string> names;
    for (auto* p = accessor.FirstChildElement("param"); p; p = p->NextSiblingElement("param")) {
      if (p->Attribute("name")) names.insert(attribute(*p, "name"));
    }
    if (names != std::multiset<std::string>{"X", "Y", "Z"}) {
      refuse(accessor, "of positions must have one <param> each of the names X, Y and Z, and no others with a name");
    }
  }
  void readMesh(const XMLElement& at, std::string_view name) {
    if (name == "float_array") {
      const std::uint64_t numbers = numbersOf(at).size();
      if (numbers != countOf(at, "count", numbers)) {
        refuse(at, "has " + std::to_string(numbers) + " numbers, and a count of " + attribute(at, "count"));
      }
      arrays_["#" + attribute(at, "id")] = numbers;
    } else if (name == "accessor") {
      accessors_.push_back(&at);
    } else if (name == "input" && attribute(at, "semantic") == "POSITION") {
      positions_.insert(attribute(at, "source"));
    } else if (name == "p" || name == "vcount") {
      forEachWord(at, [&](std::string_view word) {
        const auto index = decimalInteger(word);
        if (!index || *index < 0) refuse(at, "has '" + std::string(word) + "', which is no integer from 0 on");
      });
    }
  }

  std::map<std::string, std::set<std::string>> ids_;  // by kind
  std::set<std::string> repeated_nodes_;
  std::set<std::string> meshes_;                 // geometries that are no splines
  std::set<std::string> positions_;              // sources of positions, as they are referred to
  std::map<std::string, std::uint64_t> arrays_;  // how many numbers each has
  std::vector<const XMLElement*> uses_, accessors_;
  int in_mesh_ = 0;
  double metres_ = 1;
};

}  // namespace

std::string daeProblem(const std::string& text) {
  tinyxml2::XMLDocument document;
  if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) return document.ErrorStr();
  try {
    Check check;
    document.Accept(&check);
    check.resolve();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

}  // namespace dccd
