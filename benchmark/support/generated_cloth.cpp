// Generated scenes with cloth: position-based dynamics in small steps, one pass over the constraints each. The cloth
// rests on its obstacle and its vertices push each other apart, which keeps most folds from sinking into each other.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>

#include "support/generated_scene.h"
#include "support/generated_shapes.h"

namespace dccd {
namespace test {
namespace {

/// What the cloth falls onto.
struct Obstacle {
  /// Signed distance [m] of a point, and the outward direction.
  std::function<double(const Vec3& point, Vec3& outward)> distance;
  /// Velocity of the obstacle's surface at a point and time [m/s].
  std::function<Vec3(const Vec3& point, double time_s)> velocity;
};

struct Stretch {
  Index a, b;
  double rest_m;
  double stiffness;
};

/// Vertices by cells of a grid, so that near ones are found: rebuilt in linear time.
class NearVertices {
 public:
  NearVertices(std::size_t count, double cell_m) : next_(count), heads_(TABLE), cell_m_(cell_m) {}

  void rebuild(const Positions& positions) {
    std::fill(heads_.begin(), heads_.end(), NO_INDEX);
    for (std::size_t i = 0; i < positions.size(); ++i) {
      Index& head = heads_[slot(cell(positions[i]))];
      next_[i] = head;
      head = static_cast<Index>(i);
    }
  }

  /// visit(j) for every j < i that may lie within one cell of vertex i; others, too, where cells share a slot.
  template <class Visit>
  void forEachBefore(Index i, const Vec3& position, const Visit& visit) const {
    const std::array<std::int64_t, 3> c = cell(position);
    for (std::int64_t dx = -1; dx <= 1; ++dx) {
      for (std::int64_t dy = -1; dy <= 1; ++dy) {
        for (std::int64_t dz = -1; dz <= 1; ++dz) {
          Index j = heads_[slot({c[0] + dx, c[1] + dy, c[2] + dz})];
          for (; j != NO_INDEX; j = next_[j]) {
            if (j < i) visit(j);
          }
        }
      }
    }
  }

 private:
  static constexpr std::size_t TABLE = std::size_t{1} << 18;
  std::array<std::int64_t, 3> cell(const Vec3& p) const {
    return {static_cast<std::int64_t>(std::floor(p.x() / cell_m_)),
            static_cast<std::int64_t>(std::floor(p.y() / cell_m_)),
            static_cast<std::int64_t>(std::floor(p.z() / cell_m_))};
  }
  static std::size_t slot(const std::array<std::int64_t, 3>& c) {
    const std::uint64_t h = static_cast<std::uint64_t>(c[0]) * 73856093u ^
                            static_cast<std::uint64_t>(c[1]) * 19349663u ^ static_cast<std::uint64_t>(c[2]) * 83492791u;
    return static_cast<std::size_t>(h % TABLE);
  }
  std::vector<Index> next_, heads_;
  double cell_m_;
};

/// A square sheet under gravity.
class Cloth {
 public:
  Cloth(const TriangleShape& shape, double height_m, std::uint64_t seed)
      : position_(shape.vertices),
        thickness_m_(0.7 * (shape.vertices[1] - shape.vertices[0]).norm()),
        columns_(static_cast<Index>(std::lround(std::sqrt(static_cast<double>(shape.vertices.size()))))),
        near_(shape.vertices.size(), thickness_m_) {
    std::mt19937_64 random(seed);
    // A little unevenness, without which a perfect sheet folds like paper.
    std::uniform_real_distribution<double> rough(-1.0, 1.0);
    const std::size_t n = columns_;
    for (Vec3& p : position_) p += Vec3(0, 0, height_m + 0.07 * thickness_m_ * rough(random));
    velocity_.assign(position_.size(), Vec3::Zero());
    const auto connect = [&](std::size_t r, std::size_t c, std::size_t r2, std::size_t c2, double stiffness) {
      if (r2 >= n || c2 >= n) return;
      const Index a = static_cast<Index>(r * n + c), b = static_cast<Index>(r2 * n + c2);
      stretches_.push_back({a, b, (shape.vertices[a] - shape.vertices[b]).norm(), stiffness});
    };
    for (std::size_t r = 0; r < n; ++r) {
      for (std::size_t c = 0; c < n; ++c) {
        connect(r, c, r, c + 1, 1.0);
        connect(r, c, r + 1, c, 1.0);
        connect(r, c, r + 1, c + 1, 0.5);
        if (c > 0) connect(r, c, r + 1, c - 1, 0.5);
        connect(r, c, r, c + 2, 0.02);  // bending
        connect(r, c, r + 2, c, 0.02);
      }
    }
  }

  const Positions& positions() const { return position_; }

  /// repel: also push vertices of different folds apart.
  void step(const Obstacle& obstacle, double time_s, double dt_s, bool repel) {
    // Air drag of a light fabric: it falls at 0.8 m/s.
    constexpr double DAMPING_PER_S = 12, FRICTION = 0.7, GAP_M = 0.002;
    previous_ = position_;
    for (std::size_t i = 0; i < position_.size(); ++i) {
      velocity_[i] *= 1 - DAMPING_PER_S * dt_s;
      velocity_[i].z() -= 9.81 * dt_s;
      position_[i] += velocity_[i] * dt_s;
    }
    for (const Stretch& s : stretches_) {
      const Vec3 d = position_[s.b] - position_[s.a];
      const double length = d.norm();
      if (length == 0) continue;
      const Vec3 move = d * (0.5 * s.stiffness * (length - s.rest_m) / length);
      position_[s.a] += move;
      position_[s.b] -= move;
    }
    if (repel) repelFolds();
    for (std::size_t i = 0; i < position_.size(); ++i) {
      Vec3 outward;
      const double distance = obstacle.distance(position_[i], outward);
      if (distance < GAP_M) {
        position_[i] += (GAP_M - distance) * outward;
        const Vec3 slip = position_[i] - previous_[i] - obstacle.velocity(position_[i], time_s) * dt_s;
        position_[i] -= FRICTION * (slip - slip.dot(outward) * outward);
      }
      velocity_[i] = (position_[i] - previous_[i]) / dt_s;
    }
  }

 private:
  void repelFolds() {
    near_.rebuild(position_);
    for (Index i = 0; i < position_.size(); ++i) {
      near_.forEachBefore(i, position_[i], [&](Index j) {
        const Vec3 d = position_[i] - position_[j];
        const double distance = d.norm();
        if (distance >= thickness_m_ || distance == 0) return;
        const auto apart = [](Index a, Index b) { return a > b ? a - b : b - a; };
        if (apart(i / columns_, j / columns_) <= 2 && apart(i % columns_, j % columns_) <= 2) return;
        const Vec3 move = d * (0.5 * (thickness_m_ - distance) / distance);
        position_[i] += move;  // and the previous position, too, so that no speed comes of it
        previous_[i] += move;
        position_[j] -= move;
        previous_[j] -= move;
      });
    }
  }

  Positions position_, previous_;
  double thickness_m_;
  Index columns_;
  NearVertices near_;
  std::vector<Vec3> velocity_;
  std::vector<Stretch> stretches_;
};

constexpr double FRAME_S = 1.0 / 24;
constexpr int STEPS_PER_FRAME = 16;
constexpr int STEPS_PER_REPULSION = 2;

std::size_t sheetCells(std::size_t triangles) {
  return std::max<std::size_t>(2, static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(triangles) / 2))));
}

class ClothOnObstacle : public GeneratedSequence {
 protected:
  ClothOnObstacle(std::size_t frames, const TriangleShape& sheet_shape, double height_m, std::uint64_t seed,
                  const TriangleShape& obstacle_shape, const std::string& obstacle_name)
      : GeneratedSequence(frames), cloth_(sheet_shape, height_m, seed), obstacle_vertices_(obstacle_shape.vertices) {
    addBody("cloth", sheet_shape.vertices.size(), sheet_shape.faces, true);
    addBody(obstacle_name, obstacle_shape.vertices.size(), obstacle_shape.faces, false);
  }

  void compute(std::size_t frame) override {
    for (int s = 0; s < STEPS_PER_FRAME; ++s) {
      const double time_s = (static_cast<double>(frame) - 1 + static_cast<double>(s) / STEPS_PER_FRAME) * FRAME_S;
      cloth_.step(obstacle_, time_s, FRAME_S / STEPS_PER_FRAME, s % STEPS_PER_REPULSION == 0);
    }
    publish(obstacleRotation(static_cast<double>(frame) * FRAME_S));
  }

  virtual Eigen::Matrix3d obstacleRotation(double) const { return Eigen::Matrix3d::Identity(); }

  void publish(const Eigen::Matrix3d& rotation) {
    positions_ = cloth_.positions();
    for (const Vec3& v : obstacle_vertices_) positions_.push_back(rotation * v);
  }

  Obstacle obstacle_;

 private:
  Cloth cloth_;
  Positions obstacle_vertices_;
};

class ClothBall : public ClothOnObstacle {
 public:
  ClothBall(const GeneratedOptions& options, std::size_t sheet_triangles, std::size_t ball_cells)
      : ClothOnObstacle(94, sheet(sheetCells(sheet_triangles), 2.4), 0.52, options.seed, ball(ball_cells), "ball") {
    obstacle_.distance = [](const Vec3& p, Vec3& outward) {
      const double length = p.norm();
      outward = length > 0 ? Vec3(p / length) : Vec3::UnitZ();
      return length - RADIUS_M;
    };
    obstacle_.velocity = [](const Vec3& p, double time_s) -> Vec3 { return Vec3(0, 0, angularSpeed(time_s)).cross(p); };
    publish(Eigen::Matrix3d::Identity());
  }

 private:
  static constexpr double RADIUS_M = 0.5, START_S = 1.2, SPEED_RAD_PER_S = 1.2;
  static double angularSpeed(double time_s) { return time_s > START_S ? SPEED_RAD_PER_S : 0.0; }
  static TriangleShape ball(std::size_t cells) {
    TriangleShape s = cubeSphere(cells);
    for (Vec3& v : s.vertices) v *= RADIUS_M;
    return s;
  }
  Eigen::Matrix3d obstacleRotation(double time_s) const override {
    const double angle = SPEED_RAD_PER_S * std::max(0.0, time_s - START_S);
    return Eigen::AngleAxisd(angle, Vec3::UnitZ()).toRotationMatrix();
  }
};

class ClothBone : public ClothOnObstacle {
 public:
  ClothBone(const GeneratedOptions& options, std::size_t sheet_triangles, std::size_t rings, std::size_t segments)
      : ClothOnObstacle(90, sheet(sheetCells(sheet_triangles), 2.4), 0.45, options.seed,
                        revolution(rings, segments, HALF_LENGTH_M, radius), "bone") {
    // The distance along the radius: right where the profile is flat, a little too large on the knobs' slopes.
    obstacle_.distance = [](const Vec3& p, Vec3& outward) {
      const double from_axis = std::hypot(p.y(), p.z());
      outward = from_axis > 0 ? Vec3(0, p.y() / from_axis, p.z() / from_axis) : Vec3::UnitZ();
      return std::abs(p.x()) < HALF_LENGTH_M ? from_axis - radius(p.x()) : 1.0;
    };
    obstacle_.velocity = [](const Vec3&, double) -> Vec3 { return Vec3::Zero(); };
    publish(Eigen::Matrix3d::Identity());
  }

 private:
  static constexpr double HALF_LENGTH_M = 0.8;
  /// A shaft with a knob at each end, closed at both.
  static double radius(double x) {
    const double s = std::abs(x) / HALF_LENGTH_M;
    const double knob = std::exp(-30 * (s - 0.78) * (s - 0.78));
    return (0.13 + 0.2 * knob) * std::sqrt(std::max(0.0, 1 - s * s * s * s * s * s));
  }
};

}  // namespace

std::unique_ptr<GeneratedSequence> generateClothBall(const GeneratedOptions& options) {
  // 86K in the sheet and 6K in the ball, or in that proportion.
  const double total = options.triangles ? static_cast<double>(options.triangles) : 92000.0;
  const std::size_t ball_cells = static_cast<std::size_t>(std::lround(std::sqrt(total * 6 / 92 / 12)));
  return std::make_unique<ClothBall>(options, static_cast<std::size_t>(total * 86 / 92),
                                     std::max<std::size_t>(2, ball_cells));
}

std::unique_ptr<GeneratedSequence> generateClothBone(const GeneratedOptions& options) {
  const double total = options.triangles ? static_cast<double>(options.triangles) : 155000.0;
  const std::size_t segments =
      std::max<std::size_t>(6, static_cast<std::size_t>(std::lround(std::sqrt(total * 47 / 155 / 2 / 1.6))));
  const std::size_t rings = std::max<std::size_t>(6, static_cast<std::size_t>(1.6 * static_cast<double>(segments)));
  return std::make_unique<ClothBone>(options, static_cast<std::size_t>(total * 108 / 155), rings, segments);
}

}  // namespace test
}  // namespace dccd
