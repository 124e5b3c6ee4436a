#include "scenes/physics/simulation.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <BulletSoftBody/btDefaultSoftBodySolver.h>
#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>

#include "scenes/physics/shapes.h"

namespace dccd::scene {
namespace {

static_assert(sizeof(btScalar) == sizeof(double), "scenes are recorded with Bullet in double precision");

// Iterations of the position solver per physics step: enough that cloth of a thousand vertices does not look like
// rubber.
constexpr int POSITION_ITERATIONS = 12;
// Cell size of Bullet's sampled distance field around rigid shapes, as a multiple of the thickness it must resolve.
constexpr double SDF_CELL_PER_THICKNESS = 1.0;
// Bullet rounds a box's corners by its margin, by default 4 cm.
constexpr double BOX_MARGIN_M = 1e-3;
// A ring is a wreath of this many capsules: off the true torus by less than 1 % of its radius.
constexpr int RING_CAPSULES = 24;

btVector3 toBullet(const Vec3& v) { return btVector3(v[0], v[1], v[2]); }
Vec3 fromBullet(const btVector3& v) { return Vec3(v[0], v[1], v[2]); }

btTransform toBullet(const Eigen::Isometry3d& pose) {
  const Eigen::Quaterniond q(pose.linear());
  return btTransform(btQuaternion(q.x(), q.y(), q.z(), q.w()), toBullet(Vec3(pose.translation())));
}

std::unique_ptr<btCollisionShape> makeBox(const Vec3& half_size_m) {
  auto box = std::make_unique<btBoxShape>(toBullet(half_size_m));
  box->setMargin(std::min(BOX_MARGIN_M, 0.5 * half_size_m.minCoeff()));
  return box;
}

/// Vertices in the hand of a gripper, driven instead of simulated.
struct HeldVertices {
  const Gripper* gripper;
  btSoftBody* body;
  Positions start;
  Vec3 centroid;
  std::vector<btScalar> inverse_mass;  // given back on release
  bool taken = false, released = false;
  std::size_t link = 0;  // where the gripper names one
};

}  // namespace

struct Simulation::Impl {
  Impl(const SceneSpec& scene_spec, std::uint64_t seed) : spec(scene_spec), random(seed) {}

  // The standard's distributions differ between libraries; bags must not.
  double noise(double amplitude) {
    return amplitude * (static_cast<double>(random() >> 11) * (2.0 / 9007199254740992.0) - 1.0);
  }

  void addBody(const Body& body);
  void addEffects(const Body& body, btSoftBody& soft);
  void addObstacle(const Obstacle& obstacle);
  void addRing(const Solid& solid, double inset_m);
  btRigidBody* addRigid(std::unique_ptr<btCollisionShape> shape, const btTransform& pose, bool kinematic);
  static void take(HeldVertices& hand, const Eigen::Isometry3d& pose);
  void hold(double time);

  SceneSpec spec;
  std::mt19937_64 random;
  double time = 0.0;
  int substeps_done = 0;
  std::vector<std::string> effects;

  // Destroyed from the last to the first: the world before what it refers to.
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDefaultSoftBodySolver soft_solver;
  std::vector<std::unique_ptr<btCollisionShape>> shapes;
  std::vector<std::unique_ptr<btRigidBody>> rigid;
  std::vector<btRigidBody*> moving;  // one for each of the scene's rigid bodies
  std::vector<std::unique_ptr<btSoftBody>> soft;
  std::vector<HeldVertices> held;
  btSoftRigidDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration, &soft_solver};

  ~Impl() {
    for (auto& body : soft) world.removeSoftBody(body.get());
    for (auto& body : rigid) world.removeRigidBody(body.get());
  }
};

void Simulation::Impl::addBody(const Body& body) {
  const Positions start = startPositions(body.shape);
  std::vector<btVector3> nodes;
  for (const Vec3& p : start) {
    const Vec3 offset(noise(body.start_noise_m), noise(body.start_noise_m), noise(body.start_noise_m));
    nodes.push_back(toBullet(p + offset));
  }
  soft.push_back(
      std::make_unique<btSoftBody>(&world.getWorldInfo(), static_cast<int>(nodes.size()), nodes.data(), nullptr));
  btSoftBody& result = *soft.back();
  if (body.shape.kind == Shape::Kind::ROPE) {
    for (int i = 0; i + 1 < body.shape.cols; ++i) result.appendLink(i, i + 1);
  }
  for (const Face& face : shapeFaces(body.shape)) {
    const int v[3] = {static_cast<int>(face[0]), static_cast<int>(face[1]), static_cast<int>(face[2])};
    for (int i = 0; i < 3; ++i) result.appendLink(v[i], v[(i + 1) % 3], nullptr, true);
    result.appendFace(v[0], v[1], v[2]);
  }
  result.getCollisionShape()->setMargin(body.thickness_m);
  result.m_cfg.piterations = POSITION_ITERATIONS;
  result.m_cfg.kDP = body.damping;
  // Bullet's defaults hold effects that this scene may not have named.
  result.m_cfg.kDF = 0.0;
  result.m_cfg.collisions = 0;
  addEffects(body, result);
  result.setTotalMass(body.mass_kg);
  for (const Gripper& gripper : body.grippers) {
    effects.push_back(body.name + ": gripper");
    held.push_back({&gripper, &result, {}, Vec3::Zero(), {}});
    if (gripper.link.empty()) {
      take(held.back(), Eigen::Isometry3d::Identity());
      continue;
    }
    while (spec.robot->links.at(held.back().link).name != gripper.link) ++held.back().link;
  }
  world.addSoftBody(&result);
}

/// From now on its vertices stay where they are in the frame at `pose`.
void Simulation::Impl::take(HeldVertices& hand, const Eigen::Isometry3d& pose) {
  hand.taken = true;
  for (const int v : hand.gripper->vertices) {
    hand.start.push_back(pose.inverse() * fromBullet(hand.body->m_nodes[v].m_x));
    hand.centroid += hand.start.back() / static_cast<double>(hand.gripper->vertices.size());
    hand.inverse_mass.push_back(hand.body->m_nodes[v].m_im);
    hand.body->setMass(v, 0.0);
  }
}

void Simulation::Impl::addEffects(const Body& body, btSoftBody& result) {
  if (spec.obstacle && spec.obstacle->collides) result.m_cfg.collisions |= btSoftBody::fCollision::SDF_RS;
  if (!spec.rigid_bodies.empty()) result.m_cfg.collisions |= btSoftBody::fCollision::SDF_RS;
  if (body.bending) {
    btSoftBody::Material* material = result.appendMaterial();
    material->m_kLST = *body.bending;
    result.generateBendingConstraints(2, material);
    effects.push_back(body.name + ": bending");
  }
  if (body.self_collision) {
    result.generateClusters(*body.self_collision);
    result.m_cfg.collisions |= btSoftBody::fCollision::CL_SELF | btSoftBody::fCollision::CL_SS;
    effects.push_back(body.name + ": self-collision");
  }
  if (body.friction) {
    result.m_cfg.kDF = *body.friction;
    effects.push_back(body.name + ": friction");
  }
  if (spec.wind) {
    result.m_cfg.aeromodel = btSoftBody::eAeroModel::F_TwoSided;
    result.m_cfg.kDG = spec.wind->drag;
    result.m_cfg.kLF = spec.wind->lift;
  }
}

btRigidBody* Simulation::Impl::addRigid(std::unique_ptr<btCollisionShape> shape, const btTransform& pose,
                                        bool kinematic) {
  btRigidBody::btRigidBodyConstructionInfo info(0.0, nullptr, shape.get());
  info.m_startWorldTransform = pose;
  rigid.push_back(std::make_unique<btRigidBody>(info));
  shapes.push_back(std::move(shape));
  if (kinematic) {
    rigid.back()->setCollisionFlags(rigid.back()->getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
    rigid.back()->setActivationState(DISABLE_DEACTIVATION);
  }
  world.addRigidBody(rigid.back().get());
  return rigid.back().get();
}

void Simulation::Impl::addRing(const Solid& solid, double inset_m) {
  const Vec3 u = solid.axis.unitOrthogonal(), v = solid.axis.cross(u);
  const double arc = 2.0 * M_PI * solid.radius_m / RING_CAPSULES;
  for (int i = 0; i < RING_CAPSULES; ++i) {
    const double angle = 2.0 * M_PI * i / RING_CAPSULES;
    const Vec3 out = std::cos(angle) * u + std::sin(angle) * v;
    const Vec3 tangent = std::cos(angle) * v - std::sin(angle) * u;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() =
        Eigen::Quaterniond::FromTwoVectors(Vec3::UnitY(), tangent).toRotationMatrix();  // capsules lie along y
    pose.translation() = solid.center_m + solid.radius_m * out;
    addRigid(std::make_unique<btCapsuleShape>(solid.tube_radius_m - inset_m, arc), toBullet(pose), false);
  }
}

void Simulation::Impl::addObstacle(const Obstacle& obstacle) {
  effects.push_back("obstacle");
  for (const Solid& solid : obstacle.solids) {
    if (solid.kind == Solid::Kind::RING) {
      addRing(solid, obstacle.inset_m);
      continue;
    }
    const Vec3 half = 0.5 * (solid.box.max - solid.box.min) - Vec3::Constant(obstacle.inset_m);
    const Vec3 center = 0.5 * (solid.box.max + solid.box.min);
    addRigid(makeBox(half), btTransform(btQuaternion::getIdentity(), toBullet(center)), false);
  }
}

void Simulation::Impl::hold(double now) {
  const std::vector<Eigen::Isometry3d> links =
      spec.robot ? linkPoses(*spec.robot, now) : std::vector<Eigen::Isometry3d>();
  for (HeldVertices& hand : held) {
    if (hand.released) continue;
    const std::vector<int>& vertices = hand.gripper->vertices;
    if (hand.gripper->release_s && now >= *hand.gripper->release_s) {
      for (std::size_t i = 0; i < vertices.size(); ++i) hand.body->setMass(vertices[i], 1.0 / hand.inverse_mass[i]);
      hand.released = true;
      continue;
    }
    Eigen::Isometry3d pose;
    if (hand.gripper->link.empty()) {
      pose = motionAt(hand.gripper->motion, hand.centroid, now);
    } else {
      if (now < hand.gripper->grasp_s) continue;
      pose = links[hand.link];
      if (!hand.taken) take(hand, pose);
    }
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      btSoftBody::Node& node = hand.body->m_nodes[vertices[i]];
      node.m_x = toBullet(pose * hand.start[i]);
      node.m_v.setZero();
    }
  }
}

Simulation::Simulation(const SceneSpec& spec, std::uint64_t seed) : impl_(std::make_unique<Impl>(spec, seed)) {
  Impl& impl = *impl_;
  double thinnest_m = 1.0;
  for (const Body& body : impl.spec.bodies) thinnest_m = std::min(thinnest_m, body.thickness_m);
  btSoftBodyWorldInfo& info = impl.world.getWorldInfo();
  info.m_sparsesdf.Initialize();
  info.m_sparsesdf.setDefaultVoxelsz(SDF_CELL_PER_THICKNESS * thinnest_m);
  info.m_sparsesdf.Reset();  // only this takes the cell size over
  const Vec3 gravity = spec.gravity_m_s2.value_or(Vec3::Zero());
  info.m_gravity = toBullet(gravity);
  impl.world.setGravity(toBullet(gravity));
  if (spec.gravity_m_s2) impl.effects.push_back("gravity");
  info.air_density = spec.wind ? 1.2 : 0.0;
  if (spec.wind) impl.effects.push_back("wind");
  if (spec.obstacle && spec.obstacle->collides) impl.addObstacle(*impl.spec.obstacle);
  for (const RigidBody& body : impl.spec.rigid_bodies) {
    impl.effects.push_back(body.name + ": rigid body");
    impl.moving.push_back(impl.addRigid(makeBox(0.5 * body.size_m),
                                        btTransform(btQuaternion::getIdentity(), toBullet(body.start_m)), true));
  }
  for (const Body& body : impl.spec.bodies) impl.addBody(body);
}

Simulation::~Simulation() = default;

void Simulation::step() {
  Impl& impl = *impl_;
  const double dt = 1.0 / (impl.spec.frame_rate_hz * impl.spec.substeps);
  for (int i = 0; i < impl.spec.substeps; ++i) {
    // Counted, not added up: the stamps of a long recording must not drift.
    impl.time = ++impl.substeps_done * dt;
    if (impl.spec.wind) {
      const Wind& wind = *impl.spec.wind;
      const double gust = 1.0 + wind.gust * std::sin(2.0 * M_PI * impl.time / wind.gust_period_s);
      for (auto& body : impl.soft) body->setWindVelocity(toBullet(Vec3(gust * wind.velocity_m_s)));
    }
    for (std::size_t r = 0; r < impl.moving.size(); ++r) impl.moving[r]->setWorldTransform(toBullet(rigidPose(r)));
    impl.hold(impl.time);
    impl.world.stepSimulation(dt, 0);
    impl.hold(impl.time);
  }
}

double Simulation::time_s() const { return impl_->time; }

Positions Simulation::positions(std::size_t body) const {
  const btSoftBody& soft = *impl_->soft[body];
  Positions positions(static_cast<std::size_t>(soft.m_nodes.size()));
  for (int i = 0; i < soft.m_nodes.size(); ++i) positions[i] = fromBullet(soft.m_nodes[i].m_x);
  return positions;
}

Eigen::Isometry3d Simulation::rigidPose(std::size_t rigid_body) const {
  const RigidBody& body = impl_->spec.rigid_bodies[rigid_body];
  Eigen::Isometry3d start = Eigen::Isometry3d::Identity();
  start.translation() = body.start_m;
  return motionAt(body.motion, body.start_m, impl_->time) * start;
}

const std::vector<std::string>& Simulation::effects() const { return impl_->effects; }

}  // namespace dccd::scene
