// Which pairs of partners a step has distances of, and what is said of each in the end.
#include <algorithm>
#include <utility>

#include "step/clearance/clearance_finder.h"
#include "step/conclude.h"
#include "step/parts.h"

namespace dccd {
namespace {

/// All contacts of the two are expected.
bool expectsAll(const std::vector<Expectation>& expected, std::uint16_t a, std::uint16_t b) {
  return std::any_of(expected.begin(), expected.end(), [&](const Expectation& one) {
    const ExpectedPartner &x = one.partners[0], &y = one.partners[1];
    return x.vertices.empty() && y.vertices.empty() && std::minmax(x.body, y.body) == std::minmax(a, b);
  });
}

/// A limit that holds when leaves_m is taken off, as both are rounded.
double limitBefore(double limit_m, double leaves_m) {
  return leaves_m > 0 ? (limit_m + leaves_m) * (1 + tolerance::CLEARANCE_BOX) : limit_m;
}

}  // namespace

void ClearanceFinder::begin(const Step& step, const SceneArrays& scene, const Options& options,
                            DistanceReaders* readers) {
  step_ = &step;
  options_ = options.clearance;
  rigid_tolerance_m_ = options.rigid_tolerance_m;
  needed_ = partsAllowed(neededParts(step, rigid_tolerance_m_, scene.bodies(), options_.max_m), options.max_substeps);
  stretches_ = 1;
  exact_ = options.accuracy.rung == Accuracy::EXACT;
  const std::size_t n = step.bodies.size();
  bodies_.resize(n);
  rows_.clear();
  row_of_.assign(n * (n + 1), NOT_ASKED);
  before_m_.resize(row_of_.size(), std::numeric_limits<double>::infinity());
  pairs_ = came_ = 0;
  expected_ = options.expected;
  for (std::size_t b = 0; b < n; ++b) learn(step.bodies[b], scene.bodies()[b], bodies_[b]);
  const auto ask = [&](std::size_t a, std::size_t b) {
    row_of_[a * (n + 1) + b] = ROWLESS;
    ++pairs_;
  };
  for (std::size_t a = 0; a < n; ++a) {
    if (options_.self_m > 0 && meetsItself(step.bodies[a])) ask(a, a);
    for (std::size_t b = a + 1; b < n; ++b) {
      if (meet(step.bodies[a], a, step.bodies[b], b)) ask(a, b);
    }
    if (meetsMap(step.bodies[a]) && (step.map.surface || options.obstacle_expected)) ask(a, n);
  }
  readers_ = pairs_ <= MOST_ROWS ? readers : nullptr;  // else one row stands for others, which are as far
  std::vector<bool> lost;
  for (const Body& body : step.bodies) lost.push_back(body.dropped_faces > 0 || looseVertices(body) > 0);
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = a; b <= n; ++b) {
      if (row_of_[a * (n + 1) + b] == NOT_ASKED) continue;
      const bool unknown = lost[a] || (b == n ? !step.map.surface : lost[b]);
      if (pairs_ <= MOST_ROWS || unknown || a == b || b == n) addRow(a, b).unknown = unknown;
    }
  }
}

std::int32_t& ClearanceFinder::placeOf(std::size_t a, std::size_t b) {
  const std::size_t n = bodies_.size();
  if (a > b) std::swap(a, b);
  return row_of_[a * (n + 1) + std::min(b, n)];
}

double& ClearanceFinder::before(const Row& row) {
  return before_m_[static_cast<std::size_t>(&placeOf(row.answer.body[0], row.answer.body[1]) - row_of_.data())];
}

/// Of a pair that was far in all parts that came.
ClearanceFinder::Row ClearanceFinder::newRow(std::size_t a, std::size_t b) const {
  Row row;
  row.answer.body = {static_cast<std::uint16_t>(a),
                     b == bodies_.size() ? OBSTACLE_BODY : static_cast<std::uint16_t>(b)};
  row.answer.expected = expectsAll(expected_, row.answer.body[0], row.answer.body[1]);
  row.stretches = came_;
  if (came_ > 0) row.at_end.lower_m = row.over_step.lower_m = limitOf(row) + radiusOf(row);
  return row;
}

ClearanceFinder::Row& ClearanceFinder::addRow(std::size_t a, std::size_t b) {
  placeOf(a, b) = static_cast<std::int32_t>(rows_.size());
  rows_.push_back(newRow(a, b));
  return rows_.back();
}

/// Of two bodies that boxes do not show to be far, of which nothing is known, or that have a contact.
void ClearanceFinder::addRowsOfNear(const ClearancePart& part) {
  for (std::size_t a = 0; a < bodies_.size(); ++a) {
    for (std::size_t b = a + 1; b < bodies_.size(); ++b) {
      if (placeOf(a, b) != ROWLESS) continue;
      const BodyState &first = bodies_[a], &second = bodies_[b];
      const double limit_m = options_.max_m + first.radius_m + second.radius_m;
      const double leaves_m = first.leaves_way_m + second.leaves_way_m;
      const bool known = first.known && second.known;
      if (!known || !(apartByBoxes(first.box, second.box) >= limitBefore(limit_m, leaves_m))) addRow(a, b);
    }
  }
  const auto addRowOf = [&](const std::array<std::uint16_t, 2>& body) {
    if (placeOf(body[0], body[1]) == ROWLESS) addRow(body[0], body[1]);
  };
  for (const StartIntersection& s : part.found.intersections) addRowOf(s.body);
  for (const Contact& c : part.found.contacts) addRowOf(c.body);
}

ClearanceFinder::Row* ClearanceFinder::rowOf(std::size_t a, std::size_t b) {
  const std::int32_t row = placeOf(a, b);
  return row < 0 ? nullptr : &rows_[static_cast<std::size_t>(row)];
}

double ClearanceFinder::limitOf(const Row& row) const {
  const bool itself = row.answer.body[0] == row.answer.body[1];
  const double most_m = itself ? std::min(options_.max_m, tolerance::CLEARANCE_SELF * options_.self_m) : options_.max_m;
  return std::min(most_m, row.enough_m);
}

/// How much nearer the two may be than where they were seen.
double ClearanceFinder::radiusOf(const Row& row) const {
  const auto [a, b] = row.answer.body;
  return bodies_[a].radius_m + (b == OBSTACLE_BODY ? 0 : bodies_[b].radius_m);
}

/// How far the straight paths of the two may be from their arcs, together.
double ClearanceFinder::leavesArcsBy(const Row& row) const {
  const auto [a, b] = row.answer.body;
  return b == OBSTACLE_BODY ? bodies_[a].leaves_on_map_m : bodies_[a].leaves_way_m + bodies_[b].leaves_way_m;
}

/// From where on they are FARTHER on their straight paths.
double ClearanceFinder::limitOverStep(const Row& row) const {
  return limitBefore(limitOf(row) + radiusOf(row), leavesArcsBy(row));
}

/// wider_m: by how much more than is asked for the bounds may be apart.
void ClearanceFinder::judge(const Row& row, const FoundDistance& found, double wider_m,
                            ClearanceDistance& distance) const {
  const double limit_m = limitOf(row), radius_m = radiusOf(row);
  if (found.lower_m >= limit_m + radius_m) {
    distance = ClearanceDistance();
    distance.status = ClearanceStatus::FARTHER;
    distance.lower_m = limit_m;
    return;
  }
  const double wide_m = std::max(options_.tolerance_m, tolerance::CLEARANCE_RELATIVE * found.upper_m) + wider_m;
  distance.status = found.upper_m == 0                                        ? ClearanceStatus::TOUCHING
                    : found.cut || !(found.upper_m - found.lower_m <= wide_m) ? ClearanceStatus::LOWER
                                                                              : ClearanceStatus::MEASURED;
  distance.lower_m = std::max(0.0, found.lower_m - radius_m);
  if (radius_m > 0) distance.lower_m *= 1 - tolerance::CLEARANCE_BOX;  // for the sum of radii, and the difference
  distance.upper_m = found.upper_m;
}

void ClearanceFinder::conclude(Row& row, std::size_t stretches) const {
  Clearance& answer = row.answer;
  if (row.stretches < stretches) {  // what was not come to may be anything
    row.over_step.lower_m = row.at_end.lower_m = 0;
    row.over_step.cut = row.at_end.cut = true;
  }
  if (!row.unknown) judge(row, row.at_end, 0, answer.at_end);
  if (row.touches) {
    const double upper_m = exact_ || row.unknown ? 0 : row.over_step.upper_m;
    answer.over_step.status = ClearanceStatus::TOUCHING;
    answer.over_step.lower_m = 0;
    answer.over_step.upper_m = upper_m;
  } else if (row.unknown || row.undecided) {
    answer.over_step = ClearanceDistance();
  } else if (answer.at_end.status == ClearanceStatus::TOUCHING) {
    answer.over_step = answer.at_end;
  } else {
    // Beyond what the tolerance of arcs allows they are only bounds.
    judge(row, row.over_step, 2 * std::min(leavesArcsBy(row), 2 * rigid_tolerance_m_), answer.over_step);
  }
}

void ClearanceFinder::finish(std::size_t parts, Outcome& outcome) {
  StageStats& stats = outcome.stats[Effect::CLEARANCE];
  stats.in = pairs_;
  stats.out = 0;
  outcome.clearances.clear();
  const std::size_t n = bodies_.size();
  bool one_is_far = false;  // and has its row
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = a; b <= n; ++b) {
      const std::int32_t place = row_of_[a * (n + 1) + b];
      if (place == NOT_ASKED) continue;
      // Of half a million pairs nothing is made for most. One that is far shows that no part is missing.
      const std::uint16_t partner = b == n ? OBSTACLE_BODY : static_cast<std::uint16_t>(b);
      if (place == ROWLESS && one_is_far && !expectsAll(expected_, static_cast<std::uint16_t>(a), partner)) {
        ++stats.out;
        continue;
      }
      Row none;
      if (place == ROWLESS) none = newRow(a, b);
      Row& row = place == ROWLESS ? none : rows_[static_cast<std::size_t>(place)];
      conclude(row, parts * stretches_);
      const ClearanceStatus status = row.answer.over_step.status;
      stats.out += status != ClearanceStatus::LOWER && status != ClearanceStatus::UNKNOWN;
      const bool stands_for_others = status == ClearanceStatus::FARTHER && a != b && !row.answer.expected;
      if (pairs_ > MOST_ROWS && stands_for_others && std::exchange(one_is_far, true)) continue;
      outcome.clearances.push_back(row.answer);
    }
  }
}

}  // namespace dccd
