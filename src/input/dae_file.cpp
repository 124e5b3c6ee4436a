#include "input/dae_file.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <exception>
#include <fstream>
#include <vector>

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <Eigen/Geometry>
#include <assimp/Importer.hpp>

#include "input/dae_check.h"

namespace dccd {

namespace {

constexpr rlim_t CHILD_BYTES = rlim_t{1} << 30;  // on top of what this process has
constexpr rlim_t CHILD_CPU_S = 20;
constexpr std::chrono::seconds CHILD_WALL{60};
constexpr char GOOD = 'm', BAD = 'e';  // the first byte of an answer: polygons follow, or words

Eigen::Affine3d affine(const aiMatrix4x4& m) {
  Eigen::Affine3d out;
  out.matrix() << m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4, m.d1, m.d2, m.d3, m.d4;
  return out;
}

void addPolygons(const aiScene& scene, const aiNode& root, Positions& corners, std::vector<std::uint64_t>& ends) {
  struct Placed {
    const aiNode* node;
    Eigen::Affine3d parent;
  };
  std::vector<Placed> open{{&root, Eigen::Affine3d::Identity()}};
  while (!open.empty()) {
    const Placed at = open.back();
    open.pop_back();
    const Eigen::Affine3d transform = at.parent * affine(at.node->mTransformation);
    for (unsigned i = 0; i < at.node->mNumMeshes; ++i) {
      const aiMesh& mesh = *scene.mMeshes[at.node->mMeshes[i]];
      for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
        const aiFace& face = mesh.mFaces[f];
        for (unsigned k = 0; k < face.mNumIndices; ++k) {
          const aiVector3D& p = mesh.mVertices[face.mIndices[k]];
          corners.push_back(transform * Vec3(p.x, p.y, p.z));
        }
        ends.push_back(corners.size());
      }
    }
    for (unsigned c = at.node->mNumChildren; c-- > 0;) open.push_back({at.node->mChildren[c], transform});
  }
}

/// In the child: a byte, then words; or the number of polygons, their ends and the coordinates of their corners.
std::string answerOf(const std::string& bytes) {
  try {
    if (const std::string problem = daeProblem(bytes); !problem.empty()) return BAD + problem;
    Assimp::Importer importer;
    importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
    importer.SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);  // else its nodes, where there is no mesh
    const aiScene* scene =
        importer.ReadFileFromMemory(bytes.data(), bytes.size(), aiProcess_ValidateDataStructure, "dae");
    if (!scene || !scene->mRootNode) return BAD + std::string(importer.GetErrorString());
    Positions corners;
    std::vector<std::uint64_t> ends;
    addPolygons(*scene, *scene->mRootNode, corners, ends);
    std::string answer(1, GOOD);
    const auto append = [&](const void* data, std::size_t size) {
      answer.append(static_cast<const char*>(data), size);
    };
    const std::uint64_t count = ends.size();
    append(&count, sizeof count);
    append(ends.data(), ends.size() * sizeof ends[0]);
    append(corners.data(), corners.size() * sizeof corners[0]);
    return answer;
  } catch (const std::exception& error) {
    return BAD + std::string(error.what());
  }
}

/// Pages of this process that a limit on data counts.
rlim_t dataBytes() {
  std::ifstream statm("/proc/self/statm");
  rlim_t pages = 0;
  for (int field = 0; field < 6; ++field) statm >> pages;  // the sixth is data and stack
  return pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
}

[[noreturn]] void runChild(const std::string& bytes, rlim_t data_bytes, int pipe) {
  // The crash of the child is no crash of the node: no handler, no core.
  for (const int number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGTERM, SIGINT}) std::signal(number, SIG_DFL);
  const auto limit = [](auto what, rlim_t value) {
    const rlimit to{value, value};
    ::setrlimit(what, &to);
  };
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, CHILD_CPU_S);
  limit(RLIMIT_DATA, data_bytes + CHILD_BYTES);
  const std::string answer = answerOf(bytes);
  for (std::size_t sent = 0; sent < answer.size();) {
    const ssize_t n = ::write(pipe, answer.data() + sent, answer.size() - sent);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    sent += static_cast<std::size_t>(n);
  }
  ::_exit(0);  // without this process' destructors
}

/// What the child says until it ends or its time is over.
std::string readAnswer(int pipe) {
  std::string answer;
  std::vector<char> part(1 << 16);
  const auto end = std::chrono::steady_clock::now() + CHILD_WALL;
  while (true) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() <= 0) return {};
    pollfd wait{pipe, POLLIN, 0};
    const int ready = ::poll(&wait, 1, static_cast<int>(left.count()));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) return {};
    const ssize_t n = ::read(pipe, part.data(), part.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return answer;
    answer.append(part.data(), static_cast<std::size_t>(n));
  }
}

std::string askChild(const std::string& path, const std::string& bytes) {
  const rlim_t data_bytes = dataBytes();
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) throw MeshFileError(path + ": no pipe to a child process that reads it");
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(ends[0]);
    runChild(bytes, data_bytes, ends[1]);
  }
  ::close(ends[1]);
  const std::string answer = child < 0 ? std::string() : readAnswer(ends[0]);
  ::close(ends[0]);
  if (child < 0) throw MeshFileError(path + ": no child process to read it in");
  ::kill(child, SIGKILL);  // nothing to one that has ended
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return answer;
}

/// What a child says that came to its end. False: this one did not.
bool readPolygons(const std::string& answer, Positions& corners, std::vector<std::size_t>& ends) {
  constexpr std::size_t HEAD = 1 + sizeof(std::uint64_t);
  std::uint64_t count = 0;
  if (answer.size() < HEAD) return false;
  std::memcpy(&count, answer.data() + 1, sizeof count);
  if (count > (answer.size() - HEAD) / sizeof count) return false;
  const std::size_t begin = HEAD + count * sizeof count, bytes = answer.size() - begin;
  if (bytes % sizeof(Vec3) != 0) return false;
  ends.resize(count);
  corners.resize(bytes / sizeof(Vec3));
  if (count > 0) std::memcpy(ends.data(), answer.data() + HEAD, begin - HEAD);
  if (bytes > 0) std::memcpy(corners.data()->data(), answer.data() + begin, bytes);
  return std::is_sorted(ends.begin(), ends.end()) && (ends.empty() ? 0 : ends.back()) == corners.size();
}

}  // namespace

MeshFile loadDaeFile(const std::string& path) {
  const std::string bytes = readWholeFile(path);
  // Not left to assimp: one that reads the outline alone would fill the holes.
  if (bytes.find("<ph>") != std::string::npos) {
    throw MeshFileError(path + ": has polygons with holes (<ph>), which are not read; write it with triangles");
  }
  const std::string answer = askChild(path, bytes);
  Positions corners;
  std::vector<std::size_t> ends;
  if (!answer.empty() && answer[0] == BAD) {
    throw MeshFileError(path + ": not a readable .dae mesh: " + answer.substr(1));
  }
  if (!readPolygons(answer, corners, ends)) {
    throw MeshFileError(path + ": assimp did not come to an end of it within " + std::to_string(CHILD_CPU_S) +
                        " s and 1 GiB, or crashed; the file is damaged");
  }
  if (corners.empty()) throw MeshFileError(path + ": there are no triangles");
  MeshFile mesh = weldPolygons(corners, std::move(ends), path);
  remarkUnchecked([](std::size_t p) { return "polygon " + std::to_string(p) + " of the scene"; }, mesh);
  return mesh;
}

}  // namespace dccd
