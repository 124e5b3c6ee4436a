// Steps of one stream with the options that they share: what most tests and benchmarks ask of detect().
#pragma once

#include <vector>

#include "dccd/detect.h"

namespace dccd {
namespace test {

class Detector {
 public:
  explicit Detector(const Options& options = {}) : options_(options) {}
  void setOptions(const Options& options) { options_ = options; }
  Outcome run(const Step& step) { return detect(step, options_, history_); }
  History& history() { return history_; }

 private:
  Options options_;
  History history_;
};

/// The body where it is in a step; radius_m may be null.
inline Body moving(Body body, const Positions& t0, const Positions& t1, const std::vector<double>* radius_m = nullptr) {
  body.t0 = share(t0);
  body.t1 = share(t1);
  body.radius_m = radius_m ? share(*radius_m) : nullptr;
  return body;
}

/// A step of one body.
inline Step stepOf(const Body& body, const Positions& t0, const Positions& t1,
                   const std::vector<double>* radius_m = nullptr) {
  Step step;
  step.bodies.push_back(moving(body, t0, t1, radius_m));
  return step;
}

}  // namespace test
}  // namespace dccd
