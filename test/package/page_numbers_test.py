"""Numbers that the pages promise are those of the code, and the tests that the pages call are there."""
import fnmatch
import re
import unittest

from checkout import CHECKOUT, code_under

PAGES = sorted(CHECKOUT.glob('*.md')) + sorted((CHECKOUT / 'doc').glob('*.md'))
MB = 1 << 20
VALUE = r'\b%s(?:\s*=\s*|\{)((?:\w+(?:::\w+)*\{\w+\}|[^;{},])+)[;},]'  # of a constant of C++


def text(path):
    """On one line: sentences of the pages go on in the next one."""
    return re.sub(r'\s+', ' ', (CHECKOUT / path).read_text())


def constant(path, name, pattern=VALUE):
    found = re.findall(pattern % name, text(path))
    assert len(found) == 1, '%s in %s: %s' % (name, path, found)
    expression = re.sub(r"(?<=\d)'(?=\d)", '', re.sub(r'[\w:]+\{(\w+)\}', r'\1', found[0]))
    assert re.fullmatch(r'[\d\s.<>*/+-]+', expression), '%s in %s is %r' % (name, path, expression)
    return eval(expression)  # pylint: disable=eval-used


def tolerance(name):
    return constant('include/dccd/tolerances.h', name)


# Of each page: what it says, with the number in brackets, and what the code has.
NUMBERS = {
    'doc/interface.md': [
        (r'(\d+) steps wait at most', lambda: constant('include/dccd/stream.h', 'max_waiting')),
        (r'box around them, ([\d,]+) at most', lambda: constant('src/output/scene_markers.cpp', 'MAX_VOXELS_SHOWN')),
        (r'stops looking at (\d+) contacts a MB', lambda: MB / 4 / tolerance('BYTES_PER_CONTACT')),
        (r'and at (\d+) for each vertex, edge', lambda: tolerance('CONTACTS_PER_FEATURE')),
        (r'\((\d+) if a distance is held', lambda: tolerance('CONTACTS_PER_FEATURE_WITH_DISTANCE')),
        (r'A leaf takes (\d+) bytes', lambda: tolerance('MAP_LEAF_SORTING') + 2 * tolerance('MAP_LEAF_IN_SURFACE')),
        (r'not all alike takes (\d+)\.', lambda: tolerance('MAP_NODE_BUILDING') + 2 * tolerance('MAP_NODE')),
        (r'After (\d+) s the answer is', lambda: constant('src/node/monitor_services.cpp', 'SERVICE_TIMEOUT_S')),
        (r'Files of version (\d+) are written and read', lambda: constant('src/record/step_recording.h', 'RECORDING_VERSION')),
        (r'`DCCD_API_VERSION` \((\d+)\)', lambda: constant('include/dccd/export.h', 'DCCD_API_VERSION', r'define %s (\d+)')),
        (r'for `hold_s` \(([\d.]+)\)', lambda: constant('examples/stop_the_arm.py', 'hold_s', r'\b%s=([\d.]+)')),
    ],
    'doc/guarantees.md': [
        (r'([\d,]+) names of frames', lambda: constant('src/input/transforms.h', 'MAX_FRAMES')),
        (r'([\d,]+) transforms in 10 s', lambda: constant('src/input/transforms.h', 'MAX_KEPT')),
        (r'own queue of (\d+) messages', lambda: constant('src/input/watched_queue.h', 'SUBSCRIBER_QUEUE')),
        (r'DAE at most ([\d,]+) tags', lambda: constant('src/input/dae_file.cpp', 'MOST_MARKS')),
        (r'told to stop; ([\d.]+) s after', lambda: constant('src/node/collision_monitor.cpp', 'END_AFTER') / 1000),
    ],
}


def calls():
    """Of every call of scripts/test on a page that names what is to be run: that, and its filter or nothing."""
    # The table of what was tried has it without the command, in a column of its own.
    pattern = re.compile(r"(?:scripts/test(?: --[a-z]\w*)* |\| `)--only ([^\s`]+)(?: --filter '([^']+)')?")
    return [call for page in PAGES for call in pattern.findall(text(page))]


def gtests():
    return ['%s.%s' % case for path in code_under('test') + code_under('paper/test')
            for case in re.findall(r'\bTEST(?:_[FP])?\((\w+),\s*(\w+)\)', path.read_text())]


class PageNumbersTest(unittest.TestCase):
    def test_each_number_is_that_of_the_code(self):
        for page, numbers in NUMBERS.items():
            for said, code in numbers:
                with self.subTest(page + ': ' + said):
                    found = re.findall(said, text(page).replace(' # ', ' '))
                    self.assertEqual(len(found), 1, found)
                    self.assertEqual(float(found[0].replace(',', '')), code())


class TestsOfThePagesTest(unittest.TestCase):
    def test_what_they_run_is_there(self):
        runners = [path.name for pattern in ('*_test.py', '*.test') for path in (CHECKOUT / 'test').rglob(pattern)]
        runners = ['test/attacks/', *runners, *re.findall(r'\b\w+_tests\b', text('cmake/tests.cmake')),
                   *(path.stem for path in (CHECKOUT / 'test/fuzz').glob('*_fuzz.cpp'))]
        self.assertGreater(len(calls()), 10, 'the search found too little to mean anything')
        self.assertEqual([only for only, _ in calls() if not any(only in runner for runner in runners)], [])

    def test_what_they_filter_is_there(self):
        tests = gtests()
        patterns = {pattern for _, filters in calls() for pattern in filters.split(':') if pattern}
        self.assertGreater(len(patterns), 5, 'the search found too little to mean anything')
        self.assertEqual([p for p in sorted(patterns) if not fnmatch.filter(tests, p)], [])


if __name__ == '__main__':
    unittest.main()
