// A fuzz target is a function of some bytes that throws on a finding. With DEFORMABLE_CCD_FUZZER it becomes libFuzzer's
// entry point; without, a gtest that replays test/fuzz/corpus/NAME, seeds and former findings alike.
#pragma once

#include <cstddef>
#include <cstdint>

#ifdef DEFORMABLE_CCD_FUZZER

#define DEFORMABLE_CCD_FUZZ_TARGET(name)                                              \
  extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) { \
    name(data, size);                                                                 \
    return 0;                                                                         \
  }

#else

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace dccd {
namespace fuzz {

/// Runs the target on every file of its corpus, in the order of their names.
inline void replayCorpus(const std::string& name, void (*target)(const std::uint8_t*, std::size_t)) {
  const std::filesystem::path folder = std::filesystem::path(DEFORMABLE_CCD_SOURCE_DIR) / "test/fuzz/corpus" / name;
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path());
  ASSERT_FALSE(files.empty()) << folder;
  std::sort(files.begin(), files.end());
  for (const std::filesystem::path& path : files) {
    SCOPED_TRACE(path.string());
    std::ifstream in(path, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
    EXPECT_NO_THROW(target(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()));
    // No byte may be read beyond the end: the sanitizers see it when the copy ends where the input ends.
    const std::vector<std::uint8_t> cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(bytes.size() / 2));
    EXPECT_NO_THROW(target(cut.data(), cut.size()));
  }
}

}  // namespace fuzz
}  // namespace dccd

#define DEFORMABLE_CCD_FUZZ_TARGET(name) \
  TEST(FuzzCorpus, name) { ::dccd::fuzz::replayCorpus(#name, &name); }

#endif
