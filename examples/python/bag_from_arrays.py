#!/usr/bin/env python3
"""A bag for analyze_bag out of positions that are no messages: an array of numpy, or a folder of meshes.

usage: bag_from_arrays.py FRAMES OUT.bag [--topology MESH] [--rate HZ] [--topic NAME] [--frame NAME] [--scale FACTOR]

FRAMES: an .npy of frames x vertices x 3; an .npz that holds such an array, and perhaps `faces` (or `triangles`) of m x 3 or
`edges` (or `lines`) of m x 2, and `times` (or `time`) [s]; or a folder of meshes in whatever format meshio reads, in the order of their names, 2.obj before 10.obj. Vertices
that were lost are NaN.
MESH: a file whose triangles, or whose lines, join the vertices; the numbers are those of the frames. An array without faces is
recorded as points, for topology/rows and cols, or topology/source: polyline, in the file that --params takes.
"""
import argparse
import pathlib
import re
import sys

import genpy
import meshio
import numpy as np
import rosbag
from deformable_ccd.msg import MeshStamped
from geometry_msgs.msg import Point
from shape_msgs.msg import MeshTriangle
from visualization_msgs.msg import Marker

START_S = 1.0  # a stamp of 0 means none


def in_order(path):
    """Numbers in a name count as numbers."""
    return [int(part) if part.isdigit() else part for part in re.split(r'([0-9]+)', path.name)]


def lines_of_obj(path):
    """The segments of its `l`, which meshio passes over without a word."""
    ends = [[int(word.split('/')[0]) - 1 for word in line.split()[1:]] for line in open(path) if re.match(r'\s*l\s', line)]
    return np.array([pair for line in ends for pair in zip(line, line[1:])], int).reshape(-1, 2)


def cells_of(mesh, path):
    """Its triangles and its lines, of which it has one kind; polygons of more corners are the reader's to cut."""
    if pathlib.Path(path).suffix.lower() == '.obj' and len(lines := lines_of_obj(path)):
        mesh.cells.append(meshio.CellBlock('line', lines))
    kinds = {block.type for block in mesh.cells if len(block.data) > 0}
    if kinds - {'triangle', 'line', 'vertex'} or {'triangle', 'line'} <= kinds:
        sys.exit('%s: has %s; triangles, or lines, can be recorded' % (path, ' and '.join(sorted(kinds))))
    return tuple(np.concatenate([block.data for block in mesh.cells if block.type == kind] or [np.empty((0, size), int)])
                 for kind, size in (('triangle', 3), ('line', 2)))


def from_folder(folder):
    """Frames, and the triangles and lines of the first; all must have the same."""
    files = sorted((p for p in folder.iterdir() if p.is_file()), key=in_order)
    if not files:
        sys.exit('%s: has no files' % folder)
    frames, cells = [], None
    for path in files:
        mesh = meshio.read(path)
        own = cells_of(mesh, path)
        cells = cells or own
        if not all(np.array_equal(a, b) for a, b in zip(cells, own)) or mesh.points.shape != (frames or [mesh.points])[0].shape:
            sys.exit('%s: has not the vertices and faces of %s' % (path, files[0]))
        frames.append(mesh.points)
    return np.array(frames), cells


def numbers(load):
    """An array of numbers; None: of anything else, as Python's objects, which are not read."""
    try:
        array = load()
    except ValueError:
        return None
    return array if array.dtype.kind in 'fiu' else None


def from_archive(path):
    """Frames, triangles and lines, and times of an .npz; the latter may be missing. Edges beside faces are the faces' own."""
    archive = np.load(path)
    arrays = {name: numbers(lambda name=name: archive[name]) for name in archive.files}
    frames = [name for name, array in arrays.items() if array is not None and array.ndim == 3 and array.shape[2] == 3]
    if len(frames) != 1:
        sys.exit('%s: has %s of frames x vertices x 3; one is needed' % (path, ' and '.join(frames) or 'no array'))
    one_of = lambda names, otherwise: next((arrays[name] for name in names if arrays.get(name) is not None), otherwise)
    faces, edges = one_of(('faces', 'triangles'), np.empty((0, 3), int)), one_of(('edges', 'lines'), np.empty((0, 2), int))
    for corners, count in ((faces, 3), (edges, 2)):
        if corners.ndim != 2 or corners.shape[1] != count or corners.dtype.kind == 'f':
            sys.exit('%s: faces are whole numbers of faces x 3, and edges of edges x 2' % path)
    return arrays[frames[0]], (faces, edges[:0] if len(faces) else edges), one_of(('times', 'time'), None)


def read(arguments):
    """Frames [m], triangles, lines, times [s]."""
    path, times, cells = pathlib.Path(arguments.frames), None, None
    if path.is_dir():
        frames, cells = from_folder(path)
    elif path.suffix == '.npz':
        frames, cells, times = from_archive(path)
    else:
        frames = numbers(lambda: np.load(path))
        if frames is None:
            sys.exit('%s: is no array of numbers' % path)
    if frames.ndim != 3 or frames.shape[2] != 3 or frames.shape[1] == 0:
        sys.exit('%s: is an array of %s; frames x vertices x 3 is needed' % (path, ' x '.join(map(str, frames.shape))))
    if arguments.topology:
        cells = cells_of(meshio.read(arguments.topology), arguments.topology)
        if not any(map(len, cells)):
            sys.exit('%s: has neither triangles nor lines' % arguments.topology)
    triangles, lines = cells or (np.empty((0, 3), int), np.empty((0, 2), int))
    for corners in (triangles, lines):
        if corners.size and not 0 <= corners.min() <= corners.max() < frames.shape[1]:
            sys.exit('a face names vertex %d, and there are %d' % (corners.max(), frames.shape[1]))
    times = np.arange(len(frames)) / arguments.rate if times is None else np.ravel(times) - np.ravel(times)[0]
    if len(times) != len(frames) or not np.all(np.diff(times) > 0):
        sys.exit('%s: %d times for %d frames, or times that do not rise' % (path, len(times), len(frames)))
    return frames.astype(float) * arguments.scale, triangles, lines, times


def message_of(positions, triangles, lines):
    """Doubles, as the arrays have them: of faces a MeshStamped, of lines a Marker of segments, of neither points."""
    points = [Point(*p) for p in positions.tolist()]
    if len(lines):
        marker = Marker(type=Marker.LINE_LIST, action=Marker.ADD, points=[points[v] for v in lines.ravel().tolist()])
        marker.pose.orientation.w, marker.scale.x = 1, 0.01
        return marker
    return MeshStamped(vertices=points, triangles=[MeshTriangle(vertex_indices=face) for face in triangles.tolist()])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('frames', metavar='FRAMES')
    parser.add_argument('bag', metavar='OUT.bag')
    parser.add_argument('--topology', metavar='MESH', help='file that has the faces or lines')
    parser.add_argument('--rate', type=float, default=30, metavar='HZ', help='frames a second, where there are no times')
    parser.add_argument('--topic', default='/mesh')
    parser.add_argument('--frame', default='world')
    parser.add_argument('--scale', type=float, default=1, help='metres a unit: 0.001 for millimetres')
    arguments = parser.parse_args()
    frames, triangles, lines, times = read(arguments)
    with rosbag.Bag(arguments.bag, 'w') as bag:
        for positions, time in zip(frames, times):
            message, at = message_of(positions, triangles, lines), genpy.Time.from_sec(START_S + time)
            message.header.stamp, message.header.frame_id = at, arguments.frame
            bag.write(arguments.topic, message, at)
    print('%d frames of %d vertices, %d faces and %d lines in %s, topic %s' % (
        *frames.shape[:2], len(triangles), len(lines), arguments.bag, arguments.topic))


if __name__ == '__main__':
    main()
