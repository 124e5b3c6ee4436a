// Generated mesh files of odd but legal form: what is read is what was written.
#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <functional>
#include <iomanip>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <sstream>

#include <gtest/gtest.h>

#include "input/mesh_formats.h"
#include "support/folder_test.h"

namespace dccd {
namespace {

using Triangle = std::array<std::array<double, 3>, 3>;
/// Each begins with its least corner, so that turned ones are equal and mirrored ones are not.
using Triangles = std::multiset<Triangle>;

Triangles trianglesOf(const Positions& positions, const std::vector<Face>& faces) {
  Triangles out;
  for (const Face& face : faces) {
    Triangle t;
    for (std::size_t k = 0; k < 3; ++k) std::copy_n(positions[face[k]].data(), 3, t[k].begin());
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    out.insert(t);
  }
  return out;
}

struct Mesh {
  Positions positions;  // all different, of few bits, which float32 holds
  std::vector<Face> faces;
};

class Writer {
 public:
  explicit Writer(unsigned seed) : random_(seed) {
    std::set<std::array<int, 3>> taken;
    const std::size_t vertices = 3 + below(10);
    while (mesh.positions.size() < vertices) {
      const std::array<int, 3> k{below(65) - 32, below(65) - 32, below(65) - 32};
      if (taken.insert(k).second) mesh.positions.emplace_back(k[0] / 8.0, k[1] / 8.0, k[2] / 8.0);
    }
    for (int f = 1 + below(8); f > 0; --f) {
      std::vector<Index> v(vertices);
      for (Index i = 0; i < vertices; ++i) v[i] = i;
      std::shuffle(v.begin(), v.end(), random_);
      mesh.faces.push_back({v[0], v[1], v[2]});
    }
  }

  Mesh mesh;
  std::string bytes;

  int below(int n) { return static_cast<int>(random_() % static_cast<unsigned>(n)); }
  /// Of four files one has the form.
  bool has(const std::string& form) { return known_.emplace(form, below(4) == 0).first->second; }
  /// And there in one of three places.
  bool here(const std::string& form) { return has(form) && below(3) == 0; }

  std::string number(double x) {
    std::ostringstream text;
    if (here("exponents")) {
      text << std::scientific << std::setprecision(9) << x;
    } else if (here("plus signs") && x >= 0) {
      text << '+' << x;
    } else if (here("points at an end") && x == std::floor(x)) {
      text << x << '.';
    } else if (here("no zero before the point") && x > 0 && x < 1) {
      text << x;
      return text.str().substr(1);
    } else {
      text << std::setprecision(17) << x;
    }
    return text.str();
  }
  std::string blank() { return here("tabs") ? "\t" : here("several blanks") ? "   " : " "; }
  std::string point(const Vec3& p) { return number(p.x()) + blank() + number(p.y()) + blank() + number(p.z()); }
  void line(const std::string& text, const std::string& end = "\n") {
    bytes += (here("blanks before words") ? blank() : "") + text + (here("blanks behind words") ? blank() : "") + end;
  }

 private:
  std::mt19937 random_;
  std::map<std::string, bool> known_;
};

std::string lineEnd(Writer& w) { return w.has("CR LF") ? "\r\n" : w.has("CR") ? "\r" : "\n"; }

std::string objCorner(Writer& w, Index v, std::size_t known) {
  const bool back = w.here("indices from the end") && v < known;
  std::string text = std::to_string(back ? static_cast<long>(v) - static_cast<long>(known) : static_cast<long>(v) + 1);
  if (w.has("textures")) text += "/1";
  if (w.has("normals")) text += (w.has("textures") ? "/" : "//") + std::string("1");
  return text;
}

void writeObj(Writer& w) {
  const std::string end = lineEnd(w);
  const auto line = [&](const std::string& text) { w.line(text, end); };
  if (w.has("a byte-order mark")) w.bytes += "\xef\xbb\xbf";
  line("# by a test");
  line("vt 0 0");
  line("vn 0 0 1");
  const bool faces_first = w.has("faces before vertices");
  const auto vertices = [&] {
    for (const Vec3& p : w.mesh.positions) {
      std::string text = "v" + w.blank() + w.point(p);
      if (w.has("weights of 1"))
        text += " 1";
      else if (w.has("colours"))
        text += " 0.5 0.25 1";
      line(text);
      if (w.here("comments")) line("# v 1 2 3");
      if (w.here("empty lines")) line("");
    }
  };
  if (!faces_first) vertices();
  for (const Face& face : w.mesh.faces) {
    if (w.here("groups")) line("g one two");
    if (w.here("objects")) line("o a b");
    if (w.here("materials")) line("usemtl a");
    if (w.here("smoothing")) line("s 1");
    std::string text = "f";
    for (const Index v : face) {
      text += w.here("continued lines") ? " \\" + end + " " : w.here("form feeds") ? "\f" : w.blank();
      text += objCorner(w, v, faces_first ? 0 : w.mesh.positions.size());
    }
    if (w.here("comments behind words")) text += " # f 1 2 3";
    line(text);
  }
  if (faces_first) vertices();
}

void writeStl(Writer& w) {
  const std::string end = lineEnd(w);
  const bool capitals = w.has("capitals");
  const auto line = [&](std::string text) {
    if (capitals)
      std::transform(text.begin(), text.end(), text.begin(),
                     [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    w.line(text, end);
  };
  const std::string name = w.has("a name with a keyword") ? " my vertex 1 2 3" : w.has("no name") ? "" : " part";
  w.bytes += (capitals ? "SOLID" : "solid") + name + end;
  for (const Face& face : w.mesh.faces) {
    if (w.here("several solids")) w.bytes += "endsolid" + name + end + "solid" + name + end;
    line("facet normal " + std::string(w.here("normals of nan") ? "nan nan nan" : "0 0 1"));
    line("outer loop");
    for (const Index v : face) line("vertex" + w.blank() + w.point(w.mesh.positions[v]));
    line("endloop");
    line("endfacet");
  }
  line("endsolid" + name);
}

template <typename T>
void put(std::string& out, T value, bool big_endian = false) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  if (big_endian) std::reverse(bytes, bytes + sizeof value);
  out.append(bytes, sizeof value);
}

void writeBinaryStl(Writer& w) {
  w.bytes = w.has("a header of solid") ? "solid of a test" : w.has("a header of nothing") ? "" : "binary";
  w.bytes.resize(80);
  put(w.bytes, static_cast<std::uint32_t>(w.mesh.faces.size()));
  for (const Face& face : w.mesh.faces) {
    for (int axis = 0; axis < 3; ++axis)
      put(w.bytes, w.has("normals of nan") ? std::numeric_limits<float>::quiet_NaN() : 0.f);
    for (const Index v : face) {
      for (int axis = 0; axis < 3; ++axis) put(w.bytes, static_cast<float>(w.mesh.positions[v][axis]));
    }
    put(w.bytes, static_cast<std::uint16_t>(w.has("attributes") ? 0x8123 : 0));
  }
  if (w.has("padding")) w.bytes += std::string(7, '\0');
}

/// Values one after the other, as text or as bytes.
class PlyValues {
 public:
  PlyValues(Writer& w, int format, std::string end) : w_(w), format_(format), end_(std::move(end)) {}
  void real(double x, bool is_double) {
    if (format_ == 0)
      text(w_.number(x));
    else if (is_double)
      put(w_.bytes, x, format_ == 2);
    else
      put(w_.bytes, static_cast<float>(x), format_ == 2);
  }
  void byte(int x) {
    if (format_ == 0)
      text(std::to_string(x));
    else
      w_.bytes += static_cast<char>(x);
  }
  void integer(Index x) {
    if (format_ == 0)
      text(std::to_string(x));
    else
      put(w_.bytes, static_cast<std::int32_t>(x), format_ == 2);
  }
  void endRow() {
    if (format_ == 0) w_.line(line_, end_);
    line_.clear();
  }

 private:
  void text(const std::string& word) { line_ += (line_.empty() ? "" : w_.blank()) + word; }
  Writer& w_;
  int format_;
  std::string end_, line_;
};

/// format: 0 text, 1 little-endian, 2 big-endian.
void writePly(Writer& w, int format) {
  static const char* const NAMES[] = {"ascii", "binary_little_endian", "binary_big_endian"};
  const std::string end = w.has("CR LF") ? "\r\n" : "\n";
  const bool reals = w.has("doubles"), other = w.has("an element before"), lists = w.has("lists of it"),
             edges = w.has("edges after"), texture = w.has("texcoord lists"), flags = w.has("flags of faces"),
             colours = w.has("colours of vertices"), swapped = w.has("z before x"), sized = w.has("names with sizes");
  const std::string real = reals ? sized ? "float64" : "double" : sized ? "float32" : "float";
  std::string head = std::string("ply\nformat ") + NAMES[format] + " 1.0\ncomment by a test\n";
  if (other)
    head += std::string("element material 2\n") + (lists ? "property list uchar float weights\n" : "property int id\n");
  head += "element vertex " + std::to_string(w.mesh.positions.size()) + "\n";
  if (colours) head += "property uchar red\n";
  const std::array<int, 3> order = swapped ? std::array<int, 3>{2, 0, 1} : std::array<int, 3>{0, 1, 2};
  for (const int axis : order) head += "property " + real + " " + "xyz"[axis] + "\n";
  head += "element face " + std::to_string(w.mesh.faces.size()) + "\n";
  if (flags) head += "property uchar flags\n";
  head += "property list uchar int " + std::string(w.has("vertex_index") ? "vertex_index" : "vertex_indices") + "\n";
  if (texture) head += "property list uchar float texcoord\n";
  if (edges) head += "element edge 1\nproperty int vertex1\nproperty int vertex2\n";
  head += "end_header\n";
  for (const char c : head) c == '\n' ? w.bytes += end : w.bytes += c;
  PlyValues values(w, format, end);
  for (int row = 0; other && row < 2; ++row) {
    if (lists) {
      values.byte(2);
      for (const double weight : {0.5, 2.0}) values.real(weight, false);
    } else {
      values.integer(7);
    }
    values.endRow();
  }
  for (const Vec3& p : w.mesh.positions) {
    if (colours) values.byte(255);
    for (const int axis : order) values.real(p[axis], reals);
    values.endRow();
  }
  for (const Face& face : w.mesh.faces) {
    if (flags) values.byte(1);
    values.byte(3);
    for (const Index v : face) values.integer(v);
    if (texture) {
      values.byte(6);
      for (int k = 0; k < 6; ++k) values.real(0.5, false);
    }
    values.endRow();
  }
  if (edges) {
    values.integer(0);
    values.integer(1);
    values.endRow();
  }
}

class MeshFileForms : public test::FolderTest {
 protected:
  void expectRead(const std::string& ending, unsigned files, const std::function<void(Writer&)>& write) {
    for (unsigned seed = 0; seed < files; ++seed) {
      Writer w(seed);
      write(w);
      const std::string path = folder_ / ("a." + ending);
      std::ofstream(path, std::ios::binary) << w.bytes;
      MeshFile read;
      ASSERT_NO_THROW(read = loadMeshFile(path)) << w.bytes;
      ASSERT_EQ(trianglesOf(read.positions, read.faces), trianglesOf(w.mesh.positions, w.mesh.faces)) << w.bytes;
    }
  }
};

TEST_F(MeshFileForms, Obj) { expectRead("obj", 150, writeObj); }
TEST_F(MeshFileForms, AsciiStl) { expectRead("stl", 100, writeStl); }
TEST_F(MeshFileForms, BinaryStl) { expectRead("stl", 60, writeBinaryStl); }
TEST_F(MeshFileForms, Ply) {
  for (const int format : {0, 1, 2}) expectRead("ply", 80, [format](Writer& w) { writePly(w, format); });
}

}  // namespace
}  // namespace dccd
