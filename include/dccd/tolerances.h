// Every tolerance of the package: its unit, its reason, and what changes with it. Derivations stand beside the code
// that they are about; the value stands here. Sizes of buffers and units of work change no answer and are not here.
//
// A *margin* covers rounding: larger is safe and sends more pairs to a dearer stage, smaller loses contacts. A *guard*
// bounds the numbers for which a margin holds: outside, exact arithmetic decides; narrower guards cost time, wider ones
// certainty. A *slack* is a margin that no test cuts: another one stands in for it, or it is many times as wide as its
// proof asks. Larger and smaller mean for it what they mean for a margin. A *default* is the user's to change
// (doc/interface.md).
//
// test/margins cuts each margin in turn and shows a test that fails then; for this it builds the core with margins that
// are variables.
#pragma once

#include <cstddef>

#ifdef DEFORMABLE_CCD_VARIABLE_MARGINS
#define DCCD_MARGIN inline
#else
#define DCCD_MARGIN constexpr
#endif

namespace dccd {
namespace tolerance {

constexpr double HALF_ULP = 0x1p-53;  ///< [1] the largest relative error of one rounded operation on doubles

// --- defaults --------------------------------------------------------------------------------------------------------
/// [m] `conservative`: a contact may be reported where features come this close. Smaller: fewer false ones, more steps.
constexpr double CONTACT_M = 1e-6;
/// [m] Straight paths of a step's parts stay this close to a rigid body's arc. Smaller: more parts, each a whole step.
constexpr double RIGID_PATH_M = 1e-3;
/// [m, rad] What tf says of one stamp twice is the same place: publishers compute it anew, or send it as float. Larger:
/// a frame that is elsewhere is not seen. Smaller: what no step can feel ends its proof.
constexpr double SAME_PLACE = 1e-6;
/// [s] A longer pause between two frames is a gap: what moved in it is not known to be straight.
constexpr double LONGEST_STEP_S = 0.5;
/// [s] A frame whose stamp is before the last one's by no more than this is late, and what came before it lies beside
/// its way. Larger: after a time that begins anew steps are not proved for longer. Smaller: a late frame may be taken
/// for one of a time that begins anew.
constexpr double LATE_FRAME_S = 1;
/// [m] A vertex that moves further in a step is a teleport, no motion: trackers lose a mesh and find it elsewhere.
constexpr double FARTHEST_VERTEX_STEP_M = 0.5;
/// [s] A contact that is let go for less is the same one when it comes back. Larger: noise lets go less often, ends are
/// told later.
constexpr double PATCH_GAP_S = 0.25;
/// [m] Edge lengths of voxels that a map may have: their planes' coordinates, up to 2^16 of them, neither overflow nor
/// vanish. Wider: such a map is no longer refused, and answers about it may be wrong.
constexpr double SMALLEST_RESOLUTION_M = 1e-290, LARGEST_RESOLUTION_M = 1e290;
/// [1] How far a map's edge length and the one in its data's own header may differ, for the header has six digits.
/// Larger: maps that contradict themselves are taken. Smaller: good maps are refused.
constexpr double OCTOMAP_HEADER = 1e-5;
/// [1] How far the length of an axis in a DAE may be from 1, for six digits have it so. Larger: axes are taken
/// that others stretch a mesh by. Smaller: good files are refused.
constexpr double DAE_AXIS = 1e-6;

// --- projections and bounds ------------------------------------------------------------------------------------------
constexpr double SQRT2_UP = 1.4142135623730952;  ///< [1] length of the diagonal directions, rounded up
/// [1] Margin of a bound on the time of contact, for its few roundings. Larger: bounds are earlier, nothing else.
DCCD_MARGIN double TOC_BOUND = 8 * HALF_ULP;
/// [1] Slack of the same: of the larger of two projections, whose sums are rounded; twice where a separation is taken.
constexpr double TOC_BOUND_GAP = 2 * HALF_ULP;
/// [1] Slack of a bound on the time of contact of two groups: whole numbers, and one quotient.
constexpr double GROUP_TOC_BOUND = 1e-15;
/// [1] Of the scene's extent: how much wider the records' range is on either side where a body rests, so that others
/// may move within it. Larger: resting bodies are kept longer, all bounds are coarser.
constexpr double RECORD_PADDING = 0.5;
/// [1] Of the records' range: what the scene must fill. Smaller: bodies are kept longer, all bounds are coarser.
constexpr double RECORD_SHARE = 0.125;
/// [1] Slack of a margin in records, of the largest coordinate: the roundings of both its sums.
constexpr double RECORD_MARGIN = 4 * HALF_ULP;
/// [m] Largest coordinates of a scene whose vertices are taken as they are: others are scaled to 1 m. Larger,
/// differences come to FUSED_LARGEST_M; smaller, products of short edges underflow in floats.
constexpr double SCENE_SMALLEST_M = 0x1p-20, SCENE_LARGEST_M = 0x1p28;
constexpr double RECORD_SMALLEST_RANGE = 0x1p-20;  ///< [1] guard on the records' range, of the largest coordinate
/// [1] Margin of a separation that is a sum of several, which must not come out too small.
DCCD_MARGIN double SEPARATION_SUM = 0x1p-50;
/// [1] Slack of bounds that are placed in the frame of the map, of the size of their terms: these are off by less than
/// 2^-46 of it.
constexpr double LENGTH = 0x1p-40;

// --- filters ---------------------------------------------------------------------------------------------------------
// Planar filter (simd/fused_filter.cpp), in float on differences.
DCCD_MARGIN float FUSED_PLANAR = 128 * 0x1p-24f;  ///< [1] margin of a cross product's coefficient, times M^2
DCCD_MARGIN float FUSED_CUBIC = 192 * 0x1p-24f;   ///< [1] of one of the cubic of coplanarity, times M^3
/// [m^2, m^3] More than all that underflows in a test, which is below 2^-146 where it counts: a normal number, since
/// denormal ones may be slow to add. So much less would do; without it contacts are lost.
DCCD_MARGIN float FUSED_UNDERFLOW = 0x1p-100f;
constexpr float FUSED_LARGEST_M = 1073741824.0f;  ///< [m] guard, 2^30: cubes of differences stay finite
// No fold (culling/unfolded.cpp).
DCCD_MARGIN double UNFOLDED_COORDINATE = 0x1p-51;  ///< [1] margin of a projected coordinate, of the largest |x|+|y|+|z|
constexpr double UNFOLDED_PRODUCT = 20;  ///< [1] slack of a difference of two products, times error (extent + error)
constexpr double UNFOLDED_SMALLEST_M = 1e-100, UNFOLDED_LARGEST_M = 1e100;  ///< [m] guard
// Start state (step/start/segment_triangle.cpp), in double.
DCCD_MARGIN double SEGMENT_PROJECTED = 35 * HALF_ULP;  ///< [1] margin of a cross product's component, times M^2
DCCD_MARGIN double SEGMENT_LINE = 47 * HALF_ULP;       ///< [1] of where a line meets a face, times M^3
DCCD_MARGIN double SEGMENT_PLANE = 240 * HALF_ULP;     ///< [1] of the side of a face's plane, times M^3
/// [m^2, m^3] The same; what underflows where it counts is below 2^-1071.
DCCD_MARGIN double SEGMENT_UNDERFLOW = 0x1p-1000;
constexpr double SEGMENT_LARGEST_M = 0x1p30;  ///< [m] guard: keeps the underflow below that margin

// Distances (step/clearance/hull_pair.h).
/// [1] Slack of a bound on a distance, of the power of two that is not above the largest coordinate: 120 half ulps are
/// proved. Larger: bounds are further apart where coordinates are large.
constexpr double CLEARANCE = 0x1p-45;
constexpr double CLEARANCE_BOX = 16 * HALF_ULP;   ///< [1] slack of the squared distance of two boxes: 6 half ulps
constexpr double CLEARANCE_RELATIVE = 1e-9;       ///< [1] of a distance: how far its bounds may be apart in any case
constexpr double CLEARANCE_UNDERFLOW_M = 1e-290;  ///< [m] more than underflow takes from a distance
constexpr double CLEARANCE_LARGEST_M = 1e150;     ///< [m] guard: squares stay finite
constexpr double CLEARANCE_DIRECTION_M = 1e-140;  ///< [m] guard: squares of less lose digits, and tell no direction
constexpr double CLEARANCE_SHORTEST = 0x1p-48;    ///< [1] part of a step that is not halved any more
/// [1] Of clearance.self_m, up to where a body's distance from itself is looked for. Larger: a sheet that is not folded
/// may be found near itself, and searches take longer. Smaller: only narrower folds are seen.
constexpr double CLEARANCE_SELF = 0.25;
/// [1] How much farther than that it is looked for, so that the answer is known for some steps. Larger: it is known for
/// longer, a search takes longer.
constexpr double CLEARANCE_SELF_REACH = 1.5;

// --- elementary tests ------------------------------------------------------------------------------------------------
// Batched exact test (simd/exact_batch_bounds.h). Margins, each rounded up by more than 0.5 %.
DCCD_MARGIN double BATCH_VALUE = 107 * HALF_ULP;        ///< [1] of f(t) and f's coefficients, times U V W
DCCD_MARGIN double BATCH_MINOR = 8.0625;                ///< [1] of a minor, times (h + BATCH_TIME) X Y
DCCD_MARGIN double BATCH_SEPARATION = 22.5 * HALF_ULP;  ///< [1] of a minor's coefficient over [a, b], times X Y
constexpr double BATCH_TIME = 2.5 * HALF_ULP;           ///< [step] slack of h, half a bracket's width
DCCD_MARGIN double SIMPLE_TIME = 155 * HALF_ULP;        ///< [1] of f's coefficients up to a rounded time, times U V W
/// [1] Slack of f's coefficients from pairs of doubles, times U V W: 234 of these 4096 squares of half ulps are proved.
constexpr double BATCH_SHARP_VALUE = 0x1p-94;
/// [1] Slack of what is computed in doubles of such coefficients, times the largest: 9 half ulps are proved.
constexpr double BATCH_SHARP = 0x1p-48;
constexpr double BATCH_SMALLEST_M = 0x1p-150, BATCH_LARGEST_M = 0x1p150;  ///< [m] guard on U, V, W
/// [step] Subdivision ends here and leaves the pair to the next tier. Smaller: fewer pairs there, more steps here.
constexpr double BATCH_SMALLEST_INTERVAL = 0x1p-12;
/// [step] The same where f is uncertain at an end of the step: what wide intervals do not show to be apart there,
/// narrow ones seldom do. Smaller: more steps here for few pairs. Larger: more pairs go to the next tier.
constexpr double BATCH_SMALLEST_INTERVAL_AT_ENDS = 0.25;
/// [step] By how much a root's bracket reaches beyond what f's error says. f's signs at its ends prove it. Larger:
/// inside tests are less sharp. Smaller: brackets without a proof, which go to the next tier.
constexpr double BATCH_BRACKET = 0x1p-50;
/// [step] Where a narrower bracket leaves the inside test open, every interval around it would. Larger: pairs are left
/// to the next tier that more steps had decided. Smaller: steps that decide nothing.
constexpr double BATCH_NARROW_BRACKET = 0x1p-30;
/// [step] An estimate this close to p/q is tried as p/q; others differ by 2^-20. Integers prove it. Larger: more are
/// tried in vain. Smaller: estimates miss their p/q, and dearer integers decide.
constexpr double SAME_TIME = 0x1p-30;
// Tiers in double and in pairs of doubles (elementary/exact_refined.cpp, exact_double_double.cpp).
/// [step] Half the least width around an extremum of f on which its sign is not asked for.
constexpr double EXTREMUM_ZONE = 0x1p-40;
DCCD_MARGIN double INSIDE_MINOR = 48 * HALF_ULP;                   ///< [1] margin of a minor, times its sizes
DCCD_MARGIN double CUBIC_VALUE = 102 * HALF_ULP;                   ///< [1] of f in doubles, times U V W
DCCD_MARGIN double CUBIC_VALUE_PAIRS = 360 * HALF_ULP * HALF_ULP;  ///< [1] of f in pairs of doubles, times U V W
DCCD_MARGIN double CUBIC_SLOPE = 656 * HALF_ULP;                   ///< [1] of f' in doubles, times U V W
constexpr double BOUND_OF_BOUNDS = 1.0625;                         ///< [1] slack of a sum of such bounds, times it
constexpr double TANGENT_VALUE = 4 * HALF_ULP;  ///< [1] slack of f along its tangent, of its value and its change
/// [1] Margin of a quadratic, times (radius + QUADRATIC_TIME), times its coefficients.
DCCD_MARGIN double QUADRATIC_SIGN = 2.5;
constexpr double QUADRATIC_TIME = 4 * HALF_ULP;   ///< [step] slack of the radius: 3 half ulps for the coefficients
constexpr double QUADRATIC_UNDERFLOW = 0x1p-990;  ///< [1] slack of the same, for what underflows
/// [step] By how much a root's first bracket reaches beyond its estimate. f's signs at its ends prove it. Larger: more
/// steps to the root's cell. Smaller: the bracket misses the root and is dropped, which takes more steps, too.
constexpr double ROOT_BRACKET = 0x1p-44;
constexpr double CUBIC_SMALLEST_M3 = 0x1p-300, CUBIC_LARGEST_M3 = 0x1p300;  ///< [m^3] guard on the coefficients
constexpr double TIME_GRID = 0x1p-52;  ///< [step] times are multiples of it, so that 1 - t is exact
// Conservative advancement (elementary/conservative_advance.cpp).
DCCD_MARGIN double ADVANCE_SEPARATION = 11 * HALF_ULP;  ///< [1] margin of n.w against d |n|, times |n|_1 M
constexpr double CLOSING_SPEED = 0x1p-50;               ///< [1] slack of a closing speed times a bracket's width
DCCD_MARGIN double ADVANCE_POINT = 44 * HALF_ULP;       ///< [1] margin of the distance of two points, times M
constexpr double ADVANCE_SMALLEST_M = 1e-140;           ///< [m] guard: products of lengths do not vanish
constexpr double ADVANCE_LARGEST_M = 1e70;              ///< [m] guard: products of four lengths stay finite
/// [1] Squared sine of an angle below which a cross product is mostly rounding. Larger: shorter steps there.
constexpr double ADVANCE_PARALLEL = 1e-22;

// --- maps ------------------------------------------------------------------------------------------------------------
/// [voxel] Cell coordinates are rounded outward by this: their error is below 2^-35.
/// Larger: more candidates.
DCCD_MARGIN double VOXEL_KEY = 0x1p-34;
/// [1] Margin of a crossing time: two differences and a quotient, 3.01 half ulps, and slack for comparing two of them.
DCCD_MARGIN double CROSSING_TIME = 8 * 0x1p-53;
DCCD_MARGIN double ORIENTATION_2D = 5 * HALF_ULP;   ///< [1] of a cross product, times the sum of its magnitudes
DCCD_MARGIN double ORIENTATION_3D = 16 * HALF_ULP;  ///< [1] of a determinant, times the sum of its magnitudes
constexpr double PREDICATE_SMALLEST = 0x1p-300, PREDICATE_LARGEST = 0x1p300;      ///< [m^2] guard on products
constexpr double PREDICATE_SMALLEST_M = 0x1p-140, PREDICATE_LARGEST_M = 0x1p140;  ///< [m] guard on differences
DCCD_MARGIN double SIDE = 0x1p-48;  ///< [1] margin of a side, times M^2: 20.1 half ulps
constexpr double SIDE_SMALLEST_M = 0x1p-400, SIDE_LARGEST_M = 0x1p400;  ///< [m] guard
DCCD_MARGIN double MAP_BOUND = 2 * HALF_ULP;  ///< [1] margin of a coordinate that was moved by a separation

// --- streams and advice ----------------------------------------------------------------------------------------------
/// [1] Of a step's time, what is kept for the prediction after it where there is one. Larger: steps are cut earlier.
/// Smaller: predictions are.
constexpr double LOOK_AHEAD_SHARE = 0.25;
/// [1] Of a step's time, the most that is kept for its patches, which come last and are not cut. Larger: contacts are
/// cut earlier in steps whose patches take long. Smaller: such steps run over their time.
constexpr double PATCHES_SHARE = 0.4;
/// [1] Frames of a body that are kept however many vertices they have, for steps that wait for a clock body which comes
/// late. Larger: streams of large meshes take more memory. Smaller: steps find no frame of theirs any more.
constexpr std::size_t FRAMES_ALWAYS_KEPT = 64;
/// [1] Spots of what touched lately are all forgotten where they are more than the second, and more than the first for
/// each spot that touches now: else a burst of contacts would cost every later step as much. Larger: steps after a
/// burst take longer. Smaller: what touches again soon after a burst is told as new.
constexpr std::size_t TRACE_PER_SPOT = 8, TRACE_ALWAYS = 1 << 16;
/// [1] Transforms of one body within a step that are looked at; of a step with more nothing is known. Larger: a flood
/// of them holds the worker up longer. Smaller: broadcasters that are faster than so many a step prove nothing.
constexpr std::size_t MOST_POSES_A_STEP = 1024;
/// [ns] tf stamps that go back further begin a recording anew: broadcasters of one tree are late by less.
constexpr long long TF_JUMP_BACK_NS = 1000000000;
/// [1] As tf2's own: a rotation whose squared norm is further from 1 is none, and is left out.
constexpr double TF_QUATERNION_NORM = 1e-2;
/// [m] A larger mesh draws the advice that it may be in millimetres; no answer depends on it.
constexpr double LARGEST_PLAUSIBLE_M = 50;
/// [1] A grid whose neighbours are this much nearer with rows and columns swapped draws advice; crumpled cloth does not
/// reach it.
constexpr double SWAPPED_GRID_RATIO = 0.6;
/// [1] Neighbours on a mesh whose mean distance is more than this part of any two points' draw the advice that the
/// points are shuffled; of 64 points and more in their order it is below a half.
constexpr double SHUFFLED_RATIO = 0.7;

// --- limits of a live node -------------------------------------------------------------------------------------------
/// [bytes] What a triangle of a message may take until its step is done: as it is decoded, its topology, its share of
/// vertices, edges and trees. A message that would take more than there is room for is refused before it is decoded.
constexpr unsigned long long BYTES_PER_FACE = 400;
/// [bytes] What a contact takes on its way from a pair to a message and its markers, or what meets when a step begins
/// on its. Larger: steps are cut at fewer.
constexpr unsigned long long BYTES_PER_CONTACT = 1024;
/// [1] Contacts for each vertex, edge and face at which a step is cut. A cloth of 92,000 triangles that is crumpled
/// into a ball has 0.4, layers within a distance of several edges some tens; a mesh that collapses has half as many as
/// it has features.
constexpr unsigned long long CONTACTS_PER_FEATURE = 2, CONTACTS_PER_FEATURE_WITH_DISTANCE = 32;
/// [1] Pairs of superclusters at which a step that is limited is cut: 40 MB while they are ordered. Larger: more
/// memory. Smaller: steps in which much coincides are cut earlier.
constexpr std::size_t MAX_SUPERCLUSTER_PAIRS = std::size_t{1} << 20;
/// [1] Cubes of unknown space that become part of a map, which is refused where it needs more. Larger: more memory (see
/// MAP_LEAF_ADDED) and time. Smaller: smaller regions of a map can be asked for.
constexpr std::size_t MAX_UNKNOWN_LEAVES = 2'000'000;
/// [bytes] What a leaf of a map takes in a list; in a tree while leaves are sorted (its list included), while nodes are
/// made (included, too) and from then on; in a surface from then on. src/obstacle/voxel_tree.cpp asserts them.
constexpr unsigned long long MAP_LEAF_LISTED = 12, MAP_LEAF_SORTING = 48, MAP_LEAF_BUILDING = 32, MAP_LEAF_IN_TREE = 12,
                             MAP_LEAF_IN_SURFACE = 16;
/// [bytes] The same of a node, a block of 4^3 cells that is not all alike: while a tree is built, and from then on.
constexpr unsigned long long MAP_NODE_BUILDING = 86, MAP_NODE = 70;
/// [bytes] What a cube takes that comes into a map while it is used (unknown space, what exclude_boxes cut), its share
/// of nodes included, of which it needs at most one of three: a list that grows, three times; a tree that is built and
/// two surfaces.
constexpr unsigned long long MAP_LEAF_ADDED = 200;
/// [1] Probabilities that a voxel is occupied in which a point lies, and that a ray goes through; no voxel's is taken
/// to be less, or more. octomap_server's. A larger hit or miss: fewer looks make an obstacle, more clear it. Nearer to
/// 0 and 1: what has changed is seen later.
constexpr double MAP_HIT = 0.7, MAP_MISS = 0.4, MAP_LEAST = 0.12, MAP_MOST = 0.97;
/// [1] of a coordinate or a distance: what a body's own voxel must be nearer than own_voxels_m, for the rounding of the
/// points that show it (some 20 units in the last place). Larger: voxels at the very rim are obstacles.
constexpr double OWN_REACH = 0x1p-44;
/// [1] of a voxel: how far a body's points go from one place to the next at which it is asked what it reaches. Larger:
/// voxels near the rim of a fast body's way are obstacles. Smaller: more time.
constexpr double OWN_PLACES = 0.5;
/// [1] Places between two frames, and voxels near to bodies that are asked for; what is left out is an obstacle.
constexpr int MOST_OWN_PLACES = 64;
constexpr std::size_t MOST_OWN_ASKED = std::size_t{1} << 21;
/// [s] How far back a body's way is known at the most, where maps come seldom.
constexpr double OWN_PATH_S = 10;
/// [s] Time between two looks at a map after which a body must have been within reach all along for what appeared to be
/// its own. Larger: an obstacle that came near while nobody looked is more easily taken for a body. Smaller: more is in
/// doubt where maps come seldom.
constexpr double OWN_GAP_S = 0.5;
/// [s] For so long what appeared out of reach, or in doubt, makes what appears beside it in reach doubtful: one voxel
/// of 2 cm takes a hand of 0.1 m/s 0.2 s, and one of 10 cm a second. Larger: what a body's noise left beside it costs
/// more proofs. Smaller: a slower hand may grow into a body's own.
constexpr double OWN_GROWTH_S = 1;
/// [s] What a body left, and nobody looked at again, is its own if it comes back within this. Larger: what was put
/// there meanwhile is more easily taken for it. Smaller: an arm that goes to and fro meets its own doubt; in the real
/// cell that costs one step in nine at half a second, none at three.
constexpr double OWN_LEFT_S = 3;
/// [1] of a voxel: how far the map's frame may move before its voxels are other ones. Larger: a body's way is placed
/// the less exactly among them. Smaller: a frame that trembles ends all that is own.
constexpr double OWN_FRAME = 0x1p-6;
/// [1] Cubes that were never seen free without a body, and are free: so many are looked at anew with each map, in turn.
/// Larger: more time where a body rests in sight from the first map on. Smaller: what it leaves is in doubt for longer.
constexpr std::size_t OWN_UNKNOWN_ASKED = 1024;

}  // namespace tolerance
}  // namespace dccd

#undef DCCD_MARGIN
