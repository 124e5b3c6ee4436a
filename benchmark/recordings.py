#!/usr/bin/env python3
"""What the monitor says of recordings that others made, held to what is known of them.

Each file of config/recordings says how one of the data's recordings is read. Of each: analyze_bag answers, audit_bag judges all of it, a
brute force decides some of its steps in whole numbers alone, and what is known of the recording from elsewhere must hold. It ends with 1
where something does not.
"""
import argparse
import collections
import csv
import importlib.machinery
import importlib.util
import json
import multiprocessing
import os
import pathlib
import subprocess
import sys
import xml.etree.ElementTree as xml

import numpy as np
import rosbag
import yaml
from genpy import Time
from geometry_msgs.msg import Point, TransformStamped
from sensor_msgs.msg import CameraInfo, Image
from shape_msgs.msg import MeshTriangle
from tf2_msgs.msg import TFMessage

from deformable_ccd.msg import MeshStamped
from report import recordings_pictures
from report.paper_report import table

CHECKOUT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(CHECKOUT / 'audit'))
import came  # noqa: E402  (the judge's, which shares nothing with the monitor)
import placed  # noqa: E402
import touches  # noqa: E402

NS = 1000000000
NO_VERTEX = 4294967295
HEADER = ['recording', 'steps', 'proved', 'with contacts', 'ms, median', '95 %', 'what is known holds', 'brute force: steps, pairs',
          'audit: claims hold', 'refuted', 'not covered']
Run = collections.namedtuple('Run', 'name bag params octomap known')
Answer = collections.namedtuple('Answer', 'report steps contacts stats')


# -- bags of what is no bag ---------------------------------------------------------------------------------------------


def make_bag(positions, bag, *words):
    script = CHECKOUT / 'examples/python/bag_from_arrays.py'
    subprocess.run([sys.executable, str(script), str(positions), str(bag), *words], check=True, stdout=subprocess.DEVNULL)
    return bag


def from_arrays(name, folder, data, *words):
    return make_bag(data / 'recordings' / name / 'positions.npy', folder / (name + '.bag'), *words)


def sheet(count, size, at, along=(0, 1)):
    """A flat square of count x count points about a place, in the plane of two axes, and its triangles."""
    points = np.tile(np.array(at, float), (count * count, 1))
    steps = np.linspace(-size / 2, size / 2, count)
    points[:, along[0]] += np.repeat(steps, count)
    points[:, along[1]] += np.tile(steps, count)
    corners = [r * count + c for r in range(count - 1) for c in range(count - 1)]
    return points, [f for v in corners for f in ((v, v + count, v + 1), (v + 1, v + count, v + count + 1))]


def mesh_message(stamp, frame, positions, triangles):
    message = MeshStamped(vertices=[Point(*p) for p in positions.tolist()], triangles=[MeshTriangle(vertex_indices=f) for f in triangles])
    return stamped(message, stamp, frame)


def stamped(message, stamp, frame):
    message.header.stamp, message.header.frame_id = Time(stamp // NS, stamp % NS), frame
    return message


def write(path, messages):
    """Of (topic, message, nanoseconds), in the order of time."""
    with rosbag.Bag(str(path), 'w') as bag:
        for topic, message, at in sorted(messages, key=lambda row: row[2]):
            bag.write(topic, message, Time(at // NS, at % NS))
    return path


def config(name, folder, **more):
    """The recording's parameters, in a file of their own where it takes more."""
    path = CHECKOUT / 'config/recordings' / (name + '.yaml')
    if more:
        params = {**yaml.safe_load(path.read_text()), **more}
        path = folder / (name + '.yaml')
        path.write_text(yaml.safe_dump(params))
    return path


# -- what is known ------------------------------------------------------------------------------------------------------


def is_so(what, found, expected, off=0.0):
    """A thing that is known: in words, and whether it holds."""
    return '%s: %s, known %s' % (what, found, expected), abs(found - expected) <= off if off else found == expected


def first_through(points_at, height_at, within, begin, end):
    """When points first reach a flat sheet that lies square to an axis: they are below it at first. points_at(s): n x 3 by (two axes of the
    sheet, height); within: its size, from its middle. Found by halving."""
    def reaches(s):
        p = points_at(s)
        return ((np.abs(p[:, :2] - within[:2]) <= within[2]).all(1) & (p[:, 2] >= height_at(s))).any()
    ahead = next(s for s in np.arange(begin, end, 0.01) if reaches(s))
    low = ahead - 0.01
    for _ in range(30):
        middle = (low + ahead) / 2
        low, ahead = (low, middle) if reaches(middle) else (middle, ahead)
    return ahead


def first_contact_s(answer):
    """Of the run: the time of the first contact by the table of steps, in seconds of the stamps."""
    for row in answer.steps:
        if row['earliest_toc']:
            start, end = int(row['start_ns']), int(row['stamp_ns'])
            return (start + float(row['earliest_toc']) * (end - start)) / NS
    return None


# -- the recordings -----------------------------------------------------------------------------------------------------


def samba(data, folder, _):
    def known(answer):
        states = [row['start_state'] for row in answer.steps if row['answered'] == '1']
        yield is_so('the first step starts', states[0], 'INTERSECTING')
        yield is_so('others start CLEAR', 'CLEAR' in states[1:], True)
    bag = from_arrays('samba', folder, data, '--rate', '25', '--topology', str(data / 'recordings/samba/topology.obj'))
    yield Run('samba', bag, config('samba', folder), None, known)


def tshirt(data, folder, _):
    def known(answer):
        yield is_so('poses that make a step', sum(row['answered'] == '1' for row in answer.steps), 9)
    bag = from_arrays('tshirt', folder, data, '--rate', '0.5', '--scale', '0.1', '--topology', str(data / 'recordings/tshirt/topology.obj'))
    yield Run('tshirt', bag, config('tshirt', folder), None, known)

    def objects(answer):
        yield is_so('steps without the two parameters', sum(row['answered'] == '1' for row in answer.steps), 0)
        yield is_so('proved then', answer.report['proof']['proved'], 0)
    plain = folder / 'tshirt_plain.yaml'
    plain.write_text('fixed_frame: world\n')
    yield Run('tshirt, by default', bag, plain, None, objects)


def rope_sim(data, folder, _):
    def known(answer):
        yield is_so('steps with contacts', sum(row['contacts'] != '0' for row in answer.steps), 0)
    yield Run('rope_sim', from_arrays('rope_sim', folder, data, '--rate', '25'), config('rope_sim', folder), None, known)


def nodes_of(path):
    """How many nodes the header of a .bt file names; how many its bytes hold, and how many occupied leaves, counted here."""
    head, body = path.read_bytes().split(b'\ndata\n', 1)
    told = int(next(line for line in head.split(b'\n') if line.startswith(b'size')).split()[1])
    inner, nodes, occupied, at = 1, 1, 0, 0
    while inner > 0:
        children = [body[at + i // 4] >> 2 * (i % 4) & 3 for i in range(8)]
        inner, nodes, at = inner - 1 + children.count(3), nodes + 8 - children.count(0), at + 2
        occupied += children.count(2)
    return told, nodes, occupied


def maps(data, folder, frames):
    rope = np.load(data / 'recordings/rope_sim/positions.npy').astype(float)[:frames or 400]
    for path in sorted((data / 'recordings/maps').glob('*.bt')):
        tree = came.octomap(path.read_bytes(), True, 'OcTree', 0)
        low = (tree.corners - 32768) * tree.resolution
        begin, end = low.min(0), (low + tree.sizes[:, None] * tree.resolution).max(0)
        begin[2] = end[2] = np.median(low[:, 2])
        np.save(folder / 'carried.npy', rope + np.linspace(begin, end, len(rope))[:, None])
        bag = folder / (path.stem + '.bag')
        make_bag(folder / 'carried.npy', bag, '--rate', '25', '--frame', 'map')

        def known(answer, path=path):
            told, counted, occupied = nodes_of(path)
            yield is_so('nodes in the bytes of the map', counted, told)
            yield is_so('occupied leaves that the monitor read', answer.stats[-1].map_leaves, occupied)
        yield Run('maps/' + path.stem, bag, config('maps', folder), path, known)


def depth_pictures(data):
    import matplotlib.image  # which reads 16 bits as shares of 65535
    place = data / 'recordings/shirt_depth'
    pictures = [np.rint(matplotlib.image.imread(str(p)) * 65535).astype('<u2') for p in sorted(place.glob('depth_*.png'))]
    return pictures, np.loadtxt(place / 'intrinsics.txt')


def shirt_depth(data, folder, frames):
    edge, size, speed, begin = 0.02, 0.3, 0.5, NS
    pictures, k = depth_pictures(data)
    stamps, messages = (begin, begin + 37 * NS // 10), []
    for stamp, picture in zip(stamps, pictures):
        height, width = picture.shape
        info = CameraInfo(height=height, width=width, distortion_model='plumb_bob', D=[0] * 5, K=k[:3, :3].ravel().tolist(),
                          R=np.eye(3).ravel().tolist(), P=k[:3, :4].ravel().tolist())
        image = Image(height=height, width=width, encoding='16UC1', step=2 * width, data=picture.tobytes())
        messages += [('/camera/depth/camera_info', stamped(info, stamp, 'camera'), stamp),
                     ('/camera/depth/image_rect_raw', stamped(image, stamp, 'camera'), stamp)]
    # In the middle of what the first picture sees.
    seen = np.argwhere(pictures[0] > 0)
    v, u = seen[np.argmin(np.abs(seen - np.array(pictures[0].shape) / 2).sum(1))]
    depth = pictures[0][v, u] / 1000
    at = (u - k[0, 2]) * depth / k[0, 0], (v - k[1, 2]) * depth / k[1, 1], 0.8
    points, triangles = sheet(7, size, at)
    for i in range(frames or 150):
        stamp = begin + NS // 5 + i * NS // 30
        messages.append(('/sheet', mesh_message(stamp, 'camera', points + (0, 0, speed * i / 30), triangles), stamp))

    def known(answer):
        no_depth = sum(int((p == 0).sum()) for p in pictures)
        yield is_so('lost pixels, of both pictures', answer.stats[-1].points_no_measurement, no_depth)
        rows, columns = np.indices(pictures[0].shape)
        z = pictures[0] / 1000.0
        p = np.stack([(columns - k[0, 2]) * z / k[0, 0], (rows - k[1, 2]) * z / k[1, 1], z], 2)[z > 0]
        voxels = np.unique(np.floor(p / edge), axis=0) * edge
        under = voxels[((voxels[:, :2] <= np.array(at[:2]) + size / 2) & (voxels[:, :2] + edge >= np.array(at[:2]) - size / 2)).all(1)]
        yield is_so('first contact with the shirt [s]', first_contact_s(answer), 1.2 + (under[:, 2].min() - at[2]) / speed, 1e-4)
    yield Run('shirt_depth', write(folder / 'shirt_depth.bag', messages), config('shirt_depth', folder), None, known)


def robot_tf(data, folder, frames):
    source, transforms = data / 'recordings/robot_tf/jsk_watercan.bag', placed.Transforms()
    with rosbag.Bag(str(source)) as bag:
        messages = [(topic, message, t.to_nsec()) for topic, message, t in bag.read_messages(topics=['/tf'])]
    for topic, message, t in messages:
        transforms.add(message, False, t, 'robot')
    transforms.finish()
    transforms.judge(2 ** 62, 0, 2 ** 62)
    begin, top, speed, size = messages[0][2] + NS // 5, 1.1, 0.1, 0.9
    points, triangles = sheet(9, size, (-0.1, -0.2, top))
    count = frames or 180
    for i in range(count):
        stamp = begin + i * NS // 30
        messages.append(('/sheet', mesh_message(stamp, 'map', points - (0, 0, speed * i / 30), triangles), stamp))
    box = np.array([(x, y, z) for x in (-.025, .025) for y in (-.025, .025) for z in (-.04, .04)])

    def known(answer):
        frames_of = collections.Counter(x.child_frame_id for _, m, _ in messages if hasattr(m, 'transforms') for x in m.transforms)
        yield is_so('frames on /tf', len(frames_of), 83)
        hands = lambda s: np.concatenate([placed.carried(transforms.pose(link, 'map', int(begin + s * NS)), box)
                                          for link in ('LARM_LINK7', 'RARM_LINK7')])
        expected = first_through(hands, lambda s: top - speed * s, (-0.1, -0.2, size / 2), 0.5, count / 30)
        yield is_so('the sheet reaches a hand [s]', first_contact_s(answer) - begin / NS, expected, 1e-4)
    yield Run('robot_tf', write(folder / 'robot_tf.bag', messages), config('robot_tf', folder), None, known)


def ur5e(data, folder, frames):
    """The joints by formula, their transforms by the URDF, read here."""
    from cell_live import package_of
    urdf = data / 'robots/ur5e/ur5e.urdf'
    package_of(data, folder / 'packages')
    os.environ['ROS_PACKAGE_PATH'] = '%s:%s' % ((folder / 'packages').resolve(), os.environ.get('ROS_PACKAGE_PATH', ''))
    numbers = lambda element, name: [float(w) for w in element.get(name, '0 0 0').split()]
    turned = lambda axis, angle: np.append(np.sin(angle / 2) * np.eye(3)['xyz'.index(axis)], np.cos(angle / 2))
    joints = [(j.get('name'), j.find('parent').get('link'), j.find('child').get('link'), numbers(j.find('origin'), 'xyz'),
               numbers(j.find('origin'), 'rpy')) for j in xml.parse(str(urdf)).getroot().findall('joint')]
    pan = lambda s: 0.5 * s - 0.9  # the shoulder; the other joints stay at 0
    rotation_of = lambda rpy: np.linalg.multi_dot([came.rotation(turned(a, x)) for a, x in zip('zyx', rpy[::-1])])
    begin, messages, count, size, wall = NS, [], frames or 90, 1.0, (0.8, 0.35, 0.2)

    def pose(name, xyz, rpy, s):
        m = np.eye(4)
        m[:3, :3], m[:3, 3] = rotation_of(rpy), xyz
        if name == 'shoulder_pan_joint':
            m[:3, :3] = m[:3, :3] @ came.rotation(turned('z', pan(s)))
        return m
    for i in range(-5, 100 * count // 30 + 20):
        transform_list = []
        for name, parent, child, xyz, rpy in joints:
            m = pose(name, xyz, rpy, i / 100)
            one = stamped(TransformStamped(child_frame_id=child), begin + i * NS // 100, parent)
            one.transform.translation.x, one.transform.translation.y, one.transform.translation.z = m[:3, 3]
            w = np.sqrt(max(0, 1 + m[0, 0] + m[1, 1] + m[2, 2])) / 2
            if w < 1e-6:
                values, vectors = np.linalg.eigh(m[:3, :3] + m[:3, :3].T)
                q = np.append(vectors[:, -1], 0)
            else:
                q = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 4 * w * w]) / (4 * w)
            one.transform.rotation.x, one.transform.rotation.y, one.transform.rotation.z, one.transform.rotation.w = q / np.linalg.norm(q)
            transform_list.append(one)
        messages.append(('/tf', TFMessage(transform_list), begin + i * NS // 100))
    points, triangles = sheet(11, size, wall, (0, 2))
    for i in range(count):
        stamp = begin + i * NS // 30
        messages.append(('/sheet', mesh_message(stamp, 'base_link', points, triangles), stamp))

    def known(answer):
        parts = list(came.links(str(urdf), came.Files()))
        chain = {child: (parent, name, xyz, rpy) for name, parent, child, xyz, rpy in joints}
        yield is_so('links with a shape', len(parts), 7)

        def arm(s):
            found = []
            for link, p, *_ in parts:
                while link != 'base_link':
                    link, name, xyz, rpy = chain[link]
                    p = placed.carried(pose(name, xyz, rpy, s), p)
                found.append(p)
            return np.concatenate(found)[:, [0, 2, 1]]
        expected = first_through(arm, lambda s: wall[1], (wall[0], wall[2], size / 2), 0, count / 30)
        yield is_so('the arm reaches the sheet [s]', first_contact_s(answer) - begin / NS, expected, 1e-3)
    yield Run('ur5e', write(folder / 'ur5e.bag', messages), config('ur5e', folder, robot={'description': str(urdf.resolve())}), None, known)


RECORDINGS = {f.__name__: f for f in (samba, tshirt, shirt_depth, rope_sim, robot_tf, maps, ur5e)}


# -- answers, and who judges them ---------------------------------------------------------------------------------------


def analyse(tools, run, folder):
    """What analyze_bag says of the run: the report, its steps, the contacts of each step."""
    words = ['--octomap', str(run.octomap)] if run.octomap else []
    done = subprocess.run([str(tools / 'analyze_bag'), str(run.bag), '--params', str(run.params), '--report', str(folder), '-o',
                           str(folder / 'claims.bag'), '--quiet', *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode not in (0, 3):
        sys.exit('recordings: analyze_bag ended with %d: %s' % (done.returncode, done.stderr))
    with open(folder / 'steps.csv', newline='') as stream:
        steps = list(csv.DictReader(stream))
    with rosbag.Bag(str(folder / 'claims.bag')) as bag:
        said = {name: [m for _, m, _ in bag.read_messages('/collision_monitor/' + name)] for name in ('contacts', 'stats')}
    return Answer(json.loads((folder / 'report.json').read_text()), steps, said['contacts'], said['stats'])


def audit(tools, run, folder, most):
    words = ['--octomap', str(run.octomap)] * bool(run.octomap) + ['--steps', '0:%s' % (most or '')]
    done = subprocess.run([str(tools / 'audit_bag'), str(run.bag), str(folder / 'claims.bag'), '--params', str(run.params), '--json',
                           str(folder / 'verdict.json'), *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode not in (0, 1, 3):
        sys.exit('recordings: audit_bag ended with %d: %s' % (done.returncode, done.stderr))
    return json.loads((folder / 'verdict.json').read_text())


def judge_of(run, folder, step):
    """The judge of one step, in which floating point rejects nothing: of features whose boxes meet, whole numbers decide."""
    loader = importlib.machinery.SourceFileLoader('audit_bag', str(CHECKOUT / 'audit/audit_bag'))
    judges = importlib.util.module_from_spec(importlib.util.spec_from_loader('audit_bag', loader))
    loader.exec_module(judges)
    touches.apart = lambda first, *_, **__: np.zeros(len(first), bool)
    judges.progress = lambda *_: None
    words = argparse.Namespace(pairs=10 ** 9, steps='%d:%d' % (step, step + 1))
    with rosbag.Bag(str(run.bag)) as bag, rosbag.Bag(str(folder / 'claims.bag')) as said:
        world = judges.World(bag, yaml.safe_load(run.params.read_text()), run.octomap and str(run.octomap))
        return judges, judges.Judge(world, judges.Claims(said), words)


def decide(job):
    """One step by brute force: how many pairs were decided, and what is wrong with its claim."""
    run, folder, step = job
    judges, judge = judge_of(run, folder, step)
    decided, meet = [0], judges.meet

    def counted(*words):
        decided[0] += 1
        return meet(*words)
    judges.meet = counted
    judge.run()
    wrong = judge.refuted + judge.not_covered
    claim = judge.said[step]
    if [b for _, b in judge.world.partners()] == ['self'] and not wrong:
        (body, b), = judge.world.partners()
        crossing = judges.Step(judge.world, claim['start'], claim['end'], None, 0).crossing(body, b, claim['start'])
        if (crossing is None) == (claim['listed'].start_state == claim['listed'].INTERSECTING):
            wrong.append({'reason': 'start_state is %d, and the edge and face that cross are %s' % (claim['listed'].start_state, crossing)})
    for (a, b), listed in claim['pairs'].items():
        if b == 'octomap' and not wrong and not judge.world.clouds:  # of clouds the judge has what is filled in any case
            step = judges.Step(judge.world, claim['start'], claim['end'], claim['map_used'], 10 ** 9)
            truth = {(frozenset(map(int, one)), tuple(map(int, key))) for _, one, key, _ in step.meeting(a, b)}
            odd = {(frozenset(vertices) - {NO_VERTEX}, key) for _, vertices, key in listed} - truth
            wrong += [{'reason': '%s of %s is said to meet the voxel %s, and does not' % (sorted(one), a, key)} for one, key in odd]
    return decided[0], [one['reason'] for one in wrong]


def some_steps(run, folder, most):
    """As many that touch as do not, evenly over the run."""
    judge = judge_of(run, folder, 0)[1]
    proved = [i for i, claim in enumerate(judge.said) if claim['proved']]
    of = lambda kind: [i for i in proved if bool(judge.said[i]['touching']) == kind]
    spread = lambda steps, n: [steps[i * len(steps) // n] for i in range(n)] if n else []
    quiet = min(len(of(False)), most - min(len(of(True)), most // 2))
    return sorted(spread(of(False), quiet) + spread(of(True), min(len(of(True)), most - quiet)))


def measure(arguments, run):
    folder = arguments.out / run.name.replace('/', '_').replace(', ', '_').replace(' ', '_')
    folder.mkdir(parents=True, exist_ok=True)
    answer = analyse(arguments.tools, run, folder)
    known = list(run.known(answer))
    verdict = audit(arguments.tools, run, folder, arguments.audited)
    with multiprocessing.Pool(os.cpu_count()) as pool:
        steps = pool.apply(some_steps, (run._replace(known=None), folder, arguments.brute))
        decided = pool.map(decide, [(run._replace(known=None), folder, step) for step in steps], chunksize=1)
    proof, total = answer.report['proof'], answer.report['total']
    claims = verdict['held'] + len(verdict['refuted']) + len(verdict['not_covered'])
    left_out = proof['not_looked_at'] + [proof['unproved']] * bool(proof['unproved'])
    return answer, {'recording': run.name, 'steps': proof['steps'], 'proved': proof['proved'], 'touching': sum(
        row['contacts'] not in ('', '0') for row in answer.steps), 'contacts': sum(int(row['contacts'] or 0) for row in answer.steps),
            'median_ms': total['median_ms'], 'p95_ms': total['p95_ms'], 'left_out': left_out, 'known': [text for text, _ in known],
            'unlike': [text for text, holds in known if not holds], 'brute_steps': len(steps), 'brute_pairs': sum(n for n, _ in decided),
            'brute_wrong': [why for _, wrong in decided for why in wrong], 'claims': claims, 'held': verdict['held'],
            'refuted': [r['reason'] for r in verdict['refuted']],
            'not_covered': collections.Counter(r['reason'] for r in verdict['not_covered'])}


def line_of(row):
    return [row['recording'], str(row['steps']), '%.1f %%' % (100 * row['proved'] / max(1, row['steps'])), str(row['touching']),
            '%.3f' % row['median_ms'], '%.3f' % row['p95_ms'], '%d of %d' % (len(row['known']) - len(row['unlike']), len(row['known'])),
            '%d, %s' % (row['brute_steps'], format(row['brute_pairs'], ',')), str(row['held']), str(len(row['refuted'])),
            '%.1f %%' % (100 * sum(row['not_covered'].values()) / max(1, row['claims']))]


def page_of(rows):
    """The table, and below it what was left out and what is wrong."""
    text = table(HEADER, [line_of(row) for row in rows]) + '\n'
    for row in rows:
        notes = ['left out: ' + t for t in row['left_out']] + ['known: ' + t for t in row['known']]
        notes += ['WRONG: ' + t for t in row['unlike'] + row['brute_wrong'] + row['refuted']]
        notes += ['not covered: %s (%d claims)' % one for one in row['not_covered'].items()]
        text += '%s\n%s\n' % (row['recording'], ''.join('- %s\n' % note for note in notes))
    return text


def draw(data, folder, answers):
    """The pictures of the page, where what is on them was run."""
    recorded = data / 'recordings'
    figure = np.load(recorded / 'samba/positions.npy').astype(float)
    pictures, k = depth_pictures(data)
    tree = came.octomap((recorded / 'maps/fr_079.bt').read_bytes(), True, 'OcTree', 0)
    middles = (tree.corners - 32768 + tree.sizes[:, None] / 2) * tree.resolution
    with rosbag.Bag(str(folder / 'fr_079.bag')) as bag:
        rope = np.array([[(p.x, p.y, p.z) for p in m.vertices] for _, m, _ in bag.read_messages('/mesh')])
    recordings_pictures.draw_said(folder / 'recordings_said.png', lambda s: figure[int(round(25 * s))], answers, rope, middles)
    recordings_pictures.draw_blind(folder / 'recordings_blind.png', pictures[0], k, figure, np.load(recorded / 'tshirt/positions.npy')[:2])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--tools', required=True, type=pathlib.Path, help='folder of analyze_bag and audit_bag')
    parser.add_argument('--data', required=True, type=pathlib.Path, help='folder with recordings and robots')
    parser.add_argument('--out', required=True, type=pathlib.Path, help='folder of the results')
    parser.add_argument('--recordings', nargs='*', default=sorted(RECORDINGS), choices=sorted(RECORDINGS), help='only these')
    parser.add_argument('--frames', type=int, help='of those whose motion is made here, only so many')
    parser.add_argument('--brute', type=int, default=10, help='steps of each that a brute force decides')
    parser.add_argument('--audited', type=int, help='steps of each that the audit looks at, from the first; else all')
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    rows, answers = [], {}
    for name in arguments.recordings:
        for run in RECORDINGS[name](arguments.data, arguments.out, arguments.frames):
            answers[run.name], row = measure(arguments, run)
            rows.append(row)
            print('| ' + ' | '.join(line_of(rows[-1])) + ' |', file=sys.stderr, flush=True)
    (arguments.out / 'recordings.json').write_text(json.dumps(rows, indent=1))
    (arguments.out / 'recordings.md').write_text(page_of(rows))
    print(page_of(rows))
    if {'samba', 'maps/fr_079'} <= set(answers):
        draw(arguments.data, arguments.out, answers)
    sys.exit(1 if any(row['unlike'] or row['brute_wrong'] or row['refuted'] for row in rows) else 0)


if __name__ == '__main__':
    main()
