#include "input/dae_file.h"

#include <tinyxml2.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "base/decimal.h"
#include "dccd/tolerances.h"

namespace dccd {
namespace {

using tinyxml2::XMLElement;

// An element or attribute takes up to 120 bytes of memory, however few of the file; and a node can stand in the scene
// again and again. A step is an index or a position; a node or a part of a mesh takes as long as many of them.
constexpr std::ptrdiff_t MOST_MARKS = 4000000;
constexpr std::size_t MOST_STEPS = 30000000, STEPS_OF_ELEMENT = 30, MOST_CORNERS = 20000000, MOST_DEPTH = 256;

[[noreturn]] void refuse(const XMLElement& at, const std::string& what) {
  throw std::invalid_argument("line " + std::to_string(at.GetLineNum()) + ": <" + at.Name() + "> " + what);
}

std::string attribute(const XMLElement& at, const char* name) {
  const char* value = at.Attribute(name);
  return value ? value : "";
}

/// Calls `see` with each child of this name.
template <class See>
void forChildren(const XMLElement& at, const char* name, const See& see) {
  for (auto* child = at.FirstChildElement(name); child; child = child->NextSiblingElement(name)) see(*child);
}

/// The one of this name; null: there is none.
const XMLElement* onlyChild(const XMLElement& at, const char* name) {
  const XMLElement* child = at.FirstChildElement(name);
  if (child && child->NextSiblingElement(name)) refuse(at, std::string("has several <") + name + ">");
  return child;
}

/// Calls `see` with each word of the element's text.
template <class See>
void forEachWord(const XMLElement& at, const See& see) {
  constexpr const char* BLANKS = " \t\r\n";
  if (at.FirstChild() != at.LastChild()) refuse(at, "has something beside its text, as a comment");
  std::string_view text = at.GetText() ? at.GetText() : "";
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(BLANKS), text.size()));
    if (text.empty()) return;
    const std::size_t end = std::min(text.find_first_of(BLANKS), text.size());
    see(text.substr(0, end));
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

/// Calls `see` with each word, an integer from 0 on.
template <class See>
void forEachIndex(const XMLElement& at, const See& see) {
  forEachWord(at, [&](std::string_view word) {
    const auto index = decimalInteger(word);
    if (!index || *index < 0) refuse(at, "has '" + std::string(word) + "', which is no integer from 0 on");
    see(static_cast<std::size_t>(*index));
  });
}

/// An attribute that counts; without it `otherwise`.
std::size_t countOf(const XMLElement& at, const char* name, std::size_t otherwise) {
  const std::string word = attribute(at, name);
  if (word.empty()) return otherwise;
  const auto count = decimalInteger(word);
  if (!count || *count < 0 || *count > std::int64_t{1} << 31)
    refuse(at, std::string("has a ") + name + " of '" + word + "'");
  return static_cast<std::size_t>(*count);
}

double metresOf(const XMLElement& unit) {
  const auto metres = decimalNumber(attribute(unit, "meter").empty() ? "1" : attribute(unit, "meter"));
  if (!metres || !(*metres > 0)) refuse(unit, "has a meter of '" + attribute(unit, "meter") + "'");
  return *metres;
}

/// All that has an id, and the units of other parts than the file.
class Ids : public tinyxml2::XMLVisitor {
 public:
  bool VisitEnter(const XMLElement& at, const tinyxml2::XMLAttribute*) override {
    if (at.Attribute("id")) by_id_[{at.Name(), '#' + attribute(at, "id")}].push_back(&at);
    if (at.Name() == std::string_view("unit")) units_.push_back(&at);
    return true;
  }
  /// What an attribute refers to.
  const XMLElement& find(const XMLElement& use, const char* by, const std::string& kind) const {
    const std::string url = attribute(use, by);
    const auto found = by_id_.find({kind, url});
    const std::string said = std::string("has the ") + by + " '" + url + "', ";
    if (found == by_id_.end()) refuse(use, said + "and the file has no " + kind + " of that id");
    if (found->second.size() > 1) refuse(use, said + "of several");
    return *found->second[0];
  }
  /// The file's. Programs differ on what a part's own is for.
  double metres(const XMLElement& root) const {
    double metres = 1;
    forChildren(root, "asset", [&](const XMLElement& asset) {
      forChildren(asset, "unit", [&](const XMLElement& unit) { metres = metresOf(unit); });
    });
    for (const XMLElement* unit : units_) {
      if (metresOf(*unit) != metres) refuse(*unit, "is another one than the file's, which alone is read");
    }
    return metres;
  }

 private:
  std::map<std::pair<std::string, std::string>, std::vector<const XMLElement*>> by_id_;
  std::vector<const XMLElement*> units_;
};

/// That it is one of these: another one, as of another namespace, may be what the file means.
void requireKnown(const XMLElement& at, std::initializer_list<std::string_view> names) {
  if (std::find(names.begin(), names.end(), at.Name()) == names.end()) refuse(at, "is not known where it stands");
}

void requireChildren(const XMLElement& at, std::initializer_list<std::string_view> names) {
  for (auto* child = at.FirstChildElement(); child; child = child->NextSiblingElement()) requireKnown(*child, names);
}

/// One of a node; of what is none, the identity.
Eigen::Affine3d transformOf(const XMLElement& at) {
  static const std::map<std::string_view, std::size_t> TRANSFORMS{
      {"translate", 3}, {"rotate", 4}, {"scale", 3}, {"matrix", 16}};
  const std::string_view name = at.Name();
  if (name == "skew" || name == "lookat") refuse(at, "is not read; write the node with a <matrix>");
  Eigen::Affine3d transform = Eigen::Affine3d::Identity();
  const auto known = TRANSFORMS.find(name);
  if (known == TRANSFORMS.end()) {
    requireKnown(at, {"asset", "extra", "instance_camera", "instance_controller", "instance_geometry", "instance_light",
                      "instance_node", "node"});
    return transform;
  }
  const std::vector<double> n = numbersOf(at);
  if (n.size() != known->second) refuse(at, "must have " + std::to_string(known->second) + " numbers");
  if (name == "translate") transform.translate(Vec3(n[0], n[1], n[2]));
  if (name == "scale") transform.scale(Vec3(n[0], n[1], n[2]));
  if (name == "rotate" && n[3] != 0) {
    const Vec3 axis(n[0], n[1], n[2]);
    if (!(std::abs(axis.norm() - 1) <= tolerance::DAE_AXIS)) refuse(at, "has an axis whose length is not 1");
    transform.rotate(Eigen::AngleAxisd(n[3] * M_PI / 180, axis.normalized()));
  }
  if (name == "matrix") {
    transform.matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(n.data());
    if (transform.matrix().row(3) != Eigen::RowVector4d(0, 0, 0, 1)) refuse(at, "must end with 0 0 0 1");
  }
  return transform;
}

class DaeReader {
 public:
  explicit DaeReader(const XMLElement& root) : root_(root) { root.Accept(&ids_); }

  /// The corners of all polygons of the scene, and where each polygon ends.
  Positions corners;
  std::vector<std::size_t> ends;
  std::vector<std::pair<std::size_t, int>> lines_of;  // from which polygon on, and 0 or where a list of lines stands

  void read() {
    const Eigen::Affine3d unit(Eigen::Scaling(ids_.metres(root_)));
    forChildren(root_, "scene", [&](const XMLElement& scene) {
      requireChildren(scene, {"instance_visual_scene", "instance_physics_scene", "instance_kinematics_scene", "extra"});
      forChildren(scene, "instance_visual_scene", [&](const XMLElement& use) {
        const XMLElement& visual = ids_.find(use, "url", "visual_scene");
        requireChildren(visual, {"asset", "node", "evaluate_scene", "extra"});
        forChildren(visual, "node", [&](const XMLElement& node) { addNode(node, unit, 0); });
      });
    });
  }

 private:
  const XMLElement& root_;
  Ids ids_;
  std::map<const XMLElement*, Positions> positions_;  // of each source
  std::size_t steps_ = 0;

  void step(const XMLElement& at, std::size_t cost = 1) {
    steps_ += cost;
    if (steps_ > MOST_STEPS || corners.size() > MOST_CORNERS) refuse(at, "is too much: the scene is too large");
  }

  void addNode(const XMLElement& node, Eigen::Affine3d pose, std::size_t depth) {
    step(node, STEPS_OF_ELEMENT);
    if (depth > MOST_DEPTH) refuse(node, "holds itself, or lies too deep");
    for (auto* child = node.FirstChildElement(); child; child = child->NextSiblingElement()) {
      pose = pose * transformOf(*child);
    }
    forChildren(node, "instance_controller", [](const XMLElement& use) {
      refuse(use, "is not read; write the mesh where its skin or morph puts it");
    });
    forChildren(node, "instance_geometry", [&](const XMLElement& use) {
      const XMLElement& geometry = ids_.find(use, "url", "geometry");
      const XMLElement* mesh = onlyChild(geometry, "mesh");
      if (mesh) requireChildren(geometry, {"asset", "mesh", "extra"});
      if (!mesh) refuse(use, "has the url '" + attribute(use, "url") + "', of a geometry without a <mesh>");
      for (auto* part = mesh->FirstChildElement(); part; part = part->NextSiblingElement()) addPrimitive(*part, pose);
    });
    forChildren(node, "node", [&](const XMLElement& child) { addNode(child, pose, depth + 1); });
    forChildren(node, "instance_node",
                [&](const XMLElement& use) { addNode(ids_.find(use, "url", "node"), pose, depth + 1); });
  }

  /// Polygons of every kind that there is; nothing of what else a mesh has.
  void addPrimitive(const XMLElement& at, const Eigen::Affine3d& pose) {
    step(at, STEPS_OF_ELEMENT);
    const std::string_view kind = at.Name();
    const bool triangles = kind == "triangles", lines = kind == "lines", listed = kind == "polylist",
               strips = kind == "tristrips", fans = kind == "trifans", chains = kind == "linestrips";
    if (!triangles && !lines && !listed && !strips && !fans && !chains && kind != "polygons") {
      return requireKnown(at, {"source", "vertices", "extra"});
    }
    forChildren(at, "ph", [](const XMLElement& ph) { refuse(ph, "is a polygon with holes; write it with triangles"); });
    requireChildren(at, {"input", "vcount", "p", "extra"});
    std::vector<std::size_t> sizes;
    forChildren(at, "vcount", [&](const XMLElement& vcount) {
      forEachIndex(vcount, [&](std::size_t size) { sizes.push_back(size); });
    });
    lines_of.emplace_back(ends.size(), lines || chains ? at.GetLineNum() : 0);
    const std::size_t vcounts = sizes.size();
    std::size_t lists = 0, polygons = 0;
    forChildren(at, "p", [&](const XMLElement& p) {
      const Positions list = cornersOf(at, p, pose);
      const auto add = [&](std::initializer_list<std::size_t> places) {
        for (const std::size_t place : places) corners.push_back(list[place]);
        ends.push_back(corners.size());
      };
      ++lists;
      for (std::size_t k = 2; strips && k < list.size(); ++k) add({k - 2 + k % 2, k - 1 - k % 2, k});
      for (std::size_t k = 2; fans && k < list.size(); ++k) add({0, k - 1, k});
      for (std::size_t k = 1; chains && k < list.size(); ++k) add({k - 1, k});
      if (strips || fans || chains) return;
      if (!listed) {
        const std::size_t size = triangles ? 3 : lines ? 2 : std::max<std::size_t>(list.size(), 1);
        sizes.assign(list.size() / size, size);
      }
      polygons += sizes.size();
      std::size_t end = 0;
      for (const std::size_t size : sizes) {
        if (size > list.size() - end) refuse(p, "ends within a polygon");
        corners.insert(corners.end(), list.begin() + end, list.begin() + end + size);
        ends.push_back(corners.size());
        end += size;
      }
      if (end < list.size()) refuse(p, "has more indices than its polygons have corners");
    });
    const std::size_t count = triangles || lines || listed ? polygons : lists;
    const std::size_t said = countOf(at, "count", listed ? vcounts : count);
    if (count != said || (listed && count != vcounts)) {
      refuse(at, "has " + std::to_string(count) + ", and a count of " + std::to_string(said));
    }
  }

  /// Where the corners are that one list of indices names.
  Positions cornersOf(const XMLElement& primitive, const XMLElement& p, const Eigen::Affine3d& pose) {
    const Positions* known = nullptr;
    std::size_t offset = 0, stride = 1, word = 0;
    forChildren(primitive, "input", [&](const XMLElement& input) {
      if (!input.Attribute("offset")) refuse(input, "has no offset");
      const std::size_t at = countOf(input, "offset", 0);
      stride = std::max(stride, at + 1);
      if (attribute(input, "semantic") != "VERTEX") return;
      if (known) refuse(input, "is the second VERTEX");
      known = &positionsOf(ids_.find(input, "source", "vertices"));
      offset = at;
    });
    if (!known) refuse(primitive, "has no <input> of VERTEX");
    Positions list;
    forEachIndex(p, [&](std::size_t v) {
      step(p);
      if (word++ % stride != offset) return;
      if (v >= known->size()) refuse(p, "names vertex " + std::to_string(v) + " of " + std::to_string(known->size()));
      list.push_back(pose * (*known)[v]);
    });
    if (word % stride != 0)
      refuse(p, "has " + std::to_string(word) + " indices, no multiple of " + std::to_string(stride));
    return list;
  }

  const Positions& positionsOf(const XMLElement& vertices) {
    const XMLElement* source = nullptr;
    forChildren(vertices, "input", [&](const XMLElement& input) {
      if (attribute(input, "semantic") != "POSITION") return;
      if (source) refuse(input, "is the second POSITION");
      source = &ids_.find(input, "source", "source");
    });
    if (!source) refuse(vertices, "has no <input> of POSITION");
    const auto [known, is_new] = positions_.try_emplace(source);
    if (is_new) known->second = readPositions(*source);
    return known->second;
  }

  Positions readPositions(const XMLElement& source) {
    const XMLElement* technique = onlyChild(source, "technique_common");
    const XMLElement* accessor = technique ? onlyChild(*technique, "accessor") : nullptr;
    if (!accessor) refuse(source, "has no <accessor>");
    const XMLElement& array = ids_.find(*accessor, "source", "float_array");
    const std::vector<double> numbers = numbersOf(array);
    if (numbers.size() != countOf(array, "count", numbers.size())) {
      refuse(array, "has " + std::to_string(numbers.size()) + " numbers, and a count of " + attribute(array, "count"));
    }
    std::map<std::string, std::size_t> place;
    std::size_t params = 0, named = 0;
    forChildren(*accessor, "param", [&](const XMLElement& param) {
      if (param.Attribute("name")) place[attribute(param, "name")] = params, ++named;
      ++params;
    });
    if (named != 3 || place.count("X") + place.count("Y") + place.count("Z") != 3) {
      refuse(*accessor, "of positions must have one <param> each of the names X, Y and Z, and no others with a name");
    }
    const std::size_t count = countOf(*accessor, "count", 0), stride = countOf(*accessor, "stride", 1);
    const std::size_t first = countOf(*accessor, "offset", 0);
    if (stride < params) refuse(*accessor, "has more <param> than its stride of " + std::to_string(stride));
    if (count > 0 && first + (count - 1) * stride + params > numbers.size()) {
      refuse(*accessor, "goes beyond the " + std::to_string(numbers.size()) + " numbers of '" +
                            attribute(*accessor, "source") + "'");
    }
    Positions positions;
    for (std::size_t i = 0; i < count; ++i) {
      const double* at = numbers.data() + first + i * stride;
      step(source);
      positions.emplace_back(at[place["X"]], at[place["Y"]], at[place["Z"]]);
    }
    return positions;
  }
};

}  // namespace

MeshFile loadDaeFile(const std::string& path) {
  const std::string bytes = readWholeFile(path);
  const auto fail = [&](const std::string& what) { throw MeshFileError(path + ": not a readable .dae mesh: " + what); };
  const auto marks = std::count_if(bytes.begin(), bytes.end(), [](char c) { return c == '<' || c == '='; });
  if (marks > MOST_MARKS) fail("it has more than " + std::to_string(MOST_MARKS) + " tags and attributes");
  tinyxml2::XMLDocument document;
  if (document.Parse(bytes.data(), bytes.size()) != tinyxml2::XML_SUCCESS) fail(document.ErrorStr());
  if (!document.RootElement()) fail("it holds no element");
  DaeReader reader(*document.RootElement());
  try {
    reader.read();
  } catch (const std::invalid_argument& error) {
    fail(error.what());
  }
  if (reader.corners.empty()) throw MeshFileError(path + ": there are no triangles");
  MeshFile mesh = weldPolygons(reader.corners, std::move(reader.ends), path);
  const auto name = [lines_of = std::move(reader.lines_of)](std::size_t p) {
    const auto next = std::upper_bound(lines_of.begin(), lines_of.end(), std::pair(p, std::numeric_limits<int>::max()));
    const int line = std::prev(next)->second;
    return "polygon " + std::to_string(p) + " of the scene" +
           (line > 0 ? ", a segment of <lines> in line " + std::to_string(line) : "");
  };
  hintAtUnchecked(name, mesh);
  return mesh;
}

}  // namespace dccd
