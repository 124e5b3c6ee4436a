"""What analyze_fleet --compare says has changed, of databases and tables written by hand."""
import pathlib
import sys
import tempfile
import unittest

from checkout import CHECKOUT

sys.path.insert(0, str(CHECKOUT / 'fleet'))
import fleet_compare  # noqa: E402
import fleet_database  # noqa: E402

HEAD = 'step,stamp_ns,%s,toc_lower,toc_upper,certainty\n' % ','.join(fleet_compare.CONTACT)


def contact(stamp_ns, vertex, lower=0.5):
    return '1,%d,VF,cloth,cloth,%d,1,2,3,,,,,%s,0.6,certain\n' % (stamp_ns, vertex, lower)


class FleetCompareTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folders = [pathlib.Path(folder.name) / name for name in ('before', 'after')]

    def fill(self, folder, name, state='proved', first=None, patches=(), contacts=''):
        report = folder / 'recordings' / name / 'report'
        report.mkdir(parents=True)
        (report / 'contacts.csv').write_text(HEAD + contacts)
        with fleet_database.open_database(folder / 'fleet.sqlite') as database:
            if not database.execute('SELECT name FROM sqlite_master').fetchall():
                database.executescript(fleet_database.SCHEMA)
            database.execute('INSERT INTO recordings (name, state, first_new_contact_s, contacts_sha256) VALUES (?, ?, ?, ?)',
                             (name, state, first, contacts or 'none'))
            fleet_database.insert(database, 'patches', name, [
                {'patch': i, 'body_0': pair[0], 'body_1': pair[1], 'first_s': begin, 'last_s': end}
                for i, (pair, begin, end) in enumerate(patches)])

    def test_every_change_is_said(self):
        before, after = self.folders
        self.fill(before, 'gone')
        self.fill(after, 'new')
        self.fill(before, 'same', first=1, patches=[('ab', 1, 2)], contacts=contact(1, 7))
        self.fill(after, 'same', first=1, patches=[('ab', 1, 2)], contacts=contact(1, 7))
        self.fill(before, 'state')
        self.fill(after, 'state', 'not proved', first=0.25)
        # Of one pair the patch that overlaps the longest is the same one; the others are gone and new.
        self.fill(before, 'patches', patches=[('ab', 1, 2), ('ab', 5, 6), ('cd', 1, 2)])
        self.fill(after, 'patches', patches=[('ab', 0, 1.25), ('ab', 1.5, 3), ('ab', 8, 9), ('cd', 1, 2)])
        # Steps 1 and 6 are in the one table alone, step 2 in the other. In step 4 one is at another time, one gone, two new.
        self.fill(before, 'contacts', contacts=contact(1, 1) + contact(3, 1) + contact(4, 1) + contact(4, 2) + contact(6, 1))
        self.fill(after, 'contacts', contacts=contact(2, 1) + contact(3, 1) + contact(4, 1, 0.25) + contact(4, 3) + contact(4, 4))
        text, changed = fleet_compare.compare(before, after)
        self.assertTrue(changed)
        self.assertEqual(text, [
            'contacts: contacts: 3 new, 3 gone, 1 moved',
            'gone: is gone',
            'new: is new',
            'patches: new patch a – b from 0.0000 s to 1.2500 s',
            'patches: new patch a – b from 8.0000 s to 9.0000 s',
            'patches: gone patch a – b from 5.0000 s to 6.0000 s',
            'patches: moved patch a – b from 1.5000 s to 3.0000 s, was a – b from 1.0000 s to 2.0000 s',
            'state: not proved, was proved',
            'state: first new contact 0.250000 s, was none',
            '5 of 6 recordings changed'])


if __name__ == '__main__':
    unittest.main()
