// Moving scenes made by code from a seed, of the kinds and sizes of the paper's benchmarks (its Figures 1 and 12): what
// the benchmark measures on where the original sequences cannot be had. The motion is physically plausible and simple:
// position-based cloth, bouncing balls, flying fragments. Contacts are not resolved beyond that, surfaces pass through
// each other where they meet, and nothing is chosen with a filter in mind.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "dccd/topology.h"
#include "dccd/types.h"

namespace dccd {
namespace test {

enum class GeneratedKind : std::uint8_t {
  CLOTH_BALL = 0,  ///< 92K triangles, 94 frames: a sheet drops onto a ball that starts to rotate
  N_BODY,          ///< 146K, 96 frames: hundreds of slightly deforming balls fall into a box
  CLOTH_BONE,      ///< 108K + 47K, 90 frames: a sheet drops onto a bone at rest
  DRAGON,          ///< 252K, 64 frames: a lumpy body flies through another and breaks it into pieces
  LION,            ///< 1.6M, 90 frames: a body of several layers shatters
  COUNT
};
const char* toString(GeneratedKind kind);
/// Parses the names that toString gives. Throws std::invalid_argument naming the text.
GeneratedKind generatedKindFromString(const std::string& text);

struct GeneratedBody {
  std::string name;
  Topology topology;
  Index vertex_offset = 0;  ///< of its vertex 0 in positions()
  bool deforms = true;      ///< false: rigid or at rest, so that it cannot meet itself
};

struct GeneratedOptions {
  std::uint64_t seed = 1;
  /// Triangles to aim at; 0 takes the kind's own number. Motion per step keeps its proportion to the triangles' size in
  /// DRAGON and LION, so that scenes of different sizes are of one kind.
  std::size_t triangles = 0;
};

/// A sequence of frames, produced one after the other. The same seed gives the same positions on one machine and build.
class GeneratedSequence {
 public:
  virtual ~GeneratedSequence() = default;
  const std::vector<GeneratedBody>& bodies() const { return bodies_; }
  std::size_t frameCount() const { return frame_count_; }
  std::size_t frame() const { return frame_; }
  std::size_t triangleCount() const;
  /// All bodies' vertices at the current frame [m], body after body.
  const Positions& positions() const { return positions_; }
  /// Goes to the next frame. Returns false, and stays, at the last one.
  bool advance();
  /// Goes forward to a frame; frames that need no simulation are skipped.
  void advanceTo(std::size_t frame);

 protected:
  explicit GeneratedSequence(std::size_t frame_count) : frame_count_(frame_count) {}
  /// Positions of frame number `frame`; called with growing numbers.
  virtual void compute(std::size_t frame) = 0;
  /// Whether compute() may skip frames.
  virtual bool closedForm() const { return false; }
  void addBody(const std::string& name, std::size_t vertex_count, const std::vector<Face>& faces, bool deforms);

  std::vector<GeneratedBody> bodies_;
  Positions positions_;

 private:
  std::size_t frame_count_;
  std::size_t frame_ = 0;
};

/// At frame 0.
std::unique_ptr<GeneratedSequence> generateSequence(GeneratedKind kind, const GeneratedOptions& options = {});

std::unique_ptr<GeneratedSequence> generateClothBall(const GeneratedOptions& options);
std::unique_ptr<GeneratedSequence> generateClothBone(const GeneratedOptions& options);
std::unique_ptr<GeneratedSequence> generateNBody(const GeneratedOptions& options);
std::unique_ptr<GeneratedSequence> generateDragon(const GeneratedOptions& options);
std::unique_ptr<GeneratedSequence> generateLion(const GeneratedOptions& options);

}  // namespace test
}  // namespace dccd
