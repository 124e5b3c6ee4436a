#include "input/obj_file.h"

#include <algorithm>
#include <set>
#include <string_view>

#include "base/decimal.h"
#include "input/polygons.h"
#include "input/text_lines.h"

namespace dccd {

namespace {

constexpr std::string_view READ[] = {"v", "f", "l", "g"};
constexpr std::string_view NO_GEOMETRY[] = {
    "vt",       "vn",    "vp",       "o",        "s",   "mg",         "mtllib",    "usemtl", "maplib", "usemap",
    "material", "bevel", "c_interp", "d_interp", "lod", "shadow_obj", "trace_obj", "ctech",  "stech"};
/// Points, the old outline of a face, free-form curves and surfaces with all that belongs to them, other files,
/// commands.
constexpr std::string_view OTHER_GEOMETRY[] = {"p",    "fo",   "curv", "curv2", "surf", "cstype", "deg", "bmat",
                                               "step", "parm", "trim", "hole",  "scrv", "sp",     "end", "con",
                                               "bzp",  "bsp",  "cdc",  "cdp",   "res",  "call",   "csh"};

template <std::size_t N>
bool isOneOf(const std::string_view (&keywords)[N], std::string_view word) {
  return std::find(std::begin(keywords), std::end(keywords), word) != std::end(keywords);
}

bool isKnown(std::string_view word) {
  return isOneOf(READ, word) || isOneOf(NO_GEOMETRY, word) || isOneOf(OTHER_GEOMETRY, word);
}

class ObjReader {
 public:
  ObjReader(const std::string& text, const std::string& path) : path_(path), lines_(text, path) {}

  MeshFile read() {
    while (nextStatement()) {
      if (words_.empty()) continue;
      mesh_.census.declare();
      take(words_[0]);
    }
    endGroups();
    if (mesh_.positions.empty()) throw MeshFileError(path_ + ": no vertices");
    // Faces and lines may name vertices that come after them.
    if (furthest_ >= mesh_.positions.size()) lines_.fail(furthest_word_, missing());
    if (polygons_.size() > 0) makePolygonsOfLines();
    nameGroups(setPolygons(std::move(polygons_), mesh_));
    hintAtUnchecked([lines = std::move(face_lines_)](std::size_t p) { return "in line " + std::to_string(lines[p]); },
                    mesh_);
    if (const std::size_t unknown = mesh_.census.unchecked(); unknown > 0) {
      mesh_.hints.push_back(std::to_string(unknown) + " lines with unknown keywords are unchecked, the first is " +
                            first_unknown_);
    }
    return std::move(mesh_);
  }

 private:
  /// A line without its comment, and the lines on which it goes on. False at the end.
  bool nextStatement() {
    if (!lines_.next()) return false;
    words_.clear();
    bool comment = takeWords(0);
    while (goesOn()) {
      const std::size_t before = lines_.words().size();
      // What stands before the mark and what follows it are two words: they never are one, whoever reads them.
      const TextWord mark = lines_.words().back();
      if (!lines_.append()) lines_.fail("ends in '\\', and no line follows");
      const bool skipped = comment || (!words_.empty() && !isOneOf(READ, words_[0].text));
      if (skipped && lines_.words().size() > before && isKnown(lines_.words()[before].text)) {
        lines_.fail(mark,
                    "ends a line that is skipped, and it is not certain that the next line belongs to it; remove '\\'");
      }
      if (mark.text != "\\" && !lines_.text().empty() && !isBlank(lines_.text()[0])) {
        lines_.fail(mark, "ends in '\\', and the next line begins without a blank: write one before the '\\'");
      }
      if (!comment) comment = takeWords(before);
    }
    return true;
  }

  /// From the line's words, from the one of this number on; true where a comment ends them.
  bool takeWords(std::size_t first) {
    for (std::size_t w = first; w < lines_.words().size(); ++w) {
      TextWord word = lines_.words()[w];
      if (word.text[0] == '#') return true;
      if (w + 1 == lines_.words().size() && word.text.back() == '\\') word.text.remove_suffix(1);
      if (!word.text.empty()) words_.push_back(word);
    }
    return false;
  }
  bool goesOn() const { return !lines_.words().empty() && !lines_.text().empty() && lines_.text().back() == '\\'; }
  static bool isBlank(char c) { return c == ' ' || c == '\t' || c == '\f' || c == '\v'; }

  void take(const TextWord& keyword) {
    if (keyword.text == "v") return readVertex();
    if (keyword.text == "f") return readFace();
    if (keyword.text == "l") return readLine();
    if (keyword.text == "g") return readGroups();
    if (isOneOf(NO_GEOMETRY, keyword.text)) return mesh_.census.account();
    if (isOneOf(OTHER_GEOMETRY, keyword.text)) {
      lines_.fail(keyword, "carries geometry that is not read; write it as 'v' and 'f' or 'l' lines");
    }
    const std::string small = inSmallLetters(keyword.text);
    if (isOneOf(READ, small) || isOneOf(OTHER_GEOMETRY, small)) lines_.fail(keyword, "must be in small letters");
    const bool is_first = mesh_.positions.empty() && polygons_.size() == 0 && first_unknown_.empty();
    if (decimalNumber(keyword.text)) {
      lines_.fail(keyword, is_first
                               ? "begins the first line, where an OBJ file has 'v', 'f' or 'l': it is of another format"
                               : "begins a line, and no line goes on with '\\' before it");
    }
    if (first_unknown_.empty()) first_unknown_ = inQuotes(keyword.text) + " in line " + std::to_string(keyword.line);
  }

  /// x y z; then perhaps a weight, which must be 1, and a colour.
  void readVertex() {
    const std::size_t numbers = words_.size() - 1;
    if (numbers != 3 && numbers != 4 && numbers != 6 && numbers != 7) {
      lines_.fail(words_[0], "has " + std::to_string(numbers) +
                                 " numbers; a vertex has x y z, then perhaps a weight of 1, "
                                 "then perhaps a colour of three");
    }
    double value[7] = {};
    for (std::size_t i = 0; i < numbers; ++i) value[i] = lines_.number(words_[i + 1]);
    if ((numbers == 4 || numbers == 7) && value[3] != 1) {
      lines_.fail(words_[4], "is the weight of a vertex: only 1 is read, for programs differ on what others mean");
    }
    if (mesh_.positions.size() + 1 >= NO_INDEX) lines_.fail("too many vertices");
    mesh_.positions.emplace_back(value[0], value[1], value[2]);
    mesh_.census.account();
  }

  void readFace() {
    if (words_.size() < 4) lines_.fail(words_[0], "has fewer than three corners");
    corners_.clear();
    for (std::size_t w = 1; w < words_.size(); ++w) corners_.push_back(cornerOf(words_[w], 3));
    polygons_.add(corners_);
    face_lines_.push_back(words_[0].line);
    mesh_.census.account();
  }

  void readLine() {
    if (words_.size() < 3) lines_.fail(words_[0], "has fewer than two vertices");
    Index before = cornerOf(words_[1], 2);
    for (std::size_t w = 2; w < words_.size(); ++w) {
      const Index v = cornerOf(words_[w], 2);
      if (v == before) lines_.fail(words_[w], "is the vertex before it, too");
      mesh_.edges.push_back({std::min(before, v), std::max(before, v)});
      edge_lines_.push_back(words_[0].line);
      before = v;
    }
    mesh_.census.account();
  }

  /// Beside faces a segment is a polygon of two corners: unchecked, unless a face has that edge.
  void makePolygonsOfLines() {
    for (const Edge& edge : mesh_.edges) polygons_.add({edge[0], edge[1]});
    face_lines_.insert(face_lines_.end(), edge_lines_.begin(), edge_lines_.end());
    mesh_.edges.clear();
  }

  /// `v`, `v/vt` or `v/vt/vn`, of which all but the first may be empty.
  Index cornerOf(const TextWord& word, std::size_t most_parts) {
    std::string_view rest = word.text;
    std::int64_t number = 0;
    std::size_t parts = 0;
    for (bool more = true; more; ++parts) {
      const std::size_t slash = rest.find('/');
      more = slash != std::string_view::npos;
      const std::string_view part = rest.substr(0, slash);
      rest.remove_prefix(more ? slash + 1 : rest.size());
      const auto integer = decimalInteger(part);
      if (parts == most_parts || (!integer && (parts == 0 || !part.empty())) || (integer && *integer == 0)) {
        lines_.fail(word, "is no corner: vertex, texture and normal are integers from 1, or from -1 backwards");
      }
      if (parts == 0) number = *integer;
    }
    const auto count = static_cast<std::int64_t>(mesh_.positions.size());
    const std::int64_t v = number > 0 ? number - 1 : count + number;
    if (v < 0 || v >= std::int64_t{NO_INDEX}) lines_.fail(word, missing());
    if (v >= count && (furthest_word_.line == 0 || v > std::int64_t{furthest_})) {
      furthest_ = static_cast<Index>(v);
      furthest_word_ = word;
    }
    return static_cast<Index>(v);
  }
  std::string missing() const {
    return "names a vertex that is not there; " + std::to_string(mesh_.positions.size()) + " are";
  }

  /// Each name of the line is a group; none: the faces that follow belong to no group.
  void readGroups() {
    endGroups();
    for (std::size_t w = 1; w < words_.size(); ++w) groups_.insert(std::string(words_[w].text));
    mesh_.census.account();
  }

  /// The polygons since the last `g` are what its groups get.
  void endGroups() {
    for (const std::string& name : groups_) {
      auto& ranges = mesh_.groups[name];
      if (polygons_.size() > begin_) ranges.emplace_back(begin_, polygons_.size());
    }
    groups_.clear();
    begin_ = polygons_.size();
  }

  /// From ranges of polygons to ranges of faces.
  void nameGroups(const std::vector<std::size_t>& ends) {
    const auto face = [&](std::size_t polygon) { return polygon == 0 ? 0 : ends[polygon - 1]; };
    for (auto& [name, ranges] : mesh_.groups) {
      for (auto& [first, last] : ranges) {
        first = face(first);
        last = face(last);
      }
    }
  }

  const std::string& path_;
  TextLines lines_;
  std::vector<TextWord> words_;  // of the statement
  MeshFile mesh_;
  Polygons polygons_;
  std::vector<std::size_t> face_lines_, edge_lines_;  // of the polygons, of the lines' segments
  std::vector<Index> corners_;
  Index furthest_ = 0;  // of the vertices that were named before they came
  TextWord furthest_word_{{}, 0};
  std::string first_unknown_;
  std::set<std::string> groups_;  // of the faces since begin_
  std::size_t begin_ = 0;
};

}  // namespace

MeshFile loadObjFile(const std::string& path) {
  const std::string text = readWholeFile(path);
  return ObjReader(text, path).read();
}

}  // namespace dccd
