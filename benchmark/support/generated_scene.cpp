#include "support/generated_scene.h"

#include <stdexcept>

namespace dccd {
namespace test {

const char* toString(GeneratedKind kind) {
  switch (kind) {
    case GeneratedKind::CLOTH_BALL:
      return "clothball";
    case GeneratedKind::N_BODY:
      return "nbody";
    case GeneratedKind::CLOTH_BONE:
      return "clothbone";
    case GeneratedKind::DRAGON:
      return "dragon";
    case GeneratedKind::LION:
      return "lion";
    case GeneratedKind::COUNT:
      break;
  }
  return "unknown";
}

GeneratedKind generatedKindFromString(const std::string& text) {
  for (int k = 0; k < static_cast<int>(GeneratedKind::COUNT); ++k) {
    if (text == toString(static_cast<GeneratedKind>(k))) return static_cast<GeneratedKind>(k);
  }
  throw std::invalid_argument("unknown generated scene '" + text + "'; known: clothball nbody clothbone dragon lion");
}

std::size_t GeneratedSequence::triangleCount() const {
  std::size_t count = 0;
  for (const GeneratedBody& body : bodies_) count += body.topology.faces().size();
  return count;
}

bool GeneratedSequence::advance() {
  if (frame_ + 1 >= frame_count_) return false;
  compute(++frame_);
  return true;
}

void GeneratedSequence::advanceTo(std::size_t frame) {
  if (frame >= frame_count_) throw std::invalid_argument("frame " + std::to_string(frame) + " is past the last one");
  if (closedForm() && frame > frame_) {
    frame_ = frame;
    compute(frame_);
    return;
  }
  while (frame_ < frame) advance();
}

void GeneratedSequence::addBody(const std::string& name, std::size_t vertex_count, const std::vector<Face>& faces,
                                bool deforms) {
  Index offset = 0;
  if (!bodies_.empty()) {
    offset = bodies_.back().vertex_offset + static_cast<Index>(bodies_.back().topology.vertexCount());
  }
  bodies_.push_back({name, Topology::fromTriangles(vertex_count, faces), offset, deforms});
}

std::unique_ptr<GeneratedSequence> generateSequence(GeneratedKind kind, const GeneratedOptions& options) {
  switch (kind) {
    case GeneratedKind::CLOTH_BALL:
      return generateClothBall(options);
    case GeneratedKind::N_BODY:
      return generateNBody(options);
    case GeneratedKind::CLOTH_BONE:
      return generateClothBone(options);
    case GeneratedKind::DRAGON:
      return generateDragon(options);
    case GeneratedKind::LION:
      return generateLion(options);
    case GeneratedKind::COUNT:
      break;
  }
  throw std::invalid_argument("not a kind of generated scene");
}

}  // namespace test
}  // namespace dccd
