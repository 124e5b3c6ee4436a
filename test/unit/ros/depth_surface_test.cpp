// A depth camera's cloud as a surface, against scenes that can be had by hand.
#include "input/depth_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>

namespace dccd {
namespace {

constexpr float NOT_A_NUMBER = std::numeric_limits<float>::quiet_NaN();

/// Pixels 0.1 m apart, x along the columns, y along the rows, at depth 1 m; points of 32 bytes, xyz and a colour, rows
/// of eight bytes more.
struct Image {
  std::size_t rows, cols;
  std::vector<std::uint8_t> bytes;

  Image(std::size_t r, std::size_t c) : rows(r), cols(c), bytes(rows * rowStep()) {
    for (std::size_t i = 0; i < rows; ++i) {
      for (std::size_t j = 0; j < cols; ++j) set(i, j, 1.0f);
    }
  }
  std::size_t rowStep() const { return 32 * cols + 8; }
  void set(std::size_t row, std::size_t col, float z) {
    const float p[3] = {0.1f * static_cast<float>(col), 0.1f * static_cast<float>(row), z};
    std::memcpy(bytes.data() + row * rowStep() + 32 * col, p, sizeof p);
  }
  CloudView view() const {
    CloudView cloud;
    cloud.height = rows;
    cloud.width = cols;
    cloud.point_step = 32;
    cloud.row_step = rowStep();
    cloud.data = bytes.data();
    cloud.xyz = {{{0, false}, {4, false}, {8, false}}};
    return cloud;
  }
};

DepthSurfaceOptions options(double max_edge_m, std::size_t stride = 1) {
  DepthSurfaceOptions out;
  out.max_edge_m = max_edge_m;
  out.stride = stride;
  return out;
}

/// The area of the faces' shadows on the image plane, in squares of four pixels.
double squares(const DepthSurface& surface) {
  double area = 0;
  for (const Face& f : surface.faces) {
    const Vec3 a = surface.positions[f[1]] - surface.positions[f[0]],
               b = surface.positions[f[2]] - surface.positions[f[0]];
    area += 0.5 * std::abs(a.x() * b.y() - a.y() * b.x());
  }
  return area / 0.01;
}

TEST(DepthSurface, APlaneIsTwoTrianglesASquare) {
  const DepthSurface surface = depthSurface(Image(4, 5).view(), options(0.15));
  EXPECT_EQ(surface.positions.size(), 20u);
  EXPECT_EQ(surface.faces.size(), 24u);
  EXPECT_NEAR(squares(surface), 12, 1e-4);
  for (const Vec3& p : surface.positions) EXPECT_EQ(p.z(), 1.0) << "the camera's own bits";
}

// 12 x 12 zeros made 529 contacts at the camera's place.
TEST(DepthSurface, PixelsAtTheOriginAreNoMeasurement) {
  Image image(12, 12);
  for (std::size_t row = 2; row < 6; ++row) {
    for (std::size_t col = 2; col < 6; ++col) {
      std::memset(image.bytes.data() + row * image.rowStep() + 32 * col, 0, 12);
    }
  }
  const DepthSurface surface = depthSurface(image.view(), options(0.15));
  EXPECT_EQ(surface.no_measurement, 16u);
  EXPECT_EQ(surface.positions.size(), 144u - 16);
  for (const Vec3& p : surface.positions) EXPECT_EQ(p.z(), 1.0);
  std::fill(image.bytes.begin(), image.bytes.end(), 0);
  EXPECT_THROW(depthSurface(image.view(), options(0.15)), DepthSurfaceError) << "it sees nothing";
}

TEST(DepthSurface, NoTriangleSpansAStepThatIsDeeperThanTheLongestEdge) {
  // Columns 0 to 2 at 1 m, columns 3 to 5 at 1.3 m: across the step edges are 0.316 m long, diagonals 0.332 m.
  Image image(4, 6);
  for (std::size_t row = 0; row < 4; ++row) {
    for (std::size_t col = 3; col < 6; ++col) image.set(row, col, 1.3f);
  }
  const DepthSurface apart = depthSurface(image.view(), options(0.2));
  EXPECT_EQ(apart.faces.size(), 24u) << "two planes of 3 x 2 squares";
  for (const Face& f : apart.faces) {
    EXPECT_EQ(apart.positions[f[0]].z(), apart.positions[f[1]].z());
    EXPECT_EQ(apart.positions[f[0]].z(), apart.positions[f[2]].z());
  }
  EXPECT_EQ(depthSurface(image.view(), options(0.34)).faces.size(), 30u) << "with longer edges it is one";
}

TEST(DepthSurface, LostPixelsAreHoles) {
  Image image(5, 5);
  image.set(2, 2, NOT_A_NUMBER);
  const DepthSurface surface = depthSurface(image.view(), options(0.15));
  EXPECT_EQ(surface.positions.size(), 24u);
  // The four squares about the pixel keep one half each, that of their three other corners.
  EXPECT_EQ(surface.faces.size(), 2u * 12 + 4);
  EXPECT_NEAR(squares(surface), 12 + 4 * 0.5, 1e-4);
  image.set(2, 2, std::numeric_limits<float>::infinity());
  EXPECT_EQ(depthSurface(image.view(), options(0.15)).faces.size(), surface.faces.size());
}

TEST(DepthSurface, PixelsOutOfRangeAreLost) {
  Image image(3, 6);
  for (std::size_t row = 0; row < 3; ++row) image.set(row, 5, 4.5f);
  DepthSurfaceOptions near = options(10);
  EXPECT_EQ(depthSurface(image.view(), near).positions.size(), 18u);
  near.max_range_m = 4;
  EXPECT_EQ(depthSurface(image.view(), near).positions.size(), 15u);
  near.max_range_m = 0.5;
  EXPECT_THROW(depthSurface(image.view(), near), DepthSurfaceError);
}

TEST(DepthSurface, EveryOtherPixelOfEveryOtherRow) {
  Image image(5, 6);
  image.set(1, 1, NOT_A_NUMBER);  // one that is left out anyway
  EXPECT_EQ(keptPixels(image.view(), 2), 9u);
  const DepthSurface surface = depthSurface(image.view(), options(0.3, 2));
  EXPECT_EQ(surface.faces.size(), 8u);
  const std::set<std::uint32_t> pixels(surface.pixel.begin(), surface.pixel.end());
  EXPECT_EQ(pixels, (std::set<std::uint32_t>{0, 2, 4, 12, 14, 16, 24, 26, 28}));
  for (std::size_t v = 0; v < surface.positions.size(); ++v) {
    EXPECT_EQ(surface.positions[v], image.view().point(surface.pixel[v]));
  }
}

TEST(DepthSurface, AMedianTakesOneWrongPixelOut) {
  Image image(5, 5);
  image.set(2, 2, 1.08f);
  DepthSurfaceOptions filtered = options(0.2);
  const auto deepest = [&] {
    double z = 0;
    for (const Vec3& p : depthSurface(image.view(), filtered).positions) z = std::max(z, p.z());
    return z;
  };
  EXPECT_NEAR(deepest(), 1.08, 1e-6);
  filtered.median = 3;
  EXPECT_EQ(deepest(), 1.0);
}

TEST(DepthSurface, VerticesWithoutAFaceAreNoVertices) {
  Image image(3, 3);
  image.set(0, 0, 3.0f);  // further from each neighbour than an edge may be
  const DepthSurface surface = depthSurface(image.view(), options(0.15));
  EXPECT_EQ(surface.positions.size(), 8u);
  EXPECT_EQ(std::count(surface.pixel.begin(), surface.pixel.end(), 0u), 0);
}

TEST(DepthSurface, ACameraThatSeesNothingIsNoSurface) {
  Image blind(4, 4);
  for (std::size_t i = 0; i < 16; ++i) blind.set(i / 4, i % 4, NOT_A_NUMBER);
  EXPECT_THROW(depthSurface(blind.view(), options(0.15)), DepthSurfaceError);
  EXPECT_THROW(depthSurface(Image(4, 4).view(), options(0.15, 4)), DepthSurfaceError) << "one pixel is left";
  EXPECT_THROW(depthSurface(Image(4, 4).view(), options(0.05)), DepthSurfaceError) << "no edge is that short";
}

}  // namespace
}  // namespace dccd
