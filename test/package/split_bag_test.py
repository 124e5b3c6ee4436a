"""analyze_bag on pieces of a recording, as rosbag makes them with `record --split`: /tf_static and the map are in the first one alone."""
import copy
import json
import unittest

import genpy
from tf2_msgs.msg import TFMessage

from analyze_bag_support import AnalyzeBagTestCase
from bag_messages import by_topic, messages_of, transform, write_bag
from checkout import TOOLS, run

TABLES = ('contacts.csv', 'steps.csv', 'patches.csv', 'events.csv')


class SplitBagTest(AnalyzeBagTestCase):
    """The scene's cloth in a camera's frame, whole and in three pieces."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        start = cls.messages[0][2]
        seen = [('/tf_static', TFMessage([transform('camera')]), start)]
        for topic, message, at in cls.messages:
            message = copy.deepcopy(message)
            if topic == '/cloth':
                message.header.frame_id = 'camera'
            seen.append((topic, message, at))
        cls.whole = write_bag(cls.folder / 'whole.bag', seen)
        cls.pieces = cls.cut(seen, 'run_2026-01-31-12-00-0%d_%d.bag', 3)
        cls.given = cls.folder / 'given.yaml'
        cls.given.write_text('fixed_frame: world\ntopic: /cloth\n')

    @classmethod
    def cut(cls, messages, name, count):
        size = -(-len(messages) // count)
        return [write_bag(cls.folder / (name % ((k,) * name.count('%d'))), messages[size * k:size * (k + 1)]) for k in range(count)]

    def ran(self, *words):
        return run(TOOLS / 'analyze_bag', *words, '--report', self.folder / 'ran', '--quiet', '--params', self.given)

    def test_pieces_are_one_run_in_whatever_order(self):
        self.analyze('whole', self.whole, '--params', self.given)
        one, two, three = self.pieces
        for order in ((one, two, three), (three, one, two)):
            self.assertEqual(self.ran(*order).returncode, 0)
            for table in TABLES:
                expected = (self.folder / 'whole' / table).read_bytes()
                self.assertEqual((self.folder / 'ran' / table).read_bytes(), expected, table)
        self.assertIn('run_2026-01-31-12-00-01_1.bag', (self.folder / 'ran/report.html').read_text())

    def test_a_piece_without_the_first_is_told(self):
        ran = self.ran(self.pieces[1])
        self.assertEqual(ran.returncode, 3)
        self.assertIn('note: this is a piece of a split recording (run_2026-01-31-12-00-01_1.bag): give the first one, too', ran.stdout)
        self.assertIn('no transform', ran.stderr)
        self.assertNotIn('piece', self.ran(self.pieces[0]).stdout)
        self.assertNotIn('piece', self.ran(*self.pieces).stdout)
        ran = self.ran(self.pieces[0], self.pieces[2])
        self.assertIn('between run_2026-01-31-12-00-00_0.bag and run_2026-01-31-12-00-02_2.bag pieces of the split recording are missing',
                      ran.stdout)

    def test_a_number_alone_makes_no_piece(self):
        """But one that goes on where its neighbour ends, or one that lacks what a first piece has."""
        cloths = [(topic, message, at) for topic, message, at in self.cloths]
        first, second = self.cut(cloths, 'named_%d.bag', 2)
        self.assertIn('this is a piece of a split recording (named_1.bag)', self.ran(second).stdout)
        first.unlink()
        self.assertIn('this may be a piece of a split recording (named_1.bag)', self.ran(second).stdout, 'it has no map')
        with_map = self.write('with_1.bag', [('/octomap_binary', self.octomap(), cloths[0][2])] + cloths)
        self.assertNotIn('piece', self.ran(with_map).stdout)

    def test_static_transforms_of_another_bag(self):
        out = self.folder / 'out.bag'
        words = ['--tf-static', self.pieces[0], '-o', out]
        ran = self.ran(self.pieces[1], *words)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        lent = by_topic(out)['/tf_static']
        self.assertEqual([[t.child_frame_id for t in message.transforms] for message in lent], [['camera']])
        self.assertEqual(self.ran(out).returncode, 0, 'the bag of results has them')
        without = self.write('without.bag', self.cloths)
        self.assertIn('without.bag: has no /tf_static', self.ran(self.pieces[1], '--tf-static', without).stderr)
        start = self.messages[0][2]
        two = self.write('two.bag', [('/tf_static', TFMessage([transform('camera', z=z)]), start) for z in (0, 1)])
        self.assertIn("two.bag: its /tf_static has 'camera' at two places", self.ran(self.pieces[1], '--tf-static', two).stderr)
        # What a bag says itself holds, also where it was recorded late.
        high = self.write('high.bag', [('/tf_static', TFMessage([transform('camera', z=50)]), start)])
        (_, static, _), *rest = messages_of(self.whole)
        late = self.write('late.bag', rest[:10] + [('/tf_static', static, rest[10][2])] + rest[10:])
        said = [self.ran(late, *words) for words in ((), ('--tf-static', high))]
        self.assertEqual([one.returncode for one in said], [0, 0], said[1].stderr)
        self.assertIn('First contact', said[0].stdout)
        self.assertEqual(said[0].stdout, said[1].stdout)

    def test_what_is_no_run_is_refused_and_a_pause_is_told(self):
        self.assertRegex(self.ran(self.whole, self.pieces[2]).stderr, 'whole.bag and .*_2.bag have /cloth at the same time')
        self.assertIn('whole.bag: is given twice', self.ran(self.whole, self.whole).stderr)
        hour = genpy.Duration(3600)
        later = []
        for topic, message, at in self.cloths:
            message = copy.deepcopy(message)
            message.header.stamp += hour
            later.append((topic, message, at + hour))
        ran = self.ran(self.whole, self.write('later.bag', later))
        self.assertRegex(ran.stdout, r'note: nothing was recorded for 3599 s between .*whole.bag and .*later.bag')

    def groups(self, *bags):
        ran = run(TOOLS / 'analyze_bag', '--list-pieces', *bags)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        return json.loads(ran.stdout)

    def test_which_bags_are_pieces_of_one_run(self):
        def bag(name, begin_s, end_s):
            return write_bag(self.folder / name, [('/cloth', self.cloths[0][1], genpy.Time.from_sec(t)) for t in (begin_s, end_s)])
        pieces = [bag('a_2026-01-31-12-00-%02d_%d.bag' % (9 * k, k), 9 * k + 1, 9 * k + 9.9) for k in range(3)]
        others = [bag('a_2026-01-31-13-00-00_0.bag', 3601, 3610), bag('a_2026-01-31-13-00-09_1.bag', 3610, 3611)]
        named = [bag('named_%d.bag' % k, 10 * k + 1, 10 * k + 10.9) for k in range(8, 11)]
        runs = [bag('run_%d.bag' % k, 100 * k + 1, 100 * k + 10) for k in range(3)]  # each by itself: they do not go on
        at_once = [bag('sim_%d.bag' % k, 1, 10) for k in range(2)]
        hole = [bag('hole_0.bag', 1, 2), bag('hole_2.bag', 2.1, 3)]
        expected = [pieces, others, named, *([one] for one in runs + at_once + hole)]
        given = pieces + others + named + runs + at_once + hole
        self.assertEqual(self.groups(*given), [[str(one) for one in group] for group in expected])
        self.assertEqual(sorted(self.groups(*reversed(given))), sorted([str(one) for one in group] for group in expected))
        # Two of a name, one after the other: the second one's second piece is near enough to the first one's end.
        short = [bag('s_2026-01-31-12-00-%02d_%d.bag' % (t, k), t, t + 3.9) for t, k in ((10, 0), (14, 0), (18, 1))]
        self.assertEqual(self.groups(*short), [[str(short[0])], [str(one) for one in short[1:]]])
        silent = [bag('silent_%d.bag' % k, 10 * k + 1, 10 * k + 10.9) for k in range(3)]
        write_bag(silent[2], [])
        self.assertEqual(self.groups(*silent), [[str(one) for one in silent[:2]], [str(silent[2])]], 'nothing says whose it is')
        self.assertEqual(self.ran(self.whole, silent[2]).returncode, 0, 'it changes nothing')
        broken = self.folder / 'broken_1.bag'
        broken.write_bytes(pieces[0].read_bytes()[:100])
        self.assertEqual(self.groups(broken), [[str(broken)]])


if __name__ == '__main__':
    unittest.main()
