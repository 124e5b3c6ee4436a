// From what the pairs found to the list of contacts, in their order.
#include <algorithm>
#include <array>

#include "step/history.h"
#include "step/start/segment_triangle.h"

namespace dccd {
namespace {

using Clock = Deadline::Clock;

constexpr std::size_t CONTACT_PIECE = 16384;  // contacts in a unit of writing them out
constexpr std::size_t HITS_TO_SHARE = 4096;   // from here on the kinds are sorted side by side
constexpr std::size_t CONTACTS_PER_LOOK_AT_THE_CLOCK = 256;
constexpr std::size_t HITS_AHEAD = 48, FEATURES_AHEAD = 16;  // that are fetched from memory

/// Marks the contacts that meet at t=0 already, many at a time.
class InitialMarks {
 public:
  explicit InitialMarks(const Step& step) : step_(step) {}
  ~InitialMarks() { flush(); }

  void ask(Contact& contact) {
    const auto base = static_cast<std::uint32_t>(4 * count_);
    for (std::size_t i = 0; i < 4; ++i) {
      const Vec3& x = (*step_.bodies[contact.bodyOf(i)].t0)[contact.vertex[i]];
      std::copy_n(x.data(), 3, positions_[base + i]);
    }
    // A vertex is a segment without length, an edge a triangle without area.
    corners_[count_] = contact.kind == PairKind::VERTEX_FACE
                           ? std::array<std::uint32_t, 5>{base, base, base + 1, base + 2, base + 3}
                           : std::array<std::uint32_t, 5>{base, base + 1, base + 2, base + 3, base + 3};
    contacts_[count_] = &contact;
    if (++count_ == CAPACITY) flush();
  }

 private:
  static constexpr std::size_t CAPACITY = 32;

  void flush() {
    std::array<std::uint8_t, CAPACITY> meet;
    segmentsMeetTriangles(positions_[0], corners_.data(), count_, meet.data());
    for (std::size_t i = 0; i < count_; ++i) contacts_[i]->initial = meet[i] != 0;
    count_ = 0;
  }

  const Step& step_;
  std::size_t count_ = 0;
  std::array<Contact*, CAPACITY> contacts_;
  std::array<std::array<std::uint32_t, 5>, CAPACITY> corners_;
  alignas(64) double positions_[4 * CAPACITY][8] = {};
};

void writeContact(const SceneArrays& scene, PairKind kind, const Hit& hit, Contact& c) {
  c.kind = kind;
  c.toc_lower = hit.toc_lower;
  c.toc_upper = hit.toc_upper;
  c.certainty = hit.certainty;
  c.body = {static_cast<std::uint16_t>(hit.bodies >> 16), static_cast<std::uint16_t>(hit.bodies)};
  const std::size_t first_size = factsOf(kind).vertices[0];
  scene.featureVertices(firstKind(kind), c.body[0], static_cast<Index>(hit.key >> 32), c.vertex.data());
  scene.featureVertices(secondKind(kind), c.body[1], static_cast<Index>(hit.key), c.vertex.data() + first_size);
}

}  // namespace

void PairSearch::collect(const Part& part, Findings& result) {
  const SceneArrays& scene = part.scene;
  const Threads& threads = part.prepared.threads;
  const Clock::time_point start = Clock::now();
  for (const PairWorker& w : workers_) {
    result.stats += w.stats();
    result.unchecked_toc_lower = std::min(result.unchecked_toc_lower, w.uncheckedTocLower());
  }
  constexpr std::array<PairKind, 2> KINDS{PairKind::VERTEX_FACE, PairKind::EDGE_EDGE};
  std::size_t all = 0;
  for (const PairWorker& w : workers_) {
    for (const PairKind kind : KINDS) all += w.hits(kind).size();
  }
  threads(2, all < HITS_TO_SHARE ? 2 : 1, [&](std::size_t first, std::size_t last) {
    for (std::size_t k = first; k < last; ++k) {
      std::vector<const std::vector<Hit>*> parts;
      for (const PairWorker& w : workers_) parts.push_back(&w.hits(KINDS[k]));
      order_[k].sort(std::move(parts));
      if (KINDS[k] == PairKind::VERTEX_FACE) result.contacts.assign(all, Contact());  // there are fewer of these
    }
  });
  std::size_t base = 0;
  for (std::size_t k = 0; k < KINDS.size(); ++k) {
    const PairKind kind = KINDS[k];
    const HitOrder& sorted = order_[k];
    threads(sorted.size(), CONTACT_PIECE, [&](std::size_t first, std::size_t last) {
      InitialMarks marks(part.step);
      bool late = false;
      for (std::size_t i = first; i < last; ++i) {
        if (i % CONTACTS_PER_LOOK_AT_THE_CLOCK == 0) late = late || part.deadline.isOver();
        // Sorted by key, the hits lie anywhere in memory: the next ones are fetched while this one is written.
        if (i + HITS_AHEAD < last) {
          const Hit& next = sorted[i + HITS_AHEAD];
          __builtin_prefetch(&next);
          __builtin_prefetch(&next.certainty);  // half of them lie across two cache lines
        }
        if (i + FEATURES_AHEAD < last) {
          const Hit& later = sorted[i + FEATURES_AHEAD];
          scene.prefetchFeature(secondKind(kind), later.bodies & 0xffff, static_cast<Index>(later.key));
        }
        Contact& contact = result.contacts[base + i];
        writeContact(scene, kind, sorted[i], contact);
        if (contact.toc_lower > 0 || (late && contact.certainty == Certainty::UNDECIDED)) continue;
        // Closer than a separation counts as meeting: of such pairs the time of contact itself is the answer.
        contact.initial = scene.separation(contact.body[0], contact.body[1]) > 0 || scene.uncertain();
        if (!contact.initial) marks.ask(contact);
      }
    });
    base += sorted.size();
  }
  if (result.cut) {  // what was found beyond depends on the threads
    const auto undecided = [](const Contact& c) { return c.certainty == Certainty::UNDECIDED; };
    result.stats.undecided =
        static_cast<std::uint64_t>(std::count_if(result.contacts.begin(), result.contacts.end(), undecided));
  }
  result.stats[Stage::SORT] = {result.contacts.size(), result.contacts.size(), msSince(start)};
}

}  // namespace dccd
