"""What the live fuzzer sends: messages of all types, whole and damaged, maps and transforms, all of it from one random generator."""
import random
import struct

import rospy
from attack import checkerboard, cloud_of
from deformable_ccd.msg import MeshStamped
from geometry_msgs.msg import Point, TransformStamped
from live_node import bytes_of, raw
from octomap_msgs.msg import Octomap
from pcl_msgs.msg import PolygonMesh, Vertices
from sensor_msgs.msg import PointCloud2
from shape_msgs.msg import Mesh, MeshTriangle
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

ROWS, COLS = 8, 10
ODD = [0.0, -0.0, 1.0, 1e-320, 1e-30, 1e-9, 1e9, 1e30, 1e150, 1e300, float('inf'), float('-inf'), float('nan')]
NAMES = ['world', 'world', 'world', 'world', 'camera', 'nowhere', '', '/', '//cam', 'a b\n', '\x01', 'y' * 3000]
MESHES = [PointCloud2, MeshStamped, PolygonMesh, Mesh, Marker, MarkerArray]


class Source:
    """What is sent: all of it from one random generator."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.stamp_s = 1000.0

    def stamp(self):
        step = self.random.choices([0.03, 0, -0.03, 5.0, -100.0, 1e6], [80, 4, 4, 4, 4, 1])[0]
        self.stamp_s = min(max(self.stamp_s + step, 1.0), 4e9)
        return rospy.Time() if self.random.random() < 0.03 else rospy.Time.from_sec(self.stamp_s)

    def frame_id(self):
        return self.random.choice(NAMES) if self.random.random() < 0.3 else 'world'

    def points(self, count):
        r = self.random
        kind = r.random()
        if kind < 0.1:
            return [(0.1, 0.1, 0.1)] * count  # a tracker that collapsed
        if kind < 0.2:
            return [tuple(r.choice(ODD) for _ in range(3)) for _ in range(count)]
        size = r.choice([0.0, 0.001, 0.01, 0.1])
        at = r.choice([(0, 0, 0), (0.1, 0, 0.2), (10, 10, 10)])
        points = [(at[0] + 0.01 * (i % COLS) + r.uniform(-size, size), at[1] + 0.01 * (i // COLS) + r.uniform(-size, size),
                   at[2] + r.uniform(-size, size)) for i in range(count)]
        if kind < 0.3:
            points[r.randrange(count)] = tuple(r.choice(ODD) for _ in range(3))
        return points

    def triangles(self, points, count):
        top = points if self.random.random() < 0.95 else 2 ** 32 - 1
        return [tuple(self.random.randrange(top) for _ in range(3)) for _ in range(count)]

    def mesh(self, kind):
        r = self.random
        rows, cols = r.choice([(ROWS, COLS), (ROWS, COLS), (2, 2), (1, 7), (20, 30), (1, 1)])
        points = self.points(rows * cols)
        if kind is PointCloud2 or kind is PolygonMesh:
            message = cloud_of(0, points, rows, cols)
            message.header.frame_id, message.header.stamp = self.frame_id(), self.stamp()
            if r.random() < 0.05:
                message.fields = message.fields[:r.randrange(3)]
            if r.random() < 0.05:
                message.point_step = r.choice([0, 1, 23, 2 ** 32 - 1])
            if kind is PointCloud2:
                return message
            faces = self.triangles(len(points), r.choice([0, 1, 50, 500]))
            return PolygonMesh(header=message.header, cloud=message, polygons=[Vertices(f[:r.choice([3, 3, 3, 0, 2])]) for f in faces])
        corners = [Point(*p) for p in points]
        faces = self.triangles(len(points), r.choice([1, 50, 500]))
        if kind is Mesh:
            return Mesh(vertices=corners, triangles=[MeshTriangle(f) for f in faces])
        if kind is MeshStamped:
            message = MeshStamped(vertices=corners, triangles=[MeshTriangle(f) for f in faces])
        else:
            message = Marker(type=r.choice([11, 11, 11, 0, 7]), points=(corners * 3)[:r.choice([3, 30, 31, 90])])
            message.pose.orientation.w = r.choice([1, 1, 1, 0, float('nan')])
        message.header.frame_id, message.header.stamp = self.frame_id(), self.stamp()
        return MarkerArray([message] * r.choice([0, 1, 1, 3])) if kind is MarkerArray else message

    def damaged(self, kind, message):
        """The message with bytes changed, cut or added, or none of its bytes."""
        data = bytearray(bytes_of(message))
        r = self.random
        how = r.random()
        if how < 0.4:
            for _ in range(r.choice([1, 4, 100])):
                data[r.randrange(len(data))] = r.choice([0, 1, 0x7f, 0x80, 0xff, r.randrange(256)])
        elif how < 0.6:
            data = data[:r.randrange(len(data))]
        elif how < 0.8:
            data += bytes(r.choice([1, 1000, 3000000]))
        elif how < 0.9:
            at = 4 * r.randrange(max(1, len(data) // 4 - 1))
            data[at:at + 4] = struct.pack('<I', r.choice([2 ** 31, 2 ** 32 - 1, 1000000, 500000000]))
        else:
            data = r.randbytes(r.choice([0, 3, 100, 1000000]))
        return raw(kind, bytes(data))

    def map(self):
        r = self.random
        data = checkerboard(r.choice([0, 2, 4, 5, 5, 6, 7]))
        if r.random() < 0.2:
            data = r.randbytes(r.choice([0, 2, 100, 100000]))
        if r.random() < 0.1:
            data = data[:r.randrange(len(data) + 1)]
        if r.random() < 0.1:
            data = struct.pack('<H', r.choice([0xaaaa, 0x5555, 0xa5a5, 0xffff])) + data
        whole = Octomap(binary=r.random() < 0.8, id=r.choice(['OcTree'] * 8 + ['ColorOcTree', 'x' * 5000]),
                        resolution=r.choice([0.01, 0.01, 0.05, 1e-5] + ODD))
        whole.header.frame_id, whole.header.stamp = self.frame_id(), rospy.Time()
        # rospy packs int8[] one by one, which takes seconds.
        return raw(Octomap, bytes_of(whole)[:-4] + struct.pack('<I', len(data)) + data)

    def transform(self):
        r = self.random
        t = TransformStamped(child_frame_id=r.choice(['camera', 'camera', 'camera', 'world', '', '//a', 'z' * 1000]))
        t.header.frame_id = r.choice(['world', 'world', 'camera', '', 'nowhere'])
        t.header.stamp = rospy.Time.from_sec(max(0, self.stamp_s + r.choice([0, 0, 0.1, -0.1, -1000, 1e6])))
        t.transform.translation.x = r.choice([0.0, 0.1] + ODD)
        t.transform.rotation.w = r.choice([1.0, 1.0, 1.0, 0.5, 0.0, float('nan')])
        return TFMessage([t] * r.choice([0, 1, 1, 1, 200]))
