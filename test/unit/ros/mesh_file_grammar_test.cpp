// The grammar of mesh files: each row of the tables in doc/mesh_files.md is a test of its name here.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <random>
#include <regex>
#include <set>

#include "input/mesh_formats.h"
#include "input/npy_file.h"
#include "support/folder_test.h"
#include "support/said.h"

namespace dccd {
namespace {

using test::mentions;

class Grammar : public test::FolderTest {
 protected:
  MeshFile read(const std::string& name, const std::string& bytes) {
    const std::string path = (folder_ / name).string();
    std::ofstream(path, std::ios::binary) << bytes;
    return loadMeshFile(path);
  }
  /// Behind the folder: "a.obj:3: ..."; empty where it is read.
  std::string error(const std::string& name, const std::string& bytes) {
    try {
      read(name, bytes);
    } catch (const MeshFileError& e) {
      return std::string(e.what()).substr(folder_.string().size() + 1);
    }
    return "";
  }
  void expectRefused(const std::string& name, const std::string& bytes, const std::string& where,
                     const std::string& word) {
    const std::string said = error(name, bytes);
    EXPECT_EQ(said.substr(0, where.size()), where) << said << "\n" << bytes;
    EXPECT_TRUE(mentions(said, word)) << said << "\n" << bytes;
  }
};

const Positions SQUARE{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0.25}};
const std::vector<Face> TWO{{0, 1, 2}, {2, 1, 3}};

/// Two triangles on four vertices.
void expectTwo(const MeshFile& mesh, const std::string& what) {
  EXPECT_EQ(mesh.positions, SQUARE) << what;
  EXPECT_EQ(mesh.faces, TWO) << what;
  EXPECT_TRUE(mesh.unchecked.empty()) << what;
}

/// A quadrilateral with a notch at its last corner, which stays open.
void expectDart(const MeshFile& mesh) { EXPECT_EQ(mesh.faces, (std::vector<Face>{{3, 0, 1}, {1, 2, 3}})); }

void expectUnchecked(const MeshFile& mesh, const std::vector<std::size_t>& polygons, const std::string& first) {
  EXPECT_EQ(mesh.unchecked, polygons);
  ASSERT_EQ(mesh.hints.size(), 1u);
  EXPECT_TRUE(mentions(mesh.hints[0], "are unchecked, the first is ")) << mesh.hints[0];
  EXPECT_TRUE(mentions(mesh.hints[0], first)) << mesh.hints[0];
}

// --- OBJ

class ObjGrammar : public Grammar {
 protected:
  static std::string vertices() { return "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0.25\n"; }
  /// Of the two faces behind the vertices.
  MeshFile faces(const std::string& text) { return read("a.obj", vertices() + text); }
  void expectFaces(const std::string& text) {
    const MeshFile mesh = faces(text);
    expectTwo(mesh, text);
    EXPECT_TRUE(mesh.hints.empty()) << text;
  }
  void expectLine5(const std::string& text, const std::string& word) {
    expectRefused("a.obj", vertices() + text, "a.obj:5: ", word);
  }
};

TEST_F(ObjGrammar, Blanks) {
  for (const std::string blank : {" ", "\t", "\f", "\v", " \t\f\v "}) {
    expectFaces(blank + "f" + blank + "1" + blank + "2" + blank + "3" + blank + "\n" + blank + "f 3 2 4\n");
    expectTwo(read("a.obj",
                   blank + "v 0 0 0\n" + blank + "v" + blank + "1 0 0\n" + "v 0 1 0\nv 1 1 0.25\nf 1 2 3\nf 3 2 4\n"),
              "v");
  }
}

TEST_F(ObjGrammar, EndsOfLines) {
  const std::string text = vertices() + "f 1 2 3\n\nf 3 2 4\n";
  for (const std::string end : {"\r", "\r\n"}) {
    expectTwo(read("a.obj", std::regex_replace(text, std::regex("\n"), end)), end);
    const std::string wrong = std::regex_replace(vertices() + "f 1 2 3\nf 3 2 x\n", std::regex("\n"), end);
    expectRefused("a.obj", wrong, "a.obj:6: ", "'x'");
  }
  expectFaces("f 1 2 3\nf 3 2 4");
}

TEST_F(ObjGrammar, ByteOrderMark) {
  expectTwo(read("a.obj", "\xef\xbb\xbf" + vertices() + "f 1 2 3\nf 3 2 4\n"), "UTF-8");
  expectRefused("a.obj", std::string("\xff\xfev\0 \0", 6), "a.obj", "UTF-16");
}

TEST_F(ObjGrammar, Comments) {
  expectFaces("# a square\nf 1 2 3 # one\n  #\nf 3 2 4 #4\n#");
  expectLine5("f 1 2 3# one\n", "'3#'");
}

TEST_F(ObjGrammar, ContinuedLines) {
  expectFaces("f 1 2 \\\n3\nf 3 \\\r\n\\\n  2 4\n");
  expectTwo(read("a.obj", "v 0 0 0\nv 1\\\n 0 0\nv 0 1 \\\n0\nv 1 1 0.25\nf 1 2 3\nf 3 2 4\n"), "vertices");
  expectRefused("a.obj", vertices() + "f 1 2 \\\n  x\n", "a.obj:6: ", "'x'");
  expectLine5("f 1 2 3\\\n4\n", "without a blank");
  expectLine5("f 1 2 3 \\", "no line follows");
  // Programs differ on whether the next line belongs to it.
  expectLine5("# C:\\meshes\\\nf 1 2 3\n", "not certain");
  expectRefused("a.obj", vertices() + "f 1 2 \\\n3 # C:\\meshes\\\nf 3 2 4\n", "a.obj:6: ", "not certain");
  expectFaces("\\\nf 1 2 3\nf 3 2 4\n");
  expectLine5("usemtl C:\\meshes\\\n f 1 2 3\n", "not certain");
  expectFaces("usemtl a \\\n b\nf 1 2 3\nf 3 2 4\n");
}

TEST_F(ObjGrammar, Vertices) {
  const std::string rest = "f 1 2 3\nf 3 2 4\n";
  for (const std::string more : {" 1", " 1.0", " 0.5 0.5 1", " 1 0.5 0.5 1"}) {
    expectTwo(read("a.obj", "v 0 0 0" + more + "\nv +1 0. .0" + more + "\nv 0e5 1E0 -0\nv 10e-1 1 0.25\n" + rest),
              more);
  }
  for (const std::string numbers : {"", "0", "0 0", "0 0 0 0 0", "0 0 0 0 0 0 0 0"}) {
    expectRefused("a.obj", "v " + numbers + "\n", "a.obj:1: ", "'v'");
  }
}

TEST_F(ObjGrammar, Weights) {
  expectRefused("a.obj", "v 1 1 1 2\n", "a.obj:1: ", "'2'");
  expectRefused("a.obj", "v 1 1 1 0.5 1 0 0\n", "a.obj:1: ", "'0.5'");
}

const char* const NO_NUMBERS[] = {"1.0-1", "1.0D-2", "1d0", "0,5", "0x10",  "0x1p3", "1.0.0", "1e",       "e1",    ".",
                                  "+",     "--1",    "1f",  "1_0", "1e999", "1'0",   "1#IND", "\xd9\xa1", "nan(1)"};

TEST_F(ObjGrammar, Numbers) {
  for (const std::string word : NO_NUMBERS) {
    for (int axis = 0; axis < 3; ++axis) {
      std::string line = "v";
      for (int k = 0; k < 3; ++k) line += " " + (k == axis ? word : "0");
      expectRefused("a.obj", "v 0 0 0\n" + line + "\n", "a.obj:2: ", "is no decimal number");
    }
  }
  EXPECT_EQ(read("a.obj", "v 0.1 1e-320 123456789012345678901234567890\n").positions[0],
            Vec3(0.1, 1e-320, 123456789012345678901234567890.0));
}

TEST_F(ObjGrammar, NotFinite) {
  const MeshFile mesh = read("a.obj", "v nan 0 0\nv inf 0 0\nv -Infinity 0 NaN\n");
  EXPECT_TRUE(std::isnan(mesh.positions[0].x()));
  EXPECT_EQ(mesh.positions[1].x(), INFINITY);
  EXPECT_EQ(mesh.positions[2].x(), -INFINITY);
}

TEST_F(ObjGrammar, Corners) {
  for (const std::string tail : {"", "/7", "//7", "/7/7", "/-1/-1", "/", "//"}) {
    const auto corner = [&](const std::string& v) { return " " + v + tail; };
    expectFaces("f" + corner("1") + corner("2") + corner("3") + "\nf" + corner("-2") + corner("-3") + corner("+4") +
                "\n");
  }
  for (const std::string word :
       {"0", "x", "1.0", "1.5", "1,2", "1/x", "1/0", "1//0", "1//x", "1/1/1/1", "/1", "1e0", "0x1", "1-"}) {
    expectLine5("f 2 3 " + word + "\n", "'" + word + "'");
    expectLine5("f " + word + " 2 3\n", "'" + word + "'");
  }
  expectDart(read("a.obj", "v 0 0 0\nv 2 1 0\nv 0 2 0\nv 1.5 1 0\nf 1 2 3 4\n"));
}

TEST_F(ObjGrammar, VerticesThatAreNotThere) {
  expectTwo(read("a.obj", "f 1 2 3\nf 3 2 4\n" + vertices()), "vertices may come later");
  expectRefused("a.obj", vertices() + "f 1 2 3\nf 3 2 9\nf 3 2 5\n", "a.obj:6: ", "'9'");
  expectLine5("f 1 2 5/1\n", "'5/1'");
  expectLine5("f 1 2 -5\n", "'-5'");
  expectLine5("f 1 2 4000000000\n", "'4000000000'");
  expectLine5("f 1 2 99999999999999999999\n", "'99999999999999999999'");
  expectRefused("a.obj", "f 1 2 3\n", "a.obj: ", "no vertices");
}

TEST_F(ObjGrammar, FewCorners) {
  expectLine5("f 1 2\n", "fewer than three corners");
  expectLine5("f\n", "fewer than three corners");
}

TEST_F(ObjGrammar, RepeatedCorners) {
  const MeshFile mesh = faces("f 1 2 3\nf 2 4 4\nf 3 2 4\n");
  EXPECT_EQ(mesh.polygons.size(), 3u);
  EXPECT_EQ(mesh.faces, TWO) << "2 4 4 is an edge of the last face";
  EXPECT_TRUE(mesh.unchecked.empty());
  expectUnchecked(faces("f 1 2 3\nf 2 4 4\n"), {1}, "in line 6");
}

TEST_F(ObjGrammar, Lines) {
  const MeshFile mesh = read("a.obj", vertices() + "v 2 2 2\nl 1 2 3\nl 5/1 -2/7\n");
  EXPECT_EQ(mesh.edges, (std::vector<Edge>{{0, 1}, {1, 2}, {3, 4}}));
  EXPECT_TRUE(mesh.faces.empty());
  expectLine5("l 1\n", "fewer than two");
  expectLine5("l 1 2 2\n", "'2'");
  expectLine5("l 1 2//3\n", "'2//3'");
  expectLine5("l 1 9\n", "'9'");
}

TEST_F(ObjGrammar, LinesBesideFaces) {
  expectFaces("f 1 2 3\nl 1 2 3\nf 3 2 4\n");
  const MeshFile mesh = faces("l 3 2 1 4\nf 1 2 3\nf 3 2 4\n");
  EXPECT_EQ(mesh.faces, TWO);
  EXPECT_TRUE(mesh.edges.empty());
  expectUnchecked(mesh, {4}, "in line 5");
}

TEST_F(ObjGrammar, Groups) {
  const MeshFile mesh = faces("g one both\nf 1 2 3\ng two both\nf 3 2 4\ng\n");
  EXPECT_EQ(mesh.groups.at("one"), (FaceGroups::mapped_type{{0, 1}}));
  EXPECT_EQ(mesh.groups.at("two"), (FaceGroups::mapped_type{{1, 2}}));
  EXPECT_EQ(mesh.groups.at("both"), (FaceGroups::mapped_type{{0, 1}, {1, 2}}));
}

TEST_F(ObjGrammar, SkippedKeywords) {
  expectFaces(
      "vt 0 0\nvn 0 0 1\nvp 1\no name\ns off\nmg 1 0.5\nmtllib a.mtl\nusemtl b\nmaplib m\nusemap m\nbevel on\n"
      "c_interp on\nd_interp on\nlod 1\nshadow_obj a\ntrace_obj a\nctech a\nstech a\nf 1 2 3\nf 3 2 4\n");
}

TEST_F(ObjGrammar, OtherGeometry) {
  for (const std::string word :
       {"p",    "fo", "curv", "curv2", "surf", "cstype", "deg", "bmat", "step", "parm", "trim", "hole",
        "scrv", "sp", "end",  "con",   "bzp",  "bsp",    "cdc", "cdp",  "res",  "call", "csh"}) {
    expectLine5(word + " 1 2 3\nf 1 2 3\nf 3 2 4\n", "'" + word + "'");
  }
}

TEST_F(ObjGrammar, Capitals) {
  for (const std::string word : {"F", "V", "L", "G", "FO", "Curv"}) expectLine5(word + " 1 2 3\n", "small letters");
}

TEST_F(ObjGrammar, LinesOfNumbers) {
  expectLine5("3 2 4\nf 1 2 3\nf 3 2 4\n", "'3'");
  const std::string said = error("a.obj", "648 216\nv 0 0 0\n");
  EXPECT_NE(said.find("'648' begins the first line, where an OBJ file has 'v', 'f' or 'l'"), std::string::npos) << said;
}

TEST_F(ObjGrammar, UnknownKeywords) {
  const MeshFile mesh = faces("face 1 2 3\nf 1 2 3\nf1 2 3\nf 3 2 4\n");
  expectTwo(mesh, "unknown");
  EXPECT_EQ(mesh.uncheckedCount(), 2u) << "they may be faces";
  ASSERT_EQ(mesh.hints.size(), 1u);
  EXPECT_TRUE(mentions(mesh.hints[0], "2 lines") && mentions(mesh.hints[0], "'face' in line 5")) << mesh.hints[0];
}

// Words of nobody's at any place: what is read besides is not taken for the whole.
TEST_F(ObjGrammar, AnyOtherWordCostsTheProof) {
  std::mt19937 random(1);
  const std::vector<std::string> good{"v 0 0 0", "v 1 0 0", "v 0 1 0", "v 1 1 0.25", "f 1 2 3", "f 3 2 4"};
  for (int i = 0; i < 200; ++i) {
    std::string word = "q";
    while (random() % 3 > 0) word += static_cast<char>('a' + random() % 26);
    const std::size_t place = random() % (good.size() + 1);
    std::string text;
    for (std::size_t line = 0; line <= good.size(); ++line) {
      if (line == place) text += word + (random() % 2 == 0 ? " 1 3 2\n" : "\n");
      if (line < good.size()) text += good[line] + "\n";
    }
    EXPECT_EQ(read("a.obj", text).uncheckedCount(), 1u) << text;
  }
}

// --- STL

class StlGrammar : public Grammar {
 protected:
  static std::string facet(const std::vector<std::string>& corners, const std::string& normal = "0 0 1") {
    std::string text = "facet normal " + normal + "\nouter loop\n";
    for (const std::string& corner : corners) text += "vertex " + corner + "\n";
    return text + "endloop\nendfacet\n";
  }
  static std::string two() { return facet({"0 0 0", "1 0 0", "0 1 0"}) + facet({"0 1 0", "1 0 0", "1 1 0.25"}); }
  static std::string solid(const std::string& facets, const std::string& name = "a") {
    return "solid " + name + "\n" + facets + "endsolid " + name + "\n";
  }
  static std::string binary(std::uint32_t count, const std::string& header = "binary") {
    std::string out = header;
    out.resize(80);
    out.append(reinterpret_cast<const char*>(&count), 4);
    for (const Face& face : TWO) {
      float values[12] = {0, 0, 1};
      for (int k = 0; k < 3; ++k) {
        for (int axis = 0; axis < 3; ++axis) values[3 * k + 3 + axis] = static_cast<float>(SQUARE[face[k]][axis]);
      }
      out.append(reinterpret_cast<const char*>(values), sizeof values).append(2, '\0');
    }
    return out;
  }
};

TEST_F(StlGrammar, Ascii) {
  expectTwo(read("a.stl", solid(two())), "plain");
  expectTwo(
      read("a.stl", solid(facet({"0 0 0", "1 0 0", "0 1 0"})) + "\n" + solid(facet({"0 1 0", "1 0 0", "1 1 0.25"}))),
      "two solids");
  expectTwo(read("a.stl", std::regex_replace(solid(two()), std::regex("\n"), "\r")), "CR");
  expectTwo(read("a.stl", std::regex_replace(solid(two()), std::regex("\n"), "\r\n\t")),
            "CR LF, blanks before the words");
  expectTwo(read("a.stl", "\xef\xbb\xbf \n" + solid(two())), "mark of UTF-8");
  const std::string one_line = std::regex_replace(two(), std::regex("\n"), " ");
  expectTwo(read("a.stl", "solid\n" + one_line + "endsolid"), "facets in one line");
}

TEST_F(StlGrammar, Capitals) {
  std::string text = solid(two());
  for (char& c : text) c = static_cast<char>(std::toupper(c));
  expectTwo(read("a.stl", text), text);
}

TEST_F(StlGrammar, Names) {
  for (const std::string name : {"", "vertex", "a vertex 1 2 3", "facet normal 0 0 1", "endsolid", "solid", "1.0-1"}) {
    expectTwo(read("a.stl", solid(two(), name)), name);
  }
}

TEST_F(StlGrammar, Normals) {
  for (const std::string normal : {"nan nan nan", "-nan(ind) 0 0", "0 0 0", "5 -3 1e9"}) {
    expectTwo(read("a.stl", solid(facet({"0 0 0", "1 0 0", "0 1 0"}, normal) + facet({"0 1 0", "1 0 0", "1 1 0.25"}))),
              normal);
  }
  EXPECT_NE(error("a.stl", solid(facet({"0 0 0", "1 0 0", "0 1 0"}, "0 0"))), "");
}

TEST_F(StlGrammar, Numbers) {
  for (const std::string word : NO_NUMBERS) {
    expectRefused("a.stl", solid(facet({"0 0 0", "1 " + word + " 0", "0 1 0"})), "a.stl:5: ", "is no decimal number");
  }
  EXPECT_EQ(read("a.stl", solid(facet({"0.1 0 0", "1 0 0", "0 1 0"}))).positions[0].x(), 0.1) << "no float";
}

TEST_F(StlGrammar, OtherWords) {
  expectRefused("a.stl", solid(facet({"0 0 0", "1 0 0"})), "a.stl:6: ", "'endloop'");
  expectRefused("a.stl", solid(facet({"0 0 0", "1 0 0", "0 1 0", "1 1 0"})), "a.stl:7: ", "'vertex'");
  expectRefused("a.stl", solid(facet({"0 0 0 0", "1 0 0", "0 1 0"})), "a.stl:4: ", "'0'");
  expectRefused("a.stl", solid("color 1 0 0\n" + two()), "a.stl:2: ", "'color'");
  expectRefused("a.stl", solid(two()) + two(), "a.stl:17: ", "'facet'");
  expectRefused("a.stl", "solidify\n" + two(), "a.stl: ", "neither");
}

TEST_F(StlGrammar, CutText) {
  const std::string whole = solid(two());
  for (const std::size_t left : {whole.size() - 12, whole.size() / 2, std::size_t{9}}) {
    EXPECT_NE(error("a.stl", whole.substr(0, left)), "") << left;
  }
  expectRefused("a.stl", solid(""), "a.stl: ", "no whole triangles");
}

TEST_F(StlGrammar, Binary) {
  for (const std::string header : {"", "binary", "solid", "SOLID vertex 1 2 3"}) {
    const MeshFile mesh = read("a.stl", binary(2, header));
    expectTwo(mesh, header);
    EXPECT_TRUE(mesh.hints.empty());
  }
}

TEST_F(StlGrammar, Padding) {
  for (const std::string& more :
       {std::string(1, '\0'), std::string(50, '\0'), std::string("\r\n"), std::string(1000, ' ')}) {
    for (const std::string header : {"binary", "solid"}) {
      const MeshFile mesh = read("a.stl", binary(2, header) + more);
      expectTwo(mesh, header);
      ASSERT_EQ(mesh.hints.size(), 1u);
      EXPECT_TRUE(mentions(mesh.hints[0], std::to_string(more.size()) + " bytes")) << mesh.hints[0];
    }
  }
}

TEST_F(StlGrammar, WrongCounts) {
  for (const std::uint32_t count : {0u, 1u}) {
    expectRefused("a.stl", binary(count), "a.stl: ", "states " + std::to_string(count) + " triangles");
    expectRefused("a.stl", binary(count, "solid"), "a.stl: ", "states " + std::to_string(count) + " triangles");
  }
  expectRefused("a.stl", binary(3), "a.stl: ", "of the size that it states");
  expectRefused("a.stl", binary(3, "solid"), "a.stl: ", "of the size that it states");
  expectRefused("a.stl", binary(2).substr(0, 150), "a.stl: ", "of the size that it states");
}

TEST_F(StlGrammar, NotFinite) {
  expectRefused("a.stl", solid(facet({"nan 0 0", "1 0 0", "0 1 0"})), "a.stl: ", "is not finite");
}

TEST_F(StlGrammar, RepeatedCorners) {
  const std::string thin = facet({"0 0 0", "1 0 0", "1 0 0"}), apart = facet({"5 0 0", "6 0 0", "6 0 0"});
  expectTwo(read("a.stl", solid(two() + thin)), "an edge of a face");
  expectUnchecked(read("a.stl", solid(two() + apart)), {2}, "triangle 2, in line 16");
  std::string bytes = binary(3) + std::string(50, '\0');
  const float far = 7;
  for (std::size_t k = 1; k <= 3; ++k) std::memcpy(&bytes[84 + 2 * 50 + 12 * k], &far, sizeof far);
  expectUnchecked(read("a.stl", bytes), {2}, "triangle 2");
}

TEST_F(StlGrammar, Sequences) {
  const auto frames = [&](const std::string& first, const std::string& second) {
    return std::vector<MeshFile>{read("0.stl", solid(first)), read("1.stl", solid(second))};
  };
  const std::string thin = facet({"5 0 0", "6 0 0", "6 0 0"}), wide = facet({"5 0 0", "6 0 0", "6 1 0"});
  std::vector<MeshFile> moved = frames(two(), facet({"0 0 1", "1 0 1", "0 1 1"}) + facet({"0 1 1", "1 0 1", "0 0 1"}));
  EXPECT_EQ(moved[1].positions.size(), 3u) << "by itself: two vertices meet in it";
  EXPECT_EQ(matchSoups(moved), 0u);
  expectTwo(moved[0], "as it is alone");
  EXPECT_EQ(moved[1].positions, (Positions{{0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {0, 0, 1}})) << "what meets is contact";
  std::vector<MeshFile> torn = frames(two(), facet({"0 0 0", "1 0 0", "0 1 0"}) + facet({"0 1 1", "1 0 0", "1 1 0"}));
  EXPECT_EQ(matchSoups(torn), 1u);
  EXPECT_EQ(torn[0].faces, (std::vector<Face>{{0, 1, 2}, {3, 1, 4}}));
  EXPECT_EQ(torn[0].positions[2], torn[0].positions[3]);
  std::vector<MeshFile> grown = frames(two() + thin, two() + wide);
  ASSERT_EQ(grown[0].hints.size(), 1u) << "unchecked by itself";
  EXPECT_EQ(matchSoups(grown), 1u);
  EXPECT_EQ(grown[0].faces.size(), 3u);
  EXPECT_TRUE(grown[0].unchecked.empty() && grown[0].hints.empty()) << "a triangle that grows";
  std::vector<MeshFile> still = frames(two() + thin, two() + thin);
  EXPECT_EQ(matchSoups(still), 0u);
  expectUnchecked(still[1], {2}, "triangle 2, in line 16");
}

// --- PLY

class PlyGrammar : public Grammar {
 protected:
  static std::string head(const std::string& more, const std::string& format = "ascii") {
    return "ply\nformat " + format + " 1.0\n" + more + "end_header\n";
  }
  static std::string xyz(std::size_t count = 4, const std::string& type = "double") {
    std::string text = "element vertex " + std::to_string(count) + "\n";
    for (const char* axis : {"x", "y", "z"}) text += "property " + type + " " + axis + "\n";
    return text;
  }
  static std::string points() { return "0 0 0\n1 0 0\n0 1 0\n1 1 0.25\n"; }
  static std::string faceElement(std::size_t count = 2) {
    return "element face " + std::to_string(count) + "\nproperty list uchar int vertex_indices\n";
  }
  static std::string faces() { return "3 0 1 2\n3 2 1 3\n"; }
  static std::string whole() { return head(xyz() + faceElement()) + points() + faces(); }

  template <typename T>
  static void put(std::string& out, T value, bool big) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    if (big) std::reverse(bytes, bytes + sizeof value);
    out.append(bytes, sizeof value);
  }
  /// Its least number, 1 and its largest one, in either order of bytes.
  template <typename T>
  void expectBinary(const std::string& type) {
    using Limits = std::numeric_limits<T>;
    for (const bool big : {false, true}) {
      std::string text = head(xyz(1, type), big ? "binary_big_endian" : "binary_little_endian");
      for (const T value : {Limits::min(), T{1}, Limits::max()}) put(text, value, big);
      EXPECT_EQ(read("a.ply", text).positions.at(0), Vec3(Limits::min(), 1, Limits::max())) << type;
    }
  }
  /// With an element with a list before the faces, and lists and scalars beside their corners.
  template <typename Real = float>
  static std::string binary(bool big, const std::string& end = "\n") {
    const std::string real = sizeof(Real) == 4 ? "float" : "float64";
    std::string text =
        head("element material 1\nproperty list ushort double weights\nproperty short id\n" + xyz(4, real) +
                 "property list uchar uchar tags\nelement face 2\nproperty uchar flags\nproperty list uchar int "
                 "vertex_indices\n"
                 "property list uchar float texcoord\nelement edge 1\nproperty int vertex1\nproperty int vertex2\n",
             big ? "binary_big_endian" : "binary_little_endian");
    text = std::regex_replace(text, std::regex("\n"), end);
    put(text, std::uint16_t{2}, big);
    for (const double weight : {0.5, 2.0}) put(text, weight, big);
    put(text, std::int16_t{-7}, big);
    for (const Vec3& p : SQUARE) {
      for (int axis = 0; axis < 3; ++axis) put(text, static_cast<Real>(p[axis]), big);
      text += std::string("\3abc");
    }
    for (const Face& face : TWO) {
      text += std::string("\xff\3");
      for (const Index v : face) put(text, static_cast<std::int32_t>(v), big);
      text += '\6';
      for (int k = 0; k < 6; ++k) put(text, 0.5f, big);
    }
    put(text, std::int32_t{0}, big);
    put(text, std::int32_t{1}, big);
    return text;
  }
};

TEST_F(PlyGrammar, Encodings) {
  expectTwo(read("a.ply", whole()), "ascii");
  for (const bool big : {false, true}) {
    expectTwo(read("a.ply", binary(big)), big ? "big" : "little");
    expectTwo(read("a.ply", binary<double>(big)), "doubles");
    for (const std::size_t cut : {1u, 20u, 60u, 120u}) {
      EXPECT_NE(error("a.ply", binary(big).substr(0, binary(big).size() - cut)), "") << "cut by " << cut;
    }
  }
}

TEST_F(PlyGrammar, EndsOfLines) {
  for (const std::string end : {"\r", "\r\n"}) {
    expectTwo(read("a.ply", std::regex_replace(whole(), std::regex("\n"), end)), end);
    expectTwo(read("a.ply", binary(false, end)), end);
    // The body begins with the byte of a line feed.
    std::string text = head("element other 1\nproperty uchar a\n" + xyz(4, "uchar"), "binary_little_endian");
    text = std::regex_replace(text, std::regex("\n"), end) + "\n" + std::string(11, '\2') + '\3';
    EXPECT_EQ(read("a.ply", text).positions.back(), Vec3(2, 2, 3)) << end;
  }
  expectTwo(read("a.ply", "\xef\xbb\xbf" + whole()), "mark of UTF-8");
  expectTwo(read("a.ply", head(xyz() + faceElement()) + "\n" + points() + "\n\n" + faces() + "\n"), "empty lines");
}

TEST_F(PlyGrammar, Header) {
  const auto refused = [&](const std::string& more, const std::string& word) {
    expectRefused("a.ply", head(more) + points() + faces(), "a.ply:", word);
  };
  refused("elements vertex 4\n", "cannot be understood");
  refused("\n" + xyz(), "cannot be understood");
  refused("element vertex four\n", "'element vertex four'");
  refused("element vertex -1\n", "needs a name and a count");
  refused("element vertex 0x4\n", "needs a name and a count");
  refused("element vertex 4 4\n", "too many words");
  refused("element vertex 4000000000\n", "claims more than the file holds");
  refused("element vertex 4\nelement face 2\n", "without properties");
  refused("property double x\n", "belongs to no element");
  refused("element vertex 4\nproperty long x\n", "names no type");
  refused("element vertex 4\nproperty list float int x\n", "counts a list");
  refused("element vertex 4\nproperty double\n", "has no name");
  refused(xyz() + xyz(), "once more");
  refused("format ascii 1.0\n" + xyz(), "once more");
  expectRefused("a.ply", "ply\nformat ascii 2.0\nend_header\n", "a.ply:2: ", "names no format");
  expectRefused("a.ply", "ply\n" + xyz() + "end_header\n" + points(), "a.ply:6: ", "names no format");
  expectRefused("a.ply", "plyx\n", "a.ply:1: ", "is no PLY file");
  expectRefused("a.ply", "ply\nformat ascii 1.0\n", "a.ply:2: ", "has no end");
  expectTwo(read("a.ply", head("comment a\nobj_info b\ncomment\n" + xyz() + faceElement()) + points() + faces()),
            "comments");
}

TEST_F(PlyGrammar, Vertices) {
  const std::string properties =
      "element vertex 4\nproperty uchar red\nproperty float64 z\nproperty list int8 uint16 rings\n"
      "property float y\nproperty int32 x\nproperty float32 quality\n";
  expectTwo(read("a.ply", head(properties + faceElement()) +
                              "255 0 0 0 0 nan\n7 0 2 5 6 0 1 0.5\n0.5 0 1 9 1 0 1\n0 0.25 0 1 1 0\n" + faces()),
            "in another order, with others between them");
  for (const char* type :
       {"char", "int8", "short", "int16", "int", "int32", "uchar", "uint8", "ushort", "uint16", "uint", "uint32"}) {
    EXPECT_EQ(read("a.ply", head(xyz(1, type)) + "1 2 3\n").positions[0], Vec3(1, 2, 3)) << type;
  }
  expectBinary<std::int8_t>("char");
  expectBinary<std::uint8_t>("uchar");
  expectBinary<std::int16_t>("short");
  expectBinary<std::uint16_t>("ushort");
  expectBinary<std::int32_t>("int");
  expectBinary<std::uint32_t>("uint");
  expectRefused("a.ply", head("element vertex 1\nproperty float x\nproperty float y\n") + "0 0\n", "a.ply: ", "'z'");
  expectRefused("a.ply", head(xyz(1) + "property float x\n") + "0 0 0 0\n", "a.ply: ", "'x'");
  expectRefused("a.ply", head(faceElement()) + faces(), "a.ply: ", "no vertices");
}

TEST_F(PlyGrammar, Numbers) {
  for (const std::string word : NO_NUMBERS) {
    expectRefused("a.ply", head(xyz(1)) + "0 " + word + " 0\n", "a.ply:8: ", "is no decimal number");
    expectRefused("a.ply", head(xyz(1, "float")) + "0 " + word + " 0\n", "a.ply:8: ", "is no decimal number");
    expectRefused("a.ply", head(xyz(1, "int")) + "0 " + word + " 0\n", "a.ply:8: ", "is no integer");
    expectRefused("a.ply", head(xyz() + faceElement()) + points() + "3 0 1 2\n3 2 " + word + " 3\n",
                  "a.ply:15: ", "is no integer");
  }
  EXPECT_EQ(read("a.ply", head(xyz(1)) + "0.1 1e-320 1e300\n").positions[0], Vec3(0.1, 1e-320, 1e300));
  EXPECT_EQ(read("a.ply", head(xyz(1, "float")) + "0.1 0 0\n").positions[0].x(), double{0.1f});
  expectRefused("a.ply", head(xyz(1, "float")) + "0 1e39 0\n", "a.ply:8: ", "too large for a float");
  EXPECT_EQ(read("a.ply", head(xyz(1, "float")) + "3.4028235e38 1e-46 1e-400\n").positions[0],
            Vec3(double{std::numeric_limits<float>::max()}, 0, 0))
      << "the largest float, as it is written";
  EXPECT_EQ(read("a.ply", head(xyz(1)) + "1e-400 -1e-400 0\n").positions[0], Vec3::Zero());
  EXPECT_TRUE(std::isnan(read("a.ply", head(xyz(1)) + "nan 0 inf\n").positions[0].x()));
}

TEST_F(PlyGrammar, LinesOfText) {
  const std::string top = head(xyz() + faceElement());
  expectRefused("a.ply", top + "0 0 0\n1 0\n0 1 0\n1 1 0.25\n" + faces(), "a.ply:11: ", "vertex 1 has too few");
  expectRefused("a.ply", top + "0 0 0\n1 0 0 0\n0 1 0\n1 1 0.25\n" + faces(), "a.ply:11: ", "more than vertex 1 has");
  expectRefused("a.ply", top + points() + "3 0 1 2\n4 2 1 3\n", "a.ply:15: ", "polygon 1");
  expectRefused("a.ply", top + points() + "3 0 1 2\n2 2 1 3\n", "a.ply:15: ", "'3'");
  expectRefused("a.ply", top + points() + "3 0 1 2\n", "a.ply:14: ", "ends before polygon 1");
  expectRefused("a.ply", top + points() + faces() + "3 0 1 3\n", "a.ply:16: ", "counts are too low");
  expectRefused("a.ply", top + points() + "-3 0 1 2\n3 2 1 3\n", "a.ply:14: ", "-3");
  expectDart(read("a.ply", head(xyz() + faceElement(1)) + "0 0 0\n2 1 0\n0 2 0\n1.5 1 0\n4 0 1 2 3\n"));
}

TEST_F(PlyGrammar, FacesBesideTheirCorners) {
  expectTwo(read("a.ply", head(xyz() + "element face 2\nproperty list uchar float texcoord\nproperty uchar red\n"
                                       "property list uint8 uint32 vertex_index\nproperty int texnumber\n") +
                              points() + "6 0 0 1 0 0 1 255 3 0 1 2 0\n0 9 3 2 1 3 1\n"),
            "texcoord");
  for (const std::string properties :
       {"property list uchar int vertices\n", "property int vertex_indices\n",
        "property list uchar float vertex_indices\n",
        "property list uchar int vertex_indices\nproperty list uchar int vertex_index\n"}) {
    expectRefused("a.ply", head(xyz() + "element face 1\n" + properties) + points() + "3 0 1 2\n",
                  "a.ply: ", "'vertex_indices'");
  }
}

TEST_F(PlyGrammar, VerticesThatAreNotThere) {
  const std::string top = head(xyz() + faceElement());
  expectRefused("a.ply", top + points() + "3 0 1 2\n3 2 1 4\n", "a.ply:15: ", "polygon 1 names vertex 4 of 4");
  expectRefused("a.ply", top + points() + "3 0 1 -1\n3 2 1 3\n", "a.ply:14: ", "polygon 0 names vertex -1 of 4");
}

TEST_F(PlyGrammar, RepeatedCorners) {
  expectUnchecked(read("a.ply", head(xyz() + faceElement()) + points() + "3 0 1 2\n3 3 1 3\n"), {1}, "polygon 1");
  expectUnchecked(read("a.ply", head(xyz() + faceElement(3)) + points() + "3 0 1 2\n2 0 3\n3 2 1 3\n"), {1},
                  "polygon 1");
}

TEST_F(PlyGrammar, Strips) {
  const auto strips = [](const std::string& lines, const std::string& count = "1", const std::string& item = "int") {
    return head(xyz() + "element tristrips " + count + "\nproperty list int " + item + " vertex_indices\n") + points() +
           lines;
  };
  expectTwo(read("a.ply", strips("4 0 1 2 3\n")), "alternate");
  expectTwo(read("a.ply", strips("4 0 1 2 3\n", "1", "uint")), "without a sign");
  expectTwo(read("a.ply", strips("9 0 1 2 -1 -1 2 1 3 -1\n")), "-1 begins anew");
  expectTwo(read("a.ply", strips("3 0 1 2\n3 2 1 3\n", "2")), "two of them");
  EXPECT_EQ(read("a.ply", strips("6 3 0 1 2 -1 0\n")).faces, (std::vector<Face>{{3, 0, 1}, {1, 0, 2}}));
  expectRefused("a.ply", strips("4 0 1 2 -2\n"), "a.ply:14: ", "strip 0 names vertex -2 of 4");
  expectUnchecked(read("a.ply", strips("6 0 1 2 -1 1 3\n")), {1}, "a triangle of strip 0");
  expectUnchecked(read("a.ply", strips("3 0 1 2\n2 1 3\n", "2")), {1}, "a triangle of strip 1");
}

TEST_F(PlyGrammar, OtherElements) {
  const MeshFile mesh = read("a.ply", head("element camera 1\nproperty float view_px\n" + xyz() +
                                           "element material 2\nproperty list uchar float weights\n" + faceElement() +
                                           "element none 0\nproperty int a\n") +
                                          "0.5\n" + points() + "2 0.5 0.5\n0\n" + faces());
  expectTwo(mesh, "skipped");
  ASSERT_EQ(mesh.hints.size(), 2u);
  EXPECT_TRUE(mentions(mesh.hints[1], "'material' (2)")) << mesh.hints[1];
}

TEST_F(PlyGrammar, ElementsThatMayHoldFaces) {
  const auto withPoly = [](const std::string& type, const std::string& rows, const std::string& name = "poly") {
    const auto count = std::to_string(std::count(rows.begin(), rows.end(), '\n'));
    return head(xyz() + faceElement() + "element " + name + " " + count + "\nproperty list uchar " + type + " idx\n") +
           points() + faces() + rows;
  };
  const MeshFile mesh = read("a.ply", withPoly("int", "0\n3 1 3 2\n3 0 1 3\n"));
  EXPECT_EQ(mesh.faces, TWO) << "the rest is used";
  EXPECT_EQ(mesh.uncheckedCount(), 2u) << "an empty list holds nothing";
  ASSERT_EQ(mesh.hints.size(), 1u);
  EXPECT_TRUE(mentions(mesh.hints[0], "'poly' (3) is skipped, though its integers may be corners: unchecked"));
  const std::string one_by_one = "element triangle 2\nproperty int a\nproperty int b\nproperty int c\n";
  EXPECT_EQ(
      read("a.ply", head(xyz() + faceElement() + one_by_one) + points() + faces() + "1 3 2\n0 1 3\n").uncheckedCount(),
      2u);
  const MeshFile both = read("a.ply", head(xyz() + faceElement(3) + "element poly 1\nproperty list uchar uint idx\n") +
                                          points() + faces() + "3 0 1 0\n3 1 3 2\n");
  EXPECT_EQ(both.uncheckedCount(), 1u) << "what repeats a corner lies in another face";
  EXPECT_EQ(read("a.ply", withPoly("float", "3 1 3 2\n")).uncheckedCount(), 0u);
  EXPECT_EQ(read("a.ply", withPoly("int", "1 0\n", "range_grid")).uncheckedCount(), 0u) << "a scanner's pixels";
}

TEST_F(PlyGrammar, Edges) {
  const auto edges = [](const std::string& rows, const std::string& type = "int") {
    const auto count = std::to_string(std::count(rows.begin(), rows.end(), '\n'));
    return head(xyz() + "element face 0\nproperty list uchar int vertex_indices\nelement edge " + count +
                "\nproperty " + type + " vertex1\nproperty uchar red\nproperty " + type + " vertex2\n") +
           points() + rows;
  };
  const MeshFile ropes = read("a.ply", edges("0 255 1\n3 0 2\n"));
  EXPECT_EQ(ropes.edges, (std::vector<Edge>{{0, 1}, {2, 3}}));
  EXPECT_TRUE(ropes.faces.empty() && ropes.hints.empty());
  expectRefused("a.ply", edges("0 0 4\n"), "a.ply:18: ", "edge 0 names vertex 4 of 4");
  expectRefused("a.ply", edges("0 0 1\n2 0 2\n"), "a.ply:19: ", "edge 1 names vertex 2 twice");
  expectRefused("a.ply", edges("0 0 1\n", "float"), "a.ply:18: ", "no integer");
  expectRefused("a.ply", head(xyz() + "element edge 1\nproperty int a\n") + points() + "0\n", "a.ply: ", "'vertex1'");
}

// As it is written for what is drawn of a mesh without faces, a strut from corner to corner.
TEST_F(PlyGrammar, EdgesBesideFaces) {
  const std::string edge = "element edge 3\nproperty int vertex1\nproperty int vertex2\n", rows = "1 0\n0 3\n2 3\n";
  expectUnchecked(read("a.ply", head(xyz() + faceElement() + edge) + points() + faces() + rows), {3}, "edge 1");
  expectUnchecked(read("a.ply", head(xyz() + edge + faceElement()) + points() + rows + faces()), {3}, "edge 1");
  expectRefused("a.ply", head(xyz() + faceElement() + edge) + points() + faces() + "0 1\n0 4\n2 3\n",
                "a.ply:", "edge 1 names vertex 4 of 4");
}

TEST_F(PlyGrammar, RangeGrid) {
  const std::string grid = "element range_grid 2\nproperty list uchar int vertex_indices\n";
  EXPECT_TRUE(mentions(error("a.ply", head(xyz() + grid) + points() + "1 0\n0\n"), "range grid"));
  expectTwo(read("a.ply", head(xyz() + grid + faceElement()) + points() + "1 0\n0\n" + faces()), "with faces");
}

TEST_F(PlyGrammar, PointsAlone) { EXPECT_EQ(read("a.ply", head(xyz()) + points()).positions, SQUARE); }

TEST_F(PlyGrammar, EndOfBytes) {
  const std::string bytes = binary(false);
  for (std::size_t cut = 1; cut < 60; ++cut) EXPECT_NE(error("a.ply", bytes.substr(0, bytes.size() - cut)), "") << cut;
  for (const std::string& more : {std::string(12, '\0'), std::string("\n")}) {
    const MeshFile mesh = read("a.ply", bytes + more);
    expectTwo(mesh, "padding");
    EXPECT_TRUE(mentions(mesh.hints.back(), std::to_string(more.size()) + " bytes of padding")) << mesh.hints.back();
  }
  expectRefused("a.ply", bytes + "\1", "a.ply: ", "counts are too low");
}

// --- DAE

class DaeGrammar : public Grammar {
 protected:
  static std::string list(const std::string& kind, int count, const std::string& rest) {
    return "<" + kind + " count=\"" + std::to_string(count) +
           "\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>" + rest + "</" + kind + ">";
  }
  static std::string two() { return list("triangles", 2, "<p>0 1 2 2 1 3</p>"); }
  static std::string node(const std::string& before = "") {
    return "<node id=\"n\">" + before + "<instance_geometry url=\"#g\"/></node>";
  }
  static std::string dae(const std::string& primitives, const std::string& nodes = node(),
                         const std::string& points = "0 0 0 1 0 0 0 1 0 1 1 0.25",
                         const std::string& asset = "<unit name=\"metre\" meter=\"1\"/><up_axis>Z_UP</up_axis>") {
    return "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
           "<asset>" +
           asset +
           "</asset><library_geometries><geometry id=\"g\"><mesh><source id=\"p\">"
           "<float_array id=\"a\" count=\"12\">" +
           points +
           "</float_array><technique_common>"
           "<accessor source=\"#a\" count=\"4\" stride=\"3\"><param name=\"X\" type=\"float\"/>"
           "<param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor></technique_common></source>"
           "<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>" +
           primitives + "</mesh></geometry></library_geometries><library_visual_scenes><visual_scene id=\"s\">" +
           nodes +
           "</visual_scene></library_visual_scenes><scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>";
  }
  MeshFile readDae(const std::string& text) { return read("a.dae", text); }
  static void expectNear(const Positions& positions, const Positions& expected) {
    ASSERT_EQ(positions.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_LT((positions[i] - expected[i]).norm(), 1e-6) << i;
  }
};

TEST_F(DaeGrammar, Primitives) {
  for (const std::string& primitives :
       {two(), list("polylist", 2, "<vcount>3 3</vcount><p>0 1 2 2 1 3</p>"),
        list("polygons", 2, "<p>0 1 2</p><p>2 1 3</p>"), list("tristrips", 1, "<p>0 1 2 3</p>")}) {
    expectTwo(readDae(dae(primitives)), primitives);
  }
  EXPECT_EQ(readDae(dae(list("trifans", 1, "<p>0 1 3 2</p>"))).faces, (std::vector<Face>{{0, 1, 2}, {0, 2, 3}}));
  expectDart(
      readDae(dae(list("polylist", 1, "<vcount>4</vcount><p>0 1 2 3</p>"), node(), "0 0 0 2 1 0 0 2 0 1.5 1 0")));
}

TEST_F(DaeGrammar, Units) {
  const std::string unit = "<unit name=\"centimetre\" meter=\"0.01\"/>";
  for (const char* axis : {"X_UP", "Y_UP", "Z_UP"}) {
    const std::string asset = unit + "<up_axis>" + axis + "</up_axis>";
    expectNear(readDae(dae(two(), node(), "0 0 0 100 0 0 0 100 0 100 100 25", asset)).positions, SQUARE);
  }
  expectTwo(readDae(dae(two(), node(), "0 0 0 1 0 0 0 1 0 1 1 0.25", "")), "no unit");
}

TEST_F(DaeGrammar, Nodes) {
  const Positions mirrored{{3, 0, 0}, {2, 0, 0}, {3, 1, 0}, {2, 1, 0.25}};
  const std::string by_scale = "<translate>3 0 0</translate><scale>-1 1 1</scale>",
                    by_matrix = "<matrix>-1 0 0 3 0 1 0 0 0 0 1 0 0 0 0 1</matrix>";
  for (const std::string& transform : {by_scale, by_matrix}) {
    const MeshFile mesh = readDae(dae(two(), node(transform)));
    EXPECT_EQ(mesh.positions, mirrored) << transform;
    EXPECT_EQ(mesh.faces, TWO);
  }
  const std::string turned =
      "<node id=\"m\"><rotate>0 0 1 90</rotate>" + node("<translate>1 0 0</translate>") + "</node>";
  expectNear(readDae(dae(two(), turned)).positions, {{0, 1, 0}, {0, 2, 0}, {-1, 1, 0}, {-1, 2, 0.25}});
  const MeshFile both = readDae(dae(two(), node() + "<node id=\"m\"><translate>0 0 1</translate>"
                                                    "<instance_geometry url=\"#g\"/></node>"));
  EXPECT_EQ(both.positions.size(), 8u) << "as often as it stands in the scene";
  EXPECT_EQ(both.faces.size(), 4u);
}

TEST_F(DaeGrammar, Coordinates) {
  EXPECT_EQ(readDae(dae(two(), node(), "0.1 0 0 1 0 0 0 1 0 1 1 0.25")).positions[0].x(), 0.1);
  const std::string far = "1000000 0 0 1000000.01 0 0 1000000 1 0 1000001 1 0";
  EXPECT_EQ(readDae(dae(list("triangles", 2, "<p>0 2 3 1 2 3</p>"), node(), far)).positions.size(), 4u);
}

/// Positions as numbers 2 to 4 of six, indices as the second of three, and two lists in one element.
TEST_F(DaeGrammar, Strides) {
  const std::string input =
      "<input semantic=\"NORMAL\" source=\"#n\" offset=\"0\"/>"
      "<input semantic=\"VERTEX\" source=\"#v\" offset=\"1\"/>"
      "<input semantic=\"TEXCOORD\" source=\"#t\" offset=\"2\" set=\"0\"/>";
  std::string text =
      dae("<triangles count=\"2\">" + input + "<p>9 0 9 9 1 9 9 2 9</p><p>9 2 9 9 1 9 9 3 9</p></triangles>", node(),
          "7 0 0 0 7 7 7 1 0 0 7 7 7 0 1 0 7 7 7 1 1 0.25");
  const auto replace = [&](const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
  };
  replace("count=\"12\"", "count=\"22\"");
  replace("stride=\"3\">", "stride=\"6\"><param type=\"float\"/>");
  expectTwo(readDae(text), "numbers between");
}

TEST_F(DaeGrammar, Lines) {
  const std::string line = "<input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>";
  const auto lines = [&](const std::string& p) {
    return two() + "<lines count=\"1\">" + line + "<p>" + p + "</p></lines>";
  };
  expectTwo(readDae(dae(lines("1 2"))), "the edge of a face");
  expectUnchecked(readDae(dae(lines("0 3"))), {2}, "polygon 2 of the scene, a segment of <lines> in line ");
}

TEST_F(DaeGrammar, WhatIsRefused) {
  const std::string hole = list("polygons", 1, "<ph><p>0 1 3 2</p><h>0 1 2</h></ph>");
  expectRefused("a.dae", dae(hole), "a.dae: ", "<ph> is a polygon with holes");
  for (const std::string count : {"1", "3"}) {
    expectRefused("a.dae", dae(list("triangles", std::stoi(count), "<p>0 1 2 2 1 3</p>")),
                  "a.dae: ", "not a readable .dae mesh");
  }
  expectRefused("a.dae", dae(two(), node(), "nan 0 0 1 0 0 0 1 0 1 1 0.25"), "a.dae: ", "is not finite");
  const std::string twice = "<node id=\"m\">" + node() + "<instance_node url=\"#m\"/></node>";
  expectRefused("a.dae", dae(two(), twice), "a.dae: ", "<node> holds itself, or lies too deep");
  std::string doubled = "<node id=\"n0\"><instance_geometry url=\"#g\"/></node>";  // 2^40 of them
  for (int i = 1; i <= 40; ++i) {
    const std::string use = "<instance_node url=\"#n" + std::to_string(i - 1) + "\"/>";
    doubled += "<node id=\"n" + std::to_string(i) + "\">" + use + use + "</node>";
  }
  expectRefused("a.dae", dae(two(), doubled), "a.dae: ", "the scene is too large");
}

TEST_F(DaeGrammar, ElementsThatNobodyKnows) {
  for (const std::string parent : {"scene", "visual_scene", "node", "geometry", "mesh", "triangles"}) {
    std::string odd = dae(two());
    odd.insert(odd.find("</" + parent + ">"), "<surface>0 3 2</surface>");
    expectRefused("a.dae", odd, "a.dae: ", "<surface> is not known where it stands");
  }
}

TEST_F(DaeGrammar, WhatContradictsItself) {
  const std::string good = dae(two());
  const auto expectBad = [&](const std::string& what, const std::string& by, const std::string& reason) {
    ASSERT_NE(good.find(what), std::string::npos) << what;
    std::string bad = good;
    bad.replace(bad.find(what), what.size(), by);
    expectRefused("a.dae", bad, "a.dae: ", reason);
  };
  const std::string geometry = good.substr(good.find("<geometry"), good.find("</library_geo") - good.find("<geometry"));
  expectBad(geometry, geometry + geometry, "<instance_geometry> has the url '#g', of several");
  expectBad(geometry, "<geometry id=\"g\"><spline/></geometry>", "of a geometry without a <mesh>");
  expectBad("url=\"#g\"", "url=\"#other\"", "<instance_geometry> has the url '#other'");
  expectBad("</node>", "<instance_node url=\"#other\"/></node>", "no node of that id");
  expectBad(node(), node() + node() + "<node><instance_node url=\"#n\"/></node>", "has the url '#n', of several");
  expectBad("2 1 3", "2 1 -1", "<p> has '-1', which is no integer from 0 on");
  expectBad("0.25", "0,25", "<float_array> has '0,25', which is no decimal number");
  expectBad("1 1 0.25", "1 1", "has 11 numbers, and a count of 12");
  expectBad("count=\"4\"", "count=\"5\"", "<accessor> goes beyond the 12 numbers of '#a'");
  expectBad("stride=\"3\"", "stride=\"4\"", "<accessor> goes beyond");
  for (const char* stride : {"stride=\"2\"", ""}) expectBad("stride=\"3\"", stride, "has more <param> than its stride");
  const std::string position = "<input semantic=\"POSITION\" source=\"#p\"/>", mesh_end = "</mesh>";
  expectBad(position, position + position, "<input> is the second POSITION");
  expectBad(mesh_end, mesh_end + "<mesh></mesh>", "<geometry> has several <mesh>");
  expectBad("</technique_common>", "</technique_common><technique_common/>", "<source> has several <technique_common>");
  expectBad("</accessor>", "</accessor><accessor/>", "<technique_common> has several <accessor>");
  expectBad(" offset=\"0\"", "", "<input> has no offset");
  for (const char* name : {"quads", "Triangles", "c:triangles"}) {
    const std::string other = "<" + std::string(name) + " count=\"0\"/>";
    expectBad(mesh_end, other + mesh_end, "<" + std::string(name) + "> is not known where it stands");
    expectBad("</node>", other + "</node>", "<" + std::string(name) + "> is not known where it stands");
  }
  for (const std::string lists : {"", "<p>0 1 2</p><p>2 1 3</p>", "<p>0 1 2 2 1 3</p><p>0 1 2 2 1 3</p>"}) {
    for (const char* count : {" count=\"2\"", "", " count=\"4\""}) {
      const std::string list = "<input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><vcount>3 3</vcount>" + lists;
      expectBad(mesh_end, "<polylist" + std::string(count) + ">" + list + "</polylist></mesh>", "a.dae: ");
    }
  }
  expectBad("stride=\"3\"", "stride=\"-3\"", "<accessor> has a stride of '-3'");
  for (const char* metres : {"0", "-1", "0,01", "nan"}) {
    expectBad("meter=\"1\"", "meter=\"" + std::string(metres) + "\"", "<unit> has a meter of");
  }
  expectBad("<instance_geo", "<translate>0,5 0 0</translate><instance_geo", "<translate> has '0,5'");
  expectBad("<instance_geo", "<matrix>1 0 0 0</matrix><instance_geo", "<matrix> must have 16 numbers");
  for (const std::string transform : {"skew>45 1 0 0 0 1 0</skew", "lookat>0 0 0 0 0 -1 1 1 1</lookat"}) {
    expectBad("<instance_geo", "<" + transform + "><instance_geo", "> is not read; write the node with a <matrix>");
  }
  for (const std::string axis : {"0 0 2", "1 1 0", "0 0 0", "0 0 nan", "0.7071 0.7071 0"}) {
    expectBad("<instance_geo", "<rotate>" + axis + " 90</rotate><instance_geo", "has an axis whose length is not 1");
  }
  for (const std::string row : {"0 0 0 2", "1 0 0 1"}) {
    expectBad("<instance_geo", "<matrix>1 0 0 0 0 1 0 0 0 0 1 0 " + row + "</matrix><instance_geo", "end with 0 0 0 1");
  }
  expectBad("<instance_geometry url=\"#g\"/>", "<instance_controller url=\"#c\"/>",
            "<instance_controller> is not read");
  for (const std::string name : {"name=\"y\" ", "name=\"S\" ", "name=\"X\" ", ""}) {
    expectBad("name=\"Y\" ", name, "must have one <param> each of the names X, Y and Z");
  }
  expectBad("<param name=\"Z\" type=\"float\"/>", "", "must have one <param> each");
  expectBad("2 1 3", "2 1 <!-- three --> 3", "<p> has something beside its text");
  expectBad("1 1 0.25", "1 <![CDATA[1]]> 0.25", "<float_array> has something beside its text");
  expectBad("<geometry id=\"g\">", "<geometry id=\"g\"><asset><unit meter=\"0.001\"/></asset>",
            "<unit> is another one than the file's");
}

TEST_F(DaeGrammar, AxesOfSixDigits) {
  const std::string turn = "<rotate>0 0 0 0</rotate><rotate>0.57735 0.57735 0.57735 120</rotate>";
  const Positions expected{{0, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.25, 1, 1}};
  const MeshFile mesh = readDae(dae(two(), node(turn)));
  ASSERT_EQ(mesh.positions.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_LT((mesh.positions[i] - expected[i]).norm(), 1e-5) << i;
}

TEST_F(DaeGrammar, WithoutAMesh) {
  const std::string nodes = "<node><translate>1 2 3</translate><node><translate>0 1 0</translate></node></node>";
  expectRefused("a.dae", dae(two(), nodes), "a.dae: ", "there are no triangles");
  expectRefused("a.dae", dae(list("triangles", 0, "<p></p>"), node() + nodes), "a.dae: ", "there are no triangles");
}

// --- NPY

class NpyGrammar : public Grammar {
 protected:
  static std::string npy(const std::string& dictionary, const std::string& numbers, char version = 1) {
    std::string header = dictionary + "\n", size;
    for (std::size_t i = 0; i < (version == 1 ? 2u : 4u); ++i) size += static_cast<char>(header.size() >> 8 * i);
    return "\x93NUMPY" + std::string{version, '\0'} + size + header + numbers;
  }
  static std::string head(const std::string& shape, const std::string& type = "<f8",
                          const std::string& fortran = "False") {
    return "{'descr': '" + type + "', 'fortran_order': " + fortran + ", 'shape': " + shape + ", }";
  }
  template <typename T>
  static std::string numbers(const std::vector<double>& values, bool big = false) {
    std::string bytes;
    for (const double value : values) {
      const T number = static_cast<T>(value);
      std::string one(sizeof number, '\0');
      std::memcpy(one.data(), &number, sizeof number);
      if (big) std::reverse(one.begin(), one.end());
      bytes += one;
    }
    return bytes;
  }
  std::vector<Positions> frames(const std::string& bytes) {
    const std::string path = (folder_ / "a.npy").string();
    std::ofstream(path, std::ios::binary) << bytes;
    return loadNpyFrames(path);
  }
  void expectRefusedArray(const std::string& bytes, const std::string& word) {
    try {
      frames(bytes);
      ADD_FAILURE() << word;
    } catch (const MeshFileError& error) {
      EXPECT_TRUE(mentions(error.what(), "a.npy: ") && mentions(error.what(), word)) << error.what();
    }
  }
  const std::vector<double> ROW{0, 1, 2, 3, 4, 5.25, 6, 7, 8, 9, 10, 11};
  const std::vector<Positions> TWO_FRAMES{{{0, 1, 2}, {3, 4, 5.25}}, {{6, 7, 8}, {9, 10, 11}}};
};

TEST_F(NpyGrammar, Numbers) {
  EXPECT_EQ(frames(npy(head("(2, 2, 3)"), numbers<double>(ROW))), TWO_FRAMES);
  EXPECT_EQ(frames(npy(head("(2, 2, 3)", ">f8"), numbers<double>(ROW, true))), TWO_FRAMES);
  EXPECT_EQ(frames(npy(head("(2, 2, 3)", "<f4"), numbers<float>(ROW))), TWO_FRAMES);
  EXPECT_EQ(frames(npy(head("(2, 2, 3)", ">f4"), numbers<float>(ROW, true), 3)), TWO_FRAMES);
  for (const std::string type : {"<i8", "<f2", "|O", "<c16"}) {
    expectRefusedArray(npy(head("(2, 2, 3)", type), numbers<double>(ROW)), "holds '" + type + "'");
  }
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(frames(npy(head("(1, 1, 3)"), numbers<double>({nan, 0, 0})))[0][0].x()));
}

TEST_F(NpyGrammar, Orders) {
  const std::vector<double> fortran{0, 6, 3, 9, 1, 7, 4, 10, 2, 8, 5.25, 11};
  EXPECT_EQ(frames(npy(head("(2, 2, 3)", "<f8", "True"), numbers<double>(fortran))), TWO_FRAMES);
}

TEST_F(NpyGrammar, Shapes) {
  EXPECT_EQ(frames(npy(head("(4, 3)"), numbers<double>(ROW))).size(), 1u);
  for (const std::string shape : {"(12,)", "(2, 3, 2)", "(1, 2, 2, 3)", "()", "(0, 4, 3)", "(4, 0, 3)"}) {
    EXPECT_THROW(frames(npy(head(shape), numbers<double>(ROW))), MeshFileError) << shape;
  }
}

TEST_F(NpyGrammar, WhatIsCut) {
  const std::string whole = npy(head("(2, 2, 3)"), numbers<double>(ROW));
  expectRefusedArray(whole.substr(0, whole.size() - 1), "it is cut");
  expectRefusedArray(whole + "x", "or holds more");
  expectRefusedArray(whole.substr(0, 20), "ends in its header");
  expectRefusedArray("PK\x03\x04 an npz is not one", "is no .npy file");
  expectRefusedArray(npy(head("(9000000000000000000, 9000000000000000000, 3)"), ""), "it is cut");
  expectRefusedArray(npy(head("(2, 2, 3)"), numbers<double>(ROW), 4), "version");
  expectRefusedArray(npy("{'descr': [('x', '<f8')], 'fortran_order': False, 'shape': (4,), }", ""), "'descr'");
}

// --- the page

TEST(GrammarPages, EachTestStandsInARowAndEachRowNamesTests) {
  std::set<std::string> rows, tests;
  for (const char* name : {"mesh_files.md", "messages.md"}) {
    std::ifstream page(std::string(DEFORMABLE_CCD_SOURCE_DIR) + "/doc/" + name);
    std::string suite;  // as the head of the table names it
    for (std::string line; std::getline(page, line);) {
      if (line.size() < 2 || line[0] != '|') continue;
      const std::string last = line.substr(line.rfind('|', line.size() - 2));
      const std::regex code("`(\\w+)`");
      const bool is_head = line.rfind("| form |", 0) == 0;
      if (is_head) suite.clear();
      for (std::sregex_iterator at(last.begin(), last.end(), code), end; at != end; ++at) {
        if (is_head) {
          suite = (*at)[1];
        } else if (!suite.empty()) {
          rows.insert(suite + "." + (*at)[1].str());
        }
      }
    }
  }
  const ::testing::UnitTest& all = *::testing::UnitTest::GetInstance();
  for (int s = 0; s < all.total_test_suite_count(); ++s) {
    const ::testing::TestSuite& suite = *all.GetTestSuite(s);
    if (!std::regex_match(suite.name(), std::regex("\\w+Grammar"))) continue;
    for (int t = 0; t < suite.total_test_count(); ++t) {
      tests.insert(std::string(suite.name()) + "." + suite.GetTestInfo(t)->name());
    }
  }
  EXPECT_GT(tests.size(), 30u);
  EXPECT_EQ(rows, tests);
}

}  // namespace
}  // namespace dccd
