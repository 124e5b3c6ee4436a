// Messages and files that claim more than there is, or hold more than is allowed, are refused before memory is taken
// for them and without delay. Each is read in a process of its own, with little memory beyond what the program has
// already.
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <new>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/octomap_decode.h"
#include "base/regular_file.h"
#include "input/mesh_decoder.h"
#include "input/mesh_formats.h"
#include "input/stl_file.h"
#include "node/map_loader.h"
#include "record/step_recording.h"
#include "support/folder_test.h"
#include "support/said.h"

namespace dccd {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t MEMORY_BYTES = std::size_t{64} << 20;  // beyond what the process has when it starts to read
constexpr std::size_t GIGABYTE = std::size_t{1} << 30;
constexpr rlim_t SECONDS = 5;  // of processor time

/// Sanitizers reserve terabytes of addresses, so that their programs cannot be kept within any.
bool memoryCanBeLimited() { return std::getenv("DEFORMABLE_CCD_SANITIZED") == nullptr; }

void limitThisProcess() {
  std::ifstream statm("/proc/self/statm");
  std::size_t pages = 0;
  statm >> pages;
  const rlim_t bytes = pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE)) + MEMORY_BYTES;
  const rlimit memory{bytes, bytes}, time{SECONDS, SECONDS};
  if (memoryCanBeLimited()) ::setrlimit(RLIMIT_AS, &memory);
  ::setrlimit(RLIMIT_CPU, &time);
}

/// What the reader says of it: its error's text; "accepted"; or how its process ended.
std::string refusal(const std::function<void()>& read) {
  int pipe[2];
  if (::pipe(pipe) != 0) return "no pipe";
  const pid_t child = ::fork();
  if (child == 0) {
    limitThisProcess();
    std::string text = "accepted";
    try {
      read();
    } catch (const std::bad_alloc&) {
      text = "out of memory";
    } catch (const std::exception& error) {
      text = error.what();
    }
    const ssize_t written = ::write(pipe[1], text.data(), text.size());
    ::_exit(written == static_cast<ssize_t>(text.size()) ? 0 : 1);
  }
  ::close(pipe[1]);
  std::string text;
  char buffer[512];
  for (ssize_t n = 0; (n = ::read(pipe[0], buffer, sizeof buffer)) > 0;)
    text.append(buffer, static_cast<std::size_t>(n));
  ::close(pipe[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  if (WIFSIGNALED(status)) return "ended by signal " + std::to_string(WTERMSIG(status));
  return text;
}

using test::mentions;

/// A message's front; what follows is missing, or a gigabyte.
class Front {
 public:
  template <typename T>
  Front& put(T value) {
    const auto* at = reinterpret_cast<const std::uint8_t*>(&value);
    data_.insert(data_.end(), at, at + sizeof(T));
    return *this;
  }
  Front& count(std::uint32_t value) { return put(value); }
  Front& text(const std::string& s) {
    count(static_cast<std::uint32_t>(s.size()));
    data_.insert(data_.end(), s.begin(), s.end());
    return *this;
  }
  Front& header() { return count(1).count(5).count(0).text("world"); }
  const std::vector<std::uint8_t>& bytes() const { return data_; }

 private:
  std::vector<std::uint8_t> data_;
};

/// A gigabyte that begins with these bytes. The rest are zeros that take no memory until somebody writes to them.
class Gigabyte {
 public:
  explicit Gigabyte(const std::vector<std::uint8_t>& front)
      : data_(::mmap(nullptr, GIGABYTE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0)) {
    if (data_ == MAP_FAILED) throw std::bad_alloc();
    if (!front.empty()) std::memcpy(data_, front.data(), front.size());
  }
  ~Gigabyte() { ::munmap(data_, GIGABYTE); }
  Gigabyte(const Gigabyte&) = delete;
  Gigabyte& operator=(const Gigabyte&) = delete;
  const std::uint8_t* data() const { return static_cast<const std::uint8_t*>(data_); }

 private:
  void* data_;
};

Front cloudFront(std::uint32_t height, std::uint32_t width, std::uint32_t row_step, std::uint32_t bytes) {
  Front cloud;
  cloud.header().count(height).count(width).count(3);
  for (int axis = 0; axis < 3; ++axis) {
    cloud.text(std::string(1, static_cast<char>('x' + axis))).count(4 * static_cast<std::uint32_t>(axis));
    cloud.put<std::uint8_t>(7).count(1);
  }
  return cloud.put<std::uint8_t>(0).count(16).count(row_step).count(bytes);
}

std::string refusalOf(const char* type, const std::uint8_t* data, std::size_t size) {
  MeshInputConfig config;
  // Without rows and columns a cloud would be refused for that alone.
  if (type == std::string("sensor_msgs/PointCloud2")) config.source = TopologySource::POLYLINE;
  return refusal([&] { MeshDecoder(config).decode(type, {data, size}); });
}
std::string refusalOf(const char* type, const Front& front) {
  return refusalOf(type, front.bytes().data(), front.bytes().size());
}

TEST(HostileInput, TheLimitHolds) {
  if (!memoryCanBeLimited()) GTEST_SKIP() << "sanitizers keep no limit of addresses";
  EXPECT_EQ(refusal([] { std::vector<char>(2 * MEMORY_BYTES); }), "out of memory");
  EXPECT_EQ(refusal([] { std::vector<char>(MEMORY_BYTES / 2); }), "accepted");
}

TEST(HostileInput, FourBillionClaimedPoints) {
  constexpr std::uint32_t MANY = 0xffffffff;
  const char* const CLOUD = "sensor_msgs/PointCloud2";
  EXPECT_TRUE(mentions(refusalOf(CLOUD, cloudFront(1, MANY, 64, 0).put<std::uint8_t>(1)), "do not fit"));
  EXPECT_TRUE(mentions(refusalOf(CLOUD, cloudFront(MANY, MANY, 64, 0).put<std::uint8_t>(1)), "68719476720"));
  EXPECT_TRUE(mentions(refusalOf(CLOUD, cloudFront(1, MANY, 64, MANY)), "4294967295"));
  EXPECT_TRUE(mentions(refusalOf("deformable_ccd/MeshStamped", Front().header().count(MANY)), "4294967295"));
  EXPECT_TRUE(mentions(refusalOf("deformable_ccd/MeshStamped", Front().header().count(0).count(MANY)), "4294967295"));
  EXPECT_TRUE(mentions(refusalOf("shape_msgs/Mesh", Front().count(MANY)), "4294967295"));
  EXPECT_TRUE(mentions(refusalOf("visualization_msgs/MarkerArray", Front().count(MANY)), "4294967295"));
  EXPECT_TRUE(mentions(refusalOf("pcl_msgs/PolygonMesh", Front().header().header().count(MANY).count(MANY).count(MANY)),
                       "4294967295"));
  EXPECT_TRUE(
      mentions(refusalOf("deformable_ccd/MeshStamped", Front().count(1).count(5).count(0).count(MANY)), "4294967295"))
      << "a name of four gigabytes";
}

TEST(HostileInput, AGigabyteOfPointsThatAreThere) {
  constexpr std::uint32_t POINTS = 67000000, BYTES = 16 * POINTS;
  const Front front = cloudFront(1, POINTS, BYTES, BYTES);
  const Gigabyte cloud(front.bytes());
  const std::string text =
      refusalOf("sensor_msgs/PointCloud2", cloud.data(), front.bytes().size() + BYTES + 1);  // with is_dense
  EXPECT_TRUE(mentions(text, "more than a mesh may have")) << text;
  const Front mesh = Front().header().count(44000000);
  const Gigabyte vertices(mesh.bytes());
  const std::size_t bytes = mesh.bytes().size() + std::size_t{24} * 44000000 + 4;  // with the count of triangles
  EXPECT_TRUE(mentions(refusalOf("deformable_ccd/MeshStamped", vertices.data(), bytes), "more than a mesh may have"));
  EXPECT_TRUE(mentions(refusalOf("deformable_ccd/MeshStamped", vertices.data(), bytes + 1), "1 bytes stand after"));
}

TEST(HostileInput, AMapOfAGigabyte) {
  const auto read = [](const std::uint8_t* data, bool binary, const OctomapLimits& limits) {
    return refusal([&] { decodeOctomap({"OcTree", 0.1, binary, data, GIGABYTE}, limits); });
  };
  OctomapLimits large;
  large.max_bytes = 2 * GIGABYTE;
  const Gigabyte zeros({});
  EXPECT_TRUE(mentions(read(zeros.data(), true, {}), "1073741824")) << read(zeros.data(), true, {});
  // Allowed that size: a root with a leaf, or alone, then bytes that belong to nothing.
  const Gigabyte leaf({0x02});
  EXPECT_TRUE(mentions(read(leaf.data(), true, large), "after the tree's end")) << read(leaf.data(), true, large);
  EXPECT_TRUE(mentions(read(zeros.data(), false, large), "after the tree's end")) << read(zeros.data(), false, large);
  const Gigabyte deep(std::vector<std::uint8_t>(4096, 0xff));
  EXPECT_TRUE(mentions(read(deep.data(), true, large), "16 levels")) << read(deep.data(), true, large);
}

TEST(HostileInput, MapsWithImpossibleNumbers) {
  const std::string one_leaf(2, '\xaa');
  using Limits = std::numeric_limits<double>;
  for (const double resolution : {0.0, -0.0, -1.0, Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(),
                                  Limits::denorm_min(), Limits::max()}) {
    const std::string text = refusal([&] {
      decodeOctomap({"OcTree", resolution, true, one_leaf.data(), one_leaf.size()});
    });
    EXPECT_TRUE(mentions(text, "resolution")) << resolution << ": " << text;
  }
  // As a message: four gigabytes of data claimed.
  const Front map = Front().header().put<std::uint8_t>(1).text("OcTree").put(0.1).count(0xffffffff);
  const std::string text = refusal([&] {
    const LoadedMap loaded = decodeMapMessage(map.bytes(), MonitorConfig());
    throw std::runtime_error(loaded.problem);
  });
  EXPECT_TRUE(mentions(text, "4294967295")) << text;
}

class HostileFile : public test::FolderTest {
 protected:
  /// The path of a file of this name that holds the bytes, or as many more zeros as are asked for.
  std::string write(const std::string& name, const std::string& bytes, std::size_t size = 0) {
    const fs::path path = folder_ / name;
    std::ofstream(path, std::ios::binary) << bytes;
    if (size > bytes.size()) fs::resize_file(path, size);  // a file with a hole takes no disk
    return path.string();
  }
};

TEST_F(HostileFile, ClaimsOfFourBillionTriangles) {
  const std::string stl = write("a.stl", std::string(80, ' ') + "\xff\xff\xff\xff");
  EXPECT_TRUE(mentions(refusal([&] { loadStlFile(stl); }), "of the size that it states"))
      << refusal([&] { loadStlFile(stl); });
  const std::string ply = write("a.ply",
                                "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\n"
                                "property float z\nelement face 4000000000\nproperty list uchar int vertex_indices\n"
                                "end_header\n0 0 0\n");
  EXPECT_TRUE(mentions(refusal([&] { loadMeshFile(ply); }), "4000000000")) << refusal([&] { loadMeshFile(ply); });
  const std::string obj = write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4000000000\n");
  EXPECT_TRUE(mentions(refusal([&] { loadMeshFile(obj); }), "a.obj")) << refusal([&] { loadMeshFile(obj); });
}

TEST_F(HostileFile, RecordingsThatClaimMore) {
  std::string bytes = "DCCDSTEP";
  bytes += std::string("\2\0\0\0\xff\xff\xff\xff", 8);  // version 2, a note of four gigabytes
  const std::string path = write("a.step", bytes);
  EXPECT_TRUE(mentions(refusal([&] { readRecordingFile(path); }), "byte")) << refusal([&] { readRecordingFile(path); });
}

TEST_F(HostileFile, MapFilesOfAGigabyte) {
  const std::string path = write("a.bt", "# Octomap OcTree binary file\nid OcTree\nsize 1\nres 0.1\ndata\n", GIGABYTE);
  const std::string text = refusal([&] { readOctomapFile(path); });
  EXPECT_TRUE(mentions(text, "a.bt") && mentions(text, "10737418")) << text;
  EXPECT_EQ(regularFileProblem(path, GIGABYTE), "") << "so many may be";
  EXPECT_EQ(regularFileProblem(path, GIGABYTE - 1), "has 1073741824 bytes, at most 1073741823 are read");
}

}  // namespace
}  // namespace dccd
