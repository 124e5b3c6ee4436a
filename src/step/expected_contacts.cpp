#include "step/expected_contacts.h"

#include <stdexcept>

namespace dccd {
namespace {

constexpr std::size_t BITS = 64;
constexpr std::uint64_t FIRST_PARTNERS = 0x5555555555555555;

std::string nameOf(const ExpectedPartner& partner, const std::vector<Body>& bodies) {
  if (partner.body == OBSTACLE_BODY) return "the map";
  const std::string& name = bodies[partner.body].name;
  if (partner.vertices.empty()) return name;
  const std::string count = std::to_string(partner.vertices.size()) + " vertices";
  return name + (partner.set.empty() ? " (" + count + ")" : " ('" + partner.set + "', " + count + ")");
}

}  // namespace

void checkPartners(const std::vector<Expectation>& expected, std::size_t bodies) {
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const auto fail = [&](std::size_t side, const std::string& what) {
      throw std::invalid_argument("expected[" + std::to_string(i) + "]: partner " + std::to_string(side) + " " + what);
    };
    for (std::size_t side = 0; side < 2; ++side) {
      const ExpectedPartner& partner = expected[i].partners[side];
      const bool map = partner.body == OBSTACLE_BODY;
      if (map && side == 0) fail(side, "is the map; it comes second");
      if (map && !partner.vertices.empty()) fail(side, "is the map, which has no vertices");
      if (!map && partner.body >= bodies) {
        fail(side, "is body " + std::to_string(partner.body) + " of " + std::to_string(bodies));
      }
    }
  }
}

std::vector<std::string> describe(const std::vector<Expectation>& expected, const std::vector<Body>& bodies) {
  std::vector<std::string> sentences;
  for (const Expectation& one : expected) {
    const ExpectedPartner &first = one.partners[0], &second = one.partners[1];
    const std::string other = first == second ? "itself" : nameOf(second, bodies);
    sentences.push_back(nameOf(first, bodies) + " with " + other +
                        (one.phase.empty() ? "" : " in phase '" + one.phase + "'"));
  }
  return sentences;
}

void ExpectedContacts::set(const std::vector<Expectation>& expected, const std::vector<Body>& bodies) {
  checkPartners(expected, bodies.size());
  std::vector<Masks> masks(bodies.size() + 1);
  const std::size_t words = (2 * expected.size() + BITS - 1) / BITS;
  for (Masks& of_body : masks) of_body.anywhere.assign(words, 0);
  for (std::size_t bit = 0; bit < 2 * expected.size(); ++bit) {
    const ExpectedPartner& partner = expected[bit / 2].partners[bit % 2];
    const std::size_t word = bit / BITS;
    const Word one = Word{1} << bit % BITS;
    Masks& of_body = masks[partner.body == OBSTACLE_BODY ? bodies.size() : partner.body];
    if (partner.vertices.empty()) {
      of_body.anywhere[word] |= one;
      continue;
    }
    const std::size_t count = bodies[partner.body].topology->vertexCount();
    of_body.vertices.resize(words * count, 0);
    for (const Index v : partner.vertices) {
      if (v >= count) {
        throw std::invalid_argument("expected contacts of body '" + bodies[partner.body].name + "' name vertex " +
                                    std::to_string(v) + ", but the mesh has " + std::to_string(count));
      }
      of_body.vertices[words * v + word] |= one;
    }
  }
  masks_ = std::move(masks);
  words_ = words;
}

/// Bits of the partners that hold all of the feature.
ExpectedContacts::Word ExpectedContacts::heldBy(const Feature& feature, std::size_t word) const {
  const Masks& masks = masksOf(feature.body);
  Word held = masks.vertices.empty() || !feature.whole || feature.begin == feature.end ? 0 : ~Word{0};
  for (const Index* v = feature.begin; held != 0 && v != feature.end; ++v) held &= masks.vertices[words_ * *v + word];
  return held | masks.anywhere[word];
}

bool ExpectedContacts::isExpected(const Feature& a, const Feature& b) const {
  for (std::size_t word = 0; word < words_; ++word) {
    const Word by_a = heldBy(a, word), by_b = heldBy(b, word);
    if (((by_a & by_b >> 1) | (by_b & by_a >> 1)) & FIRST_PARTNERS) return true;
  }
  return false;
}

bool ExpectedContacts::isExpected(const Contact& contact) const {
  const Index *begin = contact.vertex.data(), *second = begin + factsOf(contact.kind).vertices[0];
  const Index* end = contact.body[1] == OBSTACLE_BODY ? second : begin + contact.vertex.size();
  return isExpected({contact.body[0], begin, second, true}, {contact.body[1], second, end, true});
}

/// Of a piece inside of a body only the first vertex is told, and of the body around it none.
bool ExpectedContacts::isExpected(const StartIntersection& start) const {
  const bool with_map = start.body[1] == OBSTACLE_BODY;
  const bool crossing = !with_map && start.vertex[1] != NO_INDEX;
  const Index *begin = start.vertex.data(), *second = begin + (crossing ? 2 : 1);
  const Index* end = crossing ? begin + start.vertex.size() : second;
  return isExpected({start.body[0], begin, second, crossing || with_map}, {start.body[1], second, end, crossing});
}

void ExpectedContacts::mark(Outcome& outcome) const {
  if (words_ == 0) return;
  for (Contact& contact : outcome.contacts) contact.expected = isExpected(contact);
  for (StartIntersection& start : outcome.intersections) start.expected = isExpected(start);
}

}  // namespace dccd
