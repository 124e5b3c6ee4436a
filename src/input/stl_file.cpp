#include "input/stl_file.h"

#include <cstring>

#include "input/text_lines.h"

namespace dccd {

namespace {

constexpr std::size_t HEADER_BYTES = 80, BEGIN_BYTES = HEADER_BYTES + 4, TRIANGLE_BYTES = 50;

Positions binaryCorners(const std::string& bytes, std::size_t triangles) {
  Positions corners;
  corners.reserve(3 * triangles);
  for (std::size_t t = 0; t < triangles; ++t) {
    float values[12];  // normal, then three corners
    std::memcpy(values, bytes.data() + BEGIN_BYTES + t * TRIANGLE_BYTES, sizeof values);
    for (int k = 1; k <= 3; ++k) corners.emplace_back(values[3 * k], values[3 * k + 1], values[3 * k + 2]);
  }
  return corners;
}

/// solid NAME, then facets, then endsolid NAME; as often as there are solids. Words in letters of either case.
class AsciiReader {
 public:
  AsciiReader(const std::string& text, const std::string& path) : path_(path), lines_(text, path) {}

  MeshFile read() {
    while (lines_.nextWithWords()) {
      at_ = 0;
      expect("solid");
      skipName();
      while (isNext("facet")) readFacet();
      expect("endsolid");
      skipName();
    }
    MeshFile mesh = weldTriangles(corners_, path_);
    const auto name = [lines = std::move(facet_lines_)](std::size_t t) {
      return "triangle " + std::to_string(t) + ", in line " + std::to_string(lines[t]);
    };
    hintAtUnchecked(name, mesh);
    return mesh;
  }

 private:
  void readFacet() {
    expect("facet");
    facet_lines_.push_back(lines_.line());
    expect("normal");
    for (int axis = 0; axis < 3; ++axis) take("a facet's normal");  // the corners' order tells it, too
    for (const char* word : {"outer", "loop"}) expect(word);
    for (int corner = 0; corner < 3; ++corner) {
      expect("vertex");
      Vec3 p;
      for (int axis = 0; axis < 3; ++axis) p[axis] = lines_.number(take("a vertex of three numbers"));
      corners_.push_back(p);
    }
    for (const char* word : {"endloop", "endfacet"}) expect(word);
  }

  /// What follows in the line.
  void skipName() { at_ = lines_.words().size(); }
  /// Goes to the next word, over ends of lines.
  const TextWord& word(const std::string& needed) {
    while (at_ == lines_.words().size()) {
      at_ = 0;
      if (!lines_.nextWithWords()) lines_.fail("the file ends where " + needed + " is needed");
    }
    return lines_.words()[at_];
  }
  const TextWord& take(const std::string& needed) {
    const TextWord& taken = word(needed);
    ++at_;
    return taken;
  }
  void expect(const std::string& keyword) {
    const TextWord& found = take("'" + keyword + "'");
    if (inSmallLetters(found.text) != keyword) lines_.fail(found, "stands where '" + keyword + "' is needed");
  }
  bool isNext(const std::string& keyword) {
    return inSmallLetters(word("'" + keyword + "' or 'endsolid'").text) == keyword;
  }

  const std::string& path_;
  TextLines lines_;
  std::size_t at_ = 0;  // among the line's words
  Positions corners_;
  std::vector<std::size_t> facet_lines_;
};

bool isText(const std::string& bytes, const std::string& path) {
  TextLines lines(bytes, path);
  return lines.nextWithWords() && inSmallLetters(lines.words()[0].text) == "solid" &&
         bytes.find('\0') == std::string::npos;
}

}  // namespace

MeshFile loadStlFile(const std::string& path) {
  const std::string bytes = readWholeFile(path);
  std::uint32_t triangles = 0;
  if (bytes.size() >= BEGIN_BYTES) std::memcpy(&triangles, bytes.data() + HEADER_BYTES, 4);
  // A binary file may begin with "solid", too. Where its triangles fit it is no text: four letters in the place of the
  // count are more than any file has that is read.
  const std::size_t end = BEGIN_BYTES + std::size_t{triangles} * TRIANGLE_BYTES;
  if (bytes.size() < BEGIN_BYTES || bytes.size() < end) {
    if (isText(bytes, path)) return AsciiReader(bytes, path).read();
    throw MeshFileError(
        path + ": neither an ASCII STL nor a binary one of the size that it states: " + std::to_string(triangles) +
        " triangles take " + std::to_string(end) + " bytes, and it has " + std::to_string(bytes.size()));
  }
  const std::string rest = std::to_string(bytes.size() - end) + " bytes";
  if (!isPadding(std::string_view(bytes).substr(end))) {
    throw MeshFileError(path + ": states " + std::to_string(triangles) + " triangles, and " + rest +
                        " that are not empty follow them; correct the count (byte 80), or cut them off");
  }
  MeshFile mesh = weldTriangles(binaryCorners(bytes, triangles), path);
  hintAtUnchecked([](std::size_t t) { return "triangle " + std::to_string(t); }, mesh);
  if (bytes.size() > end) mesh.hints.push_back(rest + " of padding after the last triangle are skipped");
  return mesh;
}

}  // namespace dccd
