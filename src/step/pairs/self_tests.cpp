#include "step/pairs/self_tests.h"

#include <functional>

#include "proof/looked.h"
#include "step/history.h"

namespace dccd {
namespace {

// A body whose vertices all move by exactly the same vector keeps its shape: what was apart at the end of the last step
// stays apart. (A rotation is no such motion: straight vertex paths deform the body.)
bool staysApart(const Part& part, std::size_t b, const std::vector<std::uint8_t>& apart) {
  const SceneBody& body = part.scene.bodies()[b];
  return part.continues && b < apart.size() && apart[b] && body.translates && !body.uncertain;
}

}  // namespace

bool mayBeUnfolded(const Options& options, const SceneArrays& scene, std::size_t b) {
  const SceneBody& body = scene.bodies()[b];
  // With a distance, not touching is not enough.
  if (!options.unfolded_test) return false;
  return scene.separation(b, b) == 0 && !body.uncertain && !body.masked;
}

void SelfTests::setBodies(const std::vector<SceneBody>& bodies, std::size_t held) {
  while (unfolded_.size() > held) unfolded_.pop_back();
  while (unfolded_.size() < bodies.size()) unfolded_.emplace_back(bodies[unfolded_.size()]);
}

void SelfTests::choose(const Part& part, const std::vector<std::uint8_t>& apart, Looked& looked, StepStats& stats) {
  const std::vector<SceneBody>& bodies = part.scene.bodies();
  tested_.assign(bodies.size(), 0);
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (!meetsItself(bodies[b].setup)) continue;
    unfolded_[b].clear();
    if (staysApart(part, b, apart)) {
      looked.atItself(b);
      continue;
    }
    const Deadline::Clock::time_point start = Deadline::Clock::now();
    const bool unfolded = certify(part, b);
    stats.unfolded_bodies += unfolded;
    stats[Effect::SELF_COLLISION].ms += msSince(start);
    tested_[b] = !unfolded;
    if (unfolded) looked.atItself(b);
  }
}

bool SelfTests::certify(const Part& part, std::size_t b) {
  if (!mayBeUnfolded(part.options(), part.scene, b)) return false;
  unfolded_[b].run(part.scene.bodies()[b], part.scene.vertices(), std::cref(part.prepared.threads));
  return unfolded_[b].isCertified();
}

}  // namespace dccd
