"""What came: the messages of a bag, mesh files and octomaps, read by readers of their own.

A reader either has all of an input, counts what it passed over (`unchecked`), or raises: NotCovered where this audit does
not know the form, Refused where the pages (doc/messages.md, doc/mesh_files.md) say that the monitor must refuse it.
"""
import os
import re
import struct
import subprocess
import xml.etree.ElementTree as xml
from dataclasses import dataclass, field, replace

import numpy as np


class NotCovered(Exception):
    """This audit cannot judge it."""


class Refused(Exception):
    """By the pages this is no input."""


@dataclass
class Surface:
    """Which vertices make edges and faces."""
    vertices: int
    faces: np.ndarray = field(default_factory=lambda: np.empty((0, 3), int))
    lines: np.ndarray = field(default_factory=lambda: np.empty((0, 2), int))

    def __post_init__(self):
        sides = [np.sort(self.faces[:, [i, (i + 1) % 3]], axis=1) for i in range(3)] + [np.sort(self.lines, axis=1)]
        every = np.concatenate(sides) if len(self.faces) or len(self.lines) else np.empty((0, 2), int)
        self.edges, counts = np.unique(every, axis=0, return_counts=True) if len(every) else (every, np.empty(0))
        self.used = np.unique(self.edges)
        self.closed = len(self.faces) > 0 and len(self.lines) == 0 and bool((counts % 2 == 0).all())
        self.pieces = np.arange(self.vertices)  # vertices that edges join have one number
        while len(self.edges):
            least = self.pieces[self.edges].min(1)
            joined = self.pieces.copy()
            np.minimum.at(joined, self.edges.ravel(), np.repeat(least, 2))
            joined = joined[joined]
            if (joined == self.pieces).all():
                break
            self.pieces = joined

    def same_as(self, other):
        return self is other or (self.vertices == other.vertices and np.array_equal(self.edges, other.edges)
                and np.array_equal(np.unique(np.sort(self.faces, 1), axis=0), np.unique(np.sort(other.faces, 1), axis=0)))


@dataclass
class Frame:
    """One body at one time, in the coordinates of its message."""
    stamp: int       # [ns]
    frame: str
    positions: np.ndarray
    surface: Surface = None
    unseen: np.ndarray = None  # of each vertex: it is not finite, or of no edge, and where no neighbour is that has one
    unchecked: int = 0         # faces that could not be used
    came: int = 0    # [ns] when the bag has it
    number: int = 0  # place among all messages


def grid(rows, cols):
    """Row by row; the two faces of a cell meet in the edge from (row, col + 1) to (row + 1, col)."""
    a = (np.arange(rows - 1)[:, None] * cols + np.arange(cols - 1)).ravel()
    faces = np.stack([np.stack([a, a + cols, a + 1], 1), np.stack([a + 1, a + cols, a + cols + 1], 1)], 1)
    return Surface(rows * cols, faces.reshape(-1, 3))


def fans(polygons, positions):
    """Triangles, and how many polygons are neither these nor lie in one. One of more corners must be convex to be judged here."""
    faces, odd = [], []
    for sent in polygons:
        corners = [c for i, c in enumerate(sent) if c != sent[i - 1]]
        if len(set(corners)) != len(corners) or len(corners) < 3:
            odd.append(set(sent))
            continue
        if len(corners) > 3:
            p = positions[corners]
            turns = np.cross(np.roll(p, -1, 0) - p, np.roll(p, -2, 0) - np.roll(p, -1, 0))
            if not ((turns @ turns.sum(0)) > 0).all():
                raise NotCovered('a polygon of %d corners that is not convex' % len(corners))
        faces += [[corners[0], corners[i], corners[i + 1]] for i in range(1, len(corners) - 1)]
    return np.array(faces, int).reshape(-1, 3), sum(len(one) > 2 or not any(one.issubset(face) for face in faces) for one in odd)


def welded(corners):
    """Corners of equal coordinates are one vertex, numbered by their first."""
    known, index, kept = {}, [], []
    for c in (corners + 0.0).tolist():  # -0.0 is 0.0
        number = known.setdefault(tuple(None if x != x else x for x in c), len(known))
        if number == len(kept):
            kept.append(c)
        index.append(number)
    return np.array(kept).reshape(-1, 3), np.array(index, int)


# -- messages -----------------------------------------------------------------------------------------------------------


def cloud_points(message, names='xyz'):
    fields = {f.name: f for f in message.fields}
    n, order = message.height * message.width, '>' if message.is_bigendian else '<'
    row = message.row_step if message.height > 1 else message.width * message.point_step
    if message.height > 1 and len(message.data) == n * message.point_step:
        row = message.width * message.point_step
    columns = []
    for name in names:
        if name not in fields or fields[name].datatype not in (7, 8):
            raise Refused('no field %s of floats' % name)
        kind = np.dtype(order + ('f4' if fields[name].datatype == 7 else 'f8'))
        if len(message.data) < (message.height - 1) * row + (message.width - 1) * message.point_step + \
                fields[name].offset + kind.itemsize:
            raise Refused('fewer data than points')
        columns.append(np.ndarray((message.height, message.width), kind, message.data, fields[name].offset,
                                  (row, message.point_step)).astype(float).ravel())
    return np.stack(columns, 1)


def viewpoint(message, points):
    """Where the points of a cloud were seen from, in its frame: one place, or None."""
    names = 'vp_x', 'vp_y', 'vp_z'
    if not {f.name for f in message.fields}.issuperset(names):
        return None
    places = cloud_points(message, names)
    places = np.unique(places[np.isfinite(places).all(1) & np.isfinite(points).all(1)], axis=0)
    if len(places) > 1:
        raise Refused('its points were seen from different places')
    return places if len(places) else None


def rotation(q):
    """The matrix of the quaternion x, y, z, w."""
    x, y, z, w = np.asarray(q, float) / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


class Reader:
    """Of the messages of one body: what its parameters, and the frames before, say of the topology."""

    def __init__(self, settings, files):
        self.settings, self.files = settings, files
        self.weld = self.known = None

    def read(self, message, kind, came, number):
        header = getattr(message, 'header', None)
        if kind == 'visualization_msgs/MarkerArray':
            given = message.markers[:None if all(x.type == 4 for x in message.markers) else 1]  # of ropes the earliest counts
            header = min((x.header for x in given), key=lambda one: one.stamp, default=None)
        if kind == 'pcl_msgs/PolygonMesh' and not message.header.frame_id:
            header = message.cloud.header
        stamp = header.stamp.to_nsec() if header and header.stamp.to_nsec() else came
        name = (header.frame_id if header and header.frame_id else self.settings.get('frame_id', '')).lstrip('/')
        positions, surface, unchecked = getattr(self, kind.split('/')[1])(message)
        surface = self.given(positions) or surface
        if surface is None:
            raise Refused('nothing says which vertices make the faces')
        if surface.vertices != len(positions):
            raise Refused('%d points, and a topology of %d' % (len(positions), surface.vertices))
        surface = self.known if self.known is not None and surface.same_as(self.known) else surface
        self.known = surface
        again = np.append(False, (positions[1:] == positions[:-1]).all(1)) & (not len(surface.faces))  # in a rope, as one before
        unseen = ~np.isfinite(positions).all(1) | ~(np.isin(np.arange(len(positions)), surface.used) | again)
        return Frame(stamp, name, positions, surface, unseen, unchecked, came, number)

    def given(self, positions):
        topology = self.settings.get('topology', {})
        topology = {'source': topology} if isinstance(topology, str) else topology
        if topology.get('source') == 'depth_image':
            raise NotCovered('a depth image as a body')
        if 'file' in topology:
            return self.files.mesh(topology['file'])[1]
        if topology.get('rows') and topology.get('cols'):
            return self.reuse(('grid', topology['rows'], topology['cols']), lambda: grid(topology['rows'], topology['cols']))
        if topology.get('source') == 'polyline':
            return self.roped(positions, range(0, len(positions), len(positions) // self.ropes_in_rows))
        return None

    made, ropes_in_rows = (None, None), 1

    def reuse(self, key, make):
        if self.made[0] != key:
            self.made = (key, make())
        return self.made[1]

    def roped(self, points, begins):  # of equal neighbours the first is all
        i = np.flatnonzero(np.append(True, (points[1:] != points[:-1]).any(1)) | np.isin(np.arange(len(points)), begins))
        lines = np.stack([i[:-1], i[1:]], 1)[~np.isin(i[1:], begins)]
        return self.reuse(('rope', len(points), lines.tobytes()), lambda: Surface(len(points), lines=lines))

    def PointCloud2(self, m):
        points = cloud_points(m)
        if not len(points):
            raise Refused('no points')
        self.ropes_in_rows = m.height if m.width > 1 else 1
        surface = self.reuse(('grid', m.height, m.width), lambda: grid(m.height, m.width)) \
            if m.height > 1 and m.width > 1 else None
        return points, surface, 0

    def MeshStamped(self, m):
        points = np.array([(p.x, p.y, p.z) for p in m.vertices], float).reshape(-1, 3)
        return (points,) + self.indexed([t.vertex_indices for t in m.triangles], points)

    Mesh = MeshStamped

    def PolygonMesh(self, m):
        points = cloud_points(m.cloud)
        return (points,) + self.indexed([p.vertices for p in m.polygons], points)

    def indexed(self, polygons, points):
        if not polygons:
            return self.known, 0
        if max(max(p) for p in polygons if p) >= len(points):
            raise Refused('an index that is no vertex')
        key = tuple(tuple(p) for p in polygons)
        if self.made[0] != key:
            faces, lost = fans(polygons, points)
            self.made = (key, Surface(len(points), faces), lost)
        return self.made[1], self.made[2]

    def MarkerArray(self, m):
        given = getattr(m, 'markers', [m])
        marker = self.settings.get('marker', {})
        mine = [x for x in given if x.action == 0 and (x.type == 11 or x.type in (4, 5, 7, 8))
                and marker.get('namespace', x.ns) == x.ns and marker.get('id', x.id) == x.id]
        soup = [x for x in mine if x.type == 11] or [x for x in mine if x.type == 5 and len(mine) == 1]
        if not soup:
            return self.ropes(mine)
        if len({(x.ns, x.id) for x in soup}) > 1:
            raise NotCovered('several lists of triangles in a message')
        size = 3 if soup[0].type == 11 else 2
        corners = self.placed(soup[0], size == 3)
        if len(corners) % size:
            raise Refused('no whole number of triangles, or of segments')
        fits = lambda weld: np.array_equal(corners[np.unique(weld, return_index=True)[1]][weld], corners, equal_nan=True)
        if self.weld is None or len(self.weld) != len(corners) or size == 2 and not fits(self.weld):
            self.weld = welded(corners)[1]  # of segments the ends are joined anew where some come apart
        if not fits(self.weld):
            raise NotCovered('welded corners that come apart')
        corners = corners[np.unique(self.weld, return_index=True)[1]]
        cells = self.weld.reshape(-1, size)
        if size == 2:
            cells = cells[cells[:, 0] != cells[:, 1]]
            return corners, self.reuse(('lines', len(corners), cells.tobytes()), lambda: Surface(len(corners), lines=cells)), 0
        faces, lost = fans(cells.tolist(), corners)
        return corners, self.reuse(('soup', faces.tobytes()), lambda: Surface(len(corners), faces)), lost

    Marker = MarkerArray

    def ropes(self, markers):
        strips = [x for x in markers if x.type == 4 and len(x.points) > 1]
        if strips and not any(x.type == 5 for x in markers):
            parts = [self.placed(x, False) for x in sorted(strips, key=lambda x: (x.ns, x.id))]
            ends = [tuple(p[i]) for p in parts for i in (0, -1)]
            if len(set(ends)) < len(ends):
                raise NotCovered('ropes of which two ends are one')
            at = np.concatenate(parts)
            return at, self.roped(at, np.cumsum([0] + [len(p) for p in parts[:-1]])), 0
        if len(markers) == 1 and markers[0].type in (7, 8):
            return self.placed(markers[0], False), None, 0
        raise NotCovered('these markers: types %s' % sorted({x.type for x in markers}))

    def placed(self, m, scaled):
        points = np.array([(p.x, p.y, p.z) for p in m.points], float).reshape(-1, 3)
        scale = (m.scale.x, m.scale.y, m.scale.z)
        if scaled and any(scale) and scale != (1, 1, 1):
            points = points * scale
        q, t = m.pose.orientation, m.pose.position
        quaternion = (q.x, q.y, q.z, q.w)
        if any(quaternion) and quaternion != (0, 0, 0, 1):
            points = points @ rotation(quaternion).T
        return points + (t.x, t.y, t.z) if (t.x, t.y, t.z) != (0, 0, 0) else points

    def PoseArray(self, m):
        points = np.array([(p.position.x, p.position.y, p.position.z) for p in m.poses], float).reshape(-1, 3)
        if len(points) < 2:
            raise Refused('fewer than two poses')
        return points, self.roped(points, [0]), 0


# -- files --------------------------------------------------------------------------------------------------------------


class Files:
    """Mesh files, by path or package://, each read once: positions, surface, how many polygons could not be used."""

    def __init__(self, folder='.'):
        self.folder, self.meshes = folder, {}

    def path(self, name):
        if name.startswith('package://'):
            package, rest = name[10:].split('/', 1)
            found = subprocess.run(['rospack', 'find', package], capture_output=True, text=True).stdout.strip()
            return os.path.join(found, rest)
        return os.path.join(self.folder, name[7:] if name.startswith('file://') else name)

    def mesh(self, name):
        if name not in self.meshes:
            path = self.path(name)
            reader = {'.obj': read_obj, '.ply': read_ply, '.stl': read_stl}.get(os.path.splitext(path)[1].lower())
            if reader is None:
                raise NotCovered('mesh files as %s' % name)
            positions, polygons, lines = reader(path)
            faces, lost = fans(polygons, positions)
            self.meshes[name] = positions, Surface(len(positions), faces, np.array(lines, int).reshape(-1, 2)), lost
        return self.meshes[name]


def read_obj(path):
    vertices, polygons, lines = [], [], []
    for line in open(path).read().replace('\\\n', ' ').splitlines():
        word = line.split('#')[0].split()
        if word and word[0] == 'v':
            vertices.append([float(w) for w in word[1:4]])
        elif word and word[0] in 'fl':
            corner = [int(w.split('/')[0]) for w in word[1:]]
            corner = [c - 1 if c > 0 else len(vertices) + c for c in corner]
            if word[0] == 'f':
                polygons.append(corner)
            else:
                lines += zip(corner, corner[1:])
    return np.array(vertices).reshape(-1, 3), polygons, lines


def read_stl(path):
    data = open(path, 'rb').read()
    count = struct.unpack_from('<I', data, 80)[0] if len(data) >= 84 else 0
    if len(data) >= 84 and len(data) >= 84 + 50 * count and not (data[:5] == b'solid' and b'facet' in data[:1000]):
        records = np.frombuffer(data, np.dtype([('n', '<f4', 3), ('v', '<f4', (3, 3)), ('a', '<u2')]), count, 84)
        corners = records['v'].astype(float).reshape(-1, 3)
    else:
        words = re.findall(rb'(?i)vertex\s+(\S+)\s+(\S+)\s+(\S+)', data)
        corners = np.array([[float(w) for w in v] for v in words]).reshape(-1, 3)
    positions, index = welded(corners)
    return positions, index.reshape(-1, 3).tolist(), []


PLY_TYPES = {'char': 'i1', 'uchar': 'u1', 'short': 'i2', 'ushort': 'u2', 'int': 'i4', 'uint': 'u4', 'float': 'f4', 'double': 'f8',
             'int8': 'i1', 'uint8': 'u1', 'int16': 'i2', 'uint16': 'u2', 'int32': 'i4', 'uint32': 'u4', 'float32': 'f4', 'float64': 'f8'}


def read_ply(path):
    data = open(path, 'rb').read()
    end = data.index(b'end_header')
    body = data.index(b'\n', end) + 1
    elements, form = [], None
    for line in data[:end].decode('latin-1').splitlines():
        word = line.split()
        if word[:1] == ['format']:
            form = word[1]
        elif word[:1] == ['element']:
            elements.append((word[1], int(word[2]), []))
        elif word[:1] == ['property']:
            elements[-1][2].append(word[1:])
    at, text, order = body, iter(data[body:].split()), '>' if form == 'binary_big_endian' else '<'

    def value(kind):
        nonlocal at
        if form == 'ascii':
            word = next(text)
            return float(np.float32(word)) if PLY_TYPES[kind] == 'f4' else float(word)
        kind = np.dtype(order + PLY_TYPES[kind])
        at += kind.itemsize
        return np.frombuffer(data, kind, 1, at - kind.itemsize)[0].item()

    read = {}
    for name, count, properties in elements:
        one = lambda p: [value(p[2]) for _ in range(int(value(p[1])))] if p[0] == 'list' else value(p[0])
        read[name] = [{p[-1]: one(p) for p in properties} for _ in range(count)]
    vertices = np.array([[r['x'], r['y'], r['z']] for r in read.get('vertex', [])]).reshape(-1, 3)
    polygons = [[int(i) for i in r.get('vertex_indices', r.get('vertex_index', []))] for r in read.get('face', [])]
    lines = [(int(r['vertex1']), int(r['vertex2'])) for r in read.get('edge', [])] if not polygons else []
    if set(read) - {'vertex', 'face', 'edge'}:
        raise NotCovered('a PLY with the elements %s' % sorted(read))
    return vertices, polygons, lines


# -- robots -------------------------------------------------------------------------------------------------------------


def boxed(size):
    """Corners and faces of a box around the origin."""
    points = np.array([[x, y, z] for z in (-.5, .5) for y in (-.5, .5) for x in (-.5, .5)]) * size
    return points, [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def turned(radius, half):
    """Of a cylinder around z, or of a sphere, which has no length: rings of 32 corners, from pole to pole, where they are one."""
    rings = [(radius, -half), (radius, half)] if half else [(radius * np.sin(a), -radius * np.cos(a)) for a in np.linspace(0, np.pi, 17)[1:-1]]
    turn = np.arange(32) * np.pi / 16
    points = [np.stack([r * np.cos(turn), r * np.sin(turn), 0 * turn + z], 1) for r, z in [(0, -(half or radius)), *rings, (0, half or radius)]]
    points, index = welded(np.concatenate(points))
    return points, [[index[32 * k + n] for k, n in ((k, i), (k, (i + 1) % 32), (k + 1, (i + 1) % 32), (k + 1, i))]
                    for k in range(len(rings) + 1) for i in range(32)]


def origin(element):
    """The pose that an origin of a URDF says, 4 x 4; without one none."""
    m = np.eye(4)
    if element is not None:
        x, (r, p, y) = ([float(w) for w in element.get(name, '0 0 0').split()] for name in ('xyz', 'rpy'))
        (cr, cp, cy), (sr, sp, sy) = np.cos(np.array([r, p, y]) / 2), np.sin(np.array([r, p, y]) / 2)
        m[:3, :3] = rotation((sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy))
        m[:3, 3] = x
    return m


def links(path, files):
    """Each collision element of a URDF: link, positions, surface, lost, whether it is round: then its mesh lies within it."""
    tree = xml.parse(path).getroot()
    for link in tree.findall('link'):
        for element in link.findall('collision'):
            shape = element.find('geometry')[0]
            numbers = lambda name, default='': [float(w) for w in shape.get(name, default).split()]
            if shape.tag == 'mesh':
                points, surface, lost = files.mesh(shape.get('filename'))
                points = points * numbers('scale', '1 1 1')
            elif shape.tag in ('box', 'cylinder', 'sphere'):
                points, polygons = boxed(numbers('size')) if shape.tag == 'box' else turned(float(shape.get('radius')), float(shape.get('length', 0)) / 2)
                faces, lost = fans(polygons, points)
                surface = Surface(len(points), faces)
            else:
                raise NotCovered('a link of shape %s' % shape.tag)
            pose = origin(element.find('origin'))
            points = points @ pose[:3, :3].T + pose[:3, 3]
            yield link.get('name'), points, surface, lost, shape.tag in ('cylinder', 'sphere')


# -- octomaps -----------------------------------------------------------------------------------------------------------


NO_KEYS = np.empty((0, 3), int)


@dataclass
class Map:
    """Occupied leaves as cubes: the smallest key and the edge, in voxels. Key k begins at (k - 32768) resolution."""
    resolution: float
    corners: np.ndarray  # n x 3
    sizes: np.ndarray
    stamp: int = 0
    frame: str = ''
    came: int = 0
    number: int = 0
    problem: str = ''  # why it cannot be read
    rays: tuple = ((), ())  # of a cloud, where its sensor was, and the points
    doubt: tuple = ()  # of clouds, what may not be an obstacle yet: three points in turn make one of what was seen free for ever
    free: tuple = (NO_KEYS, np.empty(0, int))  # leaves that are known to be free, as the two above

    def without(self, part):
        """The map without a part of it: of leaves, corners and sizes, `part` says which it does not meet, and which lie in it. The others are split."""
        corners, sizes, kept = self.corners, self.sizes, [(self.corners[:0], self.sizes[:0])]
        while len(sizes):
            out, gone = part(corners, sizes)
            kept.append((corners[out], sizes[out]))
            split = ~out & ~gone & (sizes > 1)
            half = sizes[split] // 2
            corners = np.concatenate([corners[split] + half[:, None] * [i & 1, i >> 1 & 1, i >> 2] for i in range(8)])
            sizes = np.tile(half, 8)
        corners, sizes = map(np.concatenate, zip(*kept))
        return replace(self, corners=corners, sizes=sizes)

    def boxed(self, boxes, carry):
        """The part in the boxes: the finest voxels whose centre, carried into their frame, lies in one of them."""
        def part(corners, sizes):
            middle = carry((corners - 32768 + sizes[:, None] / 2) * self.resolution)
            reach = ((sizes - 1) / 2 * self.resolution * 3 ** 0.5)[:, None]
            out, gone = np.ones(len(sizes), bool), np.zeros(len(sizes), bool)
            for box in boxes:
                low, high = np.array(box[:3]) - 1e-9, np.array(box[3:]) + 1e-9
                out &= ((middle + reach < low) | (middle - reach > high)).any(1)
                gone |= ((middle - reach >= low) & (middle + reach <= high)).all(1)
            return out, gone
        return part


def leaves_of(data, binary, bytes_a_node=4):
    """Those that are occupied, and those that are free: smallest keys, and edges."""
    found, at = ([], []), 0
    stack = [(0, 0, 0, 65536)] if len(data) else []
    while stack:
        x, y, z, size = stack.pop()
        half = size // 2
        child = lambda i: (x + half * (i & 1), y + half * (i >> 1 & 1), z + half * (i >> 2 & 1), half)
        if binary:
            bits = data[at] | data[at + 1] << 8
            at += 2
            kinds = [bits >> (2 * i) & 3 for i in range(8)]
            for i in range(8):
                if kinds[i] in (1, 2):
                    found[kinds[i] == 1].append(child(i))
            stack += [child(i) for i in reversed(range(8)) if kinds[i] == 3]
        else:
            value, bits = struct.unpack_from('<f', data, at)[0], data[at + bytes_a_node]
            at += bytes_a_node + 1
            if bits == 0:
                found[value < 0].append((x, y, z, size))
            stack += [child(i) for i in reversed(range(8)) if bits >> i & 1]
    found = [np.array(leaves, int).reshape(-1, 4) for leaves in found]
    return [(leaves[:, :3], leaves[:, 3]) for leaves in found]


def octomap(data, binary, kind, resolution):
    data = bytes(b & 255 for b in data) if not isinstance(data, bytes) else data
    if data[:9] == b'# Octomap':
        head, data = data.split(b'\ndata\n', 1)
        words = dict(line.split(None, 1) for line in head.decode('latin-1').splitlines() if not line.startswith('#'))
        kind, resolution, binary = words.get('id', kind).strip(), float(words['res']), b'binary' in head.split(b'\n')[0]
    nodes = {'OcTree': 4, 'ColorOcTree': 7}
    if not binary and kind not in nodes:
        raise NotCovered('a full octomap of type %s' % kind)
    occupied, free = leaves_of(data, binary, nodes.get(kind, 4))
    return Map(resolution, *occupied, free=free)


def picture_points(m, infos):
    """Pixels of a depth picture, as points of its optical frame; those without a depth are NaN. Where no info has its stamp, all say the same."""
    infos = [info for info in infos if info.header.stamp == m.header.stamp][-1:] or infos
    if len({info.P for info in infos}) != 1 or not (info := infos[0]).P[0] > 0 or (info.height, info.width) != (m.height, m.width):
        raise NotCovered('several CameraInfos, none of them of a picture\'s stamp') if len(infos) > 1 else Refused('no camera_info is of this picture')
    kind, metres = {'16UC1': ('u2', 0.001), 'mono16': ('u2', 0.001), '32FC1': ('f4', 1.0)}[m.encoding]
    depth = np.ndarray((m.height, m.width), ('>' if m.is_bigendian else '<') + kind, m.data, 0, (m.step, np.dtype(kind).itemsize))
    z = np.where(depth > 0, depth * metres, np.nan)
    v, u = np.indices(z.shape)
    return np.stack([(u - info.P[2]) * z / info.P[0], (v - info.P[6]) * z / info.P[5], z], 2).reshape(-1, 3)


def filled(points, sensor, settings, most_off=1e-4):
    """The voxels that a cloud of the map's frame fills for certain: keys. A point next to a border may be in either voxel."""
    edge, box = settings.get('obstacle_resolution_m', 0.05), settings.get('obstacle_box')
    away = np.linalg.norm(points - sensor, axis=1)
    most = settings.get('obstacle_max_range_m', 0) or 4000 * edge
    points = points[(away > settings.get('obstacle_min_range_m', 0.01) * (1 + 1e-6)) & (away < most * (1 - 1e-6))]
    if box:
        points = points[((points > np.array(box[:3]) + edge) & (points < np.array(box[3:]) - edge)).all(1)]
    keys = np.floor(points / edge)
    inside = np.abs(points / edge - keys - 0.5).max(1, initial=0) < 0.5 - most_off
    return np.unique(keys[inside].astype(int) + 32768, axis=0).reshape(-1, 3)
