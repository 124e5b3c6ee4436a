"""doc/guarantees.md names what holds each promise: every test, file and target that it names must be there."""
import fnmatch
import re
import unittest

from checkout import CHECKOUT, code_under

PAGE = CHECKOUT / 'doc/guarantees.md'
GTEST = re.compile(r'\b(?:TYPED_)?TEST(?:_[FP])?\((\w+),\s*(\w+)\)')


def rows():
    """Of each row: the promise, the attack, the names in its last column, and that column."""
    for line in PAGE.read_text().splitlines():
        cells = [cell.strip() for cell in line.strip('|').split('|')] if line.startswith('|') else []
        if len(cells) == 4 and not set(cells[0]) <= set('-: ') and cells[0] != 'promise':
            yield cells[0], cells[1], re.findall(r'`([^`]+)`', cells[3]), cells[3]


class Tests:
    """What the test sources define."""

    def __init__(self):
        found = [m.groups() for p in code_under('test') for m in GTEST.finditer(p.read_text())]
        self.suites = {suite for suite, _ in found}
        self.cases = {case for _, case in found}
        self.full = {suite + '.' + case for suite, case in found}
        self.functions = {m for p in (CHECKOUT / 'test').rglob('*.py') for m in re.findall(r'def (test_\w+)', p.read_text())}
        self.fuzz_targets = {p.name[:-len('_fuzz.cpp')] for p in (CHECKOUT / 'test/fuzz').rglob('*_fuzz.cpp')}
        self.files = {p.name for p in code_under('test')}

    def knows(self, name):
        if '/' in name:
            return (CHECKOUT / name.split()[0].rstrip('*')).exists()
        if name.startswith('test_'):
            return bool(fnmatch.filter(self.functions, name))
        if name.endswith(('.cpp', '.h')):
            return name in self.files
        return any(name in known for known in (self.suites, self.cases, self.full, self.fuzz_targets))


class GuaranteesTest(unittest.TestCase):
    def test_every_name_is_there(self):
        tests = Tests()
        named = [(promise, name) for promise, _, names, _ in rows() for name in names]
        self.assertGreater(len(named), 40, 'the table was not read')
        missing = ['%s (%s)' % (name, promise) for promise, name in named if not tests.knows(name)]
        self.assertEqual(missing, [])

    def test_every_promise_has_a_test(self):
        self.assertEqual([promise for promise, _, _, test in rows() if not test], [])

    def test_every_promise_has_an_attack(self):
        self.assertEqual([promise for promise, attack, _, _ in rows() if len(attack) < 10], [])

    def test_a_name_that_is_not_there_is_seen(self):
        tests = Tests()
        for name in ('NoSuchSuite', 'Soak.NoSuchCase', 'test_no_such_*', 'test/no_such_test.cpp', 'no_such_target', 'expectCut'):
            self.assertFalse(tests.knows(name), name)
        for name in ('Soak', 'Soak.FlatMemoryAndTheSameBytesForTheSameStep', 'test_overload_*', 'mesh_step'):
            self.assertTrue(tests.knows(name), name)


if __name__ == '__main__':
    unittest.main()
