// Which pixels fly along an edge, and what must not be taken for one.
#include "octomap/flying_pixels.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace dccd {
namespace {

constexpr std::size_t PIXELS_A_ROW = 7, PIXEL_ROWS = 5, MIDDLE = 2 * PIXELS_A_ROW + 3;
constexpr double APART_M = 0.25;
constexpr float LOST = std::numeric_limits<float>::quiet_NaN(), NO_RETURN = std::numeric_limits<float>::infinity();

/// In the three columns to the left something is 1 m away, behind it 2 m.
std::vector<float> edge() {
  std::vector<float> depths;
  for (std::size_t i = 0; i < PIXELS_A_ROW * PIXEL_ROWS; ++i) depths.push_back(i % PIXELS_A_ROW < 3 ? 1 : 2);
  return depths;
}

std::vector<std::size_t> leftOut(const std::vector<float>& depths) {
  std::vector<float> points, left = depths;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    const float x = 0.1f * static_cast<float>(i % PIXELS_A_ROW), y = 0.1f * static_cast<float>(i / PIXELS_A_ROW);
    const float scale = depths[i] / std::sqrt(x * x + y * y + 1);
    for (const float axis : {x, y, 1.0f}) points.push_back(axis * scale);
  }
  leaveOutFlying(left, PIXELS_A_ROW, 1, APART_M);
  leaveOutFlying(points, PIXELS_A_ROW, 3, APART_M + 1e-6);
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    const bool is_out = std::isnan(left[i]) && !std::isnan(depths[i]);
    EXPECT_EQ(std::isnan(points[3 * i + 2]), std::isnan(left[i])) << i;
    if (is_out) found.push_back(i);
  }
  return found;
}

std::vector<std::size_t> leftOutWith(float depth, std::size_t at = MIDDLE) {
  std::vector<float> depths = edge();
  depths[at] = depth;
  return leftOut(depths);
}

TEST(FlyingPixels, OneBetweenWhatIsInFrontAndWhatIsBehindIsLeftOut) {
  const std::vector<std::size_t> here{MIDDLE}, none;
  EXPECT_EQ(leftOut(edge()), none);
  EXPECT_EQ(leftOutWith(1.5f), here);
  EXPECT_EQ(leftOutWith(1.5f, MIDDLE - 1), std::vector<std::size_t>{MIDDLE - 1});
  EXPECT_EQ(leftOutWith(0.5f), none) << "nearer than all around it: a thing of its own";
  EXPECT_EQ(leftOutWith(3), none);
  EXPECT_EQ(leftOutWith(1.5f, 3), none) << "in the first row nobody knows what is above";
  EXPECT_EQ(leftOutWith(1.5f, 2 * PIXELS_A_ROW), none) << "in the first column, what is beside it";
}

TEST(FlyingPixels, OneAsNearAsANeighbourStays) {
  std::vector<float> depths = edge();
  depths[MIDDLE] = 1.25f;
  leaveOutFlying(depths, PIXELS_A_ROW, 1, APART_M);
  EXPECT_EQ(depths[MIDDLE], 1.25f);
  depths[MIDDLE] = std::nextafter(1.25f, 2.0f);
  leaveOutFlying(depths, PIXELS_A_ROW, 1, APART_M);
  EXPECT_TRUE(std::isnan(depths[MIDDLE]));
}

// However thin it is, and however it lies along an edge.
TEST(FlyingPixels, AWireStays) {
  for (const std::size_t way : {PIXELS_A_ROW, PIXELS_A_ROW + 1, PIXELS_A_ROW - 1, std::size_t{1}}) {
    std::vector<float> depths = edge();
    depths[MIDDLE] = depths[MIDDLE + way] = depths[MIDDLE - way] = 1.5f;
    EXPECT_TRUE(leftOut(depths).empty()) << way;
  }
}

TEST(FlyingPixels, OneBesideWhatSaysNothingStays) {
  for (const float nothing : {LOST, NO_RETURN, 0.0f}) {
    for (const bool is_near_side : {false, true}) {
      std::vector<float> depths = edge();
      depths[MIDDLE] = 1.5f;
      for (const std::size_t row : {1, 2, 3}) depths[row * PIXELS_A_ROW + (is_near_side ? 2 : 4)] = nothing;
      EXPECT_TRUE(leftOut(depths).empty()) << nothing;
    }
  }
}

}  // namespace
}  // namespace dccd
