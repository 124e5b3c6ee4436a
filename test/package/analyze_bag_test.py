"""analyze_bag as people use it: the same output for any number of threads, exit statuses, phases, the report at once."""
import csv
import copy
import io
import json
import unittest

from analyze_bag_support import OWN, AnalyzeBagTestCase
from bag_messages import by_topic, messages_of


def bytes_of(message):
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


class AnalyzeBagTest(AnalyzeBagTestCase):
    def test_any_number_of_threads(self):
        contents = []
        for threads in (1, 3):
            out = self.folder / ('threads_%d.bag' % threads)
            self.expect_same(self.analyze('threads_%d' % threads, self.bag, '--threads', threads, '-o', out))
            contents.append([(topic, bytes_of(message), at) for topic, message, at in messages_of(out)
                             if topic != OWN + 'stats'])  # these carry milliseconds
        self.assertEqual(contents[0], contents[1])

    def test_a_bag_in_which_no_frame_is_answered(self):
        status, _, said, steps = self.analyzed('short', self.write('short.bag', self.cloths[:1]))
        self.assertEqual((status, steps), (3, {'FIRST_FRAME': 1}))
        self.assertIn('no frame was answered', said)
        lost = self.bag_with('lost.bag')
        params = self.params('')
        params[1].write_text('fixed_frame: moon\n')
        status, _, said, steps = self.analyzed('lost', lost, *params)
        self.assertEqual((status, set(steps)), (3, {'NO_TRANSFORM'}))
        self.assertRegex(said, r'no frame was answered: (\d+) of \1 frames: NO_TRANSFORM: no transform .*moon.*\(\1\)\n')
        self.assertEqual((said + self.said).count('no transform'), 1, 'the reason is said once')
        self.assertIn('the bag has neither /tf nor /tf_static', said)

    def test_what_is_missing_or_misspelt_is_named_as_the_user_knows_it(self):
        alone = self.write('map_alone.bag', [('/octomap_binary', self.octomap(), self.messages[0][2])])
        self.assertRegex(self.refused(alone), r'no topic of a mesh type; the bag has /octomap_binary \(octomap_msgs/Octomap\).*'
                                              'doc/messages.md, "Messages of another type"')
        self.assertIn('no topic /clth; the bag has /cloth (', self.refused(self.bag, '--mesh', '/clth'))
        bodies = self.params('bodies: {cloth: {topic: /cloth}}\n')
        self.assertRegex(self.refused(self.bag, *bodies, '--mesh', '/clth'), '--mesh has no place beside the bodies of .*given.yaml')
        self.analyze('named', self.bag, *self.params('topic: /clth\n'), '--mesh', '/cloth')
        self.assertIn('--acuracy is no option; nearest is --accuracy', self.refused(self.bag, '--acuracy', 'exact'))

    def test_millimetres_are_named_in_the_headline(self):
        cloths = copy.deepcopy(self.cloths)
        for _, message, _ in cloths:
            for v in message.vertices:
                v.x, v.y, v.z = 1000 * v.x, 1000 * v.y, 1000 * v.z
        self.analyzed('large', self.write('large.bag', cloths))
        headline = json.loads((self.folder / 'large/report.json').read_text())['headline']
        self.assertRegex(headline, r'TELEPORT: .* m across: are its coordinates in millimetres\?')

    def test_a_doubt_stands_beside_the_proof(self):
        cloths = copy.deepcopy(self.cloths[:3])
        for _, message, _ in cloths:
            for v, first in zip(message.vertices, self.cloths[0][1].vertices):
                v.x, v.y, v.z = 1000 * first.x, 1000 * first.y, 1000 * first.z
        status, said, errors, _ = self.analyzed('at_rest', self.write('at_rest.bag', cloths))
        self.assertEqual(status, 0, errors)
        doubt = r"in doubt: body 'mesh': the mesh is [\d.]+ m across; coordinates are in metres, are these millimetres\?"
        self.assertRegex(said.splitlines()[0], 'all of it proved; ' + doubt)
        self.assertRegex(said.splitlines()[-1], '^' + doubt)
        self.assertEqual(len(json.loads((self.folder / 'at_rest/report.json').read_text())['proof']['doubts']), 1)

    def test_a_step_that_is_not_proved_says_why_in_its_row(self):
        mask = 'vertex_mask: [%s]' % ', '.join(map(str, range(len(self.cloths[0][1].vertices))))
        status, _, said, steps = self.analyzed('masked', self.bag, *self.params('bodies: {cloth: {topic: /cloth, %s}}\n' % mask))
        self.assertEqual((status, set(steps)), (3, {'FIRST_FRAME', 'OK'}), said)
        rows = list(csv.DictReader((self.folder / 'masked/steps.csv').read_text().splitlines()))
        self.assertEqual(rows[3]['reason'], "vertex_mask names every vertex of body 'cloth', so nothing of it was checked")
        plain = list(csv.DictReader((self.plain / 'steps.csv').read_text().splitlines()))
        self.assertEqual({row['reason'] for row in plain}, {''})

    def test_a_promise_that_nobody_looked_at_is_not_kept(self):
        octomap = ('/octomap_binary', self.octomap(), self.messages[0][2])
        for frames, said in ((2, '1 promise of .* s in the middle, 0 kept, 0 void, 1 not looked at'),
                             (3, '2 promises of .* s in the middle, 1 kept, 0 void, 1 not looked at')):
            bag = self.write('%d.bag' % frames, [octomap] + self.cloths[:frames])
            self.assertRegex(self.analyzed('promised', bag, *self.params('max_speed_m_s: 5\n'))[1], 'safe until: ' + said)

    def test_the_help_lists_the_exit_statuses(self):
        said = self.tool('analyze_bag', '--help').stdout
        for line in ('0', '1', '3'):
            self.assertRegex(said, r'(?m)^ *%s +\w' % line)

    def test_contacts_that_are_expected_in_the_phase_of_the_bag(self):
        """The cloth on its map: found as before, marked, and no alarm; in another phase it is one."""
        expected = 'expected_contacts: [{between: [mesh, octomap], phase: lay}, {between: [mesh, self], phase: fold}]\n'
        found = {}
        for phase in ('lay', 'fold'):
            out = self.folder / (phase + '.bag')
            self.analyze(phase, self.bag, *self.params(expected + 'phase: %s\n' % phase), '-o', out)
            marks, plain = (list(csv.DictReader((folder / 'contacts.csv').read_text().splitlines()))
                            for folder in (self.folder / phase, self.plain))
            partner = 'octomap' if phase == 'lay' else 'mesh'
            self.assertEqual([c['expected'] == '1' for c in marks], [c['body_1'] == partner for c in marks])
            self.assertEqual([{**c, 'expected': '0'} for c in marks], plain, 'nothing changes but the mark')
            states, firsts = (by_topic(out)[OWN + name] for name in ('state', 'first_contact'))
            self.assertTrue(all(len(s.expected) == 1 for s in states[1:]), 'said of each answer')
            self.assertEqual(sum(f.expected_contacts for f in firsts), sum(c['expected'] == '1' for c in marks))
            found[phase] = sum(f.contact for f in firsts), sum(s.touching == s.EXPECTED for s in states)
        self.assertGreater(found['fold'][0], found['lay'][0], 'steps with an alarm')
        self.assertGreater(found['lay'][1], found['fold'][1], 'steps in which all that touches is expected')
        self.assertIn("phase is 'lie', which expected_contacts does not name; known phases are 'fold', 'lay'",
                      self.refused(self.bag, *self.params(expected + 'phase: lie\n')))


if __name__ == '__main__':
    unittest.main()
