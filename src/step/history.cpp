#include "step/history.h"

#include <algorithm>
#include <cstring>
#include <type_traits>

#include "step/clearance/clearance_finder.h"

namespace dccd {
namespace {

bool sameBits(const std::shared_ptr<const Positions>& a, const std::shared_ptr<const Positions>& b) {
  return a == b || (a && b && a->size() == b->size() &&
                    (a->empty() || std::memcmp(a->data(), b->data(), a->size() * sizeof(Vec3)) == 0));
}

}  // namespace

History::History() : impl_(std::make_unique<Impl>()) {}
History::~History() = default;
History::History(History&& other) noexcept = default;
History& History::operator=(History&& other) noexcept = default;
void History::clear() { impl_->carried.clear(); }
bool History::isClear() const { return impl_->carried.isClear(); }

void Carried::clear() {
  end.clear();
  apart.clear();
  start_state.clear();
  inside.clear();
  map = std::vector<MapAnswer>();
}

bool Carried::isContinuedBy(const Step& step) const {
  if (end.empty() || end.size() != step.bodies.size()) return false;
  for (std::size_t b = 0; b < end.size(); ++b) {
    if (!sameBits(end[b], step.bodies[b].t0)) return false;
  }
  return true;
}

void Carried::rememberApart(const SceneArrays& scene, const std::vector<Contact>& contacts, bool complete) {
  apart.resize(scene.bodies().size(), 0);
  for (std::size_t b = 0; b < apart.size(); ++b) {
    const SceneBody& body = scene.bodies()[b];
    // With radii that change, what is apart now may be too close without having moved.
    apart[b] = complete && meetsItself(body.setup) && !body.masked && !body.uncertain;
  }
  std::size_t left = static_cast<std::size_t>(std::count(apart.begin(), apart.end(), 1));
  for (auto c = contacts.begin(); left > 0 && c != contacts.end(); ++c) {
    if (c->body[0] != c->body[1]) continue;
    left -= apart[c->body[0]];
    apart[c->body[0]] = 0;
  }
}

/// What throws may leave half of it made: what follows from options and map is made anew, and from bodies, where
/// these were not done. Nothing is carried over.
void History::Impl::forgetPrepared() noexcept {
  if (!prepared.bodies_known) scene.forgetBodies();
  carried.clear();
  prepared.options.reset();  // so that all that follows from them is made, too
  prepared.map.clear();
  prepared.expected_known = false;
  scene.forgetBounds();
  static_assert(std::is_nothrow_default_constructible_v<PatchMaker> && std::is_nothrow_move_assignable_v<PatchMaker>);
  patches = PatchMaker();
}

/// The one place where what is prepared changes.
void History::Impl::prepare(const Step& step, const Options& wanted) {
  setOptions(wanted);
  setBodies(step);
  if (!prepared.expected_known) prepared.expected.set(wanted.expected, step.bodies);
  prepared.expected_known = true;
  prepared.map.set(step.map, wanted.exclude_boxes, wanted.clearance.wanted);
  if (!wanted.clearance.wanted) return;
  if (!clearance) clearance = std::make_unique<ClearanceFinder>();
  clearance->begin(step, scene, wanted, readers);
}

void History::Impl::setOptions(const Options& wanted) {
  if (prepared.options && *prepared.options == wanted) return;
  check(wanted);
  prepared.elementary = makeRung(wanted.accuracy);
  prepared.threads.set(wanted.num_threads);
  scene.setKeepBounds(wanted.keep_bounds);
  map_search.keepBodies(0);
  carried.map.clear();
  prepared.expected_known = false;
  prepared.map.clear();  // other boxes may be excluded
  prepared.options = wanted;
}

void History::Impl::setBodies(const Step& step) {
  const bool known = prepared.bodies_known && scene.holds(step.bodies);
  if (!known || !prepared.expected_known) check(*prepared.options, step.bodies);  // else it was, with these options
  if (known) return;
  prepared.bodies_known = false;
  carried.clear();
  const std::size_t held = scene.setBodies(step.bodies);
  if (clearance) clearance->forgetBodies();
  carried.start_state.keepBodies(held);
  carried.inside.keepBodies(held);
  self_tests.setBodies(scene.bodies(), held);
  map_search.keepBodies(held);
  prepared.expected_known = false;
  prepared.bodies_known = true;
}

}  // namespace dccd
