// The other half of the start state (doc/algorithm.md): is a body inside of another, closed one at t=0, without an edge
// that meets a face?
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "culling/scene_arrays.h"

namespace dccd {

/// Where a closed triangle lies for one who looks from a point along +z.
enum class Sight : std::uint8_t { PAST, ABOVE, TOUCHED };

/// Exact, any finite doubles. Each argument: x, y, z. ABOVE is what the half-line upwards from the point crosses once
/// the point is moved by (e, e^2, 0), for all e > 0 below some bound: no line seen along z holds all these points, so
/// that the half-line meets no edge, and no face that is seen as a line. A point that is on no face of a closed surface
/// is moved within the room around it, so it is enclosed if the number of faces ABOVE is odd.
Sight sightOf(const double* point, const double* a, const double* b, const double* c);

/// Lists the pieces of a body (vertices that edges join) that lie in the solid of another body that has an inside
/// (SceneBody::hasInside): enclosed by its surface, as parity tells, or on it. A piece stands there with one vertex,
/// the one with the smallest number: where it is only partly inside, one of its edges meets a face, which
/// StartStateSearch lists. A body is not asked about itself. Pairs are those that meet() (body.h).
///
/// A body whose corners are doubled is closed while these are at one place throughout the step (culling/seams.h): it is
/// the same cycle then. When its seams come apart or close, all is asked anew.
///
/// What is known at the start of one step is carried over to the next, so that only the first frame, frames after a
/// reset and vertices that touched are asked about. Why that is complete: let a vertex v be on no face of B at any
/// time of the step. B's faces, an even number at each edge, are a cycle modulo 2, and whether v is enclosed is that
/// cycle's winding number around v, modulo 2. With v and the corners of B moving on straight paths, x - v for x on B
/// is a continuous motion of the cycle that never passes 0, so that the number stays what it is (homotopy), however
/// B deforms, turns, folds through itself or has faces without area. And where v is on a face of B at some time, 0 and
/// 1 included, that is a contact of v with that face (VF). So after a step in which every pair was decided, or kept
/// where it was not, the next start needs to ask about the vertices with such a contact, and no others. The same holds
/// for any part of the pairs, so a search that a deadline cuts goes on in the next step where it ended.
///
/// Needs the records and bounds of SceneArrays::refit() wherever there are two bodies or more.
class InsideSearch {
 public:
  /// All pairs unless `continues` (t=0 is t=1 of the step given to remember()), that step's contacts are known and all
  /// vertices of this one are finite. Sorted by vertex (body, number), then by the other body. Adds to in and out of
  /// stage and effect START_STATE; reads unchecked_vertices. Nothing more is asked once the deadline is over; isWhole()
  /// is false then.
  const std::vector<StartIntersection>& run(const SceneArrays& scene, bool continues, const Deadline& deadline,
                                            StepStats& stats);

  /// Whether the last run() came to all pairs: what it did not list is outside at t=0.
  bool isWhole() const { return whole_; }

  /// Contacts of the step just done (undecided ones included). complete: no other pair touches during it.
  void remember(const SceneArrays& scene, const std::vector<Contact>& contacts, bool complete);

  /// Nothing is known of a step before: the next run() asks about all pairs.
  void clear();
  bool isClear() const { return !known_ && !searched_ && inside_.empty() && open_.empty(); }
  /// The bodies change but for the first ones: what was learnt of their meshes is forgotten.
  void keepBodies(std::size_t count) { pieces_.resize(std::min(pieces_.size(), count)); }

 private:
  /// Is the vertex of `body` in the solid of `closed`?
  struct Question {
    std::uint32_t body;
    Index vertex;  ///< of the input
    std::uint32_t closed;
    Index internal;  ///< the same vertex
    std::array<std::uint32_t, 3> key() const { return {body, vertex, closed}; }
    friend bool operator<(const Question& x, const Question& y) { return x.key() < y.key(); }
    friend bool operator==(const Question& x, const Question& y) { return x.key() == y.key(); }
  };
  /// The vertex that stands for a piece.
  struct Piece {
    Index vertex, internal;
  };

  bool takeSurfaces(const SceneArrays& scene);
  static void list(const std::vector<Question>& inside, std::vector<StartIntersection>& out);
  static bool isInside(const SceneArrays& scene, const Question& question);  ///< at t=0
  void askOpen(const SceneArrays& scene, const Deadline& deadline);
  void search(const SceneArrays& scene, const Deadline& deadline);
  bool searchBodies(const SceneArrays& scene, const Deadline& deadline);
  void ask(const SceneArrays& scene, const Question& question);
  const std::vector<Piece>& piecesOf(const SceneArrays& scene, std::size_t body);

  std::vector<std::uint8_t> surfaces_;  // per body: whether it has an inside, and whether by its seams
  bool whole_ = false;
  bool known_ = false;                        // all contacts since the last run(): what that found can be carried over
  bool searched_ = false;                     // the search has come to its end
  std::array<std::uint32_t, 2> next_pair_{};  // of bodies: where a search that has not come to its end goes on,
  std::size_t next_piece_ = 0;                // with this piece of the first one; pairs are taken in ascending order
  std::vector<Question> inside_;              // answered with yes; all else that was asked is outside
  std::vector<Question> open_;  // to be asked again, since they touched; after run(): what is left of them
  std::vector<StartIntersection> intersections_;
  std::vector<std::array<std::uint32_t, 2>> body_pairs_;
  std::vector<std::uint32_t> overlapping_, scratch_;
  std::vector<std::vector<Piece>> pieces_;  // per body, ascending; empty until asked for
  bool pieces_of_all_ = true;               // they are those with all vertices finite
  std::uint64_t asked_ = 0;
};

}  // namespace dccd
