// Identities and events of patches in a stream: scenes of which it is known what begins, ends, merges and splits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "support/heap.h"
#include "unit/stream/patch_stream.h"

namespace dccd {
namespace test {
namespace {

TEST(PatchTracker, AClothLaidDownInTwoPlacesThatGrowTogether) {
  ClothOnTable stream(5, 41);
  std::vector<StampNs> stamps;
  std::vector<std::size_t> sizes;
  for (int k = 0; k < 20; ++k) {
    const Outcome outcome = stream.lift([&](std::size_t c) {
      const double left = std::abs(static_cast<double>(c) - 8) / 12;
      const double right = std::abs(static_cast<double>(c) - 32) / 12 + 0.25;
      return std::max(0.0, 0.01 + 0.05 * std::min(left, right) - 0.004 * k);
    });
    stamps.push_back(stream.now());
    for (const Patch& patch : outcome.patches) EXPECT_NE(patch.id, 0u);
    sizes.push_back(outcome.patches.size());
  }
  EXPECT_EQ(stream.text(), "BEGAN 1, BEGAN 2, MERGED 1+2");
  // 0.01 - 0.004 k is 0 from k = 3 on, in the straight step from 2 to 3 at its end.
  ASSERT_EQ(stream.events().size(), 3u);
  EXPECT_LE(stream.events()[0].from_ns, stamps[3]);
  EXPECT_GT(stream.events()[0].from_ns, stamps[2]);
  EXPECT_EQ(stream.events()[0].to_ns, stamps[3]);
  EXPECT_EQ(stream.events()[0].body, (std::array<std::uint16_t, 2>{0, OBSTACLE_BODY}));
  EXPECT_EQ(*std::max_element(sizes.begin(), sizes.end()), 2u);
  EXPECT_EQ(sizes.back(), 1u);
}

/// One sheet of 3 x 43 points, folded in the middle; the upper layer is this far above the lower one.
Positions folded(double gap_m) {
  Positions x;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 43; ++c) {
      const bool upper = c > 21;
      const double fold = c == 21 ? 0.5 * gap_m : 0;
      x.emplace_back(0.02 * (upper ? 41.6 - c : c), 0.02 * r + (upper ? 0.007 : 0), (upper ? gap_m : 0) + fold);
    }
  }
  return x;
}

TEST(PatchTracker, AFoldThatClosesAndOpens) {
  Stream stream({grid(3, 43)});
  std::vector<StampNs> stamps;
  for (int k = 0; k < 24; ++k) {
    stream.feed({folded(0.01 * std::abs(k - 3) + 0.0002)});
    stamps.push_back(stream.now());
  }
  EXPECT_EQ(stream.text(), "");
  for (int k = 0; k < 24; ++k) {
    // Through and back: the layers change sides for one frame.
    stream.feed({folded(k == 3 ? -0.0002 : 0.01 * std::abs(k - 3) + 0.0002)});
    stamps.push_back(stream.now());
  }
  EXPECT_EQ(stream.text(), "BEGAN 1, ENDED 1");
  ASSERT_EQ(stream.events().size(), 2u);
  EXPECT_GT(stream.events()[0].from_ns, stamps[24 + 2]);
  EXPECT_LE(stream.events()[0].to_ns, stamps[24 + 3]);
  EXPECT_EQ(stream.events()[0].body, (std::array<std::uint16_t, 2>{0, 0}));
  // It crossed at frame 3 and was apart at frame 4.
  EXPECT_GE(stream.events()[1].from_ns, stamps[24 + 3]);
  EXPECT_EQ(stream.events()[1].to_ns, stamps[24 + 4]);
}

/// A torus around the x axis, at x = 0.
Positions torusAt(double radius_m, double tube_m, int around, int across) {
  Positions x;
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      const double a = 2 * M_PI * i / around, b = 2 * M_PI * j / across, r = radius_m + tube_m * std::cos(b);
      x.emplace_back(tube_m * std::sin(b), r * std::sin(a), r * std::cos(a));
    }
  }
  return x;
}
Topology torus(int around, int across) {
  std::vector<Face> faces;
  const auto at = [&](int i, int j) { return static_cast<Index>((i % around) * across + j % across); };
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return Topology::fromTriangles(static_cast<std::size_t>(around * across), faces);
}

TEST(PatchTracker, ARopePulledThroughARingStaysOne) {
  constexpr int POINTS = 60, FRAMES = 90;
  constexpr double LENGTH_M = 0.02 * (POINTS - 1), INSIDE_M = 0.1 - 0.02;
  const Positions ring = torusAt(0.1, 0.02, 24, 8);
  Stream stream({share(Topology::polyline(POINTS)), share(torus(24, 8))});
  std::vector<std::size_t> touching;
  for (int k = 0; k < FRAMES; ++k) {
    // It lies on the ring's inside, in a sling; its end goes in at frame 12 and its beginning comes out at frame 71.
    Positions rope;
    for (int i = 0; i < POINTS; ++i) {
      const double x = 0.02 * (i + k) - LENGTH_M - 0.25;
      rope.emplace_back(x, 0.001 * std::sin(9 * x), -INSIDE_M - 0.0002 - 0.05 * std::abs(x));
    }
    const Outcome outcome = stream.feed({rope, ring});
    if (!outcome.patches.empty()) touching.push_back(static_cast<std::size_t>(k));
    EXPECT_LE(outcome.patches.size(), 1u) << "frame " << k;
  }
  ASSERT_GT(touching.size(), 50u);
  EXPECT_NEAR(static_cast<double>(touching.front()), 12, 2);
  EXPECT_NEAR(static_cast<double>(touching.back()), 71, 2);
  EXPECT_EQ(stream.text(), "BEGAN 1, ENDED 1");
}

TEST(PatchTracker, WhatTouchesASheetFromBothSidesAtOneVertexIsTwo) {
  const auto tip = share(Topology::fromTriangles(4, {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}}));
  const auto tipAt = [](double side, double gap_m) {
    Positions x = {Vec3(0.043, 0.044, 0), Vec3(0.05, 0.04, 0.03), Vec3(0.04, 0.05, 0.03), Vec3(0.035, 0.035, 0.03)};
    // Beside each other, so that they do not touch, on faces of one vertex.
    for (Vec3& p : x) p += Vec3(0.002 * side, 0.001 * side, 0), p.z() = side * (p.z() + gap_m);
    return x;
  };
  Stream stream({grid(5, 5), tip, tip});
  const Positions sheet = strip(5, 5, 0.02, [](std::size_t) { return 0.0; });
  for (int k = 0; k < 40; ++k) {
    const double above = k >= 3 && k < 12 ? -0.001 : 0.01, below = k >= 6 && k < 24 ? -0.001 : 0.01;
    stream.feed({sheet, tipAt(1, above), tipAt(-1, below)});
  }
  EXPECT_EQ(stream.text(), "BEGAN 1, BEGAN 2, ENDED 1, ENDED 2");
  EXPECT_EQ(stream.events()[2].body, (std::array<std::uint16_t, 2>{0, 1}));
}

TEST(PatchTracker, ASplitIsToldOnceTheGapIsOverAndTheLargerPartKeepsTheIdentity) {
  // In one step of four the last column is apart, so that not all that touched still does.
  std::vector<StampNs> splits;
  for (const int noise : {0, 1, 2, 3}) {
    ClothOnTable stream(3, 41);
    std::vector<std::uint64_t> ids;
    for (int k = 0; k < 40; ++k) {
      const Outcome outcome = stream.lift([&](std::size_t c) {
        const bool lifted = k >= 10 && ((c >= 10 && c < 20) || (c == 40 && (k + noise) % 4 < 2));
        return k == 0 ? 0.01 : lifted ? 0.05 : 0.0;
      });
      ids.clear();
      for (const Patch& patch : outcome.patches) ids.push_back(patch.id);
      if (k >= 12 && k < 16) {
        EXPECT_EQ(ids, (std::vector<std::uint64_t>{1, 1})) << "apart for a moment";
      }
    }
    ASSERT_EQ(stream.text(), "BEGAN 1, SPLIT 1+2") << noise;
    splits.push_back(stream.events()[1].to_ns);
    EXPECT_EQ(splits.back(), splits.front()) << noise;
    EXPECT_EQ(ids, (std::vector<std::uint64_t>{2, 1})) << "columns 0 to 9, and the larger part beyond 20";
  }
}

TEST(PatchTracker, NoiseOnARestingClothBeginsNothing) {
  for (const bool on_map : {true, false}) {
    Stream stream(on_map ? std::vector<std::shared_ptr<const Topology>>{grid(21, 21)}
                         : std::vector<std::shared_ptr<const Topology>>{grid(21, 21), grid(12, 12)});
    if (on_map) stream.setMap(table(0.02));
    Positions below;
    for (int i = 0; i < 144; ++i) below.emplace_back(0.05 * (i % 12) - 0.07, 0.05 * (i / 12) - 0.06, 0.0);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> noise(-0.001, 0.001);
    std::size_t first = 0, contacts = 0;
    for (int k = 0; k < 300; ++k) {
      Positions x = strip(21, 21, 0.02, [](std::size_t) { return 0.0; });
      for (Vec3& p : x) p += Vec3(noise(random), noise(random), noise(random));
      const Outcome outcome = stream.feed(on_map ? std::vector<Positions>{x} : std::vector<Positions>{x, below});
      contacts += outcome.total_contacts;
      if (k == 1) first = stream.events().size();
    }
    EXPECT_GT(contacts, 300u * 100);
    EXPECT_GT(first, 0u);
    for (std::size_t i = first; i < stream.events().size(); ++i) {
      EXPECT_NE(stream.events()[i].kind, PatchEventKind::BEGAN) << stream.text();
      EXPECT_NE(stream.events()[i].kind, PatchEventKind::ENDED) << stream.text();
    }
  }
}

TEST(PatchTracker, AVoxelThatAppearsUnderARestingCloth) {
  ClothOnTable stream(5, 5);
  for (int k = 0; k < 5; ++k) stream.at(0.01);
  EXPECT_EQ(stream.text(), "");
  std::vector<OccupiedLeaf> leaves = table(0.05)->leaves();
  leaves.push_back({{32768, 32768, 32768}, 1});
  stream.setMap(VoxelSurface::build(0.05, leaves));
  for (int k = 0; k < 5; ++k) stream.at(0.01);
  EXPECT_EQ(stream.text(), "BEGAN 1 MAP_CHANGED");
  // The same map once more, and one with other voxels elsewhere.
  stream.setMap(VoxelSurface::build(0.05, leaves));
  for (int k = 0; k < 5; ++k) stream.at(0.01);
  leaves.push_back({{32000, 32000, 32000}, 1});
  stream.setMap(VoxelSurface::build(0.05, leaves));
  for (int k = 0; k < 5; ++k) stream.at(0.01);
  EXPECT_EQ(stream.text(), "BEGAN 1 MAP_CHANGED");
  // No map at all is no reason for an end as long as one is expected.
  stream.options().detector.obstacle_expected = true;
  stream.monitor().setOptions(stream.options());
  stream.setMap(nullptr);
  for (int k = 0; k < 15; ++k) stream.at(0.01);
  stream.setMap(VoxelSurface::build(0.05, leaves));
  for (int k = 0; k < 15; ++k) stream.at(0.01);
  EXPECT_EQ(stream.text(), "BEGAN 1 MAP_CHANGED");
}

TEST(PatchTracker, ASeamEndsAllThatLivesAndWhatTouchesThenIsInitial) {
  ClothOnTable stream(5, 5);
  stream.at(0.01);
  for (int k = 0; k < 5; ++k) stream.at(0);
  EXPECT_EQ(stream.text(), "BEGAN 1");
  const StampNs last_ns = stream.now();
  stream.wait(2000000000);
  const Outcome gap = stream.at(0);
  EXPECT_EQ(gap.status, StepStatus::GAP);
  EXPECT_EQ(stream.text(), "BEGAN 1, ENDED 1 unknown");
  EXPECT_EQ(stream.events().back().from_ns, last_ns - PERIOD_NS) << "at the beginning of the last step it touched";
  const Outcome after = stream.at(0);
  EXPECT_EQ(stream.text(), "BEGAN 1, ENDED 1 unknown, BEGAN 2 INITIAL");
  EXPECT_EQ(stream.events().back().from_ns, UNKNOWN_NS);
  EXPECT_EQ(stream.events().back().to_ns, after.start_ns);
  ASSERT_EQ(after.patches.size(), 1u);
  EXPECT_EQ(after.patches[0].beginning, PatchBeginning::INITIAL);
  EXPECT_EQ(stream.events().back().patch, 0u);
  // A reset is one as well.
  stream.monitor().reset();
  stream.at(0);
  stream.at(0);
  EXPECT_EQ(stream.text(), "BEGAN 1, ENDED 1 unknown, BEGAN 2 INITIAL, ENDED 2 unknown, BEGAN 3 INITIAL");
}

TEST(PatchTracker, ASeamOfOneBodyEndsWhatItTouches) {
  Stream stream({grid(5, 5), grid(5, 5)});
  stream.setMap(table(0.05));
  const auto at = [](double x, double z) {
    Positions out = strip(5, 5, 0.02, [z](std::size_t) { return z; });
    for (Vec3& p : out) p.x() += x;
    return out;
  };
  stream.feed({at(0, 0.01), at(0.5, 0.01)});
  for (int k = 0; k < 5; ++k) stream.feed({at(0, 0), at(0.5, 0)});
  EXPECT_EQ(stream.text(), "BEGAN 1, BEGAN 2");
  // The second body is found elsewhere, as trackers do; the clock body goes on.
  for (int k = 0; k < 5; ++k) {
    stream.wait(0);
    stream.feed({at(0, 0), at(-0.5, 0)});
  }
  EXPECT_EQ(stream.text(), "BEGAN 1, BEGAN 2, ENDED 2 unknown, BEGAN 3 INITIAL");
}

TEST(PatchTracker, AStepWithoutAnAnswerOrCutEndsNothing) {
  ClothOnTable stream(9, 9);
  stream.at(0.01);
  for (int k = 0; k < 5; ++k) stream.at(0);
  const auto run = [&](const std::function<void(Options&)>& change, StepStatus status) {
    const MonitorOptions before = stream.options();
    change(stream.options().detector);
    stream.monitor().setOptions(stream.options());
    for (int k = 0; k < 20; ++k) EXPECT_EQ(stream.at(0).status, status);
    stream.options() = before;
    stream.monitor().setOptions(before);
    for (int k = 0; k < 3; ++k) EXPECT_EQ(stream.at(0).status, StepStatus::OK);
    EXPECT_EQ(stream.text(), "BEGAN 1") << toString(status);
  };
  run([](Options& o) { o.max_found = 1; }, StepStatus::TRUNCATED);
  run([](Options& o) { o.step_budget_ms = 1e-6; }, StepStatus::DEADLINE);
  // A cut list is none of this: all contacts were found.
  run([](Options& o) { o.max_contacts = 1; }, StepStatus::TRUNCATED);
  for (int k = 0; k < 20; ++k) {
    stream.monitor().skip(0, StepStatus::NO_TRANSFORM, stream.now() + 1000 * k, "no transform");
    Outcome outcome;
    ASSERT_TRUE(stream.monitor().next(0, outcome));
    stream.take(outcome);
  }
  for (int k = 0; k < 3; ++k) stream.at(0);
  EXPECT_EQ(stream.text(), "BEGAN 1");
  // And a whole answer without the contact does.
  for (int k = 0; k < 12; ++k) stream.at(0.01);
  EXPECT_EQ(stream.text(), "BEGAN 1, ENDED 1");
}

// A cloth at rest above the table, and another one below: neither moves, and more noise makes them touch.
TEST(PatchTracker, WhatWasSeenApartIsNewsWhereNoiseGrows) {
  for (const bool is_seen_before : {true, false}) {
    MonitorOptions options;
    options.detector.accuracy.rung = Accuracy::CONSERVATIVE;
    Stream stream({grid(5, 5), grid(5, 5)}, options);
    stream.setMap(table(0.05));
    const auto feed = [&](double radius_m) {
      const auto at = [](double z) { return strip(5, 5, 0.02, [z](std::size_t) { return z; }); };
      return stream.feed({at(0.004), at(0.008)}, radius_m);
    };
    const double less_m = 0.001, more_m = 0.0045;
    feed(is_seen_before ? less_m : more_m);
    for (int k = 0; is_seen_before && k < 3; ++k) EXPECT_TRUE(feed(less_m).patches.empty());
    const Outcome outcome = feed(more_m);
    ASSERT_EQ(outcome.patches.size(), 2u) << "of the two, and of the lower one with the map";
    for (const Patch& patch : outcome.patches) {
      EXPECT_EQ(patch.initial, patch.contacts);
      EXPECT_EQ(patch.is_new, is_seen_before);
      EXPECT_EQ(patch.beginning, is_seen_before ? PatchBeginning::NEW : PatchBeginning::INITIAL);
      EXPECT_EQ(patch.began_from_ns, is_seen_before ? outcome.start_ns : UNKNOWN_NS);
      EXPECT_EQ(patch.began_to_ns, outcome.start_ns);
    }
    EXPECT_FALSE(feed(more_m).patches.at(0).is_new) << "once";
  }
}

TEST(PatchTracker, WhatBeganInAStepThatWasCutIsNewsInTheNextThatIsNot) {
  Stream stream({grid(5, 5), grid(5, 5)});
  stream.setMap(table(0.05));
  const auto feed = [&](double z) {
    const auto at = [](double height) { return strip(5, 5, 0.02, [height](std::size_t) { return height; }); };
    return stream.feed({at(z), at(z + 0.3)});
  };
  feed(0.01);
  const Outcome whole = feed(0.01);
  ASSERT_EQ(whole.status, StepStatus::OK);
  const MonitorOptions before = stream.options();
  stream.options().detector.step_budget_ms = 1e-6;
  stream.monitor().setOptions(stream.options());
  for (int k = 0; k < 3; ++k) ASSERT_EQ(feed(0).status, StepStatus::DEADLINE);
  stream.monitor().setOptions(stream.options() = before);
  const Outcome outcome = feed(0);
  ASSERT_EQ(outcome.patches.size(), 1u);
  EXPECT_TRUE(outcome.patches[0].is_new);
  EXPECT_EQ(outcome.patches[0].began_from_ns, whole.stamp_ns);
  EXPECT_EQ(outcome.patches[0].began_to_ns, outcome.start_ns);
  EXPECT_FALSE(feed(0).patches.at(0).is_new) << "once";
}

// What stands still and is put elsewhere came to touch at a time that nobody knows, as a voxel does.
TEST(PatchTracker, WhatStandsStillAndIsPutElsewhereIsNoNews) {
  std::vector<Body> bodies(2);
  bodies[0].name = "cloth", bodies[1].name = "plate", bodies[1].motion = BodyMotionKind::STATIC;
  MonitorOptions options;
  options.detector.patches = true;
  Monitor monitor(options, bodies);
  StampNs stamp_ns = 1000000000;
  const auto push = [&](std::size_t body, double z) {
    MeshFrame frame;
    frame.stamp_ns = stamp_ns;
    frame.topology = grid(5, 5);
    frame.positions = strip(5, 5, 0.02, [z](std::size_t) { return z; });
    monitor.push(body, std::move(frame), 0);
  };
  Outcome outcome;
  for (int k = 0; k < 5; ++k, stamp_ns += PERIOD_NS) {
    if (k == 0 || k == 3) push(1, k == 0 ? 0.3 : 0);
    push(0, 0);
    ASSERT_TRUE(monitor.next(0, outcome));
    ASSERT_EQ(outcome.patches.size(), k < 3 ? 0u : 1u);
    if (k == 3) EXPECT_EQ(outcome.patches[0].beginning, PatchBeginning::INITIAL);
    if (k >= 3) EXPECT_FALSE(outcome.patches[0].is_new);
  }
}

TEST(PatchTracker, WhatComesBackWithinTheGapIsTheSame) {
  for (const double gap_s : {0.0, 0.1, 1.0}) {
    MonitorOptions options;
    options.patch_gap_s = gap_s;
    ClothOnTable stream(5, 5, options);
    // Up for 5 frames, 0.165 s.
    for (int k = 0; k < 30; ++k) stream.at(k == 0 || (k >= 10 && k < 15) ? 0.01 : 0);
    EXPECT_EQ(stream.text(), gap_s > 0.165 ? "BEGAN 1" : "BEGAN 1, ENDED 1, BEGAN 2") << gap_s;
  }
}

TEST(PatchTracker, AnEndSaysWhetherAllOfItWasExpected) {
  for (const bool expects : {false, true}) {
    MonitorOptions options;
    if (expects) options.detector.expected.resize(1);
    if (expects) options.detector.expected[0].partners[1].body = OBSTACLE_BODY;
    ClothOnTable stream(5, 5, options);
    for (int k = 0; k < 20; ++k) stream.at(k > 0 && k < 4 ? 0 : 0.01);
    ASSERT_EQ(stream.text(), "BEGAN 1, ENDED 1");
    for (const PatchEvent& event : stream.events()) EXPECT_EQ(event.expected, expects) << toString(event.kind);
  }
}

TEST(PatchTracker, PredictionsAndChecksLeaveItAloneAndKnowWhatLives) {
  const auto run = [](bool asks) {
    MonitorOptions options;
    options.look_ahead_s = 0.2;
    Stream stream({grid(5, 5), share(Topology::fromTriangles(3, {{0, 1, 2}}))}, options);
    stream.setMap(table(0.05));
    std::size_t known = 0, fresh = 0;
    for (int k = 0; k < 30; ++k) {
      Positions falling = {Vec3(0.02, 0.02, 0.1), Vec3(0.05, 0.02, 0.2), Vec3(0.02, 0.05, 0.2)};
      for (Vec3& p : falling) p.z() -= 0.004 * k;
      const Positions cloth = strip(5, 5, 0.02, [&](std::size_t) { return k == 0 ? 0.004 : k == 1 ? 0.001 : 0.0; });
      if (!stream.feed({cloth, falling}).answered || !asks) continue;
      for (const Patch& patch : stream.monitor().predict().patches) ++(patch.id == 0 ? fresh : known);
      for (const Patch& patch : stream.monitor().checkNow().patches) EXPECT_NE(patch.id, 0u);
    }
    if (asks) {
      EXPECT_GT(known, 0u);
      EXPECT_GT(fresh, 0u) << "the triangle's contact is seen to come";
    }
    return stream.text();
  };
  EXPECT_EQ(run(true), run(false));
  EXPECT_NE(run(false).find("BEGAN 2"), std::string::npos) << run(false);
}

TEST(PatchTracker, SwitchedOffItForgets) {
  ClothOnTable stream(5, 5);
  for (int k = 0; k < 3; ++k) stream.at(0);
  stream.options().detector.patches = false;
  stream.monitor().setOptions(stream.options());
  EXPECT_TRUE(stream.at(0).patches.empty());
  EXPECT_EQ(stream.text(), "BEGAN 1 INITIAL, ENDED 1 unknown");
  MonitorOptions bad;
  bad.patch_gap_s = -1;
  EXPECT_THROW(stream.monitor().setOptions(bad), std::invalid_argument);
}

TEST(PatchTracker, WhatABurstMadeLargeIsGivenBack) {
  if (heapInUse() == 0) GTEST_SKIP() << "a sanitizer's heap does not tell";
  constexpr std::size_t SIZE = 14;
  Stream stream({grid(SIZE, SIZE)});
  const Positions flat = strip(SIZE, SIZE, 0.02, [](std::size_t) { return 0.0; });
  for (int k = 0; k < 3; ++k) stream.feed({flat});
  const std::size_t before = heapInUse();
  std::size_t found = 0;
  {
    // A tracker that collapses: every feature meets all others.
    const Positions point(SIZE * SIZE, Vec3(0.1, 0.1, 0));
    for (const Positions* x : {&point, &flat}) found = std::max(found, stream.feed({*x}).total_contacts);
  }
  EXPECT_GT(found, 100000u);
  EXPECT_GT(heapInUse() - before, std::size_t{10} << 20);
  for (int k = 0; k < 20; ++k) stream.feed({flat});
  EXPECT_LT(heapInUse(), before + (std::size_t{4} << 20));
}

}  // namespace
}  // namespace test
}  // namespace dccd
