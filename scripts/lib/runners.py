"""What runs tests and counts them: a callable for each kind, which takes the folder for logs and returns a Result and the log.

A runner that starts fewer tests than it has, crashes or runs out of time adds failures.
"""
import dataclasses
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

from bare_root import CannotMake, bare_root

CHECKOUT = pathlib.Path(__file__).resolve().parents[2]
# No runner is near this; it ends one that hangs (a rostest waits for its node), so that the rest still count.
TIME_LIMIT_S = 6 * 3600 if os.environ.get('DEFORMABLE_CCD_LONG') or os.environ.get('DEFORMABLE_CCD_SANITIZED') else 1500


@dataclasses.dataclass
class Result:
    passed: int = 0
    failed: int = 0
    skipped: int = 0
    notes: list = dataclasses.field(default_factory=list)

    def fail(self, note, count=1):
        self.failed += count
        self.notes.append(note)


def run(command, log, environment=None, folder=None):
    """Runs a command with its output in the file `log`; returns the exit status, or None when out of time."""
    with open(log, 'w') as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
                                   env={**os.environ, **(environment or {})}, cwd=folder, start_new_session=True)
        try:
            return process.wait(timeout=TIME_LIMIT_S)
        except subprocess.TimeoutExpired:
            # The runner's own children too, which its session holds.
            os.killpg(process.pid, 15)
            try:
                process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, 9)
                process.wait()
            return None


def count_junit(path, result):
    """Adds the test cases of a JUnit file (gtest's, rostest's); returns how many it holds."""
    cases = list(ElementTree.parse(path).getroot().iter('testcase'))
    for case in cases:
        name = '%s.%s' % (case.get('classname', ''), case.get('name', ''))
        bad = case.find('failure') if case.find('failure') is not None else case.find('error')
        skipped = case.find('skipped')
        if bad is not None:
            result.fail('failed: ' + name)
        elif skipped is not None or case.get('status') == 'notrun' or case.get('result') == 'skipped':
            result.skipped += 1
            reason = (skipped.get('message') or '').strip().splitlines() if skipped is not None else []
            result.notes.append('skipped: %s%s' % (name, ' (%s)' % reason[-1].strip() if reason else ''))
        else:
            result.passed += 1
    return len(cases)


class GtestRunner:
    """One shard of a gtest binary."""

    def __init__(self, binary, shard, shards, pattern, emulator=''):
        self.binary, self.shard, self.shards, self.pattern = binary, shard, shards, pattern
        self.command = shlex.split(emulator) + [str(binary)]
        self.name = binary.name if shards == 1 else '%s (%d of %d)' % (binary.name, shard + 1, shards)

    def expected(self, flags, environment):
        listing = subprocess.run(self.command + ['--gtest_list_tests'] + flags, capture_output=True, text=True,
                                 env={**os.environ, **environment})
        return sum(line.startswith('  ') for line in listing.stdout.splitlines())

    def __call__(self, logs):
        result = Result()
        stem = logs / re.sub(r'\W+', '_', self.name)
        xml, log = stem.with_suffix('.xml'), stem.with_suffix('.log')
        if not self.binary.exists():
            result.fail('%s was not built' % self.binary.name)
            return result, None
        flags = ['--gtest_filter=' + self.pattern] if self.pattern else []
        environment = {'GTEST_TOTAL_SHARDS': str(self.shards), 'GTEST_SHARD_INDEX': str(self.shard)}
        status = run(self.command + ['--gtest_output=xml:%s' % xml] + flags, log, environment)
        if xml.exists():
            count_junit(xml, result)
            # A failure outside a test case (an environment's tear-down, a sanitizer's report at exit) has no entry.
            if status != 0 and not result.failed:
                result.fail('%s exited with status %s' % (self.name, status))
            return result, log
        # Crashed or out of time: count what it printed; all that did not finish failed. gtest lists tests regardless of
        # shards, so the count of this shard is the one it announced when it started.
        output = log.read_text(errors='replace')
        result.passed = len(re.findall(r'^\[       OK \]', output, re.M))
        result.skipped = len(re.findall(r'^\[  SKIPPED \] .*\(\d+ ms\)', output, re.M))
        announced = re.search(r'Running (\d+) tests? from', output)
        total = int(announced.group(1)) if announced else max(1, self.expected(flags, environment))
        why = 'ran out of time' if status is None else 'died with status %d' % status
        result.fail('%s %s' % (self.name, why), max(1, total - result.passed - result.skipped))
        return result, log


class RostestRunner:
    def __init__(self, path):
        self.path = path
        self.name = path.name

    def __call__(self, logs):
        result = Result()
        folder = logs / ('rostest_' + self.path.stem)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        log = logs / (self.path.name + '.log')
        # A master, log folder and port of its own: nothing is written outside the checkout.
        environment = {'ROS_HOME': str(folder / 'ros_home'), 'ROS_LOG_DIR': str(folder / 'log'),
                       'ROS_HOSTNAME': 'localhost'}
        status = run(['rostest', '--pkgdir=%s' % CHECKOUT, '--package=deformable_ccd', '--results-filename',
                      self.path.stem + '.xml', '--results-base-dir', str(folder), str(self.path)], log, environment)
        # The runner's summary file lists the same tests once more.
        files = [f for f in folder.rglob('*.xml') if not f.name.startswith('rostest-')]
        ran = 0
        for file in files:
            try:
                ran += count_junit(file, result)
            except ElementTree.ParseError:
                result.fail('%s wrote a broken result file' % self.name)
        expected = len(re.findall(r'<test\s', re.sub(r'<!--.*?-->', '', self.path.read_text(), flags=re.S)))
        if len(files) < expected:
            result.fail('%s: %d of %d tests gave no result' % (self.name, expected - len(files), expected),
                        expected - len(files))
        elif status != 0 and not result.failed:
            result.fail('%s exited with status %s' % (self.name, status))
        if not ran and not result.failed:
            result.fail('%s ran no test' % self.name)
        return result, log


class PythonRunner:
    def __init__(self, path):
        self.path = path
        self.name = str(path.relative_to(CHECKOUT))

    def __call__(self, logs):
        result = Result()
        log = logs / (self.path.stem + '.py.log')
        # From its own folder, so that unittest takes the file's name for a module and finds the helpers beside it.
        status = run([sys.executable, '-m', 'unittest', '-v', self.path.name], log, {'PYTHONDONTWRITEBYTECODE': '1'},
                     self.path.parent)
        count_unittest(log.read_text(errors='replace'), status, self.name, result)
        return result, log


# The commands of the pages take minutes: they run once, in the bare root, or here where none can be made.
PAGE_COMMANDS = PythonRunner(CHECKOUT / 'test/package/commands_test.py')


def count_unittest(output, status, name, result):
    """Adds what `python3 -m unittest -v` printed."""
    ran = re.search(r'^Ran (\d+) tests? in', output, re.M)
    if not ran:
        result.fail('%s did not run' % name)
        return
    counts = {key: int(number) for key, number in re.findall(r'(\w+)=(\d+)', output[ran.end():])}
    failed = counts.get('failures', 0) + counts.get('errors', 0) + counts.get('successes', 0)
    skipped = counts.get('skipped', 0)
    passed = max(0, int(ran.group(1)) - failed - skipped)
    result.failed += failed
    result.skipped += skipped
    result.passed += passed
    result.notes += ['failed: ' + line for line in re.findall(r'^(?:FAIL|ERROR): (.*)', output, re.M)]
    result.notes += ['skipped: %s' % line for line in re.findall(r"^(.*skipped '.*)", output, re.M)]
    if status != 0 and not failed:
        result.fail('%s exited with status %s' % (name, status))
    elif passed + failed + skipped == 0:
        result.fail('%s holds no test' % name)


class PagesRunner:
    """Counts what scripts/lib/newcomer.sh left in build/pages.log: scripts/demo, without which it ends, and the pages'
    commands."""
    name = "scripts/demo and the pages' commands"

    def __init__(self, log):
        self.log = log

    def __call__(self, logs):
        result = Result(passed=1)
        text = self.log.read_text(errors='replace') if self.log.exists() else ''
        count_unittest(text, 0 if re.search(r'^OK\b', text, re.M) else 1, PAGE_COMMANDS.name, result)
        return result, self.log


class BareRootRunner:
    """What a newcomer types, where nothing is installed: what is installed here would hide what a newcomer lacks."""
    name = 'bare root'

    def __call__(self, logs):
        log, pages = logs / 'bare_root.log', logs / 'bare_root_pages.log'
        try:
            with open(log, 'w') as output, bare_root('bookworm') as root:
                status = root.run('scripts/lib/newcomer.sh', stdout=output, stderr=subprocess.STDOUT).returncode
                if status == 0:
                    shutil.copyfile(root.path('build/pages.log'), pages)  # it goes with the root
        except CannotMake as why:
            result, log = PAGE_COMMANDS(logs)  # they are run once, here or there
            result.skipped += 1
            result.notes.append('skipped: %s' % why)
            return result, log
        if status != 0:
            result = Result()
            result.fail('scripts/demo ended with status %d in a bare root' % status)
            return result, log
        result, pages = PagesRunner(pages)(logs)
        result.notes += re.findall(r'^scripts/demo took .*', log.read_text(errors='replace'), re.M)
        return result, pages


class FuzzRunner:
    """A libFuzzer target: a decoder in rounds, until one brings no new coverage, and for a least number of runs; the core's
    (whose numbers come from the long property tests, PairDifferential and StepProperty) and replays for one round."""
    ROUND_S = int(os.environ.get('DEFORMABLE_CCD_FUZZ_SECONDS') or 600)
    CORE = ('pair_fuzz', 'mesh_step_fuzz', 'replay_fuzz')
    DECODER_RUNS = 10**6
    MAX_ROUNDS = 18
    # Most of a decoder's time under AddressSanitizer would go into the call stacks of its allocations.
    ENVIRONMENT = {'ASAN_OPTIONS': 'malloc_context_size=4:quarantine_size_mb=32'}

    def __init__(self, binary):
        self.binary = binary
        self.name = 'fuzz ' + binary.name

    def __call__(self, logs):
        result = Result()
        log = logs / (self.binary.name + '.log')
        if not self.binary.exists():
            result.fail('%s was not built' % self.binary.name)
            return result, None
        target = self.binary.name[:-len('_fuzz')]
        # Inputs found before are kept beside the build; findings lie there, too, to become seeds.
        work, findings = (self.binary.parent / folder / target for folder in ('work', 'findings'))
        for folder in (work, findings):
            folder.mkdir(parents=True, exist_ok=True)
        # A short try of a few seconds is one round, and says so.
        one_round = self.ROUND_S < 600 or self.binary.name in self.CORE
        least = 0 if one_round else self.DECODER_RUNS
        corpus, marks = CHECKOUT / 'test/fuzz/corpus' / target, CHECKOUT / 'test/fuzz/dictionaries' / (target + '.dict')
        options = []
        if marks.exists():
            keys = set(re.findall(r'\w+(?=:)', ''.join(seed.read_text() for seed in corpus.iterdir())))
            dictionary = work.parent / marks.name
            dictionary.write_text(marks.read_text() + ''.join('"%s: "\n' % key for key in sorted(keys)))
            options = ['-dict=%s' % dictionary]
        runs = most = coverage = 0
        saturated = False
        for _ in range(1 if one_round else self.MAX_ROUNDS):
            status = run([str(self.binary), *options, '-max_total_time=%d' % self.ROUND_S, '-rss_limit_mb=4096',
                          '-timeout=30', '-print_final_stats=1', '-artifact_prefix=%s/' % findings, str(work),
                          str(corpus)], log, self.ENVIRONMENT)
            output = log.read_text(errors='replace')
            done = re.search(r'number_of_executed_units: (\d+)', output)
            covered = re.findall(r' cov: (\d+)', output)
            if status != 0 or not done or not covered:
                result.fail('%s ended with status %s; the input is in %s' % (self.name, status, findings))
                return result, log
            runs += int(done.group(1))
            most, coverage = max(most, coverage), int(covered[-1])
            saturated = coverage <= most  # less: edges that only the order of inputs within one process reaches
            if runs >= least and saturated:
                break
        result.notes.append('%d runs, coverage %d, no finding%s' % (runs, coverage, ' (one round of %d s)' % self.ROUND_S
                                                                    if one_round else ''))
        if runs < least:
            result.fail('%s reached %d of %d runs' % (self.name, runs, least))
        elif not one_round and not saturated:
            result.fail('%s: the last %d s still brought coverage, %d -> %d' % (self.name, self.ROUND_S, most, coverage))
        else:
            result.passed = 1
        return result, log


class LaunchCheckRunner:
    def __init__(self, path):
        self.path = path
        self.name = 'roslaunch-check ' + str(path.relative_to(CHECKOUT))

    def __call__(self, logs):
        result = Result()
        log = logs / (re.sub(r'\W+', '_', self.name) + '.log')
        candidates = [pathlib.Path(prefix) / 'share/roslaunch/scripts/roslaunch-check'
                      for prefix in os.environ.get('CMAKE_PREFIX_PATH', '').split(':') + ['/usr'] if prefix]
        check = next((c for c in candidates if c.exists()), None)
        if check is None:
            result.fail('roslaunch-check was not found')
            return result, None
        status = run([sys.executable, str(check), '-o', str(log.with_suffix('.xml')), str(self.path)], log,
                     {'ROS_HOME': str(logs / 'ros_home')})
        if status == 0:
            result.passed = 1
        else:
            result.fail('failed: ' + self.name)
        return result, log
