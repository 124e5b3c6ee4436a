// The start state of a step (doc/algorithm.md): do an edge and a face already meet at t=0?
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "culling/scene_arrays.h"
#include "culling/unfolded.h"
#include "dccd/types.h"
#include "step/pairs/found_limit.h"
#include "step/start/crossing_finder.h"
#include "step/start/neighbourhood.h"
#include "step/start/segment_triangle.h"

namespace dccd {

/// Goes on with a search that a deadline cut: through the pairs of bodies in ascending order from `next` on, of which
/// the first one begins at `place`, all later ones at 0. search() says whether it came to its pair's end. False: to the
/// last one's it did not, and `next` and `place` are where it goes on.
template <class Place, class Search>
bool goOn(std::vector<std::array<std::uint32_t, 2>>& pairs, std::array<std::uint32_t, 2>& next, Place& place,
          const Search& search) {
  std::sort(pairs.begin(), pairs.end());
  for (auto pair = std::lower_bound(pairs.begin(), pairs.end(), next); pair != pairs.end(); ++pair) {
    if (*pair != next) place = 0;
    next = *pair;
    if (!search()) return false;
  }
  return true;
}

/// What of the edges that meet faces is to be listed. The search ends where it has that.
struct CrossingsWanted {
  std::size_t most_found = FoundLimit::NONE;        ///< of more the first ones to be found
  bool one_is_enough = false;                       ///< the first one to be found alone
  const std::vector<Unfolded>* unfolded = nullptr;  ///< per body, in this step; null: nothing is known of them
};

/// Lists the edges that meet faces at t=0, touching included; pairs that share a vertex are left out. Pairs are those
/// of the bodies' setups: within bodies with self_collision, between bodies with against_bodies.
///
/// What is known at the start of one step is carried over to the next, so that only the first frame, frames after a
/// reset and the surroundings of contacts are tested. Why that is complete: let edge e and face f, which share no
/// vertex, be apart at t=0 and meet during the step, first at t* > 0. Suppose that at t* neither end of e is on f and e
/// meets no edge of f. Then the common point is inside of f, so f has an area (a face without area is the union of its
/// edges), and inside of e. Were e in the plane of f, it would leave f across an edge of f or end on f; so it crosses
/// the plane there, and still does so inside of f a little earlier: not the first time. Hence whatever starts to meet
/// during a step shows a contact of an end of e with f (VF) or of e with an edge of f (EE), and neither pair shares a
/// vertex, since e and f do not. So after a step in which every pair was decided, or kept where it was not, the next
/// start needs to look at:
///   EE contact (e, e'): e against the faces at e', e' against the faces at e;
///   VF contact (v, f): the edges at v against f;
///   and the pairs that met already at the step's start.
/// The same holds for any part of the pairs. So a search that a deadline cuts goes on in the next step where it ended:
/// what it was past is carried over, what it had not come to is looked at then.
///
/// The search. Where a body has faces, each of its edges has one that stands for it, and an edge that meets a face of
/// another body, or one with which it shares no vertex, does so with the face that stands for it. So pairs of faces are
/// looked for (half as many as of edges and faces), and of these the edges that may pass through (simd/face_filter.h).
/// Within a body there are those besides of which the two faces share the vertex opposite the edge. None of them meet
/// where the faces at that vertex are seen side by side along some axis. A body with faces that are left out, or with
/// none, is searched by its edges.
class StartStateSearch {
 public:
  /// Calls f(first, last) over [0, n), in pieces of about a size, side by side or not.
  using Parallel =
      std::function<void(std::size_t n, std::size_t piece, const std::function<void(std::size_t, std::size_t)>& f)>;
  static void oneByOne(std::size_t n, std::size_t, const std::function<void(std::size_t, std::size_t)>& f) { f(0, n); }

  /// Full test unless `continues` (t=0 is t=1 of the step given to remember()) and the last step's contacts are known.
  /// Found pairs are sorted by edge (body, index), then by face (body, vertex indices). Fills in and out of stage and
  /// effect START_STATE. Nothing more is tested once the deadline is over, but for what it takes to list what is
  /// found; isWhole() is false then. isCut() is true where not all that is found is wanted, and the next run() begins
  /// anew. threads: that parallel has, more than one if it is worth while.
  std::vector<StartIntersection> run(const SceneArrays& scene, bool continues, const Deadline& deadline,
                                     StepStats& stats, const CrossingsWanted& wanted = {}, std::size_t threads = 1,
                                     const Parallel& parallel = oneByOne);

  /// Whether the last run() came to all pairs: what it did not list is apart at t=0.
  bool isWhole() const { return whole_; }
  bool isCut() const { return cut_; }
  /// For what comes before run(): what the run() before found is listed again first.
  Deadline beforeListing(const Deadline& deadline) const { return beforeListing(found_, deadline); }

  /// Whether run() would search the bodies' trees.
  bool needsTrees(bool continues) const { return !(continues && known_ && searched_); }

  /// Contacts of the step just done (undecided ones included). complete: no other pair touches during it.
  void remember(const SceneArrays& scene, const std::vector<Contact>& contacts, bool complete);

  /// Nothing is known of a step before: the next run() is a full test.
  void clear();
  bool isClear() const { return !known_ && !searched_ && found_.empty() && candidates_.empty() && touched_.empty(); }
  /// The bodies change but for the first ones: what was learnt of their meshes is forgotten.
  void keepBodies(std::size_t count) { neighbourhoods_.resize(std::min(neighbourhoods_.size(), count)); }

 private:
  /// The features of a contact: what crosses after it lies around them.
  struct Touched {
    PairKind kind;
    std::uint16_t first_body, second_body;
    std::array<Index, 4> vertex;
  };
  using BodyPair = std::array<std::uint32_t, 2>;  // of the edge, of the face

  static Deadline beforeListing(const std::vector<EdgeFace>& found, const Deadline& deadline);
  template <class HasMore, class Expand, class Test>
  static bool inBlocks(std::vector<EdgeFace>& pairs, const std::vector<EdgeFace>& found, const Deadline& deadline,
                       const HasMore& hasMore, const Expand& expand, const Test& test);
  void testCandidates(const SceneArrays& scene, const Deadline& deadline);
  void search(const SceneArrays& scene, const Deadline& deadline, std::size_t threads, const Parallel& parallel);
  bool searchBodies(const SceneArrays& scene, const Deadline& deadline, std::size_t threads, const Parallel& parallel);
  void moveNear(const SceneArrays& scene, const Parallel& parallel);
  void viewFaces(const ClusterTree& faces, const Parallel& parallel);
  void setUnits(std::size_t fans);
  bool searchUnit(CrossingFinder& finder, const TreePair& trees, std::size_t unit, std::vector<EdgeFace>& found) const;
  void list(const SceneArrays& scene, const std::vector<EdgeFace>& pairs, std::vector<StartIntersection>& out,
            const Parallel& parallel);
  void addCandidates(const SceneArrays& scene, const Touched& contact, std::vector<EdgeFace>& out);
  void addFacesAtEdge(const SceneArrays& scene, std::uint32_t edge_body, const Index* edge, std::uint32_t face_body,
                      const Index* other_edge, std::vector<EdgeFace>& out);
  void learn(const SceneArrays& scene, std::size_t body);
  bool hasEnough() const { return found_.size() > most_found_; }

  bool whole_ = false, has_deadline_ = false;
  bool cut_ = false;  // there was more to find than most_found_
  const std::vector<Unfolded>* unfolded_ = nullptr;
  std::size_t most_found_ = FoundLimit::NONE, most_group_pairs_ = FoundLimit::NONE;
  bool known_ = false;       // all contacts since the last run(): what that found out can be carried over
  bool searched_ = false;    // the search has come to its end
  unsigned unsearched_ = 0;  // steps on end that needed none
  BodyPair next_bodies_{};   // else where it goes on: pairs of bodies are taken in order, in them the units,
  std::uint32_t next_unit_ = 0;
  std::vector<std::uint8_t> by_faces_;  // per body, by which it is searched
  std::vector<float> near_;             // vertices at t=0, of such bodies: simd::NearVertices,
  float largest_near_ = 0;
  std::vector<std::uint32_t> views_;  // simd::faceViews() of the body that is searched with itself
  std::vector<Touched> touched_;      // of the last step; after run() those that the deadline left
  std::vector<EdgeFace> candidates_;  // to be looked at; after run() those that the deadline left
  std::vector<EdgeFace> found_;
  std::vector<std::uint32_t> groups_, scratch_, overlapping_;
  std::vector<BodyPair> body_pairs_;
  std::vector<std::array<std::uint32_t, 2>> by_group_;
  std::uint32_t fans_ = 0;                  // units of a body's fans, which come before those of groups
  std::vector<std::size_t> unit_begin_;     // of its pairs of groups, in by_group_, and where the last one's end
  std::vector<std::uint32_t> unit_number_;  // of those that are left
  std::vector<std::vector<EdgeFace>> unit_found_;
  std::vector<std::uint8_t> unit_whole_;
  std::vector<std::uint64_t> unit_tested_;
  tbb::enumerable_thread_specific<CrossingFinder> finders_;
  std::vector<std::uint64_t> keys_, other_keys_;  // of what is listed
  std::vector<Neighbourhood> neighbourhoods_;     // one a body; empty until they are asked for
  std::uint64_t tested_ = 0;
};

}  // namespace dccd
