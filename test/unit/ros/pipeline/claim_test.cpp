// What has to be answered of a step in a cell: nobody is taken to have answered, and an ordinary step has all answers.
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "dccd/assurance.h"
#include "unit/ros/pipeline/driven_pipeline.h"
#include "unit/ros/robot/robot_texts.h"

namespace dccd {
namespace test {
namespace {

/// A stream, a static body, one of tf, and a map; nothing touches.
struct Cell : Driven {
  Cell() : Driven(tree()) {
    giveMap(1);
    tell({above("tip", 3, ros::Time(1)), above("tip", 3, ros::Time(2))});
    take(1, cloudAt(ros::Time(1), 2));
  }
  static XmlRpcValue tree() {
    const std::string file = ::testing::TempDir() + "tip_of_a_cell.obj";
    std::ofstream(file) << "v 0.2 0.2 0\nv 0.21 0.2 0.05\nv 0.2 0.21 0.05\nf 1 2 3\n";
    return scene(
        "clock_body: cloth, bodies: {cloth: {topic: cloth}, shelf: {topic: shelf, motion: static}, "
        "tip: {rigid: {frame: tip, mesh: " +
        file + "}}}");
  }
};

TEST(CellsClaim, OfAnOrdinaryStepHolds) {
  Cell cell;
  cell.feed(1, 1);
  cell.feed(1.1, 1);
  EXPECT_TRUE(cell.outcome.claim.holds());
  EXPECT_TRUE(assuranceOf(cell.outcome).clear()) << joinedText(cell.outcome.missing());
  const Outcome asked = cell.pipeline.checkNow(0);
  EXPECT_TRUE(assuranceOf(asked).clear()) << joinedText(asked.missing());
}

TEST(CellsClaim, NothingIsProvedUntilSomebodyAnswersForWhatCame) {
  Cell cell;
  cell.feed(1, 1);
  cell.feed(1.1, 1);
  // Who asks the monitor without the pipeline has answered nothing.
  const Outcome asked = cell.pipeline.monitor().checkNow();
  EXPECT_TRUE(asked.answered);
  EXPECT_FALSE(assuranceOf(asked).proved);
  const std::vector<std::string> missing = asked.missing();
  for (const char* words : {"who sends 'cloth'", "who sends 'shelf'", "who sends 'tip'", "clock 'cloth' is stamped",
                            "whether vertices of 'cloth'", "clock the map is stamped", "where the map was at its stamp",
                            "whether a newer map came", "whether all of tf came", "by whose clocks tf is stamped",
                            "whether frames still come", "whether the fixed frame is at rest",
                            "whether it began after the last call", "whether all of the robot is watched"}) {
    EXPECT_TRUE(says(missing, words)) << words;
  }
  EXPECT_EQ(missing.size(), 3u * 3 + 3 + 6);
  for (const std::string& sentence : missing) EXPECT_EQ(sentence.rfind("nobody looked ", 0), 0u) << sentence;
}

}  // namespace
}  // namespace test
}  // namespace dccd
