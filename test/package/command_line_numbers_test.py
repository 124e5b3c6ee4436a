"""A number on a command line is a whole decimal one, or an error that names the option and the word."""
import unittest

from checkout import CHECKOUT, TOOLS, FolderTestCase, run

WHOLE = ('0x10', '010', '1.5', '1_0', '1e1', '3x', '')
DECIMAL = ('0x1p-3', '0,5', '1.0d-3', 'nan', 'inf', '1_0.5', '0.1-1', '1e999', '')
OPTIONS = {
    'check_step': (['a.obj', 'a.obj'], ['--threads', '--repeat'], []),
    'analyze_bag': (['a.obj', '--report', 'report'], ['--threads'], ['--look-ahead']),
    'replay_step': (['a.obj'], ['--threads'], []),
    'make_scene_bag': (['a.yaml', 'a.bag'], ['--frames', '--seed'], ['--rate']),
    'analyze_fleet': (['--out', 'out'], ['--threads', '--jobs'], []),
}


class CommandLineNumbersTest(FolderTestCase):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        (cls.folder / 'a.obj').write_text('v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n')

    def test_no_other_word_is_a_number(self):
        for name, (arguments, whole, decimal) in OPTIONS.items():
            path = TOOLS / name if (TOOLS / name).exists() else CHECKOUT / 'fleet' / name
            for options, words in ((whole, WHOLE), (decimal, DECIMAL)):
                for option in options:
                    for word in words:
                        self.refused(path, arguments, option, word)

    def refused(self, path, arguments, option, word):
        done = run(path, *arguments, option, word, cwd=self.folder)
        what = '%s %s %r: %s' % (path.name, option, word, done.stdout + done.stderr)
        self.assertEqual(done.returncode, 2 if path.name == 'replay_step' else 1, what)
        self.assertIn(option, done.stdout + done.stderr, what)
        self.assertIn(word, done.stdout + done.stderr, what)

    def test_whole_numbers_are_taken(self):
        done = run(TOOLS / 'check_step', 'a.obj', 'a.obj', '--threads', '+1', '--repeat', 2, cwd=self.folder)
        self.assertEqual(done.returncode, 0, done.stderr)


if __name__ == '__main__':
    unittest.main()
