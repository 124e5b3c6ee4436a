// Generated n-body scene: balls with a soft shell fall into a box, push each other away and wobble a little.
#include <cmath>
#include <random>

#include "support/generated_scene.h"
#include "support/generated_shapes.h"

namespace dccd {
namespace test {
namespace {

constexpr double FRAME_S = 1.0 / 24;
constexpr int STEPS_PER_FRAME = 20;
constexpr double RADIUS_M = 0.25;
constexpr std::size_t GROUND_CELLS = 26;

struct Ball {
  Vec3 centre, velocity, spin;  // [m], [m/s], [rad/s]
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Vec3 squeeze = Vec3::Zero();  // direction times share by which the ball is flattened
  double phase = 0;             // of its wobble [rad]
};

class NBody : public GeneratedSequence {
 public:
  NBody(const GeneratedOptions& options, std::size_t ball_count)
      : GeneratedSequence(96), shape_(cubeSphere(6)), half_box_m_(half(ball_count)) {
    std::mt19937_64 random(options.seed);
    std::uniform_real_distribution<double> unit(-1, 1);
    // Above the ground, shifted a little off a grid so that no two overlap at first, flying in all directions.
    const std::size_t per_side = static_cast<std::size_t>(half_box_m_ / (1.2 * RADIUS_M));
    for (std::size_t i = 0; i < ball_count; ++i) {
      Ball b;
      const std::size_t layer = i / (per_side * per_side), in_layer = i % (per_side * per_side);
      const double pitch = 2 * half_box_m_ / static_cast<double>(per_side);
      b.centre = Vec3((static_cast<double>(in_layer % per_side) + 0.5) * pitch - half_box_m_,
                      (static_cast<double>(in_layer / per_side) + 0.5) * pitch - half_box_m_,
                      0.5 + 2.4 * RADIUS_M * static_cast<double>(layer));
      b.centre += 0.08 * RADIUS_M * Vec3(unit(random), unit(random), unit(random));
      b.velocity = 10.0 * Vec3(unit(random), unit(random), 0.5 * unit(random));
      b.spin = 5.0 * Vec3(unit(random), unit(random), unit(random));
      b.phase = 3.2 * unit(random);
      balls_.push_back(b);
      addBody("ball_" + std::to_string(i), shape_.vertices.size(), shape_.faces, true);
    }
    const TriangleShape ground = sheet(GROUND_CELLS, 4 * half_box_m_);
    ground_ = ground.vertices;
    addBody("ground", ground.vertices.size(), ground.faces, false);
    publish(0);
  }

 private:
  static double half(std::size_t count) { return 0.62 * std::cbrt(static_cast<double>(count) * 8) * RADIUS_M; }

  /// A push on ball `a` at its point opposite to `outward`, which closes on what it touches at `closing` [m/s].
  static void push(Ball& a, const Vec3& outward, double depth_m, const Vec3& closing, double dt_s) {
    constexpr double STIFFNESS = 20000, DAMPING = 6, FRICTION = 0.1;  // per unit of mass
    const double speed = closing.dot(outward);
    const double force = std::max(0.0, STIFFNESS * depth_m - DAMPING * speed);
    const Vec3 slip = closing - speed * outward;
    const Vec3 friction = -FRICTION * force * slip / (0.1 + slip.norm());
    a.velocity += dt_s * (force * outward + friction);
    a.spin += dt_s * 2.5 / RADIUS_M * (-outward).cross(friction);  // a solid ball's inertia is 2/5 m r^2
    a.squeeze += outward * std::min(0.02, 0.05 * depth_m / RADIUS_M);
  }

  static Vec3 surfaceVelocity(const Ball& b, const Vec3& towards) {
    return b.velocity + b.spin.cross(RADIUS_M * towards);
  }

  void step(double dt_s) {
    for (Ball& b : balls_) b.squeeze *= 1 - 12 * dt_s;
    for (std::size_t i = 0; i < balls_.size(); ++i) {
      for (std::size_t j = i + 1; j < balls_.size(); ++j) {
        const Vec3 d = balls_[i].centre - balls_[j].centre;
        const double distance_sq = d.squaredNorm();
        if (distance_sq >= 4 * RADIUS_M * RADIUS_M || distance_sq == 0) continue;
        const double distance = std::sqrt(distance_sq);
        const Vec3 outward = d / distance;
        const Vec3 closing = surfaceVelocity(balls_[i], -outward) - surfaceVelocity(balls_[j], outward);
        push(balls_[i], outward, 2 * RADIUS_M - distance, closing, dt_s);
        push(balls_[j], -outward, 2 * RADIUS_M - distance, -closing, dt_s);
      }
    }
    for (Ball& b : balls_) {
      const auto wall = [&](const Vec3& outward, double depth_m) {
        if (depth_m > 0) push(b, outward, depth_m, surfaceVelocity(b, -outward), dt_s);
      };
      wall(Vec3::UnitZ(), RADIUS_M - b.centre.z());
      for (int k = 0; k < 2; ++k) {
        wall(-std::copysign(1.0, b.centre[k]) * Vec3::Unit(k), std::abs(b.centre[k]) + RADIUS_M - half_box_m_);
      }
      b.velocity.z() -= 9.81 * dt_s;
      b.centre += b.velocity * dt_s;
      const double angle = b.spin.norm() * dt_s;
      if (angle > 0) b.rotation = Eigen::AngleAxisd(angle, b.spin.normalized()) * b.rotation;
    }
  }

  void publish(double time_s) {
    positions_.clear();
    for (const Ball& b : balls_) {
      const Eigen::Matrix3d rotation = b.rotation.normalized().toRotationMatrix();
      const double wobble = 0.02 * std::sin(9 * time_s + b.phase);
      const double squeeze = std::min(0.15, b.squeeze.norm());
      const Vec3 along = b.squeeze.norm() > 0 ? Vec3(b.squeeze.normalized()) : Vec3::UnitZ();
      for (const Vec3& v : shape_.vertices) {
        // Flattened along the last pushes, and a standing wave of the shell.
        Vec3 p = RADIUS_M * (rotation * v) * (1 + wobble * (3 * v.z() * v.z() - 1));
        p -= squeeze * p.dot(along) * along;
        positions_.push_back(b.centre + p);
      }
    }
    positions_.insert(positions_.end(), ground_.begin(), ground_.end());
  }

  void compute(std::size_t frame) override {
    for (int s = 0; s < STEPS_PER_FRAME; ++s) step(FRAME_S / STEPS_PER_FRAME);
    publish(static_cast<double>(frame) * FRAME_S);
  }

  TriangleShape shape_;
  Positions ground_;
  double half_box_m_;
  std::vector<Ball> balls_;
};

}  // namespace

std::unique_ptr<GeneratedSequence> generateNBody(const GeneratedOptions& options) {
  const std::size_t triangles = options.triangles ? options.triangles : 146000;
  const std::size_t ground = 2 * GROUND_CELLS * GROUND_CELLS, per_ball = 12 * 6 * 6;
  const std::size_t rest = triangles > ground ? triangles - ground : 0;
  return std::make_unique<NBody>(options, std::max<std::size_t>(2, rest / per_ball));
}

}  // namespace test
}  // namespace dccd
