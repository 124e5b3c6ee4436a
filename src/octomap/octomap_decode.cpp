// The streams are parsed here and not by liboctomap: that builds a tree node by node, follows any depth, reads past the
// end of truncated data and takes the sizes that a message claims on trust. Layouts:
// OccupancyOcTreeBase::readBinaryNode (two bits a child) and OcTreeBaseImpl::readNodesRecurs (value, child bits); tests
// compare with liboctomap's own.
#include "base/octomap_decode.h"

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>

#include "base/regular_file.h"
#include "dccd/tolerances.h"
#include "obstacle/resolution.h"
#include "octomap/leaf_lists.h"
#include "octomap/octomap_header.h"

namespace dccd {
namespace {

constexpr int MAX_DEPTH = 16;

template <class Value>
std::string text(const Value& value) {
  std::ostringstream stream;
  stream << value;
  return stream.str();
}

enum class TreeKind : std::uint8_t { PLAIN, COLOR, STAMPED };

TreeKind treeKind(const std::string& id) {
  if (id == "OcTree") return TreeKind::PLAIN;
  if (id == "ColorOcTree") return TreeKind::COLOR;
  if (id == "OcTreeStamped") return TreeKind::STAMPED;
  throw OctomapError("octomap id is '" + id.substr(0, 80) + "'; OcTree, ColorOcTree and OcTreeStamped can be read");
}

void checkResolution(double resolution) {
  if (!isResolution(resolution)) throw OctomapError(noResolution("octomap resolution", resolution));
}

/// The bytes of a stream, in order.
class Bytes {
 public:
  Bytes(const unsigned char* data, std::size_t size) : data_(data), size_(size) {}
  const unsigned char* take(std::size_t count) {
    if (size_ - at_ < count) {
      throw OctomapError("octomap data end at byte " + text(size_) + " within a node that begins at byte " + text(at_));
    }
    at_ += count;
    return data_ + at_ - count;
  }
  std::size_t at() const { return at_; }
  std::size_t left() const { return size_ - at_; }

 private:
  const unsigned char* data_;
  std::size_t size_;
  std::size_t at_ = 0;
};

using Cube = OctreeCube;

void checkDepth(const Cube& parent, const Bytes& bytes) {
  if (parent.depth >= MAX_DEPTH) {
    throw OctomapError("octomap data go deeper than 16 levels at byte " + text(bytes.at()));
  }
}

/// Calls leaf(cube, log_odds) for each leaf below the inner node whose two bytes come next: 1 or -1, which they tell.
template <class Leaf>
void walkBinary(Bytes& bytes, const Cube& cube, Leaf& leaf) {
  const unsigned char* bits = bytes.take(2);
  const unsigned children = bits[0] | static_cast<unsigned>(bits[1]) << 8;
  if (children == 0) {
    // A tree that is pruned to its root is written like this whatever it holds.
    if (cube.depth == 0) {
      throw OctomapError(
          "octomap data are a root without children, which in a binary map is all occupied, all free and all unknown "
          "alike; send the full map (binary: false), or no data where nothing is known");
    }
    leaf(cube, -1.0f);  // an inner node without children: liboctomap takes it for free
    return;
  }
  for (unsigned i = 0; i < 8; ++i) {
    const unsigned state = children >> (2 * i) & 3;
    if (state == 1 || state == 2) {
      checkDepth(cube, bytes);
      leaf(cube.child(i), state == 2 ? 1.0f : -1.0f);
    } else if (state == 3) {
      checkDepth(cube, bytes);
      walkBinary(bytes, cube.child(i), leaf);
    }
  }
}

/// The same for the full stream; `extra` bytes (a colour) follow each value.
template <class Leaf>
void walkFull(Bytes& bytes, const Cube& cube, std::size_t extra, Leaf& leaf) {
  const std::size_t begin = bytes.at();
  const unsigned char* node = bytes.take(sizeof(float) + extra + 1);
  float log_odds;
  std::memcpy(&log_odds, node, sizeof log_odds);
  if (std::isnan(log_odds)) {
    throw OctomapError("octomap data hold a log-odds that is not a number at byte " + text(begin));
  }
  const unsigned children = node[sizeof(float) + extra];
  if (children == 0) {
    leaf(cube, log_odds);
    return;
  }
  checkDepth(cube, bytes);
  for (unsigned i = 0; i < 8; ++i) {
    if (children >> i & 1) walkFull(bytes, cube.child(i), extra, leaf);
  }
}

template <class Leaf>
void walk(Bytes bytes, bool binary, TreeKind kind, Leaf&& leaf) {
  if (bytes.left() == 0) return;
  if (binary) {
    walkBinary(bytes, Cube(), leaf);
  } else {
    walkFull(bytes, Cube(), kind == TreeKind::COLOR ? 3 : 0, leaf);
  }
  if (bytes.left() > 0) {
    throw OctomapError("octomap data go on for " + text(bytes.left()) + " bytes after the tree's end at byte " +
                       text(bytes.at()));
  }
}

void checkSize(std::size_t size, const OctomapLimits& limits) {
  if (size > limits.max_bytes) {
    throw OctomapError("octomap data have " + text(size) + " bytes, more than the limit of " + text(limits.max_bytes));
  }
}

DecodedOctomap decode(const OctomapHeader& header, const unsigned char* data, std::size_t size, double resolution,
                      const OctomapLimits& limits) {
  DecodedOctomap map;
  map.resolution_m = resolution;
  map.id = header.id;
  const TreeKind kind = treeKind(map.id);
  if (header.empty && size > header.length) {
    throw OctomapError("octomap header: size is 0, but " + text(size - header.length) + " bytes of data follow");
  }
  if (!header.empty && size == header.length) throw OctomapError("octomap header: no data follow it");
  const Bytes bytes(data + header.length, size - header.length);
  listLeaves([&](auto&& leaf) { walk(bytes, header.binary, kind, leaf); }, limits, !header.binary, map);
  return map;
}

}  // namespace

DecodedOctomap decodeOctomap(const OctomapFields& fields, const OctomapLimits& limits) {
  treeKind(fields.id);  // throws where it is none
  checkResolution(fields.resolution);
  checkSize(fields.size, limits);
  OctomapHeader header = parseOctomapHeader(static_cast<const char*>(fields.data), fields.size);
  if (!header.present) header = {false, fields.binary, fields.id, fields.resolution, fields.size == 0, 0};
  if (header.binary != fields.binary) {
    throw OctomapError(std::string("octomap binary is ") + (fields.binary ? "true" : "false") +
                       ", but the data begin with the header of a " + (header.binary ? ".bt" : ".ot") + " file");
  }
  if (header.id != fields.id) {
    throw OctomapError("octomap id is '" + fields.id + "', but the data's header says '" + header.id.substr(0, 80) +
                       "'");
  }
  if (!(std::abs(header.resolution - fields.resolution) <= tolerance::OCTOMAP_HEADER * fields.resolution)) {
    throw OctomapError("octomap resolution is " + text(fields.resolution) + ", but the data's header says " +
                       text(header.resolution));
  }
  return decode(header, static_cast<const unsigned char*>(fields.data), fields.size, fields.resolution, limits);
}

DecodedOctomap readOctomapFile(const std::string& path, const OctomapLimits& limits) {
  try {
    const std::string problem = regularFileProblem(path);
    if (!problem.empty()) throw OctomapError("the file " + problem);
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    if (!file) throw OctomapError("the file cannot be opened");
    const std::streamoff size = file.tellg();
    if (size < 0) throw OctomapError("the file's size cannot be had");
    checkSize(static_cast<std::size_t>(size), limits);
    std::vector<char> data(static_cast<std::size_t>(size));
    file.seekg(0);
    if (!file.read(data.data(), size)) throw OctomapError("the file cannot be read");
    const OctomapHeader header = parseOctomapFileHeader(data.data(), data.size());
    if (!header.present) throw OctomapError("the file has no header of a .bt or .ot file");
    checkResolution(header.resolution);
    return decode(header, reinterpret_cast<const unsigned char*>(data.data()), data.size(), header.resolution, limits);
  } catch (const OctomapError& error) {
    // Whole: what is relative begins in the folder that roslaunch starts nodes in, which is not the reader's.
    std::error_code ignored;
    throw OctomapError(std::filesystem::absolute(path, ignored).string() + ": " + error.what());
  }
}

}  // namespace dccd
