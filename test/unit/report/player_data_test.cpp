#include "report/player_data.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "report/lanes.h"
#include "report/report.h"

namespace dccd {
namespace {

using nlohmann::json;

constexpr StampNs STEP_NS = 100'000'000;

Positions heldAt(double z, std::size_t vertices = 4) {
  Positions positions;
  for (std::size_t i = 0; i < vertices; ++i) positions.emplace_back(0.1 * static_cast<double>(i % 2), 0.1 * (i / 2), z);
  return positions;
}

// One square that falls; step i leads from -i to -(i + 1) centimetres.
struct Falling {
  std::shared_ptr<const Topology> topology = share(Topology::grid(2, 2));
  std::vector<Body> bodies = std::vector<Body>(1);
  std::shared_ptr<const Positions> at = share(heldAt(0));
  std::uint64_t steps = 0;
  Falling() { bodies[0].name = "square"; }

  Outcome next() {
    Outcome o;
    o.answered = true;
    o.status = StepStatus::OK;
    o.start_ns = static_cast<StampNs>(steps) * STEP_NS;
    o.stamp_ns = o.start_ns + STEP_NS;
    o.sequence = ++steps;
    auto step = std::make_shared<Step>();
    step->bodies = bodies;
    step->bodies[0].topology = topology;
    step->bodies[0].t0 = at;
    at = share(heldAt(-0.01 * static_cast<double>(steps)));
    step->bodies[0].t1 = at;
    o.step = step;
    return o;
  }
};

// What the page's script does with the bytes.
std::vector<std::vector<std::int64_t>> decoded(const json& data) {
  static const std::string DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const std::string text = data["bytes"];
  std::string bytes;
  for (std::size_t i = 0; i + 3 < text.size(); i += 4) {
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 4; ++k)
      three = three << 6 | (text[i + k] == '=' ? 0u : static_cast<std::uint32_t>(DIGITS.find(text[i + k])));
    for (std::size_t k = 0; k < 3; ++k) {
      if (text[i + k + 1] != '=') bytes += static_cast<char>(three >> (16 - 8 * k) & 255);
    }
  }
  std::size_t at = 0;
  std::vector<std::vector<std::int64_t>> frames;
  for (const json& frame : data["frames"]) {
    const std::size_t n = 3 * data["shapes"][frame[3][0].get<std::size_t>()]["vertices"].get<std::size_t>();
    const int how = bytes.at(at++);
    std::vector<std::int64_t> values = how == 2 ? std::vector<std::int64_t>(n, 0) : frames.back();
    for (std::size_t i = 0; how != 0 && i < n; ++i) {
      std::uint64_t zigzag = 0;
      for (int shift = 0;; shift += 7) {
        const auto byte = static_cast<unsigned char>(bytes.at(at++));
        zigzag |= static_cast<std::uint64_t>(byte & 127) << shift;
        if (byte < 128) break;
      }
      values[i] += static_cast<std::int64_t>(zigzag >> 1) ^ -static_cast<std::int64_t>(zigzag & 1);
    }
    frames.push_back(std::move(values));
  }
  EXPECT_EQ(at, bytes.size());
  return frames;
}

TEST(PlayerData, FramesAreWhereTheBodiesWereToAQuantum) {
  Falling run;
  PlayerData player;
  for (int i = 0; i < 20; ++i) player.add(run.next(), run.bodies, 0, false);
  const json data = json::parse(player.json());
  const auto frames = decoded(data);
  ASSERT_EQ(frames.size(), 21u) << "the first one's start, too";
  const double quantum = data["bodies"][0]["quantum"], origin_z = data["bodies"][0]["origin"][2];
  EXPECT_NEAR(quantum, std::sqrt(0.02) / 16384, 1e-12);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    EXPECT_NEAR(origin_z + quantum * static_cast<double>(frames[f][2]), -0.01 * static_cast<double>(f), 0.51 * quantum);
    EXPECT_NEAR(data["frames"][f][1].get<double>(), 0.1 * static_cast<double>(f), 1e-12);
  }
}

TEST(PlayerData, AfterASeamTheStartIsAFrameOfItsOwn) {
  Falling run;
  PlayerData player;
  for (int i = 0; i < 4; ++i) {
    const Outcome o = run.next();
    if (i != 2) player.add(o, run.bodies, 0, false);
  }
  const json frames = json::parse(player.json())["frames"];
  ASSERT_EQ(frames.size(), 5u);
  EXPECT_NEAR(frames[3][1].get<double>(), 0.3, 1e-12) << "the start of the step after the seam";
}

TEST(PlayerData, AVertexWithoutAPositionIsMarkedAndABodyAtRestCostsAByte) {
  Falling run;
  PlayerData player;
  Outcome o = run.next();
  auto step = std::make_shared<Step>(*o.step);
  Positions lost = heldAt(0);
  lost[1].x() = std::numeric_limits<double>::quiet_NaN();
  step->bodies[0].t1 = share(lost);
  o.step = step;
  player.add(o, run.bodies, 0, false);
  auto still = std::make_shared<Step>(*step);
  still->bodies[0].t0 = still->bodies[0].t1;
  for (int i = 0; i < 3; ++i) {
    o.step = still;
    o.start_ns = o.stamp_ns;
    o.stamp_ns += STEP_NS;
    player.add(o, run.bodies, 0, false);
  }
  const auto frames = decoded(json::parse(player.json()));
  ASSERT_EQ(frames.size(), 5u);
  EXPECT_NE(frames[0][3], PlayerData::NOT_FINITE);
  EXPECT_EQ(frames[4][3], PlayerData::NOT_FINITE);
  EXPECT_EQ(frames[4][4], frames[0][4]);
}

/// Of more contacts than a frame has room for it shows the new ones, the earliest of them first.
TEST(PlayerData, AFrameShowsSoManyContactsAndPatchesTheNewOnesFirst) {
  Falling run;
  PlayerData player;
  Outcome o = run.next();
  constexpr std::size_t CONTACTS = 300, PATCHES = 100, NEW = 20;
  for (std::size_t i = 0; i < CONTACTS; ++i) {
    Contact contact;
    contact.vertex = {0, 1, 2, 3};
    const bool is_new = i >= CONTACTS - NEW;  // the last in the list
    contact.initial = !is_new;
    contact.toc_lower = is_new ? 0.9 - 0.01 * static_cast<double>(i - (CONTACTS - NEW)) : 0;
    o.contacts.push_back(contact);
  }
  o.patches.resize(PATCHES);
  player.add(o, run.bodies, 0, true);
  const json data = json::parse(player.json());
  const json details = data["frames"].back().back(), contacts = details["c"], patches = details["p"];
  ASSERT_EQ(contacts.size(), 48u) << details.dump().substr(0, 300);
  EXPECT_EQ(patches.size(), 32u);
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const bool is_initial = (contacts[i][4].get<int>() & 2) != 0;
    EXPECT_EQ(is_initial, i >= NEW) << i;
    if (i > 0 && i < NEW) EXPECT_LE(contacts[i - 1][5].get<double>(), contacts[i][5].get<double>());
  }
}

TEST(PlayerData, OverTheBudgetQuietFramesGoFirstAndFirstContactsStay) {
  Falling run;
  constexpr std::size_t BUDGET = 40'000;
  PlayerData player(BUDGET);
  const auto has_event = [](std::uint64_t step) { return step % 100 == 7; };
  for (int i = 0; i < 4000; ++i) {
    Outcome o = run.next();
    if (has_event(o.sequence)) o.patch_events.resize(1);
    player.add(o, run.bodies, 0, o.sequence == 1234);
  }
  const std::string text = player.json();
  EXPECT_LT(text.size(), BUDGET * 1.1);
  EXPECT_GT(text.size(), BUDGET / 4) << "the budget is used";
  std::size_t with_event = 0;
  bool has_first = false;
  const json data = json::parse(text);
  EXPECT_EQ(data["seen"], 4001);
  for (const json& frame : data["frames"]) {
    with_event += has_event(frame[2].get<std::uint64_t>()) && !frame[4].is_null();
    has_first = has_first || frame[2] == 1234;
  }
  EXPECT_EQ(with_event, 40u);
  EXPECT_TRUE(has_first);
  EXPECT_EQ(decoded(data).size(), data["frames"].size());
}

TEST(PlayerData, EventsInEveryFrameAreThinnedToo) {
  Falling run;
  constexpr std::size_t BUDGET = 20'000;
  PlayerData player(BUDGET);
  for (int i = 0; i < 3000; ++i) {
    Outcome o = run.next();
    o.patch_events.resize(1);
    player.add(o, run.bodies, 0, false);
  }
  const std::string text = player.json();
  EXPECT_LT(text.size(), BUDGET * 1.1);
  EXPECT_GT(json::parse(text)["frames"].size(), 50u);
}

TEST(PlayerData, AMeshThatChangesEveryFrameStaysWithinTheBudget) {
  Falling run;
  constexpr std::size_t BUDGET = 30'000;
  PlayerData player(BUDGET);
  for (std::size_t i = 0; i < 1000; ++i) {
    run.topology = share(Topology::grid(2, 2 + i % 300));
    Outcome o = run.next();
    auto step = std::make_shared<Step>(*o.step);
    step->bodies[0].t0 = step->bodies[0].t1 = share(heldAt(0, run.topology->vertexCount()));
    o.step = step;
    player.add(o, run.bodies, 0, false);
  }
  const std::string text = player.json();
  EXPECT_LT(text.size(), BUDGET * 1.5);
  EXPECT_GE(json::parse(text)["frames"].size(), 2u);
}

TEST(PlayerData, OnlyVoxelsNearTheBodiesAreTaken) {
  Falling run;
  PlayerData player;
  Outcome o = run.next();
  std::vector<OccupiedLeaf> leaves;
  for (const std::uint16_t x : {32768, 32770, 33768}) leaves.push_back({{x, 32768, 32768}, 1});
  o.obstacle = VoxelSurface::build(0.05, leaves);
  player.add(o, run.bodies, 0, false);
  const json maps = json::parse(player.json())["maps"];
  ASSERT_EQ(maps.size(), 1u);
  EXPECT_EQ(maps[0]["leaves"].size(), 8u) << "the third is 50 m away";
  Outcome same = run.next();
  same.obstacle = o.obstacle;
  player.add(same, run.bodies, 0, false);
  EXPECT_EQ(json::parse(player.json())["maps"].size(), 1u) << "the same map, the same place";
}

TEST(PlayerData, OwnVoxelsAndThoseInDoubtAreOfTheirMap) {
  Falling run;
  PlayerData player;
  const auto add = [&](std::vector<OccupiedLeaf> leaves, std::vector<OwnVoxel> own) {
    Outcome o = run.next();
    auto step = std::make_shared<Step>(*o.step);
    for (const OwnVoxel& voxel : own) ++(voxel.doubted ? step->map.own.doubted : step->map.own.own);
    step->map.own.voxels = share(std::move(own));
    o.step = step;
    o.obstacle = VoxelSurface::build(0.05, std::move(leaves));
    player.add(o, run.bodies, 0, false);
  };
  add({{{32770, 32768, 32768}, 1}},
      {{{32768, 32769, 32767}, 0, false}, {{32769, 32768, 32767}, 0, true}, {{40000, 0, 0}, 0, true}});
  add({}, {{{32768, 32769, 32767}, 0, false}});
  add({}, {});
  const json maps = json::parse(player.json())["maps"];
  ASSERT_EQ(maps.size(), 3u) << "also where nothing is left as an obstacle";
  EXPECT_EQ(maps[0]["own"], json({32768, 32769, 32767, 1}));
  EXPECT_EQ(maps[0]["doubted"], json({32769, 32768, 32767, 1})) << "the other one is far away";
  EXPECT_EQ(maps[1]["own"], maps[0]["own"]);
  for (const char* name : {"own", "doubted"}) EXPECT_FALSE(maps[2].contains(name));
}

TEST(ReportPage, TenMinutesOfAClothOf600VerticesFitIn25Megabytes) {
  constexpr std::size_t ROWS = 20, COLUMNS = 30, STEPS = 18000;
  const std::string folder = ::testing::TempDir() + "ten_minutes";
  std::vector<Body> bodies(1);
  bodies[0].name = "cloth";
  const auto topology = share(Topology::grid(ROWS, COLUMNS));
  const auto cloth = [&](std::uint64_t step) {  // waves of 5 cm run over it, faster than 1 m/s
    Positions positions;
    for (std::size_t r = 0; r < ROWS; ++r) {
      for (std::size_t c = 0; c < COLUMNS; ++c) {
        const double x = 0.04 * static_cast<double>(c), y = 0.04 * static_cast<double>(r);
        const double phase = 9 * x + 5 * y + 0.37 * static_cast<double>(step);
        positions.emplace_back(x + 0.01 * std::cos(phase), y, 0.05 * std::sin(phase));
      }
    }
    return share(positions);
  };
  Report report(folder);
  auto before = cloth(0);
  for (std::uint64_t i = 1; i <= STEPS; ++i) {
    Outcome o;
    o.answered = true;
    o.status = StepStatus::OK;
    o.sequence = i;
    o.start_ns = static_cast<StampNs>(i - 1) * 33'333'333;
    o.stamp_ns = o.start_ns + 33'333'333;
    auto step = std::make_shared<Step>();
    step->bodies = bodies;
    step->bodies[0].topology = topology;
    step->bodies[0].t0 = before;
    step->bodies[0].t1 = before = cloth(i);
    o.step = step;
    for (Index c = 0; i % 3 == 0 && c < 10; ++c) {
      Contact contact;
      contact.vertex = {c, 40 + c, 41 + c, 70 + c};
      contact.toc_lower = 0.1 + 1e-9 * static_cast<double>(i);
      contact.toc_upper = contact.toc_lower + 2.3283064365386963e-10;
      o.contacts.push_back(contact);
    }
    o.total_contacts = o.counts.certain = o.contacts.size();
    if (i % 30 == 0) o.patch_events.resize(1);
    report.add(o, bodies);
  }
  report.finish();
  const auto page = std::filesystem::file_size(folder + "/report.html");
  EXPECT_LT(page, 25'000'000u);
  EXPECT_GT(page, 8'000'000u) << "the player's frames are in it";
  if (!std::getenv("DEFORMABLE_CCD_KEEP")) std::filesystem::remove_all(folder);
}

Patch touching(std::uint64_t id, bool is_new, double toc, std::size_t expected = 0) {
  Patch p;
  p.id = id;
  p.body = {0, 0};
  p.contacts = 2;
  p.expected = expected;
  p.is_new = is_new;
  p.toc_lower = toc;
  return p;
}

TEST(ContactLanes, ABarFromTheFirstTouchToTheLastStepAndANewOneAfterABreak) {
  Falling run;
  ContactLanes lanes;
  for (int i = 0; i < 6; ++i) {
    Outcome o = run.next();
    if (i == 1) o.patches = {touching(5, true, 0.5)};
    if (i == 2) o.patches = {touching(5, false, 0)};
    if (i == 4) o.patches = {touching(5, false, 0), touching(6, false, 0, 2)};
    lanes.add(o, run.bodies, 0);
  }
  const json lane = lanes.json().at(0);
  EXPECT_EQ(lane["names"], json({"square", "square"}));
  ASSERT_EQ(lane["bars"].size(), 3u);
  EXPECT_EQ(lane["bars"][0][0], 5);
  EXPECT_NEAR(lane["bars"][0][1].get<double>(), 0.15, 1e-12);
  EXPECT_NEAR(lane["bars"][0][2].get<double>(), 0.3, 1e-12);
  EXPECT_NEAR(lane["bars"][1][1].get<double>(), 0.4, 1e-12) << "in the step between it did not touch";
  EXPECT_FALSE(lane["bars"][1][3].get<bool>());
  EXPECT_TRUE(lane["bars"][2][3].get<bool>());
  EXPECT_TRUE(lane["first"].is_null());
}

TEST(ContactLanes, TheFirstNewContactOfAPairInWordsAndToTheNanosecond) {
  Falling run;
  ContactLanes lanes;
  const StampNs epoch_ns = 1'700'000'000'123'456'789;
  Contact c;
  c.vertex = {0, 1, 2, 3};
  Outcome o = run.next();
  o.start_ns += epoch_ns;
  o.stamp_ns += epoch_ns;
  for (const double toc : {0.0, 0.125, 0.25}) {
    c.initial = toc == 0;
    c.expected = toc == 0.125;
    c.toc_lower = toc;
    o.contacts.push_back(c);
  }
  lanes.add(o, run.bodies, epoch_ns);
  EXPECT_TRUE(lanes.addedFirst());
  const json first = lanes.json().at(0)["first"];
  EXPECT_EQ(first["text"], "square meets square (vertex against face, vertices 0 1 2 3, certain)");
  EXPECT_EQ(first["stamp"], "1700000000.148456789");
  EXPECT_NEAR(first["t"].get<double>(), 0.025, 1e-9);
  lanes.add(o, run.bodies, epoch_ns);
  EXPECT_FALSE(lanes.addedFirst());
}

}  // namespace
}  // namespace dccd
