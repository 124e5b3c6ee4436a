"""test/mutants: small errors in every room, each found by the tests that it names (`--long`)."""
import os
import pathlib
import re
import subprocess
import sys
import unittest

from checkout import CHECKOUT

sys.path.append(str(CHECKOUT / 'test/mutants'))
import run_mutants  # noqa: E402


class Mutants(unittest.TestCase):
    def test_each_old_text_is_there_just_once(self):
        self.assertEqual([(m.name, m.file) for m in run_mutants.ALL if (CHECKOUT / m.file).read_text().count(m.old) != 1], [])

    def test_there_are_enough_of_all_rooms(self):
        names = [mutant.name for mutant in run_mutants.ALL]
        self.assertGreaterEqual(len(names), 80)
        self.assertEqual(len(set(names)), len(names), 'two have one name')
        rooms = {str(folder.relative_to(CHECKOUT)) for folder in (CHECKOUT / 'src').iterdir() if folder.is_dir()}
        files = [pathlib.PurePath(mutant.file) for mutant in run_mutants.ALL]
        hit = {str(pathlib.PurePath(*file.parts[:2])) if file.parts[0] == 'src' else file.parts[0] for file in files}
        self.assertEqual((rooms | {'include', 'python', 'fleet'}) - hit, set(), 'no mutant of these')

    def test_the_tests_that_they_name_are_there(self):
        text = '\n'.join(path.read_text() for path in (CHECKOUT / 'test').rglob('*_test.cpp'))
        suites = set(re.findall(r'^(?:TEST|TEST_F|TEST_P)\((\w+),', text, re.M))
        for mutant in run_mutants.ALL:
            if '.py' in mutant.tests:
                self.assertTrue((CHECKOUT / mutant.tests.split()[0]).exists(), mutant.name)
            else:
                self.assertEqual({name.split('.')[0].split('/')[-1] for name in mutant.tests.split(':')} - suites, set(), mutant.name)

    def test_each_question_of_a_claim_has_a_witness_that_can_be_left_out(self):
        header = (CHECKOUT / 'include/dccd/outcome.h').read_text()
        questions = set(re.findall(r'^  ROW\((\w+), (?:BODY|WHOLE), (?:STEP|CELL), ', header, re.M))
        self.assertGreater(len(questions), 10)
        witnesses = run_mutants.witnesses()
        answered = {name for mutant in witnesses for name in re.findall(r'Question::(\w+)', mutant.old)}
        self.assertEqual(questions - answered, set(), 'nobody answers these')
        for mutant in witnesses:
            text = (CHECKOUT / mutant.file).read_text()
            self.assertEqual(text.count(mutant.old), 1, mutant.name)
            self.assertLess(len(mutant.new), len(mutant.old), mutant.name)

    @unittest.skipUnless(os.environ.get('DEFORMABLE_CCD_LONG'), 'builds a copy of the checkout, then each mutant: --long')
    def test_each_is_killed(self):
        for which in ([], ['--witnesses']):
            done = subprocess.run([sys.executable, str(CHECKOUT / 'test/mutants/run_mutants.py'), *which],
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            self.assertEqual(done.returncode, 0, done.stdout)


if __name__ == '__main__':
    unittest.main()
