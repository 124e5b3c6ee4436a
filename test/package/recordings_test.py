"""Recordings that others made, read by config/recordings: each answer is held to what is known of it, and to judges that share nothing."""
import json
import multiprocessing
import os
import pathlib
import sys
import unittest

import rosbag

from checkout import CHECKOUT, TOOLS, FolderTestCase, run

DATA = pathlib.Path(os.environ.get('DEFORMABLE_CCD_DATA', CHECKOUT.parent / 'shared/data'))
CONFIGS = CHECKOUT / 'config/recordings'
SCRIPT = CHECKOUT / 'benchmark/recordings.py'
sys.path.insert(0, str(CHECKOUT / 'benchmark'))


@unittest.skipUnless((DATA / 'recordings').is_dir(), 'no %s: the recordings of others are not here' % (DATA / 'recordings'))
class RecordingsTest(FolderTestCase):
    def measured(self, *names, most=('--brute', '1', '--audited', '40')):
        """With --long the judge looks at all steps."""
        if os.environ.get('DEFORMABLE_CCD_LONG') and '--audited' in most:
            most = most[:most.index('--audited')]
        ran = run(sys.executable, SCRIPT, '--tools', TOOLS, '--data', DATA, '--out', self.folder, '--recordings', *names, *most)
        self.assertEqual(ran.returncode, 0, ran.stdout[-4000:] + ran.stderr[-4000:])
        rows = json.loads((self.folder / 'recordings.json').read_text())
        for row in rows:
            self.assertEqual((row['unlike'], row['brute_wrong'], row['refuted']), ([], [], []), row['recording'])
            self.assertLessEqual(sum(row['not_covered'].values()), 0.02 * row['claims'], row['not_covered'])
        return {row['recording']: row for row in rows}

    def test_each_folder_has_a_file_by_which_it_is_read(self):
        folders = {p.name for p in (DATA / 'recordings').iterdir() if p.is_dir()} | {'ur5e'}
        self.assertEqual({p.stem for p in CONFIGS.glob('*.yaml')}, folders)

    def test_measured_bodies(self):
        rows = self.measured('tshirt', 'rope_sim')
        self.assertEqual((rows['tshirt']['steps'], rows['tshirt']['proved']), (9, 9))
        self.assertEqual(rows['tshirt, by default']['proved'], 0)
        self.assertEqual((rows['rope_sim']['proved'], rows['rope_sim']['touching']), (1999, 0))
        self.wrong_is_seen()

    def wrong_is_seen(self):
        """What the brute force is worth: of a step that it agreed with, one contact is left out of the list."""
        import recordings  # pylint: disable=import-outside-toplevel  (it needs what the data's absence makes needless)
        shirt = recordings.Run('tshirt', self.folder / 'tshirt.bag', CONFIGS / 'tshirt.yaml', None, None)
        lie = self.folder / 'lie'
        lie.mkdir()
        with rosbag.Bag(str(self.folder / 'tshirt/claims.bag')) as bag, rosbag.Bag(str(lie / 'claims.bag'), 'w') as out:
            for topic, message, at in bag.read_messages():
                if topic.endswith('/contacts') and message.contacts:
                    message.contacts.pop()
                    message.total_contacts -= 1
                out.write(topic, message, at)
        with multiprocessing.Pool(1) as pool:
            step = pool.apply(recordings.some_steps, (shirt, lie, 2))[-1]
            self.assertRegex(' '.join(pool.apply(recordings.decide, ((shirt, lie, step),))[1]), 'are not listed')

    def test_a_captured_figure(self):
        row = self.measured('samba', 'maps', most=('--brute', '0', '--audited', '1', '--frames', '160'))['samba']
        self.assertEqual((row['steps'], row['proved']), (59, 59))
        self.assertGreater(row['claims'], 0)
        self.assertGreater(row['contacts'], 1000)
        self.assertLess({'recordings_said.png', 'recordings_blind.png'}, {p.name for p in self.folder.iterdir()}, 'the pictures of the page')

    def test_a_real_camera(self):
        row = self.measured('shirt_depth')['shirt_depth']
        self.assertEqual(row['proved'], row['steps'])
        self.assertGreater(row['touching'], 3)

    def test_real_frames_real_maps_and_a_real_arm(self):
        rows = self.measured('robot_tf', 'maps', 'ur5e', most=('--brute', '1', '--frames', '160', '--audited', '40'))
        self.assertEqual(set(rows), {'robot_tf', 'maps/fr_079', 'maps/geb079', 'ur5e'})
        for row in rows.values():
            self.assertEqual((row['steps'], row['proved']), (159, 159), row['recording'])
            self.assertGreater(row['touching'], 5, row['recording'])


if __name__ == '__main__':
    unittest.main()
