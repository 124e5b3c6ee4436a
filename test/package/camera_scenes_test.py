"""What a bag holds of a scene with a camera, with a small image: clouds, maps, and what is made of them."""
import math
import os
import struct
import unittest

import rosbag
import yaml

from checkout import CHECKOUT, TOOLS, FolderTestCase, run
from scenes_test import CENTER, RESOLUTION_M, occupied_leaves, steps_of

EMPTY_CLOUDS = 2


def key_of(point):
    return tuple(math.floor(x / RESOLUTION_M) + CENTER for x in point)


def crossed(origin, point):
    """The voxels that the straight way to a point crosses, its own left out: where it passes a plane between voxels, one changes."""
    key, keys, passes = list(key_of(origin)), set(), []
    for axis, (low, high) in enumerate(sorted(ends) for ends in zip(key, key_of(point))):
        passes += [(((plane - CENTER) * RESOLUTION_M - origin[axis]) / (point[axis] - origin[axis]), axis)
                   for plane in range(low + 1, high + 1)]
    for _, axis in sorted(passes):
        keys.add(tuple(key))
        key[axis] += 1 if point[axis] > origin[axis] else -1
    return keys


class CameraTest(FolderTestCase):
    """A scene with a camera: what a bag holds of it, with a small image."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.first = cls.record('first.bag')
        with rosbag.Bag(str(cls.folder / 'first.bag')) as bag:
            cls.messages = [(topic, message, at.to_sec() - 1000) for topic, message, at in bag.read_messages()]

    @classmethod
    def record(cls, name, **more):
        scene = yaml.safe_load((CHECKOUT / 'config/scenes/table_edge.yaml').read_text())
        scene['camera'] = {'position_m': [0.9, 0.3, 1.35], 'looks_at_m': [-0.1, 0, 0.8], 'width': 24, 'height': 18,
                           'field_of_view_rad': 0.8, 'rate_hz': 10, 'noise_m': 0.003, 'lost_share': 0.05, 'lag_s': 0.15,
                           'empty_clouds': EMPTY_CLOUDS, 'inset_m': 0.01, **more}
        (cls.folder / 'scene.yaml').write_text(yaml.safe_dump(scene))
        recorded = run(TOOLS / 'make_scene_bag', cls.folder / 'scene.yaml', cls.folder / name, '--frames', 13, '--quiet')
        assert recorded.returncode == 0, recorded.stderr
        return (cls.folder / name).read_bytes()

    def of(self, topic):
        return [(message, at) for name, message, at in self.messages if name == topic]

    def clouds_in_world(self):
        (static, _), = self.of('/tf_static')
        pose, = (t.transform for t in static.transforms if t.child_frame_id == 'camera')
        x, y, z, w = pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w
        turn = ((1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
                (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
                (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)))
        origin = (pose.translation.x, pose.translation.y, pose.translation.z)
        for cloud, _ in self.of('/camera/points'):
            yield origin, [tuple(at + sum(r * p for r, p in zip(row, point)) for row, at in zip(turn, origin))
                           for point in struct.iter_unpack('<3f', bytes(cloud.data)) if all(map(math.isfinite, point))]

    def test_the_same_seed_gives_the_same_bag(self):
        self.assertEqual(self.first, self.record('again.bag'))
        self.assertNotEqual(self.first, self.record('other.bag', seed=2))

    def test_clouds_and_maps_come_as_a_cameras_do(self):
        """At its rate, later than they are stamped; the truth once, at the start."""
        clouds, maps = self.of('/camera/points'), self.of('/octomap_binary')
        self.assertEqual([(round(m.header.stamp.to_sec() - 1000, 6), round(at, 6)) for m, at in clouds],
                         [(round(0.1 * k, 6), round(0.1 * k + 0.15, 6)) for k in range(-EMPTY_CLOUDS, 5)])
        self.assertEqual([(m.header.stamp, at) for m, at in maps], [(m.header.stamp, at) for m, at in clouds])
        for cloud, _ in clouds:
            self.assertEqual((cloud.header.frame_id, cloud.height, cloud.width, cloud.is_dense), ('camera', 18, 24, False))
            self.assertEqual([(f.name, f.datatype) for f in cloud.fields], [('x', 7), ('y', 7), ('z', 7)])
        (truth, at), = self.of('/truth/octomap')
        self.assertEqual((truth.resolution, round(at, 6)), (RESOLUTION_M, -0.1 * EMPTY_CLOUDS))
        self.assertEqual(self.messages[0][0], '/tf_static')
        self.assertEqual(len(occupied_leaves(truth.data)), 40 * 60 * 2, 'the table, 80 x 120 x 4 cm')

    def test_a_map_is_what_the_clouds_up_to_it_make(self):
        """Voxels hit and missed, added up by hand; the first map holds what was hit alone."""
        hit, miss, most, least = (math.log(p / (1 - p)) for p in (0.7, 0.4, 0.97, 0.12))
        odds, cloth = {}, []
        for k, ((origin, points), (octomap, _)) in enumerate(zip(self.clouds_in_world(), self.of('/octomap_binary'))):
            hits = {key_of(point) for point in points}
            for key in hits:
                odds[key] = min(odds.get(key, 0) + hit, most)
            for key in set().union(*(crossed(origin, point) for point in points)) - hits:
                odds[key] = max(odds.get(key, 0) + miss, least)
            expected, found = {key for key in odds if odds[key] >= 0}, occupied_leaves(octomap.data)
            if k == 0:
                self.assertEqual(expected, hits)
            self.assertGreater(len(found), 100)
            # OctoMap computes in single precision: a ray through a corner may take the other voxel, a point change sides.
            self.assertLessEqual(len(expected ^ found), 2, 'map %d' % k)
            cloth.append(sum(key[2] - CENTER > 0.80 / RESOLUTION_M for key in found))
        self.assertEqual(cloth[:EMPTY_CLOUDS], [0] * EMPTY_CLOUDS, 'the table was seen alone')
        self.assertEqual(len(cloth), EMPTY_CLOUDS + 5)
        self.assertGreater(min(cloth[EMPTY_CLOUDS:]), 20, 'the cloth is among the voxels')

    def test_one_bag_gives_the_truth_and_what_the_camera_makes_of_it(self):
        config = yaml.safe_load((CHECKOUT / 'config/scenes/table_edge.yaml').read_text())['monitor']
        clear = {}
        for topic in ('/truth/octomap', '/octomap_binary'):
            (self.folder / 'params.yaml').write_text(yaml.safe_dump({**config, 'octomap_topic': topic}))
            report = self.folder / topic.split('/')[1]
            analysed = run(TOOLS / 'analyze_bag', self.folder / 'first.bag', '--report', report, '--params', self.folder / 'params.yaml',
                           '--quiet')
            self.assertIn(analysed.returncode, (0, 3), analysed.stderr)
            clear[topic] = sum(step.clear for step in steps_of(report))
        self.assertEqual(clear['/truth/octomap'], 12, 'the cloth is above the table')
        self.assertLess(clear['/octomap_binary'], 12, 'the cloth meets its own voxels')


if __name__ == '__main__':
    os.environ.setdefault('ROS_PACKAGE_PATH', str(CHECKOUT))
    unittest.main()
