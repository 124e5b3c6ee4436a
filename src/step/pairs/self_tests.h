// Which bodies a part of a step tests against themselves, and what of them certainly does not fold.
#pragma once

#include <cstdint>
#include <vector>

#include "culling/unfolded.h"
#include "dccd/outcome.h"

namespace dccd {

struct Options;
struct Part;
class Looked;

/// The certificate has something to say of the body and itself in this step.
bool mayBeUnfolded(const Options& options, const SceneArrays& scene, std::size_t body);

class SelfTests {
 public:
  void setBodies(const std::vector<SceneBody>& bodies, std::size_t held);  ///< held: the first ones, as they were
  /// apart: Carried::apart. looked: what needs no test.
  void choose(const Part& part, const std::vector<std::uint8_t>& apart, Looked& looked, StepStats& stats);

  /// Per body: its pairs with itself are looked at.
  const std::vector<std::uint8_t>& tested() const { return tested_; }
  const std::vector<Unfolded>& unfolded() const { return unfolded_; }

 private:
  bool certify(const Part& part, std::size_t body);

  std::vector<std::uint8_t> tested_;
  std::vector<Unfolded> unfolded_;  // per body
};

}  // namespace dccd
