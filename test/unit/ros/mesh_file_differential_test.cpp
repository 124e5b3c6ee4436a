// Our readers of mesh files beside those of assimp and PCL, over generated files of odd but legal form. What was
// written is known: ours must read just that. Where another reader reads something else, the file has a form that it is
// known to mistake.
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <functional>
#include <iomanip>
#include <limits>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <sstream>

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <gtest/gtest.h>
#include <pcl/io/ply/ply_parser.h>
#include <assimp/Importer.hpp>

#include "input/mesh_formats.h"
#include "support/folder_test.h"

namespace dccd {
namespace {

using Triangle = std::array<std::array<double, 3>, 3>;
/// Each begins with its least corner, so that turned ones are equal and mirrored ones are not.
using Triangles = std::multiset<Triangle>;

void add(const Vec3& a, const Vec3& b, const Vec3& c, Triangles& out) {
  Triangle t{{{a.x(), a.y(), a.z()}, {b.x(), b.y(), b.z()}, {c.x(), c.y(), c.z()}}};
  std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  out.insert(t);
}

Triangles trianglesOf(const Positions& p, const std::vector<Face>& faces) {
  Triangles out;
  for (const Face& f : faces) add(p[f[0]], p[f[1]], p[f[2]], out);
  return out;
}

// --- the other readers, each in a child process: they crash, and some print

using Answer = std::optional<Triangles>;  // nothing: refused, or the child did not come to an end

Answer inChild(const std::function<Answer()>& read) {
  int ends[2];
  if (::pipe(ends) != 0) return std::nullopt;
  const pid_t child = ::fork();
  if (child == 0) {
    ::alarm(10);
    const Answer answer = read();
    bool good = answer.has_value();
    if (good) {
      for (const Triangle& t : *answer) good = good && ::write(ends[1], &t, sizeof t) == sizeof t;
    }
    ::_exit(good ? 0 : 1);
  }
  ::close(ends[1]);
  Triangles triangles;
  Triangle t;
  while (::read(ends[0], &t, sizeof t) == sizeof t) triangles.insert(t);
  ::close(ends[0]);
  int status = 1;
  ::waitpid(child, &status, 0);
  return status == 0 ? Answer(triangles) : std::nullopt;
}

Answer byAssimp(const std::string& bytes, const std::string& ending) {
  return inChild([&]() -> Answer {
    Assimp::Importer importer;
    const aiScene* scene = importer.ReadFileFromMemory(bytes.data(), bytes.size(), 0, ending.c_str());
    if (!scene) return std::nullopt;
    Triangles out;
    for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
      const aiMesh& mesh = *scene->mMeshes[m];
      for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
        const aiFace& face = mesh.mFaces[f];
        const auto corner = [&](unsigned k) {
          const aiVector3D& p = mesh.mVertices[face.mIndices[k]];
          return Vec3(p.x, p.y, p.z);
        };
        if (face.mNumIndices == 3) add(corner(0), corner(1), corner(2), out);
      }
    }
    return out;
  });
}

using pcl::io::ply::ply_parser;

template <typename Real>
void takeCoordinates(ply_parser::scalar_property_definition_callbacks_type& scalars, Positions& positions) {
  using Take = typename ply_parser::scalar_property_callback_type<Real>::type;
  scalars.get<Real>() = [&positions](const std::string& element, const std::string& property) -> Take {
    if (element != "vertex" || property.size() != 1 || property < "x" || property > "z") return nullptr;
    const int axis = property[0] - 'x';
    return [&positions, axis](Real x) { positions.back()[axis] = x; };
  };
}

/// Its parser takes faces of `uchar int` lists here; it refuses what has other lists.
Answer byPcl(const std::string& path) {
  return inChild([&]() -> Answer {
    Positions positions;
    std::vector<Index> polygon;
    std::vector<Face> faces;
    ply_parser parser;
    parser.element_definition_callback([&](const std::string& element, std::size_t) {
      if (element != "vertex") return ply_parser::element_callbacks_type();
      return ply_parser::element_callbacks_type([&] { positions.push_back(Vec3::Zero()); }, nullptr);
    });
    ply_parser::scalar_property_definition_callbacks_type scalars;
    takeCoordinates<float>(scalars, positions);
    takeCoordinates<double>(scalars, positions);
    parser.scalar_property_definition_callbacks(scalars);
    ply_parser::list_property_definition_callbacks_type lists;
    lists.get<std::uint8_t, std::int32_t>() = [&](const std::string&, const std::string&) {
      return std::make_tuple([&](std::uint8_t) { polygon.clear(); },
                             [&](std::int32_t v) { polygon.push_back(static_cast<Index>(v)); },
                             [&] {
                               faces.push_back({polygon.at(0), polygon.at(1), polygon.at(2)});
                             });
    };
    parser.list_property_definition_callbacks(lists);
    if (!parser.parse(path)) return std::nullopt;
    return trianglesOf(positions, faces);
  });
}

// --- what is written

struct Mesh {
  Positions positions;  // all different, of few bits, so that readers that round to float do not round them
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
  std::set<std::string> forms;  // that the file has

  int below(int n) { return static_cast<int>(random_() % static_cast<unsigned>(n)); }
  /// Of four files one has the form.
  bool has(const std::string& form) {
    if (known_.emplace(form, below(4) == 0).first->second) forms.insert(form);
    return known_[form];
  }
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
      for (const double x : w.mesh.positions[v]) put(w.bytes, static_cast<float>(x));
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

struct Tally {
  int same = 0, refused = 0;
  std::map<std::string, int> other;  // by the file's forms
};

class MeshFileDifferential : public test::FolderTest {
 protected:
  using Write = void (*)(Writer&);

  void compare(const std::string& ending, unsigned files, const std::function<void(Writer&)>& write,
               const std::set<std::string>& assimp_mistakes, const std::set<std::string>& pcl_mistakes = {}) {
    Tally assimp, pcl;
    for (unsigned seed = 0; seed < files; ++seed) {
      Writer w(seed);
      write(w);
      const std::string path = (folder_ / ("a." + ending)).string();
      std::ofstream(path, std::ios::binary) << w.bytes;
      const Triangles truth = trianglesOf(w.mesh.positions, w.mesh.faces);
      MeshFile ours;
      ASSERT_NO_THROW(ours = loadMeshFile(path)) << w.bytes;
      ASSERT_EQ(trianglesOf(ours.positions, ours.faces), truth) << w.bytes;
      count(byAssimp(w.bytes, ending), truth, w, assimp_mistakes, assimp);
      if (ending == "ply") count(byPcl(path), truth, w, pcl_mistakes, pcl);
    }
    expectJudge("assimp", assimp, files);
    if (ending == "ply") expectJudge("PCL", pcl, files);
  }

 private:
  static void count(const Answer& answer, const Triangles& truth, const Writer& w,
                    const std::set<std::string>& mistakes, Tally& tally) {
    if (!answer) {
      ++tally.refused;
    } else if (*answer == truth) {
      ++tally.same;
    } else if (std::none_of(mistakes.begin(), mistakes.end(),
                            [&](const auto& form) { return w.forms.count(form) > 0; })) {
      std::string forms;
      for (const std::string& form : w.forms) forms += form + ", ";
      ++tally.other[forms];
    }
  }
  static void expectJudge(const std::string& name, const Tally& tally, unsigned files) {
    EXPECT_GT(tally.same, static_cast<int>(files) / 4)
        << name << " reads too little to be a judge; refused " << tally.refused;
    for (const auto& [forms, times] : tally.other)
      ADD_FAILURE() << name << " reads other triangles, " << times << " x: " << forms;
  }
};

TEST_F(MeshFileDifferential, Obj) { compare("obj", 150, writeObj, {"CR", "form feeds", "faces before vertices"}); }
TEST_F(MeshFileDifferential, AsciiStl) { compare("stl", 100, writeStl, {}); }
TEST_F(MeshFileDifferential, BinaryStl) { compare("stl", 60, writeBinaryStl, {"padding"}); }
TEST_F(MeshFileDifferential, AsciiPly) {
  compare("ply", 100, [](Writer& w) { writePly(w, 0); }, {}, {});
}
TEST_F(MeshFileDifferential, BinaryPly) {
  for (const int format : {1, 2}) compare("ply", 60, [format](Writer& w) { writePly(w, format); }, {}, {});
}

}  // namespace
}  // namespace dccd
