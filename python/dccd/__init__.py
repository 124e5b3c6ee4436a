"""Exact continuous collision detection for deforming meshes, from numpy arrays.

>>> import dccd
>>> body = dccd.Body(x0, x1, triangles, name='cloth')    # positions before and after, (n, 3); triangles, (m, 3)
>>> outcome = dccd.detect(body)
>>> outcome.proved                                       # what is not in `contacts` does not touch
True
>>> outcome.contacts['toc_lower']                        # when, as fractions of the step

Start with detect() for a step, Stream for frames with stamps, pair() for two features. Lengths are in metres, and times
of contact are fractions of the step. With accuracy='exact', the default, the answer is right for all finite doubles.

What does not fit is a TypeError (a dtype, an unknown option) or a ValueError (a shape, an index, a number), which names
the argument and the value. The interpreter's lock is released while the core works; Ctrl-C ends a long step.
"""
from __future__ import annotations

import dataclasses
import os
from typing import TYPE_CHECKING, Any, Sequence

import numpy as np

from . import _dccd
from ._dccd import KINDS, NO_INDEX, OBSTACLE_BODY, Body, History, Mesh, Outcome, Stream, Voxels, __version__

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ['Body', 'EDGE_EDGE', 'EDGE_VOXEL_EDGE', 'FACE_VOXEL_CORNER', 'History', 'KINDS', 'Mesh', 'NO_INDEX',
           'OBSTACLE_BODY', 'Outcome', 'PairResult', 'Replay', 'Stream', 'TraceLine', 'VERTEX_FACE', 'VERTEX_VOXEL_FACE',
           'Voxels', 'detect', 'explain', 'pair', 'pairs', 'replay']

# The kinds of contacts, by their places in KINDS.
VERTEX_FACE, EDGE_EDGE, VERTEX_VOXEL_FACE, EDGE_VOXEL_EDGE, FACE_VOXEL_CORNER = range(5)


@dataclasses.dataclass(frozen=True)
class PairResult:
    """What pair() says: the true time of contact is from toc_lower to toc_upper. inf: they do not meet. Undecided: a contact,
    if there is one, is not before toc_lower."""
    contact: bool
    undecided: bool
    toc_lower: float
    toc_upper: float


@dataclasses.dataclass(frozen=True)
class TraceLine:
    """What one stage says of a pair: 'kept', 'rejected' (with a proof), 'contact' or 'undecided', and its reason."""
    part: int
    stage: str
    says: str
    text: str


@dataclasses.dataclass(frozen=True)
class Replay:
    """What replay() gives: both answers, what differs (a sentence each), and what detect() takes to answer it again."""
    outcome: Outcome
    recorded: Outcome | None
    differences: list[str]
    bodies: list[Body]
    voxels: Voxels | None
    options: dict[str, Any]
    note: str


def detect(bodies: Body | Sequence[Body], *, voxels: Voxels | None = None, history: History | None = None,
           **options: Any) -> Outcome:
    """Finds what the bodies touch during a step: themselves, each other, the voxels.

    Parameters
    ----------
    bodies : Body or list of Body
        With their positions at both ends of the step.
    voxels : Voxels
        The map, at rest during the step.
    history : History
        For a sequence of steps: the same one each time saves time and changes no answer, but for which contacts
        max_found keeps and which crossing earliest_only lists.
    accuracy : str
        'exact' (the default): no contact is missed, none invented. 'conservative': for distances (minimum_separation_m,
        radius_m).
    tolerance_m : float
        Of 'conservative': features that come this close [m] may be reported. 1e-6.
    toc_bits : int
        Of 'exact': times of contact are told to 2^-toc_bits of the step, 10 to 52. 32.
    max_subdivisions : int
        Of 'conservative': a pair that takes more is undecided. 4096.
    num_threads : int
        1 to 1024. 1. No answer changes.
    step_budget_ms, max_compute_ms : float
        When the step has to end [ms]; what is left is undecided, with a bound. 0: never.
    earliest_only : bool
        Only contacts that may be the first, and one edge through a face at the most. Takes half of the time.
    check_start_state : bool
        Whether surfaces cross already when the step begins. Without it nothing is proved. True.
    patches : bool
        Say which contacts belong together: Outcome.patches.
    clearance : bool
        Say how far apart things are: Outcome.clearances.
    clearance_tolerance_m, clearance_max_m, clearance_self_m : float
        How narrow its bounds are [m], 1e-4; beyond which things are only farther [m], 0.5; how far along its surface a
        body is not asked for itself [m], 0: it is not asked at all.
    expected : list of dict
        {'between': [NAME, NAME], 'vertices': {NAME: indices}}: contacts that are no alarm; 'octomap' is the voxels, 'self'
        the other body itself, and vertices may be left out.
    exclude_boxes : (k, 2, 3) float64 [m]
        min and max of boxes: voxels whose centre is inside count as free.
    obstacle_expected : bool
        Without voxels the status is NO_MAP.
    max_contacts, max_found, max_found_per_feature : int
        The earliest contacts that are kept; how many may be found before the step is TRUNCATED, in all and for each
        vertex, edge and face (0: no limit).
    suppress_initial : bool
        Leave initial contacts with the voxels out of the list.
    rigid_tolerance_m : float
        A step is split until straight paths are this close [m] to the arc of a body that turns. 1e-3.
    max_substeps : int
        In so many parts at most. 64.
    excluded : list of str
        Sentences for Outcome.excluded: what you left out before.
    keep_bounds, unfolded_test
        For measurements; no answer changes. True, True.

    Returns
    -------
    Outcome

    Raises
    ------
    TypeError
        bodies holds something else, there is no such option, or it has another type.
    ValueError
        An option or a body is out of range; the sentence names it and the value.
    KeyboardInterrupt
        Ctrl-C, in the main thread: the step has ended.

    The method and its proofs: doc/algorithm.md; what is promised: doc/guarantees.md.

    Examples
    --------
    >>> outcome = dccd.detect([cloth, table], accuracy='exact', num_threads=2)
    >>> outcome.contacts[outcome.contacts['kind'] == dccd.VERTEX_FACE]
    """
    return _dccd.detect(bodies, voxels, history, options)


def pairs(kind: int | str, t0: ArrayLike, t1: ArrayLike, *, minimum_separation_m: float = 0.0,
          **options: Any) -> NDArray[np.void]:
    """Tests pairs of moving features, each by itself: do the two meet during the step, and when first?

    Parameters
    ----------
    kind : int or str
        VERTEX_FACE, 'vertex-face' or 'VF'; EDGE_EDGE, 'edge-edge' or 'EE'.
    t0, t1 : (n, 4, 3) float64 [m]
        Positions of each pair's four points at the start and at the end: a vertex and the three of a face, or two edges.
    minimum_separation_m : float
        What comes closer [m] counts as contact. Needs accuracy='conservative'.
    accuracy, tolerance_m, toc_bits, max_subdivisions
        As of detect().

    Returns
    -------
    structured array of n
        contact, undecided (bool); toc_lower, toc_upper: as of Outcome.contacts, inf where there is no contact.

    Raises
    ------
    ValueError
        A shape does not fit, a coordinate is not finite, or a number is out of range.

    The tests: doc/algorithm.md; how hard pairs were tried: doc/hard_cases.md.
    """
    return _dccd.pairs(kind, t0, t1, minimum_separation_m, options)


def pair(kind: int | str, t0: ArrayLike, t1: ArrayLike, *, minimum_separation_m: float = 0.0,
         **options: Any) -> PairResult:
    """Tests one pair of moving features: pairs() for (4, 3) positions.

    Examples
    --------
    >>> face = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    >>> dccd.pair('VF', [[.2, .2, 1]] + face, [[.2, .2, -1]] + face)
    PairResult(contact=True, undecided=False, toc_lower=0.5, toc_upper=0.5000000002328306)
    """
    row = pairs(kind, np.asarray(t0)[None], np.asarray(t1)[None], minimum_separation_m=minimum_separation_m, **options)[0]
    return PairResult(**{name: row[name].item() for name in row.dtype.names})


def explain(bodies: Body | Sequence[Body], kind: int | str | np.void, vertices: ArrayLike | None = None,
            whose: Sequence[int | str] = (0, 0), *, voxel: ArrayLike | None = None, voxels: Voxels | None = None,
            **options: Any) -> list[TraceLine]:
    """Says why two features are a contact or not: what each stage of the step does with them. Not fast.

    Parameters
    ----------
    bodies, voxels, options
        As of detect().
    kind : int, str, or a row of Outcome.contacts
        As of pairs(). A row brings all that follows.
    vertices : (k,) integers
        Of the features: four of a vertex and a face, or of two edges; 1, 2 or 3 of what meets a voxel.
    whose : two of int or str
        The bodies of the two features.
    voxel : (3,) integers
        The key of the voxel.

    Returns
    -------
    list of TraceLine
        part of the step, stage, what it says (kept, rejected, contact, undecided) and its reason.

    Raises
    ------
    ValueError
        The bodies have no such feature, or there is no such voxel.

    Examples
    --------
    >>> for line in dccd.explain(cloth, outcome.contacts[0]):
    ...     print(line.stage, line.says, line.text)
    """
    if isinstance(kind, np.void):
        row = kind
        kind, vertices, whose, voxel = int(row['kind']), row['vertices'], row['bodies'].tolist(), row['voxel']
    one, other = whose
    lines = _dccd.explain(bodies, kind, [] if vertices is None else vertices, (one, other), voxel, voxels, options)
    return [TraceLine(*line) for line in lines]


def replay(path: str | os.PathLike[str], num_threads: int = 1) -> Replay:
    """Computes a recorded step once more, without its budget.

    Parameters
    ----------
    path : str or path
        A .step file, as the node's ~record_step writes it.
    num_threads : int
        1 to 1024. No answer changes.

    Returns
    -------
    Replay
        outcome; the recorded one (None: the program ended in the step); differences, a sentence each (none: the same bit
        for bit); bodies, voxels and options as detect() takes them; the note of who wrote it.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    ValueError
        It is no recording; the sentence names the byte.
    """
    os.stat(path)  # a FileNotFoundError of Python's own
    return Replay(*_dccd.replay(os.fspath(path), num_threads))
