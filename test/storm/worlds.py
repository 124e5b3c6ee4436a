"""Worlds of the storm: what a seed makes of bodies, frames, maps and faults, as messages in the order in which they come, and parameters."""
import math
import random
import struct

import numpy as np
import rospy
from deformable_ccd.msg import MeshStamped
from geometry_msgs.msg import Point, Pose, PoseArray, TransformStamped, TwistStamped
from octomap_msgs.msg import Octomap
from pcl_msgs.msg import PolygonMesh, Vertices
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from shape_msgs.msg import MeshTriangle
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from visualization_msgs.msg import Marker

NS, START = 10 ** 9, 1000 * 10 ** 9
FINGER = np.array([[-.03, -.03, -.03], [.03, -.03, -.03], [0, .03, -.03], [0, 0, .03]])


def tetrahedron(by=(0, 0, 0)):
    """A finger, moved, as the text of an OBJ."""
    return ''.join('v %r %r %r\n' % tuple(p) for p in (FINGER + by).tolist()) + 'f 1 2 3\nf 1 2 4\nf 2 3 4\nf 3 1 4\n'


FINGER_OBJ, ROD_OBJ = tetrahedron(), tetrahedron((0, 0, .09))
ROBOT = ('<robot name="arm"><link name="base"/><link name="tool"><collision><geometry><box size="0.05 0.05 0.05"/></geometry></collision></link>'
         '<link name="wrist"><collision><origin xyz="0 0 0.1" rpy="0.3 0 0"/><geometry><cylinder radius="0.03" length="0.06"/></geometry></collision></link>'
         '<joint name="j" type="floating"><parent link="base"/><child link="tool"/></joint><joint name="swing" type="revolute"><parent link="base"/>'
         '<child link="wrist"/><origin xyz="0.05 0 0.03"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="9"/></joint></robot>')
FAULTS = ('damaged', 'lost', 'late', 'twice', 'out of order', 'other stamp', 'elsewhere', 'stops', 'jumps', 'differs', 'other publisher')


def stamp(ns):
    return rospy.Time(ns // NS, ns % NS)


def octree(keys, free=()):
    """The bytes of a binary octree that has these finest voxels, of keys, and has seen those others free."""
    tree = {}
    for kind, some in ((1, free), (2, keys)):
        for key in some:
            node = tree
            for level in range(15, -1, -1):
                child = sum((k >> level & 1) << i for i, k in enumerate(key))
                node = node.setdefault(child, {}) if level else node.update({child: kind})
    out = []

    def write(node, level):
        kinds = [0 if i not in node else node[i] if level == 0 else 3 for i in range(8)]
        bits = sum(kind << (2 * i) for i, kind in enumerate(kinds))
        out.extend((bits & 255, bits >> 8))
        for i in range(8):
            if kinds[i] == 3:
                write(node[i], level - 1)
    write(tree, 15)
    return [b - 256 if b > 127 else b for b in out]


def full_octree(cubes, sure):
    """The bytes of a full octree: of each cube's smallest key and level (0 is a finest voxel) whether it is occupied, with those log-odds. The first
    of two that overlap counts."""
    root = {}
    for key, level, occupied in cubes:
        node = root
        for at in range(15, level - 1, -1):
            child = sum((k >> at & 1) << i for i, k in enumerate(key))
            if at == level:
                node.setdefault(child, sure if occupied else -sure)
            else:
                node = node.setdefault(child, {})
                if not isinstance(node, dict):
                    break

    def bytes_of(node):
        if not isinstance(node, dict):
            return struct.pack('<fB', node, 0)
        return struct.pack('<fB', sure, sum(1 << i for i in node)) + b''.join(bytes_of(node[i]) for i in sorted(node))
    return list(np.frombuffer(bytes_of(root), np.int8))


class Way:
    """A place over time that goes to and fro, smoothly or in jerks, and an angle about an axis."""

    def __init__(self, r, far, turn, tame):
        self.middle = np.array([r.uniform(-.05, .05), r.uniform(-.05, .05), r.uniform(-.05, .15)]) * far
        calm = tame or r.random() < .6
        self.waves = [(r.uniform(0, .03 if calm else .12) * far * (3 if i == 2 else 1), r.uniform(.3, 1.5 if calm else 9), r.uniform(0, 6.3))
                      for i in range(3)]
        self.jerks = [(r.uniform(0, 1.5), r.uniform(.01, .06), r.uniform(-.25, .25) * far) for _ in range(r.choice([0, 0, 1, 3]) * (not tame))]
        axis = np.array([r.gauss(0, 1) for _ in range(3)])
        self.axis = axis / np.linalg.norm(axis)
        self.turn = (r.uniform(0, 2.5) * (.1 if calm else 1), r.uniform(.3, 1 if calm else 5), r.uniform(0, 6.3)) if turn else (0, 1, 0)

    def at(self, t):
        p = self.middle + [a * math.sin(w * t + f) for a, w, f in self.waves]
        p[2] += sum(by for when, long, by in self.jerks if when <= t < when + long)
        a, w, f = self.turn
        angle = a * math.sin(w * t + f)
        return p, np.append(self.axis * math.sin(angle / 2), math.cos(angle / 2))


class World:
    """rows: [topic, message, when it comes (ns), publisher]; params: what the monitor is told; faults: which were made."""

    def __init__(self, seed, folder, faults=None):
        self.r, self.folder, self.rows, self.seed = random.Random(seed), folder, [], seed
        r = self.r
        self.tame = seed % 10 == 0
        self.seconds, self.begin = r.choice([.8, 1.2, 1.6]), START + r.choice([0, 0, 7, 699 * 10 ** 6, 7 * 10 ** 17])
        self.params = {'fixed_frame': 'world', 'bodies': {}}
        self.frames()
        for i in range(1 if self.tame else r.choice([1, 1, 2, 2, 3])):
            self.stream('body%d' % i, i)
        if r.random() < .6:
            self.params['bodies']['finger'] = {'rigid': {'mesh': folder + '/finger.obj', 'frame': self.chain[-1]}}
        if r.random() < .3:
            self.stream('plate', 9, static=True)
        if r.random() < .25:
            self.robot()
        if r.random() < .5:
            self.map()
        self.options()
        self.camera(random.Random(-seed))  # of its own, so that worlds without a camera stay what they were
        self.rarely(random.Random(seed + NS))
        self.otherwise(random.Random(seed + 3 * NS))
        self.rows.sort(key=lambda row: row[2])
        self.faults = []
        if not self.tame:
            for kind in faults if faults is not None else [r.choice(FAULTS) for _ in range(r.choice([0, 1, 1, 2, 3]))]:
                self.fault(kind)
        self.ahead(random.Random(seed + 2 * NS))
        self.handed_over(random.Random(seed + 4 * NS))
        self.services(random.Random(seed + 5 * NS))
        self.rows.sort(key=lambda row: row[2])
        for before, row in zip(self.rows, self.rows[1:]):  # no two at once
            row[2] = max(row[2], before[2] + 1000)

    def ticks(self, hz, before=0.0):
        r, at = self.r, self.r.uniform(0, 1 / hz) - before
        while at < self.seconds + before:
            yield at
            at += (1 if self.tame else r.uniform(.7, 1.3) if r.random() < .2 else 1) / hz

    def add(self, topic, message, at, delay=0.0):
        self.rows.append([topic, message, self.begin + int(round((at + delay) * NS)), topic])

    def ns(self, at):
        return self.begin + int(round(at * NS))

    # -- frames ----------------------------------------------------------------------------------------------------

    def frames(self):
        """A chain of moving frames from the world on, and one static frame."""
        r = self.r
        self.chain, parent = [], 'world'
        for i in range(1 if self.tame else r.choice([1, 1, 2, 3, 4])):
            name = 'joint%d' % i
            self.tf(name, parent, Way(r, .7 if i == 0 else .4, r.random() < .7, self.tame))
            self.chain.append(name)
            parent = name
        self.mount = TransformStamped(child_frame_id='mount')
        self.mount.header.frame_id = 'world'
        self.mount.transform.translation.x, self.mount.transform.rotation.w = .02, 1
        for k in range(1 if self.tame else r.choice([1, 1, 2])):
            self.add('/tf_static', TFMessage([self.mount]), -.3 if self.tame or k == 0 else r.uniform(0, self.seconds))

    def tf(self, name, parent, way):
        delay = self.r.uniform(0, .02)
        for at in self.ticks(self.r.choice([15, 30, 30, 60, 100]), .2):
            one = TransformStamped(child_frame_id=name)
            one.header.frame_id, one.header.stamp = parent, stamp(self.ns(at))
            p, q = way.at(at)
            t = one.transform
            (t.translation.x, t.translation.y, t.translation.z), (t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w) = p, q
            self.add('/tf', TFMessage([one]), at, delay)

    # -- bodies ----------------------------------------------------------------------------------------------------

    def stream(self, name, number, static=False):
        r = self.r
        kind = r.choice(['cloud', 'cloud', 'mesh', 'poses', 'soup'])
        frame = 'world' if self.tame or r.random() < .6 else r.choice(['mount'] if static else self.chain + ['mount'])
        settings = {'topic': '/' + name}
        rows, cols = r.choice([2, 3]), r.choice([2, 3, 4])
        if kind == 'cloud':
            settings['topology'] = {'rows': rows, 'cols': cols}
        way, edge = Way(r, 1, False, self.tame), r.choice([.05, .08, .12])
        way.middle[2] += .06 * number if number < 9 else -.05
        flutter = (r.uniform(0, .02), r.uniform(1, 20))
        rest = [(edge * (i - rows / 2), edge * (j - cols / 2), 0) for i in range(rows) for j in range(cols)]
        if static:
            settings['motion'], times = 'static', [-.1] + [r.uniform(0, self.seconds)] * (r.random() < .2)
        else:
            times = list(self.ticks(r.choice([10, 10, 15, 20, 30])))
        delay = r.uniform(0, .03)
        for at in times:
            p, _ = way.at(at)
            points = [(x + p[0], y + p[1], z + p[2] + flutter[0] * math.sin(flutter[1] * at + 30 * x + 17 * y)) for x, y, z in rest]
            self.add('/' + name, getattr(self, kind)(points, cols, self.ns(at), frame), at, delay)
        if static or r.random() < .3:
            settings['against_obstacle'] = False
        self.params['bodies'][name] = settings

    @staticmethod
    def cloud(points, cols, ns, frame):
        message = PointCloud2(height=1, width=len(points), point_step=12, row_step=12 * len(points), is_dense=True)
        message.header.frame_id, message.header.stamp = frame, stamp(ns)
        message.fields = [PointField(name=n, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, n in enumerate('xyz')]
        message.data = b''.join(struct.pack('<3f', *p) for p in points)
        return message

    @staticmethod
    def faces(points, cols):
        for a in range(len(points) - cols):
            if a % cols < cols - 1:
                yield a, a + cols, a + 1
                yield a + 1, a + cols, a + cols + 1

    @classmethod
    def mesh(cls, points, cols, ns, frame):
        message = MeshStamped(vertices=[Point(*p) for p in points], triangles=[MeshTriangle(f) for f in cls.faces(points, cols)])
        message.header.frame_id, message.header.stamp = frame, stamp(ns)
        return message

    @staticmethod
    def poses(points, cols, ns, frame):
        message = PoseArray(poses=[Pose(position=Point(*p)) for p in points[:cols + 1]])
        message.header.frame_id, message.header.stamp = frame, stamp(ns)
        return message

    @classmethod
    def soup(cls, points, cols, ns, frame):
        message = Marker(type=Marker.TRIANGLE_LIST, points=[Point(*points[v]) for f in cls.faces(points, cols) for v in f])
        message.header.frame_id, message.header.stamp = frame, stamp(ns)
        message.pose.orientation.w = message.scale.x = message.scale.y = message.scale.z = 1
        return message

    def robot(self):
        """A tool that flies, and a wrist that swings about the base."""
        r = self.r
        self.far, self.fast = r.uniform(.2, 1), r.uniform(.5, 4)
        base = copied(self.mount)
        base.child_frame_id = 'base'
        self.add('/tf_static', TFMessage([base]), -.3)
        self.params['robot'] = {'description': self.folder + '/arm.urdf', 'own_voxels_m': 0, 'against_map': r.random() < .5}
        self.tf('tool', self.chain[0], Way(r, .8, True, self.tame))
        self.tf('wrist', 'base', self)

    def at(self, at):
        """Where the wrist is on its base."""
        angle = self.far * math.sin(self.fast * at)
        return (.05, 0, .03), (0, math.sin(angle / 2), 0, math.cos(angle / 2))

    def swing(self, r, at):
        """Where the wrist is to go from then on, or, one of five, something else."""
        message, off = JointTrajectory(joint_names=['swing']), r.choice([0] * 8 + [.7, math.nan])
        message.header.stamp = stamp(self.ns(at))
        speeds, faster = r.choice([(False, False), (True, False), (True, True)])
        for k in range(r.choice([2, 4, 9])):
            turns = self.far * np.array([math.sin(self.fast * (at + .1 * k)), math.cos(self.fast * (at + .1 * k))])
            message.points.append(JointTrajectoryPoint(positions=[turns[0] + off], velocities=[self.fast * turns[1]] * speeds,
                                                       accelerations=[-self.fast ** 2 * turns[0]] * faster, time_from_start=rospy.Duration(0, k * NS // 10)))
        self.add('/collision_monitor/intended', message, at, r.uniform(0, .05))

    def map(self):
        r = self.r
        self.params['octomap_topic'] = '/map'
        frame = 'world' if self.tame or r.random() < .7 else r.choice(['mount', self.chain[0]])
        resolution = r.choice([.02, .05])
        voxels = {tuple(32768 + r.randrange(-6, 6) if i < 2 else 32768 + r.randrange(-6, 8) for i in range(3)) for _ in range(r.choice([1, 4, 12]))}
        for k, at in enumerate([0.0] + ([] if self.tame else sorted(r.uniform(0, self.seconds) for _ in range(r.choice([0, 0, 1, 3]))))):
            if k:
                voxels = {v for v in voxels if r.random() < .8} | {tuple(32768 + r.randrange(-6, 7) for _ in range(3)) for _ in range(2)}
            message = Octomap(binary=True, id='OcTree', resolution=resolution, data=octree(voxels))
            message.header.frame_id, message.header.stamp = frame, stamp(self.ns(at))
            self.add('/map', message, at, r.choice([0, .03, .15]) if k else 0)
        if r.random() < .3:
            self.params['exclude_boxes'] = [[-.1, -.1, r.uniform(-.2, .1), .1, .1, .3]]

    def camera(self, r):
        """Own voxels of a map, or clouds that make one."""
        if self.tame or 'exclude_boxes' in self.params or r.random() < .6:
            return
        self.params.update(own_voxels_m=r.choice(['auto', .03]), own_voxels_lag_s=r.choice([0, .1]))
        if 'octomap_topic' in self.params:
            return
        self.params.update(obstacle_cloud_topic='/points', obstacle_resolution_m=r.choice([.02, .05]))
        points = [(r.uniform(-.15, .15), r.uniform(-.15, .15), r.uniform(-.2, .2)) for _ in range(r.choice([1, 5, 20]))]
        for at in [0.02 + .1 * k for k in range(int(10 * self.seconds))]:
            seen = [p for p in points if r.random() < .9] + [(r.uniform(-.2, .2), r.uniform(-.2, .2), r.uniform(-.2, .2))]
            self.add('/points', self.cloud(seen, 1, self.ns(at), 'mount'), at, .03)
        if r.random() < .3:  # in the map's own frame, and with the place that they were seen from
            for row in self.rows:
                if row[0] == '/points':
                    row[1].header.frame_id = 'world'
                    seen_from(row[1], (.02, 0, 0))

    def rarely(self, r):
        """What few are told: distances of a body from itself, noise, pairs with a separation of their own, shells, phases."""
        p, names = self.params, list(self.params['bodies'])
        if self.tame:
            return
        if 'effects' in p and r.random() < .5:
            p['clearance'] = {'self_m': r.choice([.15, .3])}
        one = p['bodies'][r.choice(names)]
        if 'accuracy' in p and r.random() < .5:
            one['uncertainty'] = {'radius_m': r.choice([.001, .005])}
        if 'accuracy' in p and r.random() < .3 and len(names) > 1:
            p['minimum_separation_pairs'] = [{'between': r.sample(names, 2), 'separation_m': r.choice([0, .004, .02])}]
        if r.random() < .2:
            p['bodies'][r.choice(names)][r.choice(['shell', 'against_bodies'])] = r.random() < .5
        if r.random() < .2:
            name = r.choice(names)
            row = {'between': [name, r.choice([n for n in names if n != name] + ['octomap'])], 'phase': r.choice(['lay', 'carry'])}
            if r.random() < .5:
                row['vertices'] = {name: [0, 1, 2, 3]}
            p.setdefault('expected_contacts', []).append(row)
            p['phase'] = r.choice([row['phase'], ''])

    def otherwise(self, r):
        """The other forms: full maps with pruned leaves, maps of files, pictures, sensors that move or are two, a budget."""
        p = self.params
        if self.tame or r.random() < .5:
            return
        maps = [row for row in self.rows if row[0] == '/map']
        if maps and r.random() < .7:
            self.fully(r, maps)
        elif maps and 'own_voxels_m' not in p:
            self.filed(p, maps)
        if not maps and 'own_voxels_m' not in p:
            self.camera(r)
        clouds = [row for row in self.rows if row[0] == '/points']
        if clouds:
            r.choice([self.pictured, self.pictured, self.carried_along, self.two])(r, clouds)
        if r.random() < .1:
            p['step_budget_ms'] = r.choice([.01, .05, 100])
        if r.random() < .1:
            p.update(r.choice([{'max_contacts': r.choice([1, 5])}, {'max_vertex_step_m': r.choice([.01, .05])}, {'effects': {'self_collision': 'off'}}]))
        if maps and 'own_voxels_m' not in p and r.random() < .3:
            p.update(unknown_space='occupied', unknown_box=[-.3, -.3, r.uniform(-.3, .1), .3, .3, .3])
        if clouds and r.random() < .3:
            p.update(r.choice([{'obstacle_min_range_m': .1}, {'obstacle_no_return': 'clears'}, {'obstacle_box': [-.1, -.1, -.1, .1, .1, .3]}]))
        for name in p['bodies']:
            if r.random() < .5:
                self.formed(r, name, [row for row in self.rows if row[0] == '/' + name])

    def formed(self, r, name, mine):
        """The body's messages in another form of the same: padded clouds of doubles in rows, markers with a pose, lists of segments, polygons."""
        topology = self.params['bodies'][name].get('topology')
        for row in mine:
            message = row[1]
            if isinstance(message, PointCloud2):
                padded(message, topology['rows'])
            elif isinstance(message, PoseArray):
                row[1] = Marker(header=message.header, type=Marker.LINE_LIST)
                row[1].points = [p.position for pair in zip(message.poses, message.poses[1:]) for p in pair]
                row[1].pose.orientation.w = row[1].scale.x = 1
            elif isinstance(message, Marker) and message.type == Marker.TRIANGLE_LIST:  # half a turn about z, and up
                message.pose.position.z, message.pose.orientation.z, message.pose.orientation.w = .01, 1, 0
            elif isinstance(message, MeshStamped):
                row[1] = PolygonMesh(header=message.header, polygons=[Vertices(list(t.vertex_indices)) for t in message.triangles])
                row[1].cloud = self.cloud([(p.x, p.y, p.z) for p in message.vertices], 1, 0, '')
                row[1].cloud.header = message.header
        if topology and mine and r.random() < .5:  # the rows say it
            del self.params['bodies'][name]['topology']

    def fully(self, r, maps):
        """The maps as full octrees, of voxels, and of cubes of 2 or 4 voxels an edge, of which some are known to be free."""
        cubes = [((32768 + r.randrange(-16, 16, 1 << level), 32768 + r.randrange(-16, 16, 1 << level), 32768 + r.randrange(-16, 16, 1 << level)), level,
                  r.random() < .4) for level in [r.choice([0, 1, 1, 2]) for _ in range(r.choice([5, 20]))]]
        for row in maps:
            cubes = [(key, level, occupied != (r.random() < .1)) for key, level, occupied in cubes if r.random() < .95] or cubes
            row[1].binary, row[1].data = False, full_octree(cubes, r.choice([.85, 3.5]))

    def filed(self, p, maps):
        """The first of the maps as a file."""
        self.rows = [row for row in self.rows if row[0] != '/map']
        first = maps[0][1]
        with open(self.folder + '/map.bt', 'wb') as out:
            out.write(b'# Octomap OcTree binary file\nid OcTree\nsize 1\nres %r\ndata\n' % first.resolution + bytes(b & 255 for b in first.data))
        del p['octomap_topic']
        p.update(octomap_file=self.folder + '/map.bt', octomap_frame=first.header.frame_id)

    def pictured(self, r, clouds):
        """Depth pictures of a camera that looks down, in place of the clouds: a floor, and what stands on it; pixels without a depth, and stray ones."""
        eye, height, width = copied(self.mount), 24, 32
        eye.child_frame_id, eye.transform.translation.z = 'eye', .6
        eye.transform.rotation.x, eye.transform.rotation.w = 1, 0
        self.add('/tf_static', TFMessage([eye]), -.3)
        self.rows = [row for row in self.rows if row[0] != '/points']
        self.params.update(obstacle_cloud_topic='/depth/image', obstacle_max_range_m=2.)
        metres, blocks = r.random() < .5, []
        for k, (_, cloud, came, _) in enumerate(clouds):
            blocks = [b for b in blocks if r.random() < .8] + [(r.randrange(20), r.randrange(28), r.randrange(1, 8), r.uniform(.3, .75))] * (r.random() < .5)
            depth = np.full((height, width), .8)
            for v, u, size, z in blocks:
                depth[v:v + size, u:u + size] = z
            for _ in range(r.choice([0, 3])):
                depth[r.randrange(height), r.randrange(width)] = r.choice([0, 0, r.uniform(.3, .8)])
            data = depth.astype('<f4') if metres else np.round(depth * 1000).astype('<u2')
            picture = Image(height=height, width=width, encoding='32FC1' if metres else '16UC1', step=data.strides[0], data=data.tobytes())
            picture.header.frame_id, picture.header.stamp = 'eye', cloud.header.stamp
            info = CameraInfo(header=copied(picture.header), height=height, width=width, distortion_model='plumb_bob', D=[0] * 5,
                              K=[30, 0, 15.5, 0, 30, 11.5, 0, 0, 1], R=[1, 0, 0, 0, 1, 0, 0, 0, 1], P=[30, 0, 15.5, 0, 0, 30, 11.5, 0, 0, 0, 1, 0])
            for topic, message in (('/depth/camera_info', info), ('/depth/image', picture)):
                self.rows.append([topic, message, came, topic])

    def carried_along(self, r, clouds):
        """The sensor goes with a joint."""
        self.params['octomap_frame'] = r.choice(['world', 'mount'])
        for row in clouds:
            row[1].header.frame_id = self.chain[0]

    def two(self, r, clouds):
        """Every second cloud comes from another sensor."""
        del self.params['obstacle_cloud_topic']
        self.params['obstacle_cloud_topics'] = ['/points', {'topic': '/others', 'sensor_frame': r.choice(['mount', self.chain[0]])}]
        for row in clouds[::2]:
            row[0] = row[3] = '/others'

    def ahead(self, r):
        """Limits, what the finger carries, and twists by which it is said to go: some right, some late, some of a frame that is not there; or of a robot."""
        p = self.params
        if 'max_speed_m_s' not in p or r.random() < .5:
            return
        p['limits'] = {'max_m': r.choice([.1, .3, .5]), 'horizon_s': r.choice([.05, .2])}
        if 'finger' in p['bodies'] and r.random() < .5:
            carried = p['bodies'][r.choice([n for n, s in p['bodies'].items() if 'rigid' not in s and 'motion' not in s])]
            carried.update(carried_by=p['bodies']['finger']['rigid']['frame'], max_relative_speed_m_s=r.choice([.1, .5, 2]))
        if 'finger' not in p['bodies'] and 'robot' not in p or r.random() < .5:
            return
        p['intent'] = {'horizon_s': r.choice([.1, .5]), 'deviation_m': r.choice([.01, .1]), 'deviation_rate_m_s': r.choice([0, .2])}
        for at in [.05 + .1 * k for k in range(int(10 * self.seconds))]:
            if 'robot' in p and ('finger' not in p['bodies'] or self.far > .6):
                self.swing(r, at)
                continue
            message = TwistStamped()
            message.header.stamp = stamp(self.ns(at - (2 if r.random() < .1 else 0)))
            message.header.frame_id = self.chain[-1] if r.random() < .9 else 'elsewhere'
            for axis in 'xyz':
                setattr(message.twist.linear, axis, r.choice([0, r.uniform(-.2, .2), r.uniform(-.2, .2), math.nan if r.random() < .1 else 0]))
            self.add('/collision_monitor/intended', message, at, r.uniform(0, .05))

    def handed_over(self, r):
        """A frame gets another parent, for a while or for good."""
        if self.tame or r.random() < .8:
            return
        rows = [row for row in self.rows if row[0] == '/tf']
        child = r.choice(rows)[1].transforms[0].child_frame_id
        mine = [row[1].transforms[0] for row in rows if row[1].transforms[0].child_frame_id == child]
        at = r.randrange(len(mine))
        parent = r.choice([name for name in ('world', 'mount') if name != mine[at].header.frame_id])
        for one in mine[at:at + r.choice([1, 3, len(mine)])]:
            one.header.frame_id = parent
        self.faults.append('%s is handed over to %s at %d' % (child, parent, at))

    def services(self, r):
        """What is called while it runs, where a node is there to be called: phases, an object that comes and goes, resets."""
        p, self.calls = self.params, []
        phases = sorted({row['phase'] for row in p.get('expected_contacts', []) if 'phase' in row})
        links = ['finger'] * ('finger' in p['bodies']) + ['tool', 'wrist'] * ('robot' in p)
        wanted = ['set_phase', 'set_phase'] * bool(phases) + ['reset'] * (r.random() < .2)
        if links and 'own_voxels_m' not in p and 'intent' not in p:
            wanted = ['attach', *wanted, r.choice(['detach', 'remove']), r.choice(['remove', 'attach'])]
        for service, at in zip(wanted, sorted(r.uniform(0, self.seconds) for _ in wanted)):
            name = r.choice(['', *phases]) if service == 'set_phase' else 'rod'
            self.calls.append({'at': self.ns(at), 'service': service, 'name': name, 'link': r.choice(links or ['']), 'mesh': self.folder + '/rod.obj'})

    def options(self):
        r, p = self.r, self.params
        streams = [n for n, s in p['bodies'].items() if 'rigid' not in s and 'motion' not in s]
        often = max(streams, key=lambda n: sum(row[0] == '/' + n for row in self.rows))
        p['clock_body'] = often if self.tame or r.random() < .6 else r.choice(streams)
        p['sync_timeout_s'] = .1 if r.random() < .2 else .5
        if r.random() < .3:
            p.update(accuracy='conservative', minimum_separation_m=r.choice([.002, .01]))
        if r.random() < .4:
            p.update(max_speed_m_s=r.choice([1.0, 3.0]), speed_scale={'reaction_time_s': .15, 'stopping_time_s': .3, 'uncertainty_m': .01})
            p['effects'] = {'clearance': 'on'}
        if r.random() < .2:
            names = list(p['bodies'])
            p['expected_contacts'] = [{'between': [names[0], r.choice(names[1:] + ['self', 'octomap'])]}]
        if r.random() < .2 and 'topology' in p['bodies'][streams[0]]:
            p['bodies'][streams[0]]['vertex_mask'] = [0]
        if r.random() < .5:
            p['rigid_tolerance_m'] = r.choice([1e-4, 3e-3, 1e-2, 1e-2])
        if r.random() < .3:
            p.update(r.choice([{'queue_size': 1}, {'transform_timeout_s': .05}, {'sync_timeout_s': .02}, {'max_step_s': .15},
                               {'octomap_timeout_s': .4}, {'answer_timeout_s': .1}, {'queue_policy': 'oldest'}]))
            if self.tame:  # its map comes once
                p.pop('octomap_timeout_s', None)

    # -- faults ----------------------------------------------------------------------------------------------------

    def fault(self, kind):
        r = self.r
        topic = r.choice(sorted({row[0] for row in self.rows}))
        mine = [row for row in self.rows if row[0] == topic]
        if topic == '/tf' and kind in ('stops', 'differs', 'jumps'):  # of one joint
            child = r.choice(mine)[1].transforms[0].child_frame_id
            mine = [row for row in mine if row[1].transforms[0].child_frame_id == child]
        row = r.choice(mine)
        at = mine.index(row)
        self.faults.append('%s %s at %d' % (topic, kind, at))
        if kind == 'lost':
            for gone in mine[at:at + r.choice([1, 1, 3])]:
                self.rows.remove(gone)
        elif kind == 'stops':
            for gone in mine[max(at, len(mine) // 2):]:
                self.rows.remove(gone)
        elif kind == 'late':
            row[2] += r.choice([5, 30, 120, 300]) * 10 ** 6
        elif kind == 'out of order' and at + 1 < len(mine):
            row[2], mine[at + 1][2] = mine[at + 1][2], row[2]
        elif kind in ('twice', 'elsewhere', 'other publisher'):
            again = [topic, copied(row[1]), row[2] + r.choice([1, 20, 80]) * 10 ** 6, 'another' if kind == 'other publisher' else row[3]]
            if kind != 'twice':
                moved(again[1], r.choice([.0005, .01, .1]), r)
            if kind == 'other publisher':
                restamped(again[1], r.choice([0, 3, -7, 40]) * 10 ** 6)
            self.rows.append(again)
        elif kind == 'other stamp':
            restamped(row[1], r.choice([-1, 1, -20, 20, -300, 3000]) * 10 ** 6)
        elif kind == 'differs':
            by = r.choice([-2, 2, .05, -.05, .4]) * NS
            for one in mine:
                restamped(one[1], int(by))
        elif kind == 'jumps':
            by = r.choice([-1, -.2, .3, 5]) * NS
            for one in mine[at:]:
                restamped(one[1], int(by))
        elif kind == 'damaged':
            row[1] = damaged(copied(row[1]), r)


def padded(cloud, rows):
    """As an organised cloud of doubles, big-endian, with a gap after each point and each row."""
    points = np.frombuffer(cloud.data, '<f4').reshape(rows, -1, 3)
    cloud.height, cloud.width = points.shape[:2]
    cloud.point_step, cloud.row_step, cloud.is_bigendian = 40, 40 * points.shape[1] + 16, True
    for field in cloud.fields:
        field.offset, field.datatype = 2 * field.offset + 8, PointField.FLOAT64
    cloud.data = b''.join(b''.join(struct.pack('>8x3d8x', *p) for p in row) + bytes(16) for row in points.tolist())


def seen_from(cloud, place):
    cloud.fields += [PointField(name='vp_' + n, offset=12 + 4 * i, datatype=PointField.FLOAT32, count=1) for i, n in enumerate('xyz')]
    cloud.data = b''.join(cloud.data[i:i + 12] + struct.pack('<3f', *place) for i in range(0, len(cloud.data), 12))
    cloud.point_step, cloud.row_step = 24, 24 * cloud.width


def copied(message):
    import io
    out = io.BytesIO()
    message.serialize(out)
    return type(message)().deserialize(out.getvalue())


def headers(message):
    return [t.header for t in message.transforms] if hasattr(message, 'transforms') else [message.header]


def restamped(message, by):
    for header in headers(message):
        header.stamp = stamp(max(1, header.stamp.to_nsec() + by))


def moved(message, by, r):
    if isinstance(message, TFMessage):
        message.transforms[0].transform.translation.z += by
    elif isinstance(message, Image):
        message.data = message.data[64:] + message.data[:64]
    elif isinstance(message, CameraInfo):
        message.P = [value + by for value in message.P]
    elif isinstance(message, PointCloud2):
        step, (kind, at) = message.point_step, ('>d', 24) if message.is_bigendian else ('<f', message.fields[2].offset)
        data = bytearray(message.data)
        for begin in range(0, len(data), message.row_step):
            for place in range(begin + at, begin + at + message.width * step, step):
                struct.pack_into(kind, data, place, struct.unpack_from(kind, data, place)[0] + by)
        message.data = bytes(data)
    elif isinstance(message, PolygonMesh):
        moved(message.cloud, by, r)
    elif isinstance(message, Octomap):
        message.binary, message.data = True, octree({tuple(32768 + r.randrange(-6, 7) for _ in range(3)) for _ in range(4)})
    else:
        for p in getattr(message, 'vertices', None) or getattr(message, 'points', None) or [x.position for x in message.poses]:
            p.z += by


def damaged(message, r):
    nan = float('nan')
    if isinstance(message, TFMessage):
        setattr(message.transforms[0].transform.rotation, 'w', r.choice([nan, 5.0]))
    elif isinstance(message, PointCloud2):
        number = struct.pack('>8xd', nan) if message.is_bigendian else struct.pack('<f', nan)
        message.data = message.data[:-5] if r.random() < .5 else number + message.data[len(number):]
    elif isinstance(message, Octomap):
        message.data = message.data[:r.randrange(1, 20)]
    elif isinstance(message, Image):
        message.step, message.width = r.choice([(3, 32), (0, 0), (128, 31)])
    elif isinstance(message, CameraInfo):
        message.P = [r.choice([nan, 0.0])] * 12
    elif isinstance(message, PolygonMesh):
        message.polygons[0].vertices = (0, 999, 1)
    elif isinstance(message, MeshStamped) and r.random() < .5:
        message.triangles[0].vertex_indices = (0, 1, 999)
    else:
        points = getattr(message, 'vertices', None) or getattr(message, 'points', None) or [x.position for x in message.poses]
        points[0].x = nan if r.random() < .7 else 1e6
    return message
