#include "culling/unfolded.h"

#include <algorithm>
#include <numeric>

#include "culling/surface_cells.h"
#include "simd/surface_views.h"

namespace dccd {
namespace {

using simd::GROUP;

// Runs left out after one that certified next to nothing, each time about twice as many; of a view without a part.
constexpr std::size_t RUNS_LEFT_OUT = 15, MOST_LEFT_OUT = 127;
constexpr std::size_t FEW = 8;  // one in so many of the cells beside each other is next to nothing
constexpr std::size_t MOST_PARTS = 64;
constexpr std::size_t SAMPLES = 256;           // pairs of cells that choose a view
constexpr std::size_t FEWEST_CELLS = 16;       // of a part of a surface
constexpr std::size_t PAIRS_A_DIRECTION = 32;  // one in so many of the cells beside each other are worth a direction
constexpr std::size_t LEAST_BUDGET = 4096;     // edges of borders that are tested in a run, or one for each cell
constexpr std::size_t FIRST_BUDGET = 4;        // times as much in the first run
constexpr std::size_t TRIES = 8;               // of a part whose border meets itself, in one run or in several
constexpr std::size_t TRIES_BY_CELLS = 3;      // after which the cells around those that stand against it go, too
constexpr std::size_t RUNS_TO_FINISH = 5;      // that end with their budget and certify next to nothing
constexpr std::size_t MOST_IN_NONE = 6;    // one in so many clusters of edges, of a surface of which most is in parts
constexpr std::size_t LONG_BORDER = 1024;  // edges
constexpr std::size_t CELLS_A_PIECE = 256, CELLS_AT_ONCE = 32;
constexpr std::uint32_t ALL_VIEWS = (1u << simd::VIEWS) - 1;

ViewPlane planeOf(std::size_t view) {
  const int* line = simd::VIEW_LINE[view / 2];
  return ViewPlane((view % 2 ? -1.0 : 1.0) * Vec3(line[0], line[1], line[2]));
}

}  // namespace

std::size_t leaveOutPairs(const PartsOfGroups& a, const PartsOfGroups& b, std::size_t level, std::uint32_t* pairs,
                          std::size_t count) {
  std::size_t left = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t first = pairs[2 * i], second = pairs[2 * i + 1];
    pairs[2 * left] = first;
    pairs[2 * left + 1] = second;
    left += !a.isLeftOut(level, b, first, second);
  }
  return left;
}

class Unfolded::Search {
 public:
  explicit Search(const SceneBody& body)
      : cells_(body),
        contour_(body.internal_begin, body.usedCount()),
        parts_of_(cells_.count()),
        views_(cells_.count()),
        marks_(cells_.count()) {}

  /// The number of parts. Whether the first one is the whole surface.
  std::size_t run(const SceneBody& body, const VertexMotion* vertices, const Parallel& parallel, bool& whole) {
    part_count_ = 0;
    whole = false;
    vertices_ = vertices;
    if (left_out_runs_ > 0) {
      --left_out_runs_;
      return 0;
    }
    std::fill(parts_of_.begin(), parts_of_.end(), 0);
    budget_ = std::max(LEAST_BUDGET, cells_.count()) * (is_first_run_ ? FIRST_BUDGET : 1);
    is_first_run_ = false;
    rest();
    findViews(body.tree(FeatureKind::FACE), parallel);
    whole = certifyMost() && cells_.isWhole();
    if (!whole && cells_.count() >= FEWEST_CELLS) certifyRest();
    return part_count_;
  }

  void markGroups(const SceneBody& body, FeatureKind kind, std::vector<std::vector<std::uint64_t>>& levels) const {
    const std::size_t clusters = (body.tree(kind).featureCount() + GROUP - 1) / GROUP;
    for (std::size_t g = 0; g < clusters; ++g) {
      const std::uint32_t *home = cells_.firstHome(kind, g), *last = cells_.lastHome(kind, g);
      std::uint64_t parts = home == last ? 0 : ~std::uint64_t{0};
      for (; home != last; ++home) parts &= parts_of_[*home];
      levels[0][g] = parts;
    }
    for (std::size_t l = 1; l < levels.size(); ++l) {
      std::fill(levels[l].begin(), levels[l].end(), ~std::uint64_t{0});
      for (std::size_t g = 0; g < levels[l - 1].size(); ++g) levels[l][g / GROUP] &= levels[l - 1][g];
    }
  }

 private:
  /// Some part holds both.
  bool areTogether(std::uint32_t a, std::uint32_t b) const { return (parts_of_[a] & parts_of_[b]) != 0; }
  bool isMarked(std::uint32_t cell) const { return marks_[cell] == mark_; }

  /// What a direction remembers of the runs before.
  struct View {
    std::size_t rests = 0;               // runs that it is left out of
    std::vector<std::uint32_t> dropped;  // cells that stood against a part,
    std::size_t kept = 0;                // for so many runs
    std::size_t tries = 0;               // since a part was certified, and
    std::size_t stood_against = 0;       // cells in the last of them
    bool holds = false;                  // a part, as of the last run that asked for one
  };

  /// What stood against a part is left out of the same view for some runs, for more where that gave a part; and a view
  /// without a part is left out.
  void rest() {
    allowed_ = ALL_VIEWS;
    for (std::size_t v = 0; v < simd::VIEWS; ++v) {
      View& view = per_view_[v];
      if (view.rests > 0 && --view.rests > 0) allowed_ &= ~(1u << v);
      if (++view.kept <= (view.holds ? MOST_LEFT_OUT : RUNS_LEFT_OUT)) continue;
      view.kept = 0;
      view.dropped.clear();
    }
  }
  /// Of the cells that are not dropped.
  void certifyAlong(std::size_t direction, std::vector<std::uint32_t>& cells) {
    View& view = per_view_[direction];
    if (!view.dropped.empty()) {
      mark(view.dropped);
      cells.erase(std::remove_if(cells.begin(), cells.end(), [&](std::uint32_t c) { return isMarked(c); }),
                  cells.end());
    }
    const std::size_t before = part_count_;
    if (cells.size() == cells_.count()) {
      certifyPart(cells, planeOf(direction), view);
    } else {
      for (std::vector<std::uint32_t>& component : componentsOf(cells)) {
        if (part_count_ < MOST_PARTS) certifyPart(std::move(component), planeOf(direction), view);
      }
    }
    view.holds = part_count_ > before;
    const bool hopeless = view.tries >= TRIES;
    if (!view.holds && (budget_ > 0 || hopeless)) view.rests = RUNS_LEFT_OUT + 1;
    if (view.holds || view.rests > 0) view.tries = view.stood_against = 0;
  }

  /// Views of each cell that all its faces face.
  void findViews(const ClusterTree& faces, const Parallel& parallel) {
    const auto* positions = reinterpret_cast<const double*>(vertices_);
    const std::uint32_t* groups = faces.leaves(false).vertices;
    parallel(cells_.count(), CELLS_A_PIECE, [&](std::size_t first, std::size_t last) {
      std::uint32_t views[CELLS_AT_ONCE * GROUP];
      for (std::size_t c = first, end = first; c < last; c = end) {
        end = std::min(c + CELLS_AT_ONCE, last);
        simd::facedViews(positions, groups + c * 3 * GROUP, end - c, views);
        for (std::size_t cell = c; cell < end; ++cell) {
          const std::uint32_t* face = views + (cell - c) * GROUP;
          views_[cell] = cells_.isSound(cell) ? std::accumulate(face, face + GROUP, ALL_VIEWS, std::bit_and<>()) : 0;
        }
      }
    });
  }

  /// Of a budget, in edges of borders, that grows with the surface: they take up to a third of a microsecond.
  bool canPay(std::size_t edges) {
    const bool can = edges <= budget_;
    budget_ = can ? budget_ - edges : 0;
    return can;
  }

  /// The view that most count for, of cells or of pairs of them: one that held a part in the run before is worth a
  /// third more, but not more than all cells.
  std::size_t bestOf(const std::array<std::size_t, simd::VIEWS>& counts) const {
    const auto worth = [&](std::size_t v) {
      return counts[v] == cells_.count() ? 4 * counts[v] : counts[v] * (per_view_[v].holds ? 4 : 3);
    };
    std::size_t best = 0;
    for (std::size_t v = 1; v < simd::VIEWS; ++v) best = worth(v) > worth(best) ? v : best;
    return best;
  }

  /// Along the direction that most cells face. True: it holds all of them.
  bool certifyMost() {
    std::array<std::size_t, simd::VIEWS> counts{};
    for (const std::uint32_t views : views_) {
      for (std::uint32_t v = views & allowed_; v != 0; v &= v - 1) ++counts[static_cast<std::size_t>(__builtin_ctz(v))];
    }
    first_view_ = bestOf(counts);
    if (counts[first_view_] < std::min(FEWEST_CELLS, cells_.count())) return false;
    std::vector<std::uint32_t> cells;
    for (std::uint32_t c = 0; c < cells_.count(); ++c) {
      if ((views_[c] >> first_view_ & 1) != 0) cells.push_back(c);
    }
    const bool all = cells.size() == cells_.count();
    certifyAlong(first_view_, cells);
    return all && part_count_ == 1 && std::find(parts_of_.begin(), parts_of_.end(), 0) == parts_of_.end();
  }

  /// Along further directions, cells that lie beside each other in no part.
  void certifyRest() {
    open_.clear();
    std::size_t all = 0;
    for (std::uint32_t c = 0; c < cells_.count(); ++c) {
      for (auto n = cells_.firstNeighbour(c); n != cells_.lastNeighbour(c); ++n) {
        if (n->cell == SurfaceCells::BORDER || n->cell < c) continue;
        ++all;
        if (!areTogether(c, n->cell)) open_.push_back({c, n->cell});
      }
    }
    const std::size_t fewest = std::max(FEWEST_CELLS, all / PAIRS_A_DIRECTION);
    std::vector<std::uint32_t> cells;
    std::uint32_t left = allowed_ & ~(1u << first_view_);
    while (open_.size() >= fewest) {
      std::array<std::size_t, simd::VIEWS> counts{};
      const std::size_t stride = std::max<std::size_t>(1, open_.size() / SAMPLES);
      for (std::size_t i = 0; i < open_.size(); i += stride) {
        const auto [a, b] = open_[i];
        for (std::uint32_t v = views_[a] & views_[b] & left; v != 0; v &= v - 1) {
          counts[static_cast<std::size_t>(__builtin_ctz(v))] += stride;
        }
      }
      const std::size_t view = bestOf(counts);
      if (counts[view] < fewest) break;
      left &= ~(1u << view);
      cells.clear();
      mark(cells);
      for (const auto& [a, b] : open_) {
        if ((views_[a] & views_[b] & 1u << view) != 0) add(a, cells), add(b, cells);
      }
      for (std::size_t i = 0, last = cells.size(); i < last; ++i) {
        for (auto n = cells_.firstNeighbour(cells[i]); n != cells_.lastNeighbour(cells[i]); ++n) {
          if (n->cell != SurfaceCells::BORDER && (views_[n->cell] >> view & 1) != 0) add(n->cell, cells);
        }
      }
      certifyAlong(view, cells);
      open_.erase(std::remove_if(open_.begin(), open_.end(), [&](const auto& p) { return areTogether(p[0], p[1]); }),
                  open_.end());
    }
    const bool hardly_any = (all - open_.size()) * FEW < all;
    unfinished_ = hardly_any && budget_ == 0 ? unfinished_ + 1 : 0;
    if (unfinished_ > 0 && unfinished_ % RUNS_TO_FINISH != 0) return;
    if (hardly_any) left_out_runs_ = next_left_out_;
    next_left_out_ = hardly_any ? std::min(2 * next_left_out_ + 1, MOST_LEFT_OUT) : RUNS_LEFT_OUT;
  }

  /// From now on those in the list are marked, and no others.
  void mark(const std::vector<std::uint32_t>& cells) {
    ++mark_;
    for (const std::uint32_t c : cells) marks_[c] = mark_;
  }
  /// And marks it. One that is marked is in the list.
  void add(std::uint32_t cell, std::vector<std::uint32_t>& cells) {
    if (isMarked(cell)) return;
    marks_[cell] = mark_;
    cells.push_back(cell);
  }

  /// Those of more than a few cells, in the order of their first cells.
  std::vector<std::vector<std::uint32_t>> componentsOf(const std::vector<std::uint32_t>& cells) {
    std::vector<std::vector<std::uint32_t>> components;
    mark(cells);
    for (const std::uint32_t start : cells) {
      if (!isMarked(start)) continue;
      std::vector<std::uint32_t> component{start};
      marks_[start] = 0;
      for (std::size_t i = 0; i < component.size(); ++i) {
        for (auto n = cells_.firstNeighbour(component[i]); n != cells_.lastNeighbour(component[i]); ++n) {
          if (n->cell == SurfaceCells::BORDER || !isMarked(n->cell)) continue;
          marks_[n->cell] = 0;
          component.push_back(n->cell);
        }
      }
      if (component.size() >= FEWEST_CELLS) components.push_back(std::move(component));
    }
    return components;
  }

  void certifyPart(std::vector<std::uint32_t> cells, const ViewPlane& plane, View& view) {
    for (std::size_t i = 0; i < TRIES; ++i) {
      mark(cells);
      border_.clear();
      border_cell_.clear();
      std::size_t won = 0;
      for (const std::uint32_t c : cells) {
        for (auto n = cells_.firstNeighbour(c); n != cells_.lastNeighbour(c); ++n) {
          if (n->cell != SurfaceCells::BORDER && isMarked(n->cell)) {
            won += c < n->cell && !areTogether(c, n->cell);
            continue;
          }
          border_.insert(border_.end(), cells_.firstSide(*n), cells_.lastSide(*n));
          border_cell_.resize(border_.size(), c);
        }
      }
      // A pair of cells saves about what two edges of the border take; those of a long one meet more others in a sweep.
      const bool is_long = border_.size() > LONG_BORDER;
      if (cells.size() < cells_.count() && 4 * won < (is_long ? 5 : 2) * border_.size()) return;
      if (!canPay(border_.size())) return;
      ++view.tries;
      if (contour_.isSimple(border_, plane, vertices_)) {
        for (const std::uint32_t c : cells) parts_of_[c] |= std::uint64_t{1} << part_count_;
        ++part_count_;
        return;
      }
      bad_cells_.clear();
      for (std::size_t s = 0; s < border_.size(); ++s) {
        if (!contour_.bad()[s] || marks_[border_cell_[s]] == 0) continue;
        marks_[border_cell_[s]] = 0;
        bad_cells_.push_back(border_cell_[s]);
      }
      if (view.tries > TRIES_BY_CELLS) {
        for (std::size_t b = 0, last = bad_cells_.size(); b < last; ++b) {
          for (auto n = cells_.firstNeighbour(bad_cells_[b]); n != cells_.lastNeighbour(bad_cells_[b]); ++n) {
            if (n->cell == SurfaceCells::BORDER || !isMarked(n->cell)) continue;
            marks_[n->cell] = 0;
            bad_cells_.push_back(n->cell);
          }
        }
      }
      view.dropped.insert(view.dropped.end(), bad_cells_.begin(), bad_cells_.end());
      const bool too_many = view.stood_against > 0 && 4 * bad_cells_.size() > view.stood_against;
      view.stood_against = bad_cells_.size();
      if (too_many && bad_cells_.size() > FEWEST_CELLS) view.tries = TRIES;
      if (view.tries >= TRIES) return;
      cells.erase(std::remove_if(cells.begin(), cells.end(), [&](std::uint32_t c) { return !isMarked(c); }),
                  cells.end());
      std::vector<std::vector<std::uint32_t>> components = componentsOf(cells);
      if (components.empty()) return;
      const auto fewer = [](const auto& a, const auto& b) { return a.size() < b.size(); };
      cells = std::move(*std::max_element(components.begin(), components.end(), fewer));
    }
  }

  SurfaceCells cells_;
  Contour contour_;
  const VertexMotion* vertices_ = nullptr;
  std::size_t part_count_ = 0, left_out_runs_ = 0, first_view_ = 0, budget_ = 0, next_left_out_ = RUNS_LEFT_OUT;
  std::uint32_t allowed_ = ALL_VIEWS;
  std::array<View, simd::VIEWS> per_view_;
  bool is_first_run_ = true;
  std::size_t unfinished_ = 0;           // runs one after another
  std::vector<std::uint64_t> parts_of_;  // per cell: a bit for each part that holds it
  std::vector<std::uint32_t> views_;     // per cell: views that all its faces face
  std::vector<std::uint64_t> marks_;     // per cell
  std::uint64_t mark_ = 0;
  std::vector<Contour::Side> border_;
  std::vector<std::uint32_t> border_cell_, bad_cells_;
  std::vector<std::array<std::uint32_t, 2>> open_;  // cells beside each other that no part holds
};

Unfolded::Unfolded(const SceneBody& body) {
  if (!meetsItself(body.setup) || body.tree(FeatureKind::FACE).featureCount() == 0) return;
  search_ = std::make_unique<Search>(body);
  for (const FeatureKind kind : {FeatureKind::VERTEX, FeatureKind::EDGE, FeatureKind::FACE}) {
    for (std::size_t l = 0; l < body.tree(kind).height(); ++l) {
      parts_[static_cast<int>(kind)].levels_.emplace_back(body.tree(kind).level(l).groups);
    }
  }
}

Unfolded::~Unfolded() = default;
Unfolded::Unfolded(Unfolded&&) noexcept = default;

void Unfolded::run(const SceneBody& body, const VertexMotion* vertices, const Parallel& parallel) {
  clear();
  if (!search_) return;
  part_count_ = search_->run(body, vertices, parallel, whole_);
  if (part_count_ == 0) return;
  for (const FeatureKind kind : {FeatureKind::VERTEX, FeatureKind::EDGE, FeatureKind::FACE}) {
    std::vector<std::vector<std::uint64_t>>& levels = parts_[static_cast<int>(kind)].levels_;
    if (!whole_) search_->markGroups(body, kind, levels);
    for (std::vector<std::uint64_t>& level : levels) {
      if (whole_) std::fill(level.begin(), level.end(), 1);
    }
  }
  const std::vector<std::uint64_t>& edges = parts_[static_cast<int>(FeatureKind::EDGE)].levels_[0];
  const auto in_none = static_cast<std::size_t>(std::count(edges.begin(), edges.end(), std::uint64_t{0}));
  holds_most_ = MOST_IN_NONE * in_none < edges.size();
}

}  // namespace dccd
