#!/usr/bin/env python3
"""Is a simulator's step valid, and if not, what is the largest one that is? (ipc-toolkit's is_step_collision_free and
compute_collision_free_stepsize, without a tolerance)."""
import numpy as np

import dccd


def is_valid(before, after, triangles, history=None):
    """Whether nothing touches on the straight way from `before` to `after`, (n, 3) [m], and nothing crosses at its start."""
    return dccd.detect(dccd.Body(before, after, triangles), history=history, earliest_only=True).clear


def largest_valid_step(before, after, triangles):
    """The part of the way, 0 to 1, that can be gone; 0.0 where something touches already, or nothing can be proved."""
    body = dccd.Body(before, after, triangles)
    history = dccd.History()
    part = 1.0
    while part > 0:
        body.t1 = before + part * (after - before)
        outcome = dccd.detect(body, history=history, earliest_only=True)
        if outcome.clear:
            return part
        if not outcome.proved or outcome.start_state != 'CLEAR':
            return 0.0
        # earliest_toc is never late. Just short of it, since the positions there are rounded.
        part *= min(outcome.earliest_toc, 1.0) * (1 - 2.0**-30)
    return part


def main():
    # A triangle falls through another one; the time of contact is 2/3.
    before = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [.2, .2, 1], [.4, .2, 1], [.2, .4, 1]], dtype=float)
    after = before.copy()
    after[3:, 2] -= 1.5
    triangles = np.array([[0, 1, 2], [3, 4, 5]])
    print('valid' if is_valid(before, after, triangles) else 'not valid')
    part = largest_valid_step(before, after, triangles)
    print('the largest valid step: %.9f' % part)
    assert is_valid(before, before + part * (after - before), triangles)


if __name__ == '__main__':
    main()
