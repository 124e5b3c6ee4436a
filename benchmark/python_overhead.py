#!/usr/bin/env python3
"""What a step costs from Python above the time that the core itself says it took (total_ms): setting both positions, the call, and
the contacts as an array. The answers are those that check_step gives, or there is no time."""
import argparse
import json
import pathlib
import statistics
import subprocess
import tempfile
import time

import meshio
import numpy as np

import dccd


def ten_triangles():
    """Five that fall through five others."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
    below = np.concatenate([corners + [2 * i, 0, 0] for i in range(5)])
    above = below * .5 + [.1, .1, 1]
    return np.concatenate([below, above]), np.concatenate([below, above - [0, 0, 2]]), np.arange(30).reshape(-1, 3)


def scene(folder):
    first, second = (meshio.read(folder / ('frame_%d.ply' % i)) for i in (0, 1))
    return first.points.astype(float), second.points.astype(float), first.cells_dict['triangle']


def certain_contacts(check_step, t0, t1, triangles):
    """How many there are, by the tool in C++."""
    with tempfile.TemporaryDirectory() as folder:
        frames = [pathlib.Path(folder, '%d.ply' % i) for i in (0, 1)]
        for frame, points in zip(frames, (t0, t1)):
            meshio.write(frame, meshio.Mesh(points, [('triangle', triangles.astype('i4'))]))
        stats = pathlib.Path(folder, 'stats.json')
        subprocess.run([check_step, *frames, '--stats', stats], stdout=subprocess.DEVNULL, check=True)
        return json.loads(stats.read_text())['contacts']


def measure(name, check_step, t0, t1, triangles, repeat):
    body, history = dccd.Body(t0, t1, triangles), dccd.History()
    wanted = certain_contacts(check_step, t0, t1, triangles)
    core_ms, whole_ms = [], []
    for _ in range(repeat + 1):
        started = time.perf_counter()
        body.t0, body.t1 = t0, t1
        outcome = dccd.detect(body, history=history, keep_bounds=False)
        found = np.count_nonzero(outcome.contacts['certain'])
        whole_ms.append(1e3 * (time.perf_counter() - started))
        core_ms.append(outcome.stats['total_ms'])
        assert found == wanted, '%s: %d contacts, not %d' % (name, found, wanted)
    over_ms = [whole - core for whole, core in list(zip(whole_ms, core_ms))[1:]]  # the first makes the trees
    return {'step': name, 'triangles': len(triangles), 'contacts': wanted, 'repeat': repeat, 'core_ms': statistics.median(core_ms[1:]),
            'over_ms': statistics.median(over_ms), 'least_over_ms': min(over_ms)}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--check-step', required=True)
    parser.add_argument('--data', type=pathlib.Path, help='the public data; without it only the small step is measured')
    parser.add_argument('--out', required=True)
    parser.add_argument('--repeat', type=int, default=5)
    arguments = parser.parse_args()
    rows = [measure('ten triangles', arguments.check_step, *ten_triangles(), 2000 * arguments.repeat)]
    if arguments.data:
        rows.append(measure('cloth-ball', arguments.check_step, *scene(arguments.data / 'scenes/cloth-ball'), 10 * arguments.repeat))
    pathlib.Path(arguments.out).write_text(json.dumps(rows, indent=2))


if __name__ == '__main__':
    main()
