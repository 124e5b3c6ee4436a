#!/usr/bin/env python3
"""Contacts over time: goes through a folder of frames (whatever meshio reads), prints each step, and plots them.

usage: contacts_over_time.py FOLDER PICTURE [FRAMES_PER_SECOND]

The frames are meshes with the same triangles, in the order of their names, 2.obj before 10.obj.
"""
import pathlib
import re
import sys

import matplotlib
import meshio
import numpy as np

import dccd

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402  (the backend must be set first)


def contacts_of(files, rate_hz):
    """Yields the time of each step's end [s] and its Outcome."""
    first = meshio.read(files[0])
    body = dccd.Body(first.points, triangles=first.cells_dict['triangle'], name='mesh')
    history = dccd.History()
    for i, file in enumerate(files[1:], 1):
        body.move_to(meshio.read(file).points)
        yield i / rate_hz, dccd.detect(body, history=history, num_threads=2)


def in_order(path):
    """Numbers in a name count as numbers."""
    return [int(part) if part.isdigit() else part for part in re.split(r'([0-9]+)', path.name)]


def main():
    folder, picture = pathlib.Path(sys.argv[1]), sys.argv[2]
    rate_hz = float(sys.argv[3]) if len(sys.argv) > 3 else 30.0
    times, certain, undecided = [], [], []
    for time_s, outcome in contacts_of(sorted((p for p in folder.iterdir() if p.is_file()), key=in_order), rate_hz):
        print('%.3f s: %s' % (time_s, outcome))
        times.append(time_s)
        certain.append(np.count_nonzero(outcome.contacts['certain']))
        undecided.append(np.count_nonzero(~outcome.contacts['certain']))
    pyplot.step(times, certain, where='pre', label='contacts')
    if any(undecided):
        pyplot.step(times, undecided, where='pre', label='undecided')
    pyplot.xlabel('time [s]')
    pyplot.ylabel('in the step that ends then')
    pyplot.legend()
    pyplot.savefig(picture)


if __name__ == '__main__':
    main()
