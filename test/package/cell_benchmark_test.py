"""The judge of `scripts/benchmark cell`: runs that are made up, so that what it says of them can be worked out by hand."""
import importlib.util
import sys
import unittest

import yaml

from checkout import CHECKOUT, TOOLS, FolderTestCase, run

HAS_NUMPY = importlib.util.find_spec('numpy') is not None
if HAS_NUMPY:
    sys.path.append(str(CHECKOUT / 'benchmark'))
    from cell import CELLS, SETTINGS, Contact, Run, Step, blind_percent, derived_page, judge, occupied_voxels, required, table_line

RESOLUTION_M = 0.02


def run_of(*contacts, clear_from=0):
    """Ten steps of a tenth of a second. Contacts: (time, x, patch), that close with 0.2 m/s; all of their patches are alarms. Patches from
    100 on are another body's."""
    steps = []
    for i in range(10):
        found = [Contact(t, (x, 0, 0), patch, 0.2, int(patch >= 100)) for t, x, patch in contacts if i <= 10 * t < i + 1]
        steps.append(Step(0.1 * i, 0.1 * (i + 1), not found and i >= clear_from, found))
    return Run(steps, {patch for _, _, patch in contacts}, [], 100)


@unittest.skipUnless(HAS_NUMPY, 'numpy, which comes with what scripts/setup --benchmark installs, is not there')
class JudgeTest(FolderTestCase):
    TRUTH = (0.35, 0.0, 1), (0.45, 0.0, 1), (0.85, 1.0, 2)

    def judged(self, *contacts, **more):
        return judge(run_of(*self.TRUTH), run_of(*contacts, **more), set(), RESOLUTION_M)

    def expect(self, row, **expected):
        self.assertEqual({name: row[name] for name in expected}, expected, row)

    def test_the_truth_is_right(self):
        row = self.judged(*self.TRUTH)
        self.expect(row, clear=7, clear_of=7, true=2, false=0, false_before=0, missed=0, true_alarms=2, in_time=2, first_ms=0,
                    first_voxels=0)

    def test_what_comes_early_at_another_place_is_false(self):
        row = self.judged((0.05, 5.0, 7), *self.TRUTH)
        self.expect(row, clear=6, clear_of=7, true=2, false=1, false_before=1, missed=0, in_time=2)
        self.assertAlmostEqual(row['first_ms'], -300)
        self.assertAlmostEqual(row['first_voxels'], -3, msg='0.2 m/s for 0.3 s, in voxels of 2 cm')

    def test_a_true_alarm_is_found_within_two_voxels(self):
        self.expect(self.judged((0.35, 0.039, 1), (0.85, 1.041, 2)), true=1, false=1, false_before=0, missed=1)

    def test_another_body_at_the_same_place_is_another_alarm(self):
        self.expect(self.judged((0.35, 0.0, 100), (0.85, 1.0, 2)), true=1, false=1, missed=1)

    def test_the_same_place_at_another_time_is_neither_true_nor_found(self):
        """A voxel is a tenth of a second."""
        self.expect(self.judged((0.15, 0.0, 1), (0.95, 1.0, 2)), true=1, false=1, missed=1, in_time=1)
        # A patch that begins earlier and still touches there is found, but not in time.
        self.expect(self.judged((0.15, 0.0, 1), (0.25, 0.0, 1), (0.35, 0.0, 1), (0.85, 1.0, 2)), true=2, false=0, missed=0, in_time=1)

    def test_where_the_truth_touches_already_it_is_in_time_to_go_on(self):
        """A second patch of the truth begins where a first one touches; in the run that one goes on."""
        row = judge(run_of((0.35, 0.0, 1), (0.45, 0.0, 1), (0.55, 0.0, 2)), run_of((0.35, 0.0, 1), (0.45, 0.0, 1), (0.55, 0.0, 1)),
                    set(), RESOLUTION_M)
        self.expect(row, true=1, false=0, missed=0, true_alarms=2, in_time=2)

    def test_what_is_required_is_said_of_the_settings_that_it_is_required_of(self):
        row = {'scene': 's', 'noise_m': 0.003, 'lag_s': 0.1, 'rate_hz': 5.0, 'own': 'with', 'clear': 19, 'clear_of': 20, 'false_before': 0,
               'missed': 0, 'true_alarms': 6, 'in_time': 5}
        rows = [row, {**row, 'lag_s': 0.3}, {**row, 'own': 'without'}, {**row, 'noise_m': 0.01}, {**row, 'rate_hz': 10.0},
                {**row, 'lag_s': 0.0, 'clear': 18, 'false_before': 2}]
        self.assertEqual(required(rows).splitlines()[2:], ['| s | 0.1 | yes | yes | yes | no, 5 of 6 |',
                                                            '| s | 0 | no, 18 of 20 | no, 2 | yes | no, 5 of 6 |'])

    def test_what_is_no_alarm_finds_nothing(self):
        run = run_of(*self.TRUTH)
        row = judge(run, Run(run.steps, set(), [], 100), set(), RESOLUTION_M)
        self.expect(row, true=0, false=0, missed=2, in_time=0, clear=7)

    def test_clear_is_asked_for_where_the_truth_is_clear(self):
        self.expect(self.judged(*self.TRUTH, clear_from=2), clear=5, clear_of=7)

    def test_without_a_contact_there_is_no_first_one(self):
        row = self.judged()
        self.expect(row, clear=7, true=0, false=0, missed=2)
        self.assertNotIn('first_ms', row)
        self.assertIn('| 0 | 0 | 0 | 2 of 2 | 0 % | – | – | – |',
                      table_line({'scene': 's', 'noise_m': 0.003, 'lag_s': 0, 'rate_hz': 5, 'own': 'with', **row}))

    def test_own_voxels_that_the_truth_has_are_blind(self):
        ring = {'center_m': [1, 0, 0], 'axis': [0, 0, 1], 'radius_m': 0.1, 'tube_radius_m': 0.03}
        voxels = occupied_voxels([{'box': {'min_m': [0, 0, 0], 'max_m': [0.04, 0.02, 0.02]}}, {'ring': ring}], RESOLUTION_M)
        self.assertLessEqual({(0, 0, 0), (1, 0, 0), (55, 0, 0)}, voxels)
        self.assertTrue(voxels.isdisjoint({(2, 0, 0), (-1, 0, 0), (50, 0, 0)}))
        own = [(0.01, 0.01, 0.01), (0.03, 0.01, 0.01), (0.05, 0.01, 0.01), (1.01, 0.01, 0.01), (1.11, 0.01, 0.01)]
        self.assertEqual(blind_percent(Run([], set(), own, 100), voxels, RESOLUTION_M), 60)
        self.assertIsNone(blind_percent(Run([], set(), [], 100), voxels, RESOLUTION_M))

    def test_every_scene_can_be_recorded_with_its_camera(self):
        for scene in CELLS:
            page, monitor = derived_page(scene, SETTINGS[0])
            page['camera'].update(width=8, height=6)
            self.assertEqual((page['monitor'], monitor['octomap_topic']), (monitor, page['obstacle']['topic']))
            path = self.folder / (scene + '.yaml')
            path.write_text(yaml.safe_dump(page))
            recorded = run(TOOLS / 'make_scene_bag', path, path.with_suffix('.bag'), '--frames', 2, '--quiet')
            self.assertEqual(recorded.returncode, 0, recorded.stderr)


if __name__ == '__main__':
    unittest.main()
