#!/usr/bin/env python3
"""Runs worlds of the storm: storm.py [--from SEED] [--worlds N | --cases] [--live] [--log FILE] [--keep DIR] [--smaller]; with --smaller it also says
which faults of a refuted world are needed for what is refuted; with --live the node answers in place of analyze_bag."""
import argparse
import collections
import copy
import importlib.machinery
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import types

import rosbag
import yaml

HERE = pathlib.Path(__file__).resolve().parent
CHECKOUT = HERE.parents[1]
TOOLS = pathlib.Path(os.environ.get('DEFORMABLE_CCD_WORKSPACE', CHECKOUT / 'build')) / 'devel/lib/deformable_ccd'
sys.path.insert(0, str(HERE))
import cases  # noqa: E402
import worlds  # noqa: E402

audit = types.ModuleType('audit_bag')  # a program without an ending
audit.__file__ = str(CHECKOUT / 'audit/audit_bag')
importlib.machinery.SourceFileLoader('audit_bag', audit.__file__).exec_module(audit)
audit.progress = lambda done, of: None


def roles(world):
    """What each name is, for the kinds: who is carried by tf, and who stands still."""
    found = {name: 'frame' for row in world.rows if row[0].startswith('/tf') for t in row[1].transforms for name in (
        t.child_frame_id, t.header.frame_id)}
    found.update({'tool': 'link', 'wrist': 'link', 'octomap': 'map', 'self': 'itself'} if 'robot' in world.params else {'octomap': 'map', 'self': 'itself'})
    for name, settings in world.params['bodies'].items():
        header = next((row[1].header for row in world.rows if row[0] == '/' + name), None)
        role = 'static mesh' if 'motion' in settings else 'mesh'
        found[name] = 'rigid' if 'rigid' in settings else role if header is None or header.frame_id == 'world' else 'carried ' + role
    return found


def kind_of(row, role):
    """What a refutation says, without its numbers and with what the names stand for: worlds of the same fault have the same kind."""
    words = re.sub(r'\[[^\]]*\]|\([^)]*\)', '#', row['reason'])
    words = re.sub(r'\b(vf|fv|ee|vx|ex|fx)\b', 'P', words)
    words = re.sub(r'-?\b\d[\d.e+-]*', 'N', ' '.join(role.get(word.strip(','), word) for word in words.split(' ')))
    pair = re.match(r'(P #) of (.*) and # of (\S+( \S+)*?) (meet|are)(.*)', words)
    if pair:  # of either order
        words = '%s of %s and %s %s%s' % (pair.group(1), *sorted(pair.group(2, 3)), *pair.group(5, 6))
    return row['claim'] + ': ' + words


Verdict = collections.namedtuple('Verdict', 'refuted kinds not_covered held statuses problem')


def judge(world, folder, live=False):
    """What analyze_bag, or the node, says of the world, held against what came."""
    if live:  # one process publishes
        world.rows = [row for row in world.rows if row[3] == row[0]]
    folder = pathlib.Path(folder)
    bag, params, out = folder / 'world.bag', folder / 'params.yaml', folder / 'out.bag'
    connections = {}
    with rosbag.Bag(str(bag), 'w') as written:
        for topic, message, at, publisher in world.rows:
            # rosbag has one connection for a topic, and with it one publisher, unless it is made to forget it.
            written._topic_connections.pop(topic, None)
            if (topic, publisher) in connections:
                written._topic_connections[topic] = connections[topic, publisher]
            header = {'callerid': '/' + publisher.strip('/'), 'topic': topic, 'message_definition': message._full_text,
                      'md5sum': message._md5sum, 'type': message._type, 'latching': '0'}
            written.write(topic, message, worlds.stamp(at), connection_header=header)
            connections[topic, publisher] = written._topic_connections[topic]
    params.write_text(yaml.safe_dump(world.params))
    (folder / 'finger.obj').write_text(worlds.FINGER_OBJ)
    (folder / 'arm.urdf').write_text(worlds.ROBOT)
    (folder / 'rod.obj').write_text(worlds.ROD_OBJ)
    (folder / 'calls.yaml').write_text(yaml.safe_dump(getattr(world, 'calls', [])))
    command = [sys.executable, str(HERE / 'live.py'), str(folder)] if live else [
        str(TOOLS / 'analyze_bag'), str(bag), '--params', str(params), '-o', str(out), '--report', str(folder / 'report'), '--quiet']
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    if ran.returncode not in (0, 3):
        return Verdict([], [], [], 0, collections.Counter(), ran.stderr.strip()[-400:])
    arguments = argparse.Namespace(steps=None, pairs=500)
    with rosbag.Bag(str(bag)) as came, rosbag.Bag(str(out)) as said:
        judged = audit.Judge(audit.World(came, yaml.safe_load(params.read_text()), None), audit.Claims(said), arguments)
    judged.run()
    statuses = collections.Counter('proved' if c['proved'] else 'not' for c in judged.said)
    role = roles(world)
    kinds = sorted({kind_of(row, role) for row in judged.refuted})
    return Verdict(judged.refuted, kinds, judged.not_covered, judged.held, statuses, '')


def rebuilt(seed, folder, keep):
    """The same world with only these of its faults: the others are drawn, too, so that the rest stays as it is."""
    class Some(worlds.World):
        def fault(self, kind):
            self.unless_left_out(super().fault, kind)

        def handed_over(self, r):
            self.unless_left_out(super().handed_over, r)

        def unless_left_out(self, change, given):
            before, count = copy.deepcopy(self.rows), len(self.faults)
            change(given)
            if set(self.faults[count:]) - set(keep):
                self.rows = before
    return Some(seed, folder)


def smaller(seed, folder, wanted):
    """The fewest faults of the world that still show a refutation of this kind, by leaving out one after the other."""
    left = worlds.World(seed, folder).faults
    for fault in list(left):
        keep = [f for f in left if f != fault]
        if wanted in judge(rebuilt(seed, folder, keep), folder).kinds:
            left = keep
    return left


def one(seed, folder, arguments):
    """The row of the log: what became of a world."""
    world = cases.case(seed, folder) if arguments.cases else worlds.World(seed, folder)
    verdict = judge(world, folder, arguments.live)
    row = {'seed': seed, 'kinds': verdict.kinds, 'held': verdict.held, 'faults': world.faults,
           'not_covered': [r['reason'] for r in verdict.not_covered], 'statuses': dict(verdict.statuses), 'problem': verdict.problem,
           'first': verdict.refuted[:1], 'tame': world.tame}
    if arguments.smaller and row['kinds'] and not arguments.cases:
        row['needed'] = smaller(seed, folder, verdict.kinds[0])
    return row


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('--from', dest='first', type=int, default=1)
    parser.add_argument('--worlds', type=int, default=300)
    parser.add_argument('--cases', action='store_true')
    parser.add_argument('--live', action='store_true')
    parser.add_argument('--log')
    parser.add_argument('--keep')
    parser.add_argument('--smaller', action='store_true')
    arguments = parser.parse_args()
    begin = arguments.first
    if arguments.log and os.path.exists(arguments.log) and not arguments.cases:  # goes on where it ended
        begin = max([begin] + [json.loads(line)['seed'] + 1 for line in open(arguments.log)])
    kinds, uncovered, claims = collections.defaultdict(list), collections.Counter(), collections.Counter()
    for seed in cases.CASES if arguments.cases else range(begin, arguments.first + arguments.worlds):
        with tempfile.TemporaryDirectory() as folder:
            folder = os.path.join(arguments.keep, str(seed)) if arguments.keep else folder
            os.makedirs(folder, exist_ok=True)
            row = one(seed, folder, arguments)
        if arguments.log:
            with open(arguments.log, 'a') as log:
                log.write(json.dumps(row) + '\n')
        claims.update(row['statuses'])
        uncovered.update(row['not_covered'])
        for kind in row['kinds']:
            kinds[kind].append(seed)
        if row['problem']:
            print(seed, row['problem'], flush=True)
    for kind, seeds in sorted(kinds.items(), key=lambda k: -len(k[1])):
        print(len(seeds), kind, seeds[:6])
    print(dict(claims), 'not covered', dict(uncovered.most_common(8)))


if __name__ == '__main__':
    main()
