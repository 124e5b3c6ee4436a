// Every tolerance of the package: its unit, its reason, and what changes with it. Derivations stand beside the code
// that they are about; the value stands here. Sizes of buffers and units of work change no answer and are not here.
//
// A *margin* covers rounding: larger is safe and sends more pairs to a dearer stage, smaller loses contacts. A *guard*
// bounds the numbers for which a margin holds: outside, exact arithmetic decides; narrower guards cost time, wider ones
// certainty. A *default* is the user's to change (doc/interface.md).
//
// test/margins cuts each margin in turn and shows a test that fails then; for this it builds the core with margins that
// are variables.
#pragma once

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
/// [s] A longer pause between two frames is a gap: what moved in it is not known to be straight.
constexpr double LONGEST_STEP_S = 0.5;
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

// --- projections and bounds ------------------------------------------------------------------------------------------
constexpr double SQRT2_UP = 1.4142135623730952;  ///< [1] length of the diagonal directions, rounded up
/// [1] Margin of a bound on the time of contact, for its few roundings. Larger: bounds are earlier, nothing else.
DCCD_MARGIN double TOC_BOUND = 8 * HALF_ULP;
/// [1] Of the scene's extent: how much wider the records' range is on either side where a body rests, so that others
/// may move within it. Larger: resting bodies are kept longer, all bounds are coarser.
constexpr double RECORD_PADDING = 0.5;
/// [1] Of the records' range: what the scene must fill. Smaller: bodies are kept longer, all bounds are coarser.
constexpr double RECORD_SHARE = 0.125;
/// [1] Margin of a separation that is a sum of several, which must not come out too small.
DCCD_MARGIN double SEPARATION_SUM = 0x1p-50;

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
constexpr double UNFOLDED_SMALLEST_NORMAL = 1e-200, UNFOLDED_LARGEST_NORMAL = 1e200;  ///< [m^2] guard
constexpr double UNFOLDED_SMALLEST_M = 1e-100, UNFOLDED_LARGEST_M = 1e100;            ///< [m] guard
// Start state (step/segment_triangle.cpp), in double.
DCCD_MARGIN double SEGMENT_PROJECTED = 35 * HALF_ULP;  ///< [1] margin of a cross product's component, times M^2
DCCD_MARGIN double SEGMENT_LINE = 47 * HALF_ULP;       ///< [1] of where a line meets a face, times M^3
DCCD_MARGIN double SEGMENT_PLANE = 240 * HALF_ULP;     ///< [1] of the side of a face's plane, times M^3
/// [m^2, m^3] The same; what underflows where it counts is below 2^-1071.
DCCD_MARGIN double SEGMENT_UNDERFLOW = 0x1p-1000;
constexpr double SEGMENT_LARGEST_M = 0x1p30;  ///< [m] guard: keeps the underflow below that margin

// --- elementary tests ------------------------------------------------------------------------------------------------
// Batched exact test (simd/exact_batch_bounds.h). Margins, each rounded up by more than 0.5 %.
DCCD_MARGIN double BATCH_VALUE = 107 * HALF_ULP;        ///< [1] of f(t) and f's coefficients, times U V W
DCCD_MARGIN double BATCH_MINOR = 8.0625;                ///< [1] of a minor, times (h + 2.5 HALF_ULP) X Y
DCCD_MARGIN double BATCH_SEPARATION = 22.5 * HALF_ULP;  ///< [1] of a minor's coefficient over [a, b], times X Y
DCCD_MARGIN double SIMPLE_TIME = 155 * HALF_ULP;        ///< [1] of f's coefficients up to a rounded time, times U V W
constexpr double BATCH_SMALLEST_M = 0x1p-150, BATCH_LARGEST_M = 0x1p150;  ///< [m] guard on U, V, W
/// [step] Subdivision ends here and leaves the pair to the next tier. Smaller: fewer pairs there, more steps here.
constexpr double BATCH_SMALLEST_INTERVAL = 0x1p-12;
// Tiers in double and in pairs of doubles (elementary/exact_refined.cpp, exact_double_double.cpp).
/// [step] Half the least width around an extremum of f on which its sign is not asked for.
constexpr double EXTREMUM_ZONE = 0x1p-40;
DCCD_MARGIN double INSIDE_MINOR = 48 * HALF_ULP;                   ///< [1] margin of a minor, times its sizes
DCCD_MARGIN double CUBIC_VALUE = 102 * HALF_ULP;                   ///< [1] of f in doubles, times U V W
DCCD_MARGIN double CUBIC_VALUE_PAIRS = 360 * HALF_ULP * HALF_ULP;  ///< [1] of f in pairs of doubles, times U V W
DCCD_MARGIN double CUBIC_SLOPE = 656 * HALF_ULP;                   ///< [1] of f' in doubles, times U V W
DCCD_MARGIN double SUBDIVISION = 0x1p-50;  ///< [1] of the difference of two projections, times the largest
DCCD_MARGIN double QUADRATIC_SIGN = 2.5;   ///< [1] of a quadratic, times (radius + 2^-51), times its coefficients
constexpr double CUBIC_SMALLEST_M3 = 0x1p-300, CUBIC_LARGEST_M3 = 0x1p300;  ///< [m^3] guard on the coefficients
constexpr double TIME_GRID = 0x1p-52;  ///< [step] times are multiples of it, so that 1 - t is exact
// Conservative advancement (elementary/conservative_advance.cpp).
DCCD_MARGIN double ADVANCE_SEPARATION = 11 * HALF_ULP;  ///< [1] margin of n.w against d |n|, times |n|_1 M
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

}  // namespace tolerance
}  // namespace dccd

#undef DCCD_MARGIN
