"""audit_bag, the judge that shares nothing: truths hold, and a claim that lies about any of them is refuted."""
import ast
import copy
import json
import os
import pathlib
import re
import sys
import unittest
from fractions import Fraction

import genpy

from analyze_bag_support import OWN, AnalyzeBagTestCase
from bag_messages import messages_of
from checkout import CHECKOUT, TOOLS, run

AUDIT = CHECKOUT / 'audit'
FILES = [AUDIT / 'audit_bag', AUDIT / 'came.py', AUDIT / 'placed.py', AUDIT / 'touches.py']
QUERIES = pathlib.Path(os.environ.get('DEFORMABLE_CCD_DATA', CHECKOUT.parent / 'shared/data')) / 'ccd_queries'
sys.path.insert(0, str(AUDIT))
import touches  # noqa: E402  (it lies beside the tool)


class AuditTest(AnalyzeBagTestCase):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.config = cls.folder / 'given.yaml'
        cls.config.write_text('fixed_frame: world\noctomap_topic: /octomap_binary\nbodies: {cloth: {topic: /cloth}}\n')
        cls.out = cls.folder / 'out.bag'
        cls.analyze('said', cls.bag, '--params', cls.config, '-o', cls.out)
        cls.said = messages_of(cls.out)

    def audit(self, *words):
        ran = run(TOOLS / 'audit_bag', *words, '--params', self.config, '--json', self.folder / 'verdict.json')
        verdict = json.loads((self.folder / 'verdict.json').read_text()) if ran.returncode in (0, 1, 3) else {}
        return ran.returncode, verdict, ran.stdout + ran.stderr

    def lies(self, change, came=None):
        """The verdict on what was said, each message as `change(topic, message)` leaves it (None: left out)."""
        told = [(topic, change(topic, copy.deepcopy(message)), at) for topic, message, at in self.said if topic.startswith(OWN)]
        claims = self.write('claims.bag', [row for row in told if row[1] is not None])
        status, verdict, said = self.audit(came or self.bag, claims)
        self.assertEqual(status, 1, said)
        return verdict['refuted']

    def test_what_is_true_holds(self):
        status, verdict, said = self.audit(self.out)
        self.assertEqual((status, verdict['refuted'], verdict['not_covered']), (0, [], []), said)
        self.assertGreater(verdict['held'], 35)
        self.assertEqual(self.audit(self.bag)[0], 0, 'it asks analyze_bag where nothing was said')

    def test_a_contact_that_is_hidden(self):
        hidden = []

        def hide(topic, message):
            if topic == OWN + 'contacts' and message.contacts:
                hidden.append(message.header.stamp.to_sec())
                message.contacts, message.total_contacts = [], 0
            return message
        refuted = self.lies(hide)
        self.assertGreater(len(hidden), 3)
        self.assertEqual([round(r['stamp'], 6) for r in refuted], [round(s, 6) for s in hidden])

    def test_clear_where_something_touches(self):
        def clear(topic, message):
            if topic == OWN + 'state':
                message.touching, message.clear = 0, message.proved
            return message
        self.assertRegex(self.lies(clear)[0]['reason'], 'of cloth and .* of octomap meet at 0')

    def test_a_frame_that_never_came_and_one_that_is_passed_over(self):
        def later(topic, message):
            if topic == OWN + 'state' and message.proved:
                message.holds_until += genpy.Duration(0, 1000)
            return message
        self.assertRegex(self.lies(later)[0]['reason'], 'no frame came for')
        starts = [m.start for t, m, _ in self.said if t == OWN + 'state' and m.proved]

        def longer(topic, message):
            if topic == OWN + 'state' and message.proved and message.start in starts[1:]:
                message.start = starts[starts.index(message.start) - 1]
            return message
        self.assertRegex(self.lies(longer)[0]['reason'], 'a frame of cloth came for .* passes over it')

    def test_a_map_that_was_passed_over(self):
        map_, begin = self.octomap(), self.cloths[0][2]
        newer = copy.deepcopy(map_)
        newer.header.stamp += genpy.Duration(0, 1)
        came = self.write('maps.bag', [('/octomap_binary', m, begin) for m in (map_, newer)] + self.cloths)
        self.assertRegex(self.lies(lambda topic, message: message, came)[0]['reason'], 'a newer map came')

    def test_what_is_not_whole(self):
        cloths = copy.deepcopy(self.cloths)
        cloths[5][1].vertices[7].x = float('nan')
        begin = self.cloths[0][2]
        came = self.write('hole.bag', [('/octomap_binary', self.octomap(), begin)] + cloths)
        self.assertRegex(self.lies(lambda topic, message: message, came)[0]['reason'], 'cannot be checked')

    def test_what_it_has_no_rules_for_is_not_covered(self):
        self.config.write_text(self.config.read_text() + 'own_voxels_m: 0.02\n')
        try:
            status, verdict, said = self.audit(self.out)
        finally:
            self.config.write_text(self.config.read_text().replace('own_voxels_m: 0.02\n', ''))
        self.assertEqual((status, verdict['refuted']), (3, []), said)
        self.assertIn('own_voxels_m', verdict['not_covered'][0]['reason'])

    def test_what_cannot_be_read_is_no_verdict(self):
        status, _, said = self.audit(self.folder / 'none.bag')
        self.assertEqual(status, 2, said)
        self.assertRegex(said, r'^audit_bag: .*none\.bag')

    def test_it_shares_nothing_and_is_read_in_an_hour(self):
        allowed = {'argparse', 'bisect', 'dataclasses', 'fractions', 'json', 'os', 'random', 're', 'struct', 'subprocess', 'sys',
                   'tempfile', 'time', 'numpy', 'rosbag', 'yaml', 'came', 'placed', 'touches'}
        for path in FILES:
            for node in ast.walk(ast.parse(path.read_text())):
                names = [a.name for a in node.names] if isinstance(node, ast.Import) else \
                    [node.module] if isinstance(node, ast.ImportFrom) else []
                self.assertLessEqual(set(names), allowed, path)
        self.assertLessEqual(sum(p.read_text().count('\n') for p in FILES), 1600)


class TouchesTest(unittest.TestCase):
    def test_hard_queries_with_exact_truth(self):
        if not QUERIES.is_dir():
            self.skipTest('no ' + str(QUERIES))
        asked, met = 0, 0
        for kind, folder in (('vf', 'vertex-face'), ('ee', 'edge-edge')):
            for path in sorted(QUERIES.glob('*/%s/*.csv' % folder)):
                rows = [line.split(',') for line in path.read_text().splitlines()[:8 * 80]]
                for i in range(0, len(rows), 8):
                    points = [[float(Fraction(int(r[2 * k]), int(r[2 * k + 1]))) for k in range(3)] for r in rows[i:i + 8]]
                    found = touches.first_touch(kind, points[:4], points[4:]) is not None
                    self.assertEqual(found, rows[i][6] == '1', '%s, line %d' % (path, i))
                    asked, met = asked + 1, met + found
        self.assertGreater(min(met, asked - met), 100)

    def test_what_floating_point_rejects_does_not_meet(self):
        import numpy
        random = numpy.random.default_rng(7)
        rejected = 0
        for kind, one in (('vf', 1), ('ee', 2)):
            points = numpy.round(random.normal(size=(2, 400, 4, 3)), 1)
            apart = touches.apart(points[0][:, :one], points[1][:, :one], points[0][:, one:], points[1][:, one:])
            for i in numpy.nonzero(apart)[0]:
                self.assertIsNone(touches.first_touch(kind, points[0][i], points[1][i]))
                rejected += 1
        self.assertGreater(rejected, 100)


if __name__ == '__main__':
    unittest.main()
