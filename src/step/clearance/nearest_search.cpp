#include "step/clearance/nearest_search.h"

#include <cmath>

namespace dccd {
namespace {

constexpr int MOST_HALVINGS = 1 << 12;  // of one pair; what is left is as wide as it is
constexpr std::uint64_t WORK = 64;      // boxes and times between two looks at the clock

struct Interval {
  double from, to, lower;
  std::array<Vec3, 2> direction;  // that held at either end
};

}  // namespace

void NearestSearch::begin(const Goal& goal, const FoundDistance& known) {
  goal_ = goal;
  found_ = known;
  found_.lower_m = settled_squared_ = std::numeric_limits<double>::infinity();
  found_.cut = false;
  looks_ = 0;
  number_ = 1;
  checked_from_ = 0;
  has_direction_ = false;
  if (!goal.first) plane_ = 0;
  touching_.clear();
  heap_.clear();
  setEnough();
}

FoundDistance NearestSearch::result() const {
  FoundDistance found = found_;
  const double boxes_m = std::sqrt(settled_squared_) * (1 - tolerance::CLEARANCE_BOX);
  found.lower_m = std::min({found.lower_m, boxes_m, found.upper_m});
  return found;
}

/// From which distance on nothing needs a further look. Its square is rounded up, so that result() holds it.
void NearestSearch::setEnough() {
  enough_m_ = goal_.limit_m;
  if (found_.upper_m < std::numeric_limits<double>::infinity()) {
    const double wide_m = std::max(goal_.tolerance_m, tolerance::CLEARANCE_RELATIVE * found_.upper_m);
    enough_m_ = std::min(enough_m_, found_.upper_m - wide_m);
  }
  enough_squared_ = enough_m_ > 0 ? enough_m_ * enough_m_ * (1 + 4 * tolerance::CLEARANCE_BOX) : 0;
}

bool NearestSearch::isLate() { return found_.cut || (++looks_ % WORK == 0 && goal_.deadline.isOver()); }

Nearest NearestSearch::takeAt(double t) {
  const Nearest nearest = pair_.at(t, goal_.tolerance_m / 4);
  const double upper_m = pair_.upperInMetres(nearest.upper);
  if (upper_m < found_.upper_m) {
    found_.upper_m = upper_m;
    found_.t = t;
    for (int side = 0; side < 2; ++side) found_.point[side] = pair_.pointInMetres(nearest.point[side]);
    found_.item = item_;
    setEnough();
  }
  return nearest;
}

/// What is pushed later is held against it at once.
void NearestSearch::setDirection(const Turning& direction) {
  if (direction[0] == Vec3::Zero() || direction[1] == Vec3::Zero()) return;
  direction_ = direction;
  ++directions_;
  checked_from_ = number_;
  has_direction_ = true;
}

/// The pair meets at the end.
void NearestSearch::takeMeeting() {
  const Nearest nearest = pair_.at(1, goal_.tolerance_m / 4);
  for (int side = 0; side < 2; ++side) found_.point[side] = pair_.pointInMetres(nearest.point[side]);
  found_.t = 1;
  found_.item = item_;
  found_.upper_m = 0;
  setEnough();
  settle(0);
}

/// Of the pair over the whole step. The directions at an interval's ends bound the distance over it, and err by the
/// square of its length, so that few halvings do.
void NearestSearch::refine() {
  std::array<Interval, 64> left;  // a path to one interval leaves one beside each of its halvings
  std::size_t count = 1;
  const double upper_m = found_.upper_m;
  const Vec3 at_end = takeAt(1).direction;
  Vec3 at_start = Vec3::Zero();
  left[0] = {0, 1, 0, {at_end, at_end}};
  for (int halvings = 0; count > 0; ++halvings) {
    Interval one = left[--count];
    one.lower = std::max(one.lower, pair_.lowerOver(one.direction, one.from, one.to));
    double lower_m = pair_.lowerInMetres(one.lower);
    if (lower_m < enough_m_ && halvings == 0) {
      one.direction[0] = at_start = takeAt(0).direction;
      one.lower = std::max(one.lower, pair_.lowerOver(one.direction, 0, 1));
      lower_m = pair_.lowerInMetres(one.lower);
    }
    const bool late = lower_m < enough_m_ && isLate();
    if (late || lower_m >= enough_m_ || one.to - one.from <= tolerance::CLEARANCE_SHORTEST ||
        halvings >= MOST_HALVINGS) {
      settle(lower_m);
      found_.cut = found_.cut || late;
      continue;
    }
    const double middle = (one.from + one.to) / 2;
    const Vec3 direction = takeAt(middle).direction;
    left[count++] = {middle, one.to, one.lower, {direction, one.direction[1]}};
    left[count++] = {one.from, middle, one.lower, {one.direction[0], direction}};
  }
  if (found_.upper_m < upper_m) setDirection({at_start == Vec3::Zero() ? takeAt(0).direction : at_start, at_end});
}

}  // namespace dccd
