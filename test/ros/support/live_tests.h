// What each main of a live test does.
#pragma once

#include <string>

namespace dccd {
namespace test {

/// Runs the tests of this file as a ROS node of that name, whose callbacks come on two threads beside the tests'.
/// Returns the exit status. What has to be there while they run is a testing::Environment.
int runLiveTests(int& argc, char** argv, const std::string& name);

}  // namespace test
}  // namespace dccd
