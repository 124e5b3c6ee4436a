"""Worlds made by hand, each of one thing that a monitor may get wrong: what came shows a contact, or that nobody knows."""
import collections
import math
import random

from geometry_msgs.msg import TransformStamped
from octomap_msgs.msg import Octomap
from tf2_msgs.msg import TFMessage

import worlds

Made = collections.namedtuple('Made', 'rows params faults tame')
SHEET = [(.1 * i - .1, .1 * j - .1, 0) for i in range(3) for j in range(3)]
SMALL = [(.02 * i, .02 * j, 0) for i in range(2) for j in range(2)]


class Case:
    def __init__(self, folder):
        self.rows, self.folder, self.begin = [], folder, worlds.START
        self.params = {'fixed_frame': 'world', 'clock_body': 'sheet', 'sync_timeout_s': .5, 'bodies': {}}

    def ns(self, at):
        return self.begin + int(round(at * worlds.NS))

    def add(self, topic, message, at, delay=.001):
        self.rows.append([topic, message, self.ns(at + delay), topic])

    def body(self, name, points, cols, times, frame='world', z=lambda t: 0.0, delay=.001, **settings):
        self.params['bodies'][name] = {'topic': '/' + name, 'topology': {'rows': len(points) // cols, 'cols': cols}, **settings}
        for t in times:
            self.add('/' + name, worlds.World.cloud([(x, y, h + z(t)) for x, y, h in points], cols, self.ns(t), frame), t, delay)

    def tf(self, child, times, z=lambda t: 0.0, angle=lambda t: 0.0, x=0.0, parent='world', topic='/tf', delay=.0005):
        for t in times:
            one = TransformStamped(child_frame_id=child)
            one.header.frame_id, one.header.stamp = parent, worlds.stamp(self.ns(t))
            one.transform.translation.x, one.transform.translation.z = x, z(t)
            one.transform.rotation.y, one.transform.rotation.w = math.sin(angle(t) / 2), math.cos(angle(t) / 2)
            self.add(topic, TFMessage([one]), t, delay)

    def finger(self, frame):
        self.params['bodies']['finger'] = {'rigid': {'mesh': self.folder + '/finger.obj', 'frame': frame}, 'against_obstacle': False}

    def map(self, keys, at, stamp_at=None, frame='world', free=()):
        self.params['octomap_topic'] = '/map'
        bits = worlds.octree(*({tuple(32768 + k for k in key) for key in some} for some in (keys, free)))
        message = Octomap(binary=True, id='OcTree', resolution=.05, data=bits)
        message.header.frame_id, message.header.stamp = frame, worlds.stamp(self.ns(at if stamp_at is None else stamp_at))
        self.add('/map', message, at)

    def made(self, name):
        self.rows.sort(key=lambda row: row[2])
        for before, row in zip(self.rows, self.rows[1:]):
            row[2] = max(row[2], before[2] + 1000)
        return Made(self.rows, self.params, [name], False)


def every(dt, end=1.0, begin=0.0):
    return [begin + k * dt for k in range(int(round((end - begin) / dt)) + 1)]


def dip(t):
    """Through the sheet and back, between two frames of it."""
    return .1 - (.2 if .44 < t < .46 else 0)


def a_mesh_in_a_frame_that_dips(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.body('object', SMALL, 2, every(.1), frame='hand')
    c.tf('hand', every(.01, 1.1, -.1), z=dip)


def a_clock_body_in_a_frame_that_dips(c):
    c.body('sheet', SHEET, 3, every(.1), frame='hand')
    c.body('object', SMALL, 2, every(.1), z=lambda t: -.05)
    c.tf('hand', every(.01, 1.1, -.1), z=dip)


def a_finger_that_dips(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.tf('finger', every(.01, 1.1, -.1), z=dip)
    c.finger('finger')


def a_finger_on_a_joint(c):
    """At 2 rad/s on an arm of half a metre; its path bulges 2.5 mm out of the chord between two samples, into the sheet."""
    c.params['rigid_tolerance_m'] = 1e-4
    c.body('sheet', [(x, y, -.5287) for x, y, _ in SHEET], 3, every(.1))
    c.tf('arm', every(.1, 1.1, -.1), angle=lambda t: 2 * (t - .45))
    c.tf('finger', every(.1, 1.1, -.1), z=lambda t: -.5, parent='arm')
    c.finger('finger')


def a_frame_on_tf_then_static_then_moved(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.tf('finger', every(.02, 1.1, -.1), z=lambda t: .5 - .2 * max(0, t - .4))
    c.tf('finger', [.1], z=lambda t: .5, topic='/tf_static')
    c.finger('finger')


def a_static_frame_that_turns_a_little(c):
    """By 0.9 mrad on a lever of 10 m: 9 mm."""
    c.body('sheet', [(x + 10, y, -.037) for x, y, _ in SHEET], 3, every(.1))
    c.tf('finger', [-.05], topic='/tf_static', parent='mount', x=10)
    c.tf('mount', [-.05], topic='/tf_static')
    c.tf('mount', every(.1, 1.0, .45), angle=lambda t: .0009)
    c.finger('finger')


def a_map_from_the_future(c):
    c.map([(0, 0, 5)], -.1)
    c.body('sheet', SHEET, 3, every(.1))
    c.map([(0, 0, 5), (0, 0, 0)], .3, stamp_at=3.3)


def a_map_from_the_future_of_another_frame(c):
    c.tf('cart', every(.02, 1.1, -.2))
    c.map([(0, 0, 5)], -.1, frame='cart')
    c.body('sheet', SHEET, 3, every(.1))
    c.map([(0, 0, 5), (0, 0, 0)], .3, stamp_at=3.3, frame='cart')


def a_map_in_a_frame_that_dips(c):
    c.map([(0, 0, 2)], -.05, frame='cart')
    c.body('sheet', SHEET, 3, every(.1))
    c.tf('cart', every(.01, 1.1, -.1), z=lambda t: dip(t) - .1)


def a_map_in_a_frame_that_turns_into_the_sheet(c):
    c.body('sheet', [(x, y, .3) for x, y, _ in SHEET], 3, every(.1))
    c.map([(6, 0, 0)], -.05, frame='cart')
    c.tf('cart', every(.02, 1.1, -.1), angle=lambda t: -1.5 * t)


def a_body_elsewhere_at_the_same_stamp(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.body('object', SMALL, 2, every(.1), z=lambda t: .1)
    c.body('object', SMALL, 2, [.5], z=lambda t: -.1, delay=.02)


def a_static_body_that_moved(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.body('table', SMALL, 2, [-.05], z=lambda t: -.1, motion='static')
    c.body('table', SMALL, 2, [.55], z=lambda t: .0, motion='static')


def a_static_body_whose_newest_frame_cannot_be_used(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.body('table', SMALL, 2, [-.05], z=lambda t: -.1, motion='static')
    c.add('/table', worlds.World.cloud(SMALL + [(0, 0, 0)], 5, c.ns(.45), 'world'), .45)


def a_frame_between_that_cannot_be_used(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.body('object', SMALL, 2, every(.1), z=lambda t: .1)
    c.add('/object', worlds.World.cloud(SMALL + [(0, 0, 0)], 5, c.ns(.45), 'world'), .45)


def a_chain_of_which_a_joint_dips(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.tf('arm', every(.05, 1.1, -.1), z=lambda t: .2)
    c.tf('wrist', every(.01, 1.1, -.1), z=lambda t: dip(t) - .2, parent='arm')
    c.tf('finger', [-.2], topic='/tf_static', parent='wrist')
    c.finger('finger')


def two_joints_that_turn_back_and_forth(c):
    """The arm turns by a radian in a step and the wrist back by as much: the finger swings aside, and is level at both ends."""
    c.params.update(rigid_tolerance_m=1e-3, max_vertex_step_m=0)
    c.body('sheet', [(x + .03, y + .02, .015) for x, y, _ in SHEET], 3, every(.1))
    c.tf('arm', every(.1, 1.1, -.1), angle=lambda t: .5 * (-1) ** int(round(t / .1)), z=lambda t: -.5)
    c.tf('wrist', every(.1, 1.1, -.1), z=lambda t: .5, angle=lambda t: -1.0 * (-1) ** int(round(t / .1)), parent='arm')
    c.tf('finger', [-.2], topic='/tf_static', parent='wrist')
    c.finger('finger')


def a_turn_between_two_samples_of_another_joint(c):
    """Samples of the base lie between those of the arm: at them the pose is as on a path of which neither end tells."""
    c.params['rigid_tolerance_m'] = 1e-4
    c.body('sheet', [(x, y, -.5287) for x, y, _ in SHEET], 3, every(.1))
    c.tf('base', every(.1, 1.1, -.15))
    c.tf('arm', every(.1, 1.1, -.1), angle=lambda t: 2 * (t - .45), parent='base')
    c.tf('finger', [-.2], z=lambda t: -.5, parent='arm', topic='/tf_static')
    c.finger('finger')


def joints_that_turn_against_each_other(c):
    """One sample of either at the ends of a step; the pose at both ends is the same, and between them the finger swings out."""
    c.params.update(rigid_tolerance_m=1e-3, max_vertex_step_m=0)
    c.body('sheet', [(x, y, -.5) for x, y, _ in SHEET], 3, every(.2))
    c.tf('arm', every(.2, 1.2, -.2), angle=lambda t: 1.2 * (round(t / .2) % 2) - .6)
    c.tf('finger', every(.2, 1.2, -.2), z=lambda t: -.5, parent='arm')
    c.finger('finger')


def a_finger_that_is_handed_over_around_the_end_of_a_step(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.tf('arm', every(.04, 1.12, -.08), z=lambda t: .3)
    c.tf('finger', [t for t in every(.04, 1.12, -.08) if t < .5], parent='arm')
    c.tf('finger', [t for t in every(.04, 1.12, -.08) if t > .5], z=lambda t: .3)
    c.finger('finger')


def a_frame_between_of_which_nothing_is_known(c):
    nan = float('nan')
    c.body('sheet', SHEET, 3, every(.1))
    c.body('object', SMALL, 2, every(.1), z=lambda t: .1)
    c.body('object', [(x, y, nan) for x, y, _ in SMALL], 2, [.45])


def a_body_that_jumps_there_and_back_within_a_step(c):
    c.params['max_vertex_step_m'] = .15
    c.body('sheet', SHEET, 3, every(.1))
    c.body('object', SMALL, 2, every(.05), z=lambda t: -.1 if abs(t - .45) < .01 else .1)


def a_body_that_is_another_mesh_within_a_step(c):
    c.body('sheet', SHEET, 3, every(.1))
    for t in every(.05):
        odd = abs(t - .45) < .01
        c.add('/object', worlds.World.mesh([(x, y, -.1 if odd else .1) for x, y, _ in (SMALL + [(.04, 0, 0), (.04, .02, 0)] if odd else SMALL)], 2,
                                           c.ns(t), 'world'), t)
    c.params['bodies']['object'] = {'topic': '/object'}


def a_frame_of_the_clock_that_comes_late(c):
    """The one at 0.5 s comes after those at 0.6 and 0.7 s; of it the object hangs below."""
    times = [t for t in every(.1) if abs(t - .5) > .01]
    c.body('sheet', SHEET, 3, times, z=lambda t: 0)
    c.body('sheet', SHEET, 3, [.5], z=lambda t: .2, delay=.25)
    c.body('object', SMALL, 2, every(.1), z=lambda t: .1)


def a_frame_of_another_body_that_comes_late(c):
    times = [t for t in every(.05) if abs(t - .45) > .01]
    c.body('sheet', SHEET, 3, every(.1))
    c.body('object', SMALL, 2, times, z=lambda t: .1)
    c.body('object', SMALL, 2, [.45], z=lambda t: -.1, delay=.06)


def a_transform_that_comes_late(c):
    times = [t for t in every(.01, 1.1, -.1) if abs(t - .45) > .001]
    c.body('sheet', SHEET, 3, every(.1))
    c.tf('finger', times, z=lambda t: .1)
    c.tf('finger', [.45], z=lambda t: -.1, delay=.3)
    c.finger('finger')


def a_static_body_in_a_frame_that_dips(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.body('table', SMALL, 2, [-.05], frame='cart', motion='static')
    c.tf('cart', every(.01, 1.1, -.1), z=dip)


def a_rope_through_a_rope(c):
    c.params['bodies'].update({n: {'topic': '/' + n} for n in ('sheet', 'rope')})
    for t in every(.1):
        c.add('/sheet', worlds.World.poses([(-.1, 0, 0), (.1, 0, 0)], 1, c.ns(t), 'world'), t)
        c.add('/rope', worlds.World.poses([(.01, -.1, .45 - t), (.01, .1, .45 - t)], 1, c.ns(t), 'world'), t)


def a_mesh_whose_frame_is_another_one_in_between(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.body('object', SMALL, 2, [t for t in every(.1) if t < .45], z=lambda t: .1)
    c.body('object', SMALL, 2, [t for t in every(.1) if t > .45], z=lambda t: 0, frame='hand')
    c.tf('hand', every(.01, 1.1, -.1), z=lambda t: dip(t))


def a_separation_that_an_arc_comes_within(c):
    c.params.update(rigid_tolerance_m=1e-4, accuracy='conservative', minimum_separation_m=.002)
    c.body('sheet', [(x, y, -.5315) for x, y, _ in SHEET], 3, every(.1))
    c.tf('arm', every(.1, 1.1, -.1), angle=lambda t: 2 * (t - .45))
    c.tf('finger', [-.2], z=lambda t: -.5, parent='arm', topic='/tf_static')
    c.finger('finger')


def a_promise_about_a_finger_in_a_chain(c):
    c.params.update(max_speed_m_s=1.0, speed_scale={'reaction_time_s': .1, 'stopping_time_s': .1}, effects={'clearance': 'on'})
    c.body('sheet', SHEET, 3, every(.1))
    c.tf('arm', every(.05, 1.1, -.1), z=lambda t: .6)
    c.tf('finger', every(.05, 1.1, -.1), z=lambda t: -.3 * t, parent='arm')
    c.finger('finger')


def swing(c, child, far, times):
    """At each sample the frame is `far` away along x, and between two of them it is nearer: two joints turn against each other."""
    side = lambda t: (-1) ** int(round(t / .1))
    c.tf('arm', times, angle=side)
    for t in times:
        one = TransformStamped(child_frame_id=child)
        one.header.frame_id, one.header.stamp = 'arm', worlds.stamp(c.ns(t))
        a = -side(t)  # back again
        one.transform.translation.x, one.transform.translation.z = far * math.cos(a), -far * math.sin(a)
        one.transform.rotation.y, one.transform.rotation.w = math.sin(a / 2), math.cos(a / 2)
        c.add('/tf', TFMessage([one]), t, .0007)


def a_map_in_a_frame_that_swings(c):
    swing(c, 'cart', .6, every(.1, 1.1, -.1))
    c.map([(0, 0, 0)], -.05, stamp_at=0, frame='cart')
    c.body('sheet', [(x + .4, y, .02) for x, y, _ in SHEET], 3, every(.1))


def a_static_body_in_a_frame_that_swings(c):
    swing(c, 'cart', .6, every(.1, 1.1, -.1))
    c.body('table', [(0, 0, -.02), (0, 0, .02), (.02, .02, -.02), (.02, .02, .02)], 2, [0], frame='cart', motion='static')
    c.body('sheet', [(x + .4, y, 0) for x, y, _ in SHEET], 3, every(.1))


def closed(c, name, at, z, size=.3, **settings):
    c.params['bodies'][name] = {'topic': '/' + name, **settings}
    message = worlds.MeshStamped(vertices=[worlds.Point(x * size, y * size, z + h * size) for x, y, h in (worlds.FINGER / .03).tolist()],
                                 triangles=[worlds.MeshTriangle(f) for f in ((0, 1, 2), (0, 1, 3), (1, 2, 3), (2, 0, 3))])
    message.header.frame_id, message.header.stamp = 'world', worlds.stamp(c.ns(at))
    c.add('/' + name, message, at)


def a_closed_static_body_that_comes_around_another(c):
    c.body('sheet', SMALL, 2, every(.1))
    closed(c, 'table', -.05, 5, motion='static')
    closed(c, 'table', .55, 0, motion='static')


def a_closed_body_that_jumps_around_another(c):
    c.body('sheet', SMALL, 2, every(.1))
    for t in every(.1):
        closed(c, 'object', t, 5 if t < .45 else 0)


def a_finger_that_jumps_around_a_mesh(c):
    c.body('sheet', [(.1 * x, .1 * y, -.01) for x, y, _ in SMALL], 2, every(.1))
    c.tf('finger', every(.1, 1.1, -.1), z=lambda t: 2 if t < .45 else 0)
    c.finger('finger')


def a_finger_without_tf_that_comes_back_around_a_mesh(c):
    c.body('sheet', [(.1 * x, .1 * y, -.01) for x, y, _ in SMALL], 2, every(.1, 2.0))
    c.tf('finger', every(.02, .5, -.1), z=lambda t: .3)
    c.tf('finger', every(.02, 2.1, 1.2))
    c.finger('finger')


def a_map_that_comes_around_a_mesh(c):
    c.map([(9, 9, 9)], -.05)
    c.body('sheet', SMALL, 2, every(.1))
    c.map([(x, y, z) for x in range(-3, 3) for y in range(-3, 3) for z in range(-3, 3)], .45)


def a_vertex_that_is_seen_only_at_one_end(c):
    c.body('sheet', SHEET, 3, [t for t in every(.1) if t < .45])
    c.body('sheet', SHEET[:4] + [(0, 0, float('nan'))] + SHEET[5:], 3, [.5])
    c.body('sheet', SHEET, 3, [t for t in every(.1) if t > .55])
    c.body('object', SMALL, 2, every(.1), z=lambda t: .05 - t * .1)


def a_frame_that_comes_again_elsewhere_before_its_answer(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.body('object', SMALL, 2, every(.15, 1.05), z=lambda t: .1)
    c.body('sheet', SHEET, 3, [.5], z=lambda t: .2, delay=.02)


def a_mesh_in_a_chain_of_which_a_joint_swings(c):
    swing(c, 'hand', .6, every(.1, 1.1, -.1))
    c.body('object', [(x, y, -.01 + h) for x, y, h in SMALL[:2]] + [(0, 0, .02), (.02, 0, .02)], 2, every(.1), frame='hand')
    c.body('sheet', [(x + .35, y, 0) for x, y, _ in SHEET], 3, every(.1))


def ropes_in_the_rows_of_a_cloud(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.params['bodies']['sheet']['topology'] = {'source': 'polyline'}
    for _, message, _, _ in c.rows:
        message.height, message.width, message.row_step = 3, 3, 36
    c.body('object', [(x, y - .01, h) for x, y, h in SMALL], 2, every(.1), z=lambda t: .32 - t * .4)


def down(t):
    return max(.02, .3 - .5 * t)


def owned(c, times=every(.1)):
    """A sheet that comes down upon voxels of 5 cm, of which some may be its own."""
    c.params.update(own_voxels_m='auto', own_voxels_lag_s=0.1)
    c.body('sheet', SMALL, 2, times, z=down)


def an_obstacle_that_was_there_before_the_body(c):
    owned(c)
    c.map([(9, 9, 9), (0, 0, 0)], -.05)


def a_voxel_that_appears_within_reach(c):
    owned(c)
    c.map([(9, 9, 9)], -.05)
    c.map([(9, 9, 9), (0, 0, 0)], .65)


def a_voxel_that_appears_out_of_reach(c):
    owned(c)
    c.map([(9, 9, 9)], -.05)
    c.map([(9, 9, 9), (0, 0, 0)], .15)


def a_voxel_that_the_body_hid_and_that_comes_back(c):
    owned(c, every(.1, 1.5))
    c.map([(9, 9, 9), (0, 0, 0)], -.05)
    c.map([(9, 9, 9)], .62)
    c.map([(9, 9, 9), (0, 0, 0)], .92)


def a_first_map_that_shows_the_body_and_perhaps_more(c):
    c.params.update(own_voxels_m='auto')
    c.body('sheet', SMALL, 2, every(.1), z=lambda t: .02)
    c.map([(9, 9, 9), (0, 0, 0)], -.05, stamp_at=.05)


def a_space_below_a_sheet_of_which_nothing_is_known(c):
    c.params.update(unknown_space='occupied', unknown_box=[-.1, -.1, -.1, .2, .2, .35])
    c.body('sheet', SMALL, 2, every(.1), z=down)
    c.map([(9, 9, 9)], -.05, free=[(x, y, z) for x in range(-2, 4) for y in range(-2, 4) for z in range(2, 7)])


def an_obstacle_that_the_map_forgot_and_shows_again(c):
    """The map tells what it has seen free, and of the obstacle it tells nothing for a while."""
    owned(c, every(.1, 1.5))
    far = [(x, y, 9) for x in range(4) for y in range(4)]
    c.map([(9, 9, 9), (0, 0, 0)], -.05, free=far)
    c.map([(9, 9, 9)], .12, free=far)
    c.map([(9, 9, 9), (0, 0, 0)], .92, free=far)


def side(t):
    return .2 if round(t, 3) in (.3, .5) else -.2


def frames_that_arrive_in_another_order(c):
    """The one of 0.4 s has come when the one of 0.3 s does, from which the next step begins."""
    c.body('object', SMALL, 2, every(.1))
    c.body('sheet', SHEET, 3, [.3], z=side, delay=.15)
    c.body('sheet', SHEET, 3, [t for t in every(.1) if round(t, 3) != .3], z=side)


def frames_of_another_body_that_arrive_in_another_order(c):
    c.body('sheet', SHEET, 3, every(.1))
    c.body('object', SMALL, 2, [.3], z=side, delay=.15)
    c.body('object', SMALL, 2, [t for t in every(.1) if round(t, 3) != .3], z=side)


def a_hole_in_the_transforms_of_a_finger(c):
    """It comes back on the other side of the sheet."""
    c.body('sheet', SHEET, 3, every(.1, 4))
    c.tf('finger', [t for t in every(.05, 4.2, -.1) if not .4 < t < 3.4], z=lambda t: .3 if t < 1 else -.3)
    c.finger('finger')


def a_time_that_begins_anew_without_transforms(c):
    c.body('sheet', SHEET, 3, every(.1, 2))
    c.body('sheet', SHEET, 3, every(.1, 1.5, .3), delay=2.5)
    c.tf('finger', every(.05, 2.2, -.1), z=lambda t: .3)
    c.finger('finger')


def a_map_that_is_stamped_ahead_of_all_frames(c):
    owned(c, every(.1, 1.5))
    c.map([(9, 9, 9)], -.05)
    c.map([(9, 9, 9), (0, 0, 0)], .05, stamp_at=3)


def a_map_of_a_clock_that_is_ahead(c):
    """By its stamp the sheet was there when it shows the voxel, and by when it came it cannot have been."""
    owned(c, every(.1, 2.5))
    c.map([(9, 9, 9)], -.05)
    c.map([(9, 9, 9), (0, 0, 0)], .05, stamp_at=.75)


def camera(c, points, times):
    c.params.update(obstacle_cloud_topic='/points', obstacle_resolution_m=.05)
    c.tf('eye', [-.2], z=lambda t: 1, topic='/tf_static')
    for t in times:
        c.add('/points', worlds.World.cloud([(x, y, z - 1) for x, y, z in points(t)], 1, c.ns(t), 'eye'), t)


def a_cloud_that_shows_an_obstacle(c):
    c.body('sheet', SMALL, 2, every(.1), z=down)
    camera(c, lambda t: [(.012, .013, .021), (.4, .4, .4)], every(.1, 1.0, -.05))


def a_cloud_that_shows_an_obstacle_below_what_it_may_show_of_the_body(c):
    owned(c)
    camera(c, lambda t: [(.012, .013, .021 if t < .3 else down(t)), (.4, .4, .4)], every(.1, 1.0, -.05))


def a_camera_in_a_frame_that_tf_has_late(c):
    c.body('sheet', SMALL, 2, every(.1), z=down)
    camera(c, lambda t: [(.012, .013, .021), (.4, .4, .4)], every(.1, 1.0, -.05))
    for row in c.rows:
        if row[0] == '/tf_static':
            row[0], row[1].transforms[0].header.stamp = '/tf', worlds.stamp(c.ns(.4))


def a_cloud_that_showed_what_no_ray_reaches_again(c):
    c.body('sheet', SMALL, 2, every(.1), z=down)
    camera(c, lambda t: [(.012, .013, .021)] * (t < .1) + [(.4, .4, .4)], every(.1, 1.0, -.05))


def clouds_that_say_where_they_were_seen_from(c):
    c.body('sheet', SMALL, 2, every(.1), z=down)
    camera(c, lambda t: [(.012, .013, 1.021), (.4, .4, 1.4)], every(.1, 1.0, -.05))
    for row in c.rows:
        if row[0] == '/points':
            row[1].header.frame_id = 'world'
            worlds.seen_from(row[1], (0, 0, 1))


def a_static_body_in_a_frame_that_is_at_two_places(c):
    """At one stamp tf has it above the sheet and below."""
    c.body('sheet', SHEET, 3, every(.1))
    c.body('table', SMALL, 2, [-.05], frame='cart', motion='static')
    c.tf('cart', every(.01, 1.1, -.1), z=lambda t: .1)
    c.tf('cart', [.45], z=lambda t: -.1, delay=.0007)


def own_voxels_beside_a_static_frame_that_is_sent_elsewhere(c):
    """The table stood at a voxel when a map first showed that, and a finger comes to it later."""
    c.params.update(own_voxels_m='auto', own_voxels_lag_s=0)
    c.body('sheet', SMALL, 2, every(.1), z=down)
    c.tf('mount', [-.2], x=.3, topic='/tf_static')
    c.body('table', SMALL, 2, [-.05], frame='mount', motion='static', against_obstacle=False)
    c.tf('mount', [.35], x=.6, topic='/tf_static')
    c.map([(9, 9, 9)], -.05)
    c.map([(9, 9, 9), (0, 0, 0), (6, 0, 0)], .15)


def a_transform_that_comes_again_elsewhere_before_the_answer(c):
    """The end of a step at 0.5 s lies between two samples; the later one comes again elsewhere, then the frame that the answer waits for."""
    c.body('sheet', SHEET, 3, every(.1))
    c.body('object', SMALL, 2, every(.1, 1.03, -.07), z=lambda t: .3, delay=.06)
    c.tf('finger', every(.02, 1.11, -.11), z=lambda t: .3)
    c.tf('finger', [.51], z=lambda t: -.3, delay=.03)
    c.finger('finger')


# Nothing is wrong in these, and all is proved but the first frame, and a step before a second body's first.
LOW = [(x / 2, y / 2, -.8) for x, y, _ in SHEET]


def an_arm(c, times, turn):
    c.tf('arm', times, angle=turn)
    c.tf('finger', times, z=lambda t: -.5, parent='arm')
    c.finger('finger')


def all_proved_a_fast_robot_whose_joints_come_at_500_hz(c):
    c.body('sheet', LOW, 3, every(1 / 30, 1.5))
    an_arm(c, every(.002, 1.6, -.1), lambda t: t - .7)


def all_proved_a_fast_arm_seen_at_30_hz_and_a_cloth_at_10(c):
    c.body('sheet', LOW, 3, every(.1, 2))
    an_arm(c, every(1 / 30, 2.1, -.1), lambda t: 1.5 * (t - 1))


def all_proved_a_map_and_a_table_that_turn_with_their_frame(c):
    c.body('sheet', LOW, 3, every(1 / 30, 1.5))
    c.map([(4, 0, 0), (9, 0, 0)], -.05, frame='cart')
    c.body('table', SMALL, 2, [-.05], frame='cart', motion='static')
    c.tf('cart', every(.02, 1.6, -.1), angle=lambda t: t - .7)


def all_proved_two_noisy_cloths_out_of_phase(c):
    noise = random.Random(1)
    for name, height, begin in (('sheet', 0, 0), ('other', .1, .015)):
        c.params['bodies'][name] = {'topic': '/' + name, 'topology': {'rows': 3, 'cols': 3}}
        for t in every(1 / 30, 1.5, begin):
            points = [tuple(x + noise.gauss(0, .001) for x in (p[0], p[1], height)) for p in SHEET]
            c.add('/' + name, worlds.World.cloud(points, 3, c.ns(t), 'world'), t)


def all_proved_a_simulation_at_a_third_of_real_time(c):
    del c.params['sync_timeout_s']
    c.body('sheet', LOW, 3, every(1 / 30, 1.5))
    c.body('other', [(x, y, z - .2) for x, y, z in LOW], 3, every(1 / 30, 1.5, .01))
    an_arm(c, every(1 / 30, 1.6, -.1), lambda t: .5 * (t - .7))
    for row in c.rows:
        row[2] = c.begin + int((row[2] - c.begin) / .3)


CASES = {name: make for name, make in list(globals().items()) if callable(make) and getattr(make, '__code__', None)
         and make.__code__.co_varnames[:1] == ('c',) and make.__code__.co_argcount == 1}


def case(name, folder):
    one = Case(folder)
    CASES[name](one)
    return one.made(name)
