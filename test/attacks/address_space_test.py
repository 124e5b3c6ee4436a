"""Nothing ends a node that has an address space of 1 GB and limits that promise it four times as much: what does not fit is refused."""
import resource
import struct
import time
import unittest

from attack import SLOW, AttackTest, checkerboard, cloud_of, flat_cloud, wait_for
from deformable_ccd.msg import MeshStamped
from live_node import bytes_of, raw
from octomap_msgs.msg import Octomap
from pcl_msgs.msg import PolygonMesh

SPACE = 1 << 30


def limited():
    resource.setrlimit(resource.RLIMIT_AS, (SPACE, SPACE))


@unittest.skipIf(SLOW > 1, 'sanitizers map more than that at the start')
class AddressSpaceTest(AttackTest):
    def start(self, name, **parameters):
        self.node = self.start_node(name, {'preexec_fn': limited}, max_memory_mb=4096, max_map_mb=4096, **parameters)
        self.outcomes_of(self.publisher, [flat_cloud(0), flat_cloud(1)])

    def lives(self, publisher, first):
        """Good frames again: the second is answered."""
        outcomes = self.outcomes_of(publisher, [flat_cloud(first + i) for i in range(3)])
        self.assertTrue(outcomes[1].answered and outcomes[2].answered, [(o.status, o.reason) for o in outcomes])
        self.assertIsNone(self.node.poll())

    def is_refused(self, publisher, message):
        """By the node with a status, or by roscpp, which then says so in the log and hands nothing over."""
        seen, begin = len(self.contacts), time.monotonic()
        publisher.publish(message)

        def lost():
            return any('deserializing' in line for line in self.log_lines())
        wait_for(lambda: len(self.contacts) > seen or lost() or self.node.poll() is not None, 60, 'an outcome')
        self.assertIsNone(self.node.poll(), '\n'.join(self.log_lines()[-5:]))
        said = self.contacts[-1].reason if len(self.contacts) > seen else 'lost by roscpp'
        print('%s: %.1f s, %s' % (self.id().split('.')[-1], time.monotonic() - begin, said[:200]))
        self.assertTrue(lost() or 'memory' in said, said)
        self.assertFalse(len(self.contacts) > seen and self.contacts[-1].answered)

    def back(self, name):
        publisher = self.retype(name, type(flat_cloud(0)))
        self.lives(publisher, 100)

    def test_polygons_without_corners(self):
        self.start('polygons', transform_timeout_s=0.0)
        publisher = self.retype('polygons', PolygonMesh)
        message = PolygonMesh(cloud=flat_cloud(2))
        message.header = message.cloud.header
        count = 25000000
        self.is_refused(publisher, raw(PolygonMesh, bytes_of(message)[:-4] + struct.pack('<I', count) + bytes(4 * count)))
        self.back('polygons')

    def test_millions_of_triangles(self):
        self.start('triangles')
        publisher = self.retype('triangles', MeshStamped)
        message = MeshStamped()
        message.header.frame_id, message.header.stamp = 'world', flat_cloud(2).header.stamp
        count, points = 4500000, 300
        triangles = struct.pack('<36I', *((7 * k) % points for k in range(36))) * (count // 12)
        vertices = b''.join(struct.pack('<3d', 0.01 * (i % 20), 0.01 * (i // 20), 0.001 * i) for i in range(points))
        header = bytes_of(message)
        end = header.index(b'world') + 5
        data = header[:end] + struct.pack('<I', points) + vertices + struct.pack('<I', len(triangles) // 12) + triangles + header[end + 8:]
        self.is_refused(publisher, raw(MeshStamped, data))
        self.back('triangles')

    def test_a_checkerboard(self):
        name = 'space_board'
        self.start(name, **{'effects/octomap': 'on', 'octomap_topic': '/%s/map' % name})
        resource.prlimit(self.node.pid, resource.RLIMIT_AS, (7 * SPACE // 8, SPACE))  # in all of it the map has room
        maps = self.advertise('/%s/map' % name, Octomap)
        whole = Octomap(binary=True, id='OcTree', resolution=0.01)
        whole.header.frame_id = 'world'
        data = checkerboard(7)
        maps.publish(raw(Octomap, bytes_of(whole)[:-4] + struct.pack('<I', len(data)) + data))
        index = 10
        end = time.monotonic() + 60
        while 'memory' not in self.contacts[-1].reason and time.monotonic() < end:
            self.outcomes_of(self.publisher, [flat_cloud(index)])
            index += 1
        self.assertIn('there is not enough memory for this map', self.contacts[-1].reason)
        self.lives(self.publisher, index)

    def test_large_frames(self):
        """Ten of 50 MB that wait: some are lost, none ends the node."""
        self.start('frames', transform_timeout_s=3.0, queue_size=100)
        cloud = flat_cloud(2)
        cloud.header.frame_id = 'nowhere'
        data = bytes_of(cloud) + bytes(50000000)
        for i in range(10):
            self.publisher.publish(raw(type(cloud), data))
            time.sleep(0.1)
        time.sleep(5)
        self.assertIsNone(self.node.poll(), '\n'.join(self.log_lines()[-5:]))
        self.lives(self.publisher, 1000)

    def test_a_tracker_that_collapses(self):
        self.start('space_collapsed', step_budget_ms=5000.0)
        self.outcomes_of(self.publisher, [flat_cloud(2, 30, 30), cloud_of(3, [(0.1, 0.1, 0.1)] * 900, 30, 30)])
        self.lives(self.publisher, 100)


if __name__ == '__main__':
    unittest.main()
