#include "input/npy_file.h"

#include <algorithm>
#include <cstring>
#include <regex>

#include "base/decimal.h"

namespace dccd {
namespace {

/// What the header of an .npy says: a dictionary of Python in one line.
struct NpyHeader {
  bool is_double = false, is_swapped = false, is_fortran = false;
  std::vector<std::size_t> shape;
  std::size_t length = 0;  // bytes up to the numbers

  NpyHeader(const std::string& bytes, const std::string& path) : path_(path) {
    const std::string mark = "\x93NUMPY";
    if (bytes.compare(0, mark.size(), mark) != 0 || bytes.size() < 10) fail("is no .npy file");
    const bool is_first = bytes[mark.size()] == 1;
    const std::size_t size_of_size = is_first ? 2 : 4, begin = mark.size() + 2 + size_of_size;
    if (bytes[mark.size()] < 1 || bytes[mark.size()] > 3) fail("is of a version of .npy that is not read");
    std::uint32_t size = 0;
    if (bytes.size() >= begin) std::memcpy(&size, bytes.data() + mark.size() + 2, size_of_size);
    if (bytes.size() < begin || size > bytes.size() - begin) fail("ends in its header");
    length = begin + size;
    const std::string text = bytes.substr(begin, std::min<std::size_t>(size, MOST_HEADER));
    takeType(entry(text, "'descr' *: *'([^']*)'", "descr"));
    is_fortran = entry(text, "'fortran_order' *: *(True|False)", "fortran_order") == "True";
    takeShape(entry(text, "'shape' *: *\\(([0-9, ]*)\\)", "shape"));
  }

 private:
  static constexpr std::size_t MOST_HEADER = 1000;  // of what is read here; records have longer ones
  const std::string& path_;

  [[noreturn]] void fail(const std::string& what) const { throw MeshFileError(path_ + ": " + what); }
  std::string entry(const std::string& text, const char* pattern, const std::string& name) const {
    std::smatch found;
    if (!std::regex_search(text, found, std::regex(pattern))) fail("its header has no '" + name + "' that is read");
    return found[1];
  }
  void takeType(const std::string& type) {
    const bool is_big = type == ">f4" || type == ">f8";
    if (!is_big && type != "<f4" && type != "<f8") fail("holds '" + type + "'; float32 and float64 are read");
    is_double = type[2] == '8';
    is_swapped = is_big;
  }
  void takeShape(const std::string& text) {
    std::size_t at = 0;
    while (at < text.size()) {
      const std::size_t end = std::min(text.find(',', at), text.size());
      std::string word = text.substr(at, end - at);
      word.erase(std::remove(word.begin(), word.end(), ' '), word.end());
      if (const auto number = decimalInteger(word)) shape.push_back(static_cast<std::size_t>(*number));
      at = end + 1;
    }
    if (shape.size() == 2) shape.insert(shape.begin(), 1);
    if (shape.size() != 3 || shape[2] != 3) {
      fail("is an array of the shape (" + text + "); frames x vertices x 3 is read, and vertices x 3");
    }
    if (shape[0] == 0 || shape[1] == 0) fail("no vertices");
  }
};

template <typename Number>
double numberAt(const char* bytes, bool is_swapped) {
  char own[sizeof(Number)];
  std::memcpy(own, bytes, sizeof(Number));
  if (is_swapped) std::reverse(own, own + sizeof(Number));
  Number number;
  std::memcpy(&number, own, sizeof(Number));
  return double{number};
}

}  // namespace

std::vector<Positions> loadNpyFrames(const std::string& path) {
  const std::string bytes = readWholeFile(path);
  const NpyHeader header(bytes, path);
  const std::size_t size = header.is_double ? sizeof(double) : sizeof(float), there = bytes.size() - header.length;
  const std::size_t frames = header.shape[0], vertices = header.shape[1];
  // There may be so many that their product is none.
  const bool fits = vertices <= there / size / 3 && frames <= there / size / 3 / vertices;
  if (!fits || frames * vertices * 3 * size != there) {
    throw MeshFileError(path + ": has " + std::to_string(there) + " bytes of numbers, and " + std::to_string(frames) +
                        " x " + std::to_string(vertices) + " x 3 need others: it is cut, or holds more");
  }
  std::vector<Positions> all(frames, Positions(vertices));
  for (std::size_t f = 0; f < frames; ++f) {
    for (std::size_t v = 0; v < vertices; ++v) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t place =
            header.is_fortran ? f + frames * (v + vertices * axis) : axis + 3 * (v + vertices * f);
        const char* at = bytes.data() + header.length + size * place;
        all[f][v][static_cast<Eigen::Index>(axis)] =
            header.is_double ? numberAt<double>(at, header.is_swapped) : numberAt<float>(at, header.is_swapped);
      }
    }
  }
  return all;
}

}  // namespace dccd
