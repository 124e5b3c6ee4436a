"""The layering rules of doc/development.md, held against the includes of every source file."""
import re
import unittest

from checkout import CHECKOUT, code_under, tracked_files

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.M)

# Folder of src/ -> the folders of src/ that it may include. The public headers (dccd/...) are open to all but simd,
# which takes the tolerances alone; so are those of base, which are not installed. A folder may always include itself.
CORE = {
    'base': set(),
    'simd': set(),
    'culling': {'simd'},
    'elementary': {'simd'},
    'obstacle': {'simd'},
    'proof': set(),
    'step': {'culling', 'elementary', 'obstacle', 'proof', 'simd'},
    'stream': {'step', 'obstacle'},
    'record': {'stream', 'step', 'culling', 'obstacle', 'simd'},
}
MAY_INCLUDE = {
    **CORE,
    'report': {'stream'},
    'octomap': {'obstacle', 'simd'},
    'input': {'obstacle'},
    'config': {'input'},
    'robot': {'input', 'config'},
    'output': {'input', 'config', 'report'},
    'node': {'input', 'config', 'robot', 'output', 'octomap', 'record', 'report'},
    'apps': None,  # everything
}
ROS_ROOMS = ('input', 'config', 'output', 'node', 'apps')
# What tests and benchmarks hold the libraries against.
OUTSIDE = ('scenes/', 'paper/', 'oracle/', 'support/', 'test/', 'unit/')
ROS_OR_PCL = re.compile(r'^(ros/|ros\.h|tf2|pcl|rosbag|roslib|nodelet|pluginlib|topic_tools|dynamic_reconfigure|'
                        r'diagnostic_updater|xmlrpcpp|message_filters|[a-z_]+_msgs/|std_srvs/)')
OCTOMAP = re.compile(r'^octomap/(?!.*\.hh)')
INTRINSICS = re.compile(r'\b_mm(?:256|512)?_[a-z]|\b__m(?:128|256|512)|immintrin\.h|arm_neon\.h|hwy/highway\.h|'
                        r'hwy/foreach_target\.h|HWY_NAMESPACE')
# The rooms that compute with rounding, and what a tolerance looks like there: a small power, or a factor of nearly 1.
ROUNDED = ('culling', 'simd', 'elementary', 'obstacle', 'step')
SMALL_NUMBER = re.compile(r"\b0x1p-(?!64\b)\d+|\b\d+e-\d+\b|\b(?:1\.0\d+|0\.99\d*)\b|epsilon\(\)")
# A fraction with a name of its own. What is called WORTH_... says which work is worth its time, and decides no answer.
FRACTION = re.compile(r'\bconstexpr (?:double|float) (?!WORTH_)(?:\w+ = [^,;]*, )*?\w+ = \d*\.0*[1-9]\d*f?\b')
TEXT = re.compile(r'"(?:[^"\\]|\\.)*"')


def includes(path):
    return INCLUDE.findall(path.read_text(errors='replace'))


def name(path):
    return str(path.relative_to(CHECKOUT))


class LayeringTest(unittest.TestCase):
    def test_every_folder_of_src_has_a_rule(self):
        folders = {p.name for p in (CHECKOUT / 'src').iterdir() if p.is_dir() and code_under('src/' + p.name)}
        self.assertLessEqual(folders, set(MAY_INCLUDE))
        self.assertGreaterEqual(len(folders), 8, 'the scan found too little to mean anything')

    def test_own_includes_point_right_to_left(self):
        wrong = []
        for folder, allowed in MAY_INCLUDE.items():
            if allowed is None:
                continue
            for path in code_under('src/' + folder):
                for bracket, target in includes(path):
                    first = target.split('/')[0]
                    if bracket == '"' and '/' in target and first in MAY_INCLUDE and first != folder and \
                            first not in allowed | {'base'}:
                        wrong.append('%s includes %s' % (name(path), target))
        self.assertEqual(wrong, [])

    def test_simd_includes_nothing_of_the_package(self):
        wrong = ['%s includes %s' % (name(path), target) for path in code_under('src/simd')
                 for _, target in includes(path) if target.startswith('dccd/') and target not in ('dccd/tolerances.h', 'dccd/export.h')]
        self.assertEqual(wrong, [])

    def test_public_headers_include_no_room_of_src(self):
        wrong = ['%s includes %s' % (name(path), target) for path in code_under('include') for bracket, target in includes(path)
                 if bracket == '"' and not target.startswith('dccd/')]
        self.assertEqual(wrong, [])

    def test_libraries_and_tools_need_neither_tests_nor_paper(self):
        wrong = ['%s includes %s' % (name(path), target) for path in code_under('src') for _, target in includes(path)
                 if target.startswith(OUTSIDE)]
        self.assertEqual(wrong, [])

    def test_core_handles_no_signals_and_writes_no_page(self):
        words = re.compile(r'#include <(csignal|signal\.h|nlohmann|CLI)|<html')
        wrong = [name(p) for folder in CORE for p in code_under('src/' + folder) if words.search(p.read_text(errors='replace'))]
        self.assertEqual(wrong, [])

    def test_every_tolerance_is_in_its_header(self):
        wrong = []
        for folder in ROUNDED:
            for path in code_under('src/' + folder):
                for number, line in enumerate(path.read_text().splitlines(), 1):
                    code = re.sub(r'"[^"]*"', '""', line.split('//')[0])
                    if SMALL_NUMBER.search(code):
                        wrong.append('%s:%d: %s' % (name(path), number, line.strip()))
        self.assertEqual(wrong, [])
        self.assertTrue(SMALL_NUMBER.search('x * (1 + 0x1p-50)') and SMALL_NUMBER.search('1e-12') and SMALL_NUMBER.search('0.999 * x'))

    def test_fractions_with_a_name_are_tolerances(self):
        """They are shares of a step and the like, of which answers depend."""
        files = [p for folder in CORE for p in code_under('src/' + folder)] + code_under('include')
        wrong = ['%s:%d: %s' % (name(path), number, line.strip()) for path in files if path.name != 'tolerances.h'
                 for number, line in enumerate(path.read_text().splitlines(), 1) if FRACTION.search(line.split('//')[0])]
        self.assertEqual(wrong, [])
        for line in ('constexpr double SHARE = 0.4;', '  static constexpr float A = B, C = .25f;', 'constexpr double N = 2.50;'):
            self.assertTrue(FRACTION.search(line), line)
        for line in ('constexpr double SPLIT = 134217729.0;', 'constexpr double WORTH_IT = 0.75;', 'constexpr double A = tolerance::B;'):
            self.assertFalse(FRACTION.search(line), line)

    def test_no_text_repeats_a_tolerance(self):
        """Where a text names one, it is written from the constant."""
        files = [p for folder in {*CORE, 'octomap'} for p in code_under('src/' + folder)]
        wrong = ['%s: %s' % (name(path), text) for path in files for line in path.read_text().splitlines()
                 for text in TEXT.findall(line.split('//')[0]) if SMALL_NUMBER.search(text)]
        self.assertEqual(wrong, [])

    def test_production_classes_do_not_end_in_test(self):
        found = [m for folder in ('src', 'include') for p in code_under(folder)
                 for m in re.findall(r'^(?:class|struct) (?:DCCD_EXPORT )?(\w*Test)\b', p.read_text(), re.M)]
        self.assertEqual(found, [])

    def test_core_is_free_of_ros_pcl_and_octomap(self):
        files = code_under('include/dccd') + [p for folder in CORE for p in code_under('src/' + folder)]
        wrong = ['%s includes %s' % (name(path), target) for path in files for bracket, target in includes(path)
                 if ROS_OR_PCL.match(target) or (bracket == '<' and OCTOMAP.match(target))]
        self.assertEqual(wrong, [])
        self.assertGreater(len(files), 30)

    def test_ros_and_pcl_only_in_the_rooms_of_the_node(self):
        files = [p for p in code_under('src') if p.relative_to(CHECKOUT).parts[1] not in ROS_ROOMS]
        wrong = ['%s includes %s' % (name(path), target) for path in files for _, target in includes(path)
                 if ROS_OR_PCL.match(target)]
        self.assertEqual(wrong, [])

    def test_the_python_module_takes_the_interface_and_recordings(self):
        files = code_under('python')
        self.assertGreater(len(files), 5)
        wrong = ['%s includes %s' % (name(path), target) for path in files for _, target in includes(path)
                 if ROS_OR_PCL.match(target) or target.split('/')[0] in set(MAY_INCLUDE) - {'base', 'record'}]
        self.assertEqual(wrong, [])

    def test_pcl_stays_as_loud_as_the_process_wants_it(self):
        wrong = [name(path) for folder in ('src', 'include') for path in code_under(folder)
                 if 'pcl/console' in path.read_text() or 'setVerbosityLevel' in path.read_text()]
        self.assertEqual(wrong, [])

    def test_liboctomap_only_under_octomap(self):
        files = [p for p in code_under('src') + code_under('include')
                 if p.relative_to(CHECKOUT).parts[:2] != ('src', 'octomap')]
        wrong = ['%s includes %s' % (name(path), target) for path in files for bracket, target in includes(path)
                 if bracket == '<' and OCTOMAP.match(target)]
        self.assertEqual(wrong, [])

    def test_bullet_only_under_physics(self):
        files = [p for p in code_under('src') + code_under('scenes') if p.parent.name != 'physics']
        wrong = [name(p) for p in files if any(re.match(r'(bt[A-Z]|Bullet)', t) for _, t in includes(p))]
        self.assertEqual(wrong, [])

    def test_intrinsics_only_under_simd(self):
        files = [p for p in code_under('src') + code_under('include')
                 if p.relative_to(CHECKOUT).parts[:2] != ('src', 'simd')]
        self.assertEqual([name(p) for p in files if INTRINSICS.search(p.read_text(errors='replace'))], [])


class HygieneTest(unittest.TestCase):
    """What must not be in any file of the checkout."""

    def find(self, pattern, exclude=()):
        found = []
        for path in tracked_files():
            if name(path).startswith('test/package/') or name(path) in exclude:
                continue
            for number, line in enumerate(path.read_text(errors='replace').splitlines(), 1):
                if re.search(pattern, line):
                    found.append('%s:%d: %s' % (name(path), number, line.strip()[:100]))
        return found

    def test_no_paths_of_one_machine(self):
        self.assertEqual(self.find(r'(?<![\w.])/(work|farm|root|home/[a-z]+)/'), [])

    def test_no_flag_that_breaks_certified_signs(self):
        # Prose may name the flags in order to forbid them; what builds must not use them.
        found = [line for line in self.find(r'-march=native|-Ofast|-ffast-math')
                 if re.match(r'(CMakeLists|cmake/|scripts/|benchmark/.*CMake|dependencies/)', line)]
        self.assertEqual(found, [])

    def test_no_unfinished_marks(self):
        self.assertEqual(self.find(r'\b(TO' r'DO|FIX' r'ME|HA' r'CK)\b'), [])

    def test_scripts_can_be_run(self):
        for script in ['scripts/setup', 'scripts/build', 'scripts/test', 'scripts/demo', '.ci/run']:
            self.assertTrue((CHECKOUT / script).stat().st_mode & 0o100, script + ' has no run bit')


if __name__ == '__main__':
    unittest.main()
