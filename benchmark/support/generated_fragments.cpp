// Generated scenes that break: a body of several layers falls into pieces (Voronoi cells of seeded points), each of
// which flies and tumbles as a rigid body. Positions have a closed form. Lengths per step are in units of the
// triangles' edges, so that a scene of more triangles is the same kind of scene.
#include <cmath>
#include <random>

#include "support/generated_scene.h"
#include "support/generated_shapes.h"

namespace dccd {
namespace test {
namespace {

/// The radius of a lumpy body in a direction, between 0.6 and 1.4.
class Lumps {
 public:
  explicit Lumps(std::mt19937_64& random) {
    std::normal_distribution<double> normal;
    for (Vec3& axis : axes_) axis = Vec3(normal(random), normal(random), normal(random)).normalized();
  }
  double radius(const Vec3& direction) const {
    double r = 1;
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      const double order = 2.0 + static_cast<double>(i);
      r += 0.05 * std::cos(order * std::acos(std::max(-1.0, std::min(1.0, direction.dot(axes_[i])))));
    }
    return r;
  }

 private:
  std::array<Vec3, 8> axes_;
};

/// A connected lump of faces, moving as one.
struct Piece {
  Vec3 centroid = Vec3::Zero();
  Vec3 velocity = Vec3::Zero();  // [m per frame]
  Vec3 spin = Vec3::Zero();      // [rad per frame]
  double release = 0;            // [frames]
  std::size_t vertex_count = 0;
};

/// The nearest of the points, by trying all: pieces number in the hundreds, and faces are asked once.
std::size_t nearest(const Positions& points, const Vec3& x) {
  std::size_t best = 0;
  double best_sq = (points[0] - x).squaredNorm();
  for (std::size_t i = 1; i < points.size(); ++i) {
    const double d_sq = (points[i] - x).squaredNorm();
    if (d_sq < best_sq) {
      best_sq = d_sq;
      best = i;
    }
  }
  return best;
}

/// Layers of a lumpy body cut into pieces. Vertices on a cut are doubled, and every piece is drawn in by a hundredth
/// of an edge, so that neighbours do not start in exact contact.
class Fragments {
 public:
  Fragments(std::size_t cells, std::size_t layers, double edges_between_layers, std::size_t faces_per_piece,
            std::mt19937_64& random) {
    const Lumps lumps(random);
    const TriangleShape sphere = cubeSphere(cells);
    edge_m_ = 1.57 / static_cast<double>(cells);  // a quarter turn of the unit sphere
    std::normal_distribution<double> normal;
    for (std::size_t layer = 0; layer < layers; ++layer) {
      const double depth = edges_between_layers * edge_m_ * static_cast<double>(layer);
      Positions seeds(std::max<std::size_t>(1, sphere.faces.size() / faces_per_piece));
      for (Vec3& s : seeds) s = Vec3(normal(random), normal(random), normal(random)).normalized();
      cut(sphere, lumps, depth, seeds);
    }
  }

  const Positions& vertices() const { return vertices_; }
  const std::vector<Face>& faces() const { return faces_; }
  std::vector<Piece>& pieces() { return pieces_; }
  double edge() const { return edge_m_; }

  /// Appends all vertices at a time [frames].
  void append(double time, double gravity_m_per_frame_sq, Positions& out) const {
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      const Piece& p = pieces_[piece_of_[i]];
      const double t = std::max(0.0, time - p.release);
      const double angle = p.spin.norm() * t;
      Vec3 arm = vertices_[i] - p.centroid;
      if (angle > 0) arm = Eigen::AngleAxisd(angle, p.spin.normalized()) * arm;
      out.push_back(p.centroid + arm + p.velocity * t - Vec3(0, 0, 0.5 * gravity_m_per_frame_sq * t * t));
    }
  }

 private:
  void cut(const TriangleShape& sphere, const Lumps& lumps, double depth, const Positions& seeds) {
    std::vector<std::vector<Face>> faces_of(seeds.size());
    for (const Face& f : sphere.faces) {
      const Vec3 middle = (sphere.vertices[f[0]] + sphere.vertices[f[1]] + sphere.vertices[f[2]]) / 3;
      faces_of[nearest(seeds, middle)].push_back(f);
    }
    std::vector<Index> copy(sphere.vertices.size(), NO_INDEX);
    for (const std::vector<Face>& own : faces_of) {
      if (own.empty()) continue;
      Piece piece;
      const std::size_t first = vertices_.size();
      for (const Face& f : own) {
        Face copied;
        for (std::size_t k = 0; k < 3; ++k) {
          if (copy[f[k]] == NO_INDEX || copy[f[k]] < first) {
            copy[f[k]] = static_cast<Index>(vertices_.size());
            const Vec3& direction = sphere.vertices[f[k]];
            vertices_.push_back(direction * (lumps.radius(direction) - depth));
            piece_of_.push_back(static_cast<Index>(pieces_.size()));
            piece.centroid += vertices_.back();
          }
          copied[k] = copy[f[k]];
        }
        faces_.push_back(copied);
      }
      piece.vertex_count = vertices_.size() - first;
      piece.centroid /= static_cast<double>(piece.vertex_count);
      for (std::size_t i = first; i < vertices_.size(); ++i) {
        const Vec3 arm = vertices_[i] - piece.centroid;
        if (arm.norm() > 0) vertices_[i] -= 0.01 * edge_m_ * arm.normalized();
      }
      pieces_.push_back(piece);
    }
  }

  double edge_m_ = 0;
  Positions vertices_;
  std::vector<Face> faces_;
  std::vector<Index> piece_of_;
  std::vector<Piece> pieces_;
};

Vec3 randomVector(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random), y = normal(random), z = normal(random);
  return {x, y, z};
}

std::size_t cellsFor(double triangles, double layers) {
  return std::max<std::size_t>(3, static_cast<std::size_t>(std::lround(std::sqrt(triangles / (12 * layers)))));
}

/// A lumpy projectile flies along x through a lumpy body of two layers; each piece flies off when it is reached.
class Dragon : public GeneratedSequence {
 public:
  Dragon(const GeneratedOptions& options, double triangles)
      : GeneratedSequence(64),
        random_(options.seed),
        dragon_(cellsFor(triangles * 0.7, 2), 2, 2.0, 240, random_),
        bunny_(cellsFor(triangles * 0.3, 1), 1, 0, SIZE_MAX, random_) {
    speed_ = 4.2 / 64;
    for (Piece& p : dragon_.pieces()) {
      p.release = std::max(0.0, (p.centroid.x() + START_M - BUNNY_SIZE) / speed_);
      p.velocity =
          0.5 * speed_ * (p.centroid.normalized() + 0.6 * Vec3::UnitX()) + 1.2 * dragon_.edge() * randomVector(random_);
      p.spin = 0.05 * randomVector(random_);
    }
    addBody("dragon", dragon_.vertices().size(), dragon_.faces(), true);
    addBody("bunny", bunny_.vertices().size(), bunny_.faces(), true);
    compute(0);
  }

 private:
  static constexpr double BUNNY_SIZE = 0.45, START_M = 1.9;
  bool closedForm() const override { return true; }
  void compute(std::size_t frame) override {
    const double time = static_cast<double>(frame);
    positions_.clear();
    dragon_.append(time, 0.02 * dragon_.edge(), positions_);
    const std::size_t first = positions_.size();
    bunny_.append(0, 0, positions_);
    for (std::size_t i = first; i < positions_.size(); ++i) {
      positions_[i] = BUNNY_SIZE * positions_[i] + Vec3(speed_ * time - START_M, 0.05 * std::sin(0.2 * time), 0);
    }
  }

  std::mt19937_64 random_;
  Fragments dragon_, bunny_;
  double speed_ = 0;  // [m per frame]
};

/// A body of four layers shatters: its pieces start at different times and pass through those of the next layer.
class Lion : public GeneratedSequence {
 public:
  Lion(const GeneratedOptions& options, double triangles)
      : GeneratedSequence(90), random_(options.seed), lion_(cellsFor(triangles, 4), 4, 0.5, 800, random_) {
    std::uniform_real_distribution<double> unit(0, 1);
    for (Piece& p : lion_.pieces()) {
      const Vec3 outward = p.centroid.normalized();
      p.velocity = lion_.edge() * (4 * outward * unit(random_) + 2 * randomVector(random_));
      p.spin = 0.02 * randomVector(random_);
      p.release = 6 * unit(random_);
    }
    addBody("lion", lion_.vertices().size(), lion_.faces(), true);
    compute(0);
  }

 private:
  bool closedForm() const override { return true; }
  void compute(std::size_t frame) override {
    positions_.clear();
    lion_.append(static_cast<double>(frame), 0.02 * lion_.edge(), positions_);
  }

  std::mt19937_64 random_;
  Fragments lion_;
};

double triangleGoal(const GeneratedOptions& options, double own) {
  return options.triangles ? static_cast<double>(options.triangles) : own;
}

}  // namespace

std::unique_ptr<GeneratedSequence> generateDragon(const GeneratedOptions& options) {
  return std::make_unique<Dragon>(options, triangleGoal(options, 252000));
}

std::unique_ptr<GeneratedSequence> generateLion(const GeneratedOptions& options) {
  return std::make_unique<Lion>(options, triangleGoal(options, 1.6e6));
}

}  // namespace test
}  // namespace dccd
