#include "stream/seam_reason.h"

#include <gtest/gtest.h>

#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

MeshFrame frameAt(StampNs stamp_ns, const Vec3& last) {
  return {stamp_ns, share(Topology::fromTriangles(3, {{0, 1, 2}})), {{0, 0, 0}, {1, 0, 0}, last}};
}

TEST(SeamReason, OfATeleportHowFarWhichVertexWentAndWhatIsAllowed) {
  MeshStoreOptions options;
  options.max_vertex_step_m = 0.25;
  const MeshFrame before = frameAt(0, {0, 1, 0});
  const auto said = [&](const Vec3& last) {
    return seamReason(StepStatus::TELEPORT, before, frameAt(100000000, last), options);
  };
  EXPECT_EQ(said({0, 1.5, 0}), "vertex 2 moved 0.5 m in 0.1 s, max_vertex_step_m is 0.25");
  EXPECT_NE(said({0, 900, 0}).find("; the mesh is 900 m across: are its coordinates in millimetres?"),
            std::string::npos);
}

// Before /clock, where use_sim_time is set, the time of receipt is 0.
TEST(SeamReason, OfADuplicateWithoutAStampThatThereIsNoClock) {
  const auto said = [](StampNs stamp_ns) {
    const MeshFrame frame = frameAt(stamp_ns, {0, 1, 0});
    return seamReason(StepStatus::DUPLICATE, frame, frame, {});
  };
  EXPECT_NE(said(0).find("no /clock yet"), std::string::npos);
  EXPECT_EQ(said(1), "the stamp is that of the last frame");
}

}  // namespace
}  // namespace test
}  // namespace dccd
