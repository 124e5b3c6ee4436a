#include "input/ply_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "input/ply_header.h"
#include "input/text_lines.h"

namespace dccd {

namespace {

using ply::Element, ply::Encoding, ply::isInteger, ply::Number, ply::Property;

/// Elements of these names: a scanner's pixels, and what scanners and viewers say of a picture.
constexpr std::string_view HOLD_NO_FACES[] = {"range_grid", "camera", "material"};

std::size_t bytesOf(Number type) {
  static constexpr std::size_t BYTES[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return BYTES[static_cast<std::size_t>(type)];
}

/// The rows of the elements, value by value: words, where a row is a line, or bytes.
class PlyBody {
 public:
  /// `bytes`: behind the head.
  PlyBody(TextLines& lines, std::string_view bytes, Encoding encoding, const std::string& path)
      : lines_(lines),
        rest_(bytes),
        is_text_(encoding == Encoding::ASCII),
        swap_(encoding == Encoding::BIG_ENDIAN_BYTES),
        path_(path) {}

  /// `what` outlives the row.
  void beginRow(std::string_view what, std::uint64_t number) {
    what_ = what;
    number_ = number;
    next_ = 0;
    if (is_text_ && !lines_.nextWithWords()) lines_.fail("the file ends before " + row());
  }
  void endRow() {
    if (is_text_ && next_ < lines_.words().size()) lines_.fail(lines_.words()[next_], "is more than " + row() + " has");
  }
  double number(Number type) {
    if (isInteger(type)) return static_cast<double>(integer(type));
    if (!is_text_) return type == Number::FLOAT ? double{take<float>()} : take<double>();
    const TextWord& word = takeWord();
    const double value = lines_.number(word);
    if (type == Number::DOUBLE || !std::isfinite(value)) return value;
    // Up to half a unit in the last place above the largest float it is rounded to that.
    if (std::abs(value) >= 0x1.ffffffp127) lines_.fail(word, "is too large for a float");
    return double{static_cast<float>(value)};
  }
  /// Of a type that is an integer.
  std::int64_t integer(Number type) {
    if (is_text_) return lines_.integer(takeWord());
    switch (type) {
      case Number::INT8:
        return take<std::int8_t>();
      case Number::UINT8:
        return take<std::uint8_t>();
      case Number::INT16:
        return take<std::int16_t>();
      case Number::UINT16:
        return take<std::uint16_t>();
      case Number::INT32:
        return take<std::int32_t>();
      default:
        return take<std::uint32_t>();
    }
  }
  void skip(Number type, std::uint64_t count) {
    if (!holds(type, count)) end();
    next_ += is_text_ ? count : 0;
    rest_.remove_prefix(is_text_ ? 0 : static_cast<std::size_t>(count) * bytesOf(type));
  }
  bool holds(Number type, std::uint64_t count) const {
    return count <= (is_text_ ? lines_.words().size() - next_ : rest_.size() / bytesOf(type));
  }
  [[noreturn]] void fail(const std::string& what) const {
    if (is_text_) lines_.fail(row() + " " + what);
    throw MeshFileError(path_ + ": " + row() + " " + what);
  }
  /// After the last row. A hint, or nothing.
  std::string finish() {
    const std::string low = "all that the header counts: its counts are too low";
    if (is_text_ && lines_.nextWithWords()) lines_.fail(lines_.words()[0], "stands after " + low);
    if (is_text_ || rest_.empty()) return {};
    const std::string count = std::to_string(rest_.size());
    if (isPadding(rest_)) return count + " bytes of padding after the last element are skipped";
    throw MeshFileError(path_ + ": " + count + " bytes stand after " + low);
  }

 private:
  /// "polygon 3", for messages.
  std::string row() const { return std::string(what_) + " " + std::to_string(number_); }
  [[noreturn]] void end() const {
    if (is_text_) lines_.fail(row() + " has too few values in its line");
    throw MeshFileError(path_ + ": the file ends in " + row());
  }
  const TextWord& takeWord() {
    if (next_ == lines_.words().size()) end();
    return lines_.words()[next_++];
  }
  template <typename T>
  T take() {
    char bytes[sizeof(T)];
    if (rest_.size() < sizeof(T)) end();
    std::memcpy(bytes, rest_.data(), sizeof(T));
    rest_.remove_prefix(sizeof(T));
    if (swap_) std::reverse(bytes, bytes + sizeof(T));
    T value;
    std::memcpy(&value, bytes, sizeof(T));
    return value;
  }

  TextLines& lines_;
  std::string_view rest_;
  bool is_text_, swap_;
  const std::string& path_;
  std::string_view what_;
  std::uint64_t number_ = 0;
  std::size_t next_ = 0;  // of a line's words
};

class PlyReader {
 public:
  PlyReader(const std::string& bytes, const std::string& path)
      : bytes_(bytes), path_(path), lines_(bytes, path), header_(lines_, bytes.size()) {}

  MeshFile read() {
    requireMesh();
    vertices_ = elementNamed("vertex")->count;
    PlyBody body(lines_, bytesOfBody(), *header_.encoding, path_);
    for (const Element& element : header_.elements) {
      if (element.name == "vertex") {
        readVertices(element, body);
      } else if (element.name == "face" || element.name == "tristrips") {
        readPolygons(element, body);
      } else if (element.name == "edge") {
        readEdges(element, body);
      } else {
        skip(element, body);
      }
    }
    if (std::string hint = body.finish(); !hint.empty()) mesh_.hints.push_back(std::move(hint));
    const std::size_t edges_begin = polygons_.size();
    if (hasFaces()) makePolygonsOfEdges();
    setPolygons(std::move(polygons_), mesh_);
    const auto name = [edges_begin, begin = faces_begin_, end = faces_end_,
                       strips = std::move(strip_ends_)](std::size_t p) {
      if (p >= begin && p < end) return "polygon " + std::to_string(p - begin);
      if (p >= edges_begin) return "edge " + std::to_string(p - edges_begin);
      const auto strip = std::upper_bound(strips.begin(), strips.end(), p) - strips.begin();
      return "a triangle of strip " + std::to_string(strip);
    };
    hintAtUnchecked(name, mesh_);
    return std::move(mesh_);
  }

 private:
  const Element* elementNamed(std::string_view name) const {
    for (const Element& element : header_.elements) {
      if (element.name == name) return &element;
    }
    return nullptr;
  }

  bool holds(std::string_view name) const { return elementNamed(name) && elementNamed(name)->count > 0; }
  bool hasFaces() const { return holds("face") || holds("tristrips"); }

  void requireMesh() const {
    if (!holds("vertex")) throw MeshFileError(path_ + ": no vertices");
    if (holds("range_grid") && !hasFaces()) {
      throw MeshFileError(path_ +
                          ": has no faces, but a scanner's range grid (element 'range_grid'); convert it to faces");
    }
  }

  std::string_view bytesOfBody() const {
    const std::string_view rest = lines_.rest();
    // Where lines end with CR alone, a line feed after the header's last one is a byte of the body.
    const std::size_t first_end = bytes_.find('\r'), at = bytes_.size() - rest.size();
    const bool by_cr = first_end < bytes_.find('\n') && bytes_[first_end + 1] != '\n';
    const bool is_first = by_cr && at >= 2 && bytes_[at - 2] == '\r' && bytes_[at - 1] == '\n';
    return is_first ? std::string_view(bytes_).substr(at - 1) : rest;
  }

  static std::string_view rowName(const Element& element) {
    return element.name == "face" ? "polygon" : element.name == "tristrips" ? "strip" : std::string_view(element.name);
  }

  static void skipValue(const Property& property, PlyBody& body) {
    body.skip(property.type, property.count_type ? countOf(property, body) : 1);
  }
  static std::uint64_t countOf(const Property& list, PlyBody& body) {
    const std::int64_t count = body.integer(*list.count_type);
    if (count < 0 || !body.holds(list.type, static_cast<std::uint64_t>(count))) {
      body.fail("has a list '" + list.name + "' of " + std::to_string(count) + ", which is not there");
    }
    return static_cast<std::uint64_t>(count);
  }

  /// Calls take(p) for each property of each row, and after each row done().
  template <typename Take, typename Done>
  void forRows(const Element& element, PlyBody& body, Take take, Done done) {
    mesh_.census.declare(element.count);
    for (std::uint64_t row = 0; row < element.count; ++row) {
      body.beginRow(rowName(element), row);
      for (std::size_t p = 0; p < element.properties.size(); ++p) take(p);
      body.endRow();
      done();
    }
  }

  /// Integers may be corners, in a list or one by one, whatever the element is called.
  void skip(const Element& element, PlyBody& body) {
    const bool may_hold_faces =
        std::find(std::begin(HOLD_NO_FACES), std::end(HOLD_NO_FACES), element.name) == std::end(HOLD_NO_FACES);
    std::uint64_t integers = 0, unread = 0;
    const auto take = [&](std::size_t p) {
      const Property& property = element.properties[p];
      const std::uint64_t count = property.count_type ? countOf(property, body) : 1;
      body.skip(property.type, count);
      if (isInteger(property.type)) integers += property.count_type ? 2 * count : 1;
    };
    forRows(element, body, take, [&] {
      const bool is_unread = may_hold_faces && std::exchange(integers, 0) > 1;
      unread += is_unread;
      mesh_.census.account(is_unread ? 0 : 1);
    });
    if (element.count == 0) return;
    mesh_.hints.push_back("element " + inQuotes(element.name) + " (" + std::to_string(element.count) + ") is skipped" +
                          (unread > 0 ? ", though its integers may be corners: unchecked" : ""));
  }

  /// The place of the one property of one of these names.
  std::size_t propertyOf(const Element& element, std::initializer_list<std::string_view> names, bool list) const {
    const auto named = [&](const Property& p) { return std::find(names.begin(), names.end(), p.name) != names.end(); };
    const auto& all = element.properties;
    const auto found = std::find_if(all.begin(), all.end(), named);
    if (std::count_if(all.begin(), all.end(), named) == 1 && found->count_type.has_value() == list &&
        (!list || isInteger(found->type))) {
      return static_cast<std::size_t>(found - all.begin());
    }
    throw MeshFileError(path_ + ": element " + inQuotes(element.name) + " needs just one property '" +
                        std::string(*names.begin()) + (list ? "', a list of integers" : "', a number"));
  }

  void readVertices(const Element& element, PlyBody& body) {
    std::vector<int> axis_of(element.properties.size(), -1);
    int axis = 0;
    for (const std::string_view name : {"x", "y", "z"}) axis_of[propertyOf(element, {name}, false)] = axis++;
    Vec3 at = Vec3::Zero();
    const auto take = [&](std::size_t p) {
      if (axis_of[p] < 0) return skipValue(element.properties[p], body);
      at[axis_of[p]] = body.number(element.properties[p].type);
    };
    forRows(element, body, take, [&] {
      mesh_.positions.push_back(at);
      mesh_.census.account();
    });
  }

  Index vertexOf(std::int64_t v, const PlyBody& body) const {
    if (v < 0 || static_cast<std::uint64_t>(v) >= vertices_ || v >= std::int64_t{NO_INDEX}) {
      body.fail("names vertex " + std::to_string(v) + " of " + std::to_string(vertices_));
    }
    return static_cast<Index>(v);
  }

  /// Every second triangle of a strip goes round the other way. Fewer than three corners stay one polygon.
  void addStrip() {
    if (corners_.size() < 3 && !corners_.empty()) polygons_.add(corners_);
    for (std::size_t k = 2; k < corners_.size(); ++k) {
      const std::size_t odd = k % 2;
      polygons_.add({corners_[k - 2 + odd], corners_[k - 1 - odd], corners_[k]});
    }
    corners_.clear();
  }

  void readPolygons(const Element& element, PlyBody& body) {
    const std::size_t list = propertyOf(element, {"vertex_indices", "vertex_index"}, true);
    const bool strips = element.name == "tristrips";
    if (!strips) faces_begin_ = polygons_.size();
    const auto take = [&](std::size_t i) {
      const Property& property = element.properties[i];
      if (i != list) return skipValue(property, body);
      corners_.clear();
      for (std::uint64_t left = countOf(property, body); left > 0; --left) {
        const std::int64_t v = body.integer(property.type);
        if (strips && v == -1) {
          addStrip();
        } else {
          corners_.push_back(vertexOf(v, body));
        }
      }
      if (strips) {
        addStrip();
        strip_ends_.push_back(polygons_.size());
      } else {
        polygons_.add(corners_);
      }
    };
    forRows(element, body, take, [&] { mesh_.census.account(); });
    if (!strips) faces_end_ = polygons_.size();
  }

  /// As of an OBJ's lines: beside faces an edge is unchecked, unless a face has it.
  void makePolygonsOfEdges() {
    for (const Edge& edge : mesh_.edges) polygons_.add({edge[0], edge[1]});
    mesh_.edges.clear();
  }

  void readEdges(const Element& element, PlyBody& body) {
    const std::size_t ends[] = {propertyOf(element, {"vertex1"}, false), propertyOf(element, {"vertex2"}, false)};
    std::int64_t vertex[2] = {};
    const auto take = [&](std::size_t p) {
      const Property& property = element.properties[p];
      if (p != ends[0] && p != ends[1]) return skipValue(property, body);
      if (!isInteger(property.type)) body.fail("numbers its vertices by a type that is no integer");
      vertex[p == ends[1]] = body.integer(property.type);
    };
    forRows(element, body, take, [&] {
      const Index a = vertexOf(vertex[0], body), b = vertexOf(vertex[1], body);
      if (a == b) body.fail("names vertex " + std::to_string(a) + " twice");
      mesh_.edges.push_back({std::min(a, b), std::max(a, b)});
      mesh_.census.account();
    });
  }

  const std::string& bytes_;
  const std::string& path_;
  TextLines lines_;
  ply::Header header_;
  MeshFile mesh_;
  Polygons polygons_;
  std::uint64_t vertices_ = 0;
  std::size_t faces_begin_ = 0, faces_end_ = 0;  // of the element `face` among the polygons
  std::vector<std::size_t> strip_ends_;          // of each strip among the polygons
  std::vector<Index> corners_;
};

}  // namespace

MeshFile loadPlyFile(const std::string& path) {
  const std::string bytes = readWholeFile(path);
  return PlyReader(bytes, path).read();
}

}  // namespace dccd
