#include "ros/support/live_tests.h"

#include <gtest/gtest.h>
#include <ros/ros.h>

namespace dccd {
namespace test {

int runLiveTests(int& argc, char** argv, const std::string& name) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, name);
  ros::NodeHandle node;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}

}  // namespace test
}  // namespace dccd
