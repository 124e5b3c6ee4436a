#include "report/player_data.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "report/words.h"

namespace dccd {
namespace {

constexpr double QUANTA_OF_A_BODY = 16384;
constexpr std::int32_t FARTHEST = 1 << 28;  // so that a difference fits 31 bits after zigzag
constexpr std::size_t FRAME_BYTES = 60;     // of its row in JSON, besides positions and details

std::string base64(const std::string& bytes) {
  static const char DIGITS[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      three = three << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    }
    for (std::size_t k = 0; k < 4; ++k) text += i + k > bytes.size() ? '=' : DIGITS[three >> (18 - 6 * k) & 63];
  }
  return text;
}

// Hundredths of a millimetre: what a page has use for.
double rounded(double x) { return std::isfinite(x) ? std::round(x * 1e5) / 1e5 : 0; }
nlohmann::json rounded(const Vec3& v) { return {rounded(v.x()), rounded(v.y()), rounded(v.z())}; }

Box boxOf(const Positions& positions) {
  Box box;
  for (const Vec3& p : positions) {
    if (!p.allFinite()) continue;
    box.min = box.min.cwiseMin(p);
    box.max = box.max.cwiseMax(p);
  }
  return box;
}

std::string dumped(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

void appendDifferences(const PlayerData::Quanta& now, const PlayerData::Quanta* before, std::string& bytes) {
  for (std::size_t i = 0; i < now.size(); ++i) {
    const std::int32_t difference = now[i] - (before ? (*before)[i] : 0);
    std::uint32_t rest = (static_cast<std::uint32_t>(difference) << 1) ^ static_cast<std::uint32_t>(difference >> 31);
    for (; rest >= 128; rest >>= 7) bytes += static_cast<char>((rest & 127) | 128);
    bytes += static_cast<char>(rest);
  }
}

std::size_t PlayerData::shapeOf(const std::shared_ptr<const Topology>& topology) {
  const auto same = [&](const Shape& s) { return s.topology && (s.topology == topology || *s.topology == *topology); };
  // The newest first: a body that changes is seldom what it was long ago.
  const auto known = std::find_if(shapes_.rbegin(), shapes_.rend(), same);
  if (known != shapes_.rend()) return static_cast<std::size_t>(shapes_.rend() - known) - 1;
  nlohmann::json j = {{"vertices", topology->vertexCount()}};
  if (topology->hasFaces()) {
    j["faces"] = topology->faces();
  } else {
    j["edges"] = topology->edges();
  }
  shapes_.push_back({topology, dumped(j)});
  bytes_ += shapes_.back().json.size();
  return shapes_.size() - 1;
}

PlayerData::Place PlayerData::placeOf(std::size_t b, const Body& body, bool at_start) {
  const auto& positions = at_start ? body.t0 : body.t1;
  if (!positions || !body.topology || positions->size() != body.topology->vertexCount()) return {};
  if (grids_.size() <= b) grids_.resize(b + 1);
  if (!grids_[b]) {
    const Box box = boxOf(*positions);
    if (box.empty()) return {};
    grids_[b] = Grid{std::max((box.max - box.min).norm(), 1e-6) / QUANTA_OF_A_BODY, 0.5 * (box.min + box.max)};
  }
  if (last_places_.size() <= b) last_places_.resize(b + 1);
  Place& last = last_places_[b];
  if (last.source != positions || !last.quanta) {
    Quanta quanta;
    quanta.reserve(3 * positions->size());
    for (const Vec3& p : *positions) {
      for (int k = 0; k < 3; ++k) {
        const double q = std::round((p[k] - grids_[b]->origin_m[k]) / grids_[b]->quantum_m);
        quanta.push_back(std::isfinite(p[k]) ? static_cast<std::int32_t>(std::clamp<double>(q, -FARTHEST, FARTHEST))
                                             : NOT_FINITE);
      }
    }
    if (!last.quanta || *last.quanta != quanta) last.quanta = share(std::move(quanta));
    last.source = positions;
  }
  last.shape = shapeOf(body.topology);
  return last;
}

std::string PlayerData::detailsOf(const Outcome& o, StampNs origin_ns) const {
  std::vector<std::size_t> order(o.contacts.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto before = [&](std::size_t a, std::size_t b) {
    const Contact &x = o.contacts[a], &y = o.contacts[b];
    return std::tie(x.initial, x.expected, x.toc_lower, a) < std::tie(y.initial, y.expected, y.toc_lower, b);
  };
  const std::size_t most = std::min(order.size(), MOST_CONTACTS);
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(most), order.end(), before);
  order.resize(most);
  nlohmann::json contacts = nlohmann::json::array(), patches = nlohmann::json::array();
  for (const std::size_t i : order) {
    const Contact& c = o.contacts[i];
    nlohmann::json row = {static_cast<int>(c.kind), c.body[0], c.body[1], nlohmann::json::array()};
    forContactVertices(c, [&](std::uint16_t, Index v) { row[3].push_back(v); });
    row.push_back((c.certainty == Certainty::CERTAIN ? 1 : 0) | (c.initial ? 2 : 0) | (c.leaving ? 4 : 0) |
                  (c.expected ? 8 : 0));
    row.push_back(c.toc_lower);
    row.push_back(c.toc_upper);
    row.push_back(rounded(contactGeometry(o, c).point));
    const std::uint32_t patch = i < o.patch_of.size() ? o.patch_of[i] : NO_PATCH;
    row.push_back(patch == NO_PATCH ? 0 : o.patches[patch].id);
    if (c.body[1] == OBSTACLE_BODY) row.push_back({c.voxel.x, c.voxel.y, c.voxel.z, c.voxel_size});
    contacts.push_back(std::move(row));
  }
  for (std::size_t i = 0; i < std::min(o.patches.size(), MOST_PATCHES); ++i) {
    const Patch& p = o.patches[i];
    const auto seconds = [&](StampNs ns) {
      return ns == UNKNOWN_NS ? nlohmann::json() : nlohmann::json(secondsBetween(origin_ns, ns));
    };
    patches.push_back({p.id, p.body[0], p.body[1], toString(p.beginning), p.contacts, p.crossings, p.expected,
                       p.toc_lower, p.toc_upper, p.area_m2, rounded(p.centroid), rounded(p.normal),
                       seconds(p.began_from_ns), seconds(p.began_to_ns)});
  }
  return dumped({{"n", o.total_contacts}, {"np", o.patches.size()}, {"c", contacts}, {"p", patches}});
}

void PlayerData::addFrame(Frame frame) {
  std::size_t delta_bytes = 0;
  std::string differences;
  for (std::size_t b = 0; b < frame.places.size(); ++b) {
    const Place& place = frame.places[b];
    if (!place.quanta) continue;
    const Place* before = frames_.empty() || b >= frames_.back().places.size() ? nullptr : &frames_.back().places[b];
    const bool follows = before && before->quanta && before->quanta->size() == place.quanta->size();
    if (follows && before->quanta == place.quanta) continue;
    differences.clear();
    appendDifferences(*place.quanta, follows ? before->quanta.get() : nullptr, differences);
    delta_bytes += differences.size();
  }
  frame.bytes = FRAME_BYTES + delta_bytes * 4 / 3 + frame.details.size();
  bytes_ += frame.bytes;
  frames_.push_back(std::move(frame));
  // A long run of thinnings that finds nothing more to leave out ends: what is kept for ever is little.
  while (bytes_ > budget_bytes_ && frames_.size() > 2) {
    const std::size_t had = frames_.size();
    thin();
    if (frames_.size() == had) break;
  }
}

void PlayerData::thin() {
  std::size_t of_level[3] = {0, 0, 0};
  for (const Frame& f : frames_) ++of_level[f.level];
  // Quiet ones go first, down to as many as there are with events; then both thin alike.
  const Level level = of_level[QUIET] > 1 && of_level[QUIET] >= of_level[EVENT] ? QUIET : EVENT;
  if (of_level[level] < 2) return;
  stride_[level] *= 2;
  const std::uint64_t stride = stride_[level];
  frames_.erase(std::remove_if(frames_.begin(), frames_.end(),
                               [&](const Frame& f) { return f.level == level && f.ordinal % stride != 0; }),
                frames_.end());
  // A shape that no frame has any more goes with its last frame; its number stays.
  std::vector<bool> used(shapes_.size(), false);
  for (const Frame& f : frames_) {
    for (const Place& p : f.places) {
      if (p.quanta) used[p.shape] = true;
    }
  }
  for (const Place& p : last_places_) {
    if (p.quanta) used[p.shape] = true;
  }
  bytes_ = 0;
  for (std::size_t s = 0; s < shapes_.size(); ++s) {
    if (!used[s]) shapes_[s] = {nullptr, "null"};
    bytes_ += shapes_[s].json.size();
  }
  for (const Frame& f : frames_) bytes_ += f.bytes;
}

namespace {

/// Of the leaves that meet `around`, those that are nearest to `bodies`. False: there are more.
bool takeNearest(const std::vector<OccupiedLeaf>& leaves, double resolution_m, const Box& bodies, const Box& around,
                 std::vector<OccupiedLeaf>& taken) {
  std::vector<std::pair<double, OccupiedLeaf>> near;  // by how far it is from the bodies' box
  for (const OccupiedLeaf& leaf : leaves) {
    const Vec3 low(voxelPlane(leaf.min.x, resolution_m), voxelPlane(leaf.min.y, resolution_m),
                   voxelPlane(leaf.min.z, resolution_m));
    const Vec3 high = low.array() + leaf.size * resolution_m;
    if ((high.array() < around.min.array()).any() || (low.array() > around.max.array()).any()) continue;
    const Vec3 away = (low - bodies.max).cwiseMax(bodies.min - high).cwiseMax(0);
    near.emplace_back(away.norm(), leaf);
  }
  const auto nearer = [](const auto& a, const auto& b) {
    return std::tie(a.first, a.second.min) < std::tie(b.first, b.second.min);
  };
  const bool all = near.size() <= PlayerData::MOST_VOXELS;
  if (!all) {
    std::nth_element(near.begin(), near.begin() + PlayerData::MOST_VOXELS, near.end(), nearer);
    near.resize(PlayerData::MOST_VOXELS);
  }
  std::sort(near.begin(), near.end(), nearer);
  for (const auto& [away, leaf] : near) taken.push_back(leaf);
  return all;
}

std::vector<OccupiedLeaf> leavesOf(const OwnVoxels& own, bool doubted) {
  std::vector<OccupiedLeaf> leaves;
  if (!own.voxels) return leaves;
  for (const OwnVoxel& voxel : *own.voxels) {
    if (voxel.doubted == doubted) leaves.push_back({voxel.key, 1});
  }
  return leaves;
}

nlohmann::json listOf(const std::vector<OccupiedLeaf>& leaves) {
  nlohmann::json list = nlohmann::json::array();
  for (const OccupiedLeaf& leaf : leaves) {
    for (const std::uint32_t x :
         {std::uint32_t{leaf.min.x}, std::uint32_t{leaf.min.y}, std::uint32_t{leaf.min.z}, leaf.size}) {
      list.push_back(x);
    }
  }
  return list;
}

}  // namespace

// The leaves near the bodies. All leaves are looked through when the map changes, and when the bodies leave the box
// that was looked at, which reaches half of their size beyond them.
void PlayerData::addVoxels(const Outcome& o, double from_s) {
  if (!o.obstacle) return;
  const OwnVoxels& own = o.step->map.own;
  const bool is_empty = o.obstacle->leafCount() == 0 && own.own + own.doubted == 0;
  if (is_empty && voxels_.empty()) return;
  const Eigen::Isometry3d at_end = o.step->map.fromFixedAt(1);
  Box bodies;
  for (const Body& body : o.step->bodies) {
    if (!body.t1 || !meetsMap(body)) continue;
    const Box box = boxOf(*body.t1);
    if (box.empty()) continue;
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3 p = at_end * Vec3(corner & 1 ? box.max.x() : box.min.x(), corner & 2 ? box.max.y() : box.min.y(),
                                   corner & 4 ? box.max.z() : box.min.z());
      bodies.min = bodies.min.cwiseMin(p);
      bodies.max = bodies.max.cwiseMax(p);
    }
  }
  if (bodies.empty()) return;
  const bool is_inside = !looked_at_.empty() && (looked_at_.min.array() <= bodies.min.array()).all() &&
                         (bodies.max.array() <= looked_at_.max.array()).all();
  if (o.obstacle == surface_ && own.voxels == own_ && is_inside && o.step->map.way.empty()) return;
  const double resolution_m = o.obstacle->resolution();
  const double beyond_m = 0.5 * (bodies.max - bodies.min).norm() + 4 * resolution_m;
  looked_at_ = {bodies.min.array() - beyond_m, bodies.max.array() + beyond_m};
  surface_ = o.obstacle;
  own_ = own.voxels;
  if (voxels_kept_ >= 10 * MOST_VOXELS) {
    ++maps_left_out_;
    return;
  }
  Voxels voxels{from_s, resolution_m, at_end.inverse(), {}, {}, {}, true};
  voxels.all &= takeNearest(o.obstacle->leaves(), resolution_m, bodies, looked_at_, voxels.leaves);
  voxels.all &= takeNearest(leavesOf(own, false), resolution_m, bodies, looked_at_, voxels.own);
  voxels.all &= takeNearest(leavesOf(own, true), resolution_m, bodies, looked_at_, voxels.doubted);
  voxels_kept_ += voxels.leaves.size() + voxels.own.size() + voxels.doubted.size();
  voxels_.push_back(std::move(voxels));
}

void PlayerData::add(const Outcome& o, const std::vector<Body>& bodies, StampNs origin_ns, bool keep) {
  if (!o.answered || !o.step) return;
  for (std::size_t b = names_.size(); b < bodies.size(); ++b) names_.push_back(bodies[b].name);
  const auto seconds = [&](StampNs ns) { return secondsBetween(origin_ns, ns); };
  addVoxels(o, seconds(o.start_ns));
  const bool begins = end_ns_ != o.start_ns;  // after a seam the step's start is a frame of its own
  for (const bool at_start : {true, false}) {
    if (at_start && !begins) continue;
    ++seen_;
    const Level level = at_start ? QUIET : keep ? KEPT : o.patch_events.empty() ? QUIET : EVENT;
    const std::uint64_t ordinal = count_[level]++;
    if (level != KEPT && ordinal % stride_[level] != 0) continue;
    Frame frame{seconds(o.start_ns),
                seconds(at_start ? o.start_ns : o.stamp_ns),
                o.sequence,
                level,
                ordinal,
                {},
                at_start ? "null" : detailsOf(o, origin_ns),
                0};
    for (std::size_t b = 0; b < o.step->bodies.size(); ++b)
      frame.places.push_back(placeOf(b, o.step->bodies[b], at_start));
    addFrame(std::move(frame));
  }
  end_ns_ = o.stamp_ns;
}

std::string PlayerData::json() {
  nlohmann::json bodies = nlohmann::json::array();
  for (std::size_t b = 0; b < names_.size(); ++b) {
    nlohmann::json body = {{"name", names_[b]}};
    if (b < grids_.size() && grids_[b]) {
      body["quantum"] = grids_[b]->quantum_m;
      body["origin"] = {grids_[b]->origin_m.x(), grids_[b]->origin_m.y(), grids_[b]->origin_m.z()};
    }
    bodies.push_back(std::move(body));
  }
  nlohmann::json maps = nlohmann::json::array();
  for (const Voxels& v : voxels_) {
    nlohmann::json matrix = nlohmann::json::array();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) matrix.push_back(v.fixed_from_map.matrix()(row, column));
    }
    maps.push_back({{"from", v.from_s},
                    {"resolution", v.resolution_m},
                    {"matrix", matrix},
                    {"leaves", listOf(v.leaves)},
                    {"all", v.all}});
    if (!v.own.empty()) maps.back()["own"] = listOf(v.own);
    if (!v.doubted.empty()) maps.back()["doubted"] = listOf(v.doubted);
  }
  // In the order of the frames: of each body its shape, or -1; then its positions in `bytes`.
  std::string text =
      "{\"bodies\":" + dumped(bodies) + ",\"seen\":" + std::to_string(seen_) +
      ",\"not_finite\":" + std::to_string(NOT_FINITE) + ",\"most_contacts\":" + std::to_string(MOST_CONTACTS) +
      ",\"maps_left_out\":" + std::to_string(maps_left_out_) + ",\"maps\":" + dumped(maps) + ",\"shapes\":[";
  for (std::size_t s = 0; s < shapes_.size(); ++s) text += (s ? "," : "") + shapes_[s].json;
  text += "],\"frames\":[";
  std::string bytes;
  const Frame* last = nullptr;
  for (const Frame& f : frames_) {
    nlohmann::json shapes = nlohmann::json::array();
    for (std::size_t b = 0; b < f.places.size(); ++b) {
      const Place& place = f.places[b];
      shapes.push_back(place.quanta ? static_cast<std::int64_t>(place.shape) : -1);
      if (!place.quanta) continue;
      const Place* before = last && b < last->places.size() ? &last->places[b] : nullptr;
      const bool follows = before && before->quanta && before->quanta->size() == place.quanta->size();
      const bool unchanged = follows && before->quanta == place.quanta;
      bytes += static_cast<char>(unchanged ? 0 : follows ? 1 : 2);
      if (!unchanged) appendDifferences(*place.quanta, follows ? before->quanta.get() : nullptr, bytes);
    }
    text += std::string(last ? "," : "") + "[" + dumped(f.from_s) + ',' + dumped(f.to_s) + ',' +
            std::to_string(f.step) + ',' + dumped(shapes) + ',' + f.details + ']';
    last = &f;
  }
  return text + "],\"bytes\":\"" + base64(bytes) + "\"}";
}

}  // namespace dccd
