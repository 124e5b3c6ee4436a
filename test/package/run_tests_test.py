"""The runner that adds the tests up: a test that did not start, crashed or failed must never read as passed."""
import contextlib
import os
import pathlib
import shutil
import stat
import subprocess
import sys
import tempfile
import textwrap
import threading
import time
import unittest
import unittest.mock

from checkout import CHECKOUT
import run_tests
import runners


class RunTestsTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)

    def gtest(self, body):
        binary = self.path / 'suite_tests'
        binary.write_text('#!/bin/sh\nfor a in "$@"; do case $a in --gtest_output=xml:*) xml=${a#*xml:};; esac; done\n' +
                          textwrap.dedent(body))
        binary.chmod(binary.stat().st_mode | stat.S_IXUSR)
        result, _ = runners.GtestRunner(binary, 0, 1, '')(self.path)
        return result.passed, result.failed, result.skipped

    def test_counts_what_gtest_reports(self):
        self.assertEqual(self.gtest('''
            cat >"$xml" <<END
            <testsuites><testsuite name="A"><testcase name="a" status="run" result="completed"/>
            <testcase name="b" status="run"><failure message="x"/></testcase>
            <testcase name="c" status="run" result="skipped"><skipped message="why"/></testcase>
            </testsuite></testsuites>
            END
            exit 1'''), (1, 1, 1))

    def test_what_a_crash_left_undone_failed(self):
        self.assertEqual(self.gtest('''
            echo "[==========] Running 5 tests from 1 test suite."
            echo "[       OK ] A.a (0 ms)"
            echo "[       OK ] A.b (0 ms)"
            kill -SEGV $$'''), (2, 3, 0))

    def test_a_binary_that_says_nothing_failed(self):
        self.assertEqual(self.gtest('exit 0'), (0, 1, 0))

    def test_a_bad_exit_after_good_tests_failed(self):
        self.assertEqual(self.gtest('''
            echo '<testsuites><testcase name="a" status="run"/></testsuites>' >"$xml"
            exit 66'''), (1, 1, 0))

    def test_a_binary_that_was_not_built_failed(self):
        result, _ = runners.GtestRunner(self.path / 'not_there', 0, 1, '')(self.path)
        self.assertEqual((result.passed, result.failed), (0, 1))

    def test_a_filter_that_nothing_matches_failed(self):
        (self.path / 'gtest_suites.txt').write_text('suite_tests')
        (self.path / 'gtest').mkdir()
        binary = self.path / 'gtest/suite_tests'
        binary.write_text('#!/bin/sh\nfor a in "$@"; do case $a in --gtest_output=xml:*) '
                          'echo "<testsuites/>" >"${a#*xml:}";; esac; done\n')
        binary.chmod(0o755)
        ran = subprocess.run([sys.executable, str(CHECKOUT / 'scripts/lib/run_tests.py'), '--build', str(self.path),
                              '--filter', 'NoSuchTest.*'], capture_output=True, text=True, check=False,
                             env={k: v for k, v in os.environ.items() if k != 'DEFORMABLE_CCD_SANITIZER_REPORTS'})
        self.assertEqual((ran.returncode, ran.stdout.splitlines()[-1]), (1, '0 passed, 1 failed, 0 skipped'))

    def test_each_report_of_a_sanitizer_failed(self):
        result = runners.Result()
        run_tests.sanitizer_reports(self.path, result)
        self.assertEqual(result.failed, 0)
        (self.path / 'report.node.17').write_text('WARNING: ThreadSanitizer: data race\n')
        (self.path / 'report.node.18').write_text('ERROR: LeakSanitizer: detected memory leaks\n')
        run_tests.sanitizer_reports(self.path, result)
        self.assertEqual(result.failed, 2)
        self.assertIn('data race', result.notes[0])

    def test_python_tests_are_counted(self):
        test = CHECKOUT / 'build' / 'counted_test.py'
        test.parent.mkdir(exist_ok=True)
        test.write_text(textwrap.dedent('''
            import unittest
            class T(unittest.TestCase):
                def test_good(self): pass
                def test_bad(self): self.fail()
                def test_skipped(self): self.skipTest('why')
            '''))
        self.addCleanup(test.unlink)
        result, _ = runners.PythonRunner(test)(self.path)
        self.assertEqual((result.passed, result.failed, result.skipped), (1, 1, 1))

    def test_a_python_file_that_cannot_be_imported_failed(self):
        test = CHECKOUT / 'build' / 'broken_test.py'
        test.parent.mkdir(exist_ok=True)
        test.write_text('import there_is_no_such_module\n')
        self.addCleanup(test.unlink)
        result, _ = runners.PythonRunner(test)(self.path)
        self.assertGreater(result.failed, 0)
        self.assertEqual(result.passed, 0)

    def test_live_tests_run_one_at_a_time_beside_a_thread_a_core(self):
        meeting, ran, now, most = threading.Barrier(2), [], [], []

        def work(runner):
            ran.append(runner)
            if runner == 'live':
                now.append(runner)
                most.append(len(now))
                time.sleep(0.02)
                now.pop()
            elif runner == 'one of two':
                meeting.wait(20)
        with unittest.mock.patch.object(os, 'cpu_count', return_value=2):
            run_tests.run_all(work, ['busy', 'one of two', 'one of two'], ['live'] * 3)
        self.assertEqual((sorted(ran), most), (['busy', 'live', 'live', 'live', 'one of two', 'one of two'], [1, 1, 1]))

    def test_the_commands_of_the_pages_run_here_where_there_is_no_bare_root(self):
        (self.path / 'gtest_suites.txt').write_text('')
        arguments = unittest.mock.Mock(build=self.path, filter='', emulator='', fuzzers=None, pages=None, only='')
        environment = {k: v for k, v in os.environ.items() if k not in ('DEFORMABLE_CCD_IN_BARE_ROOT', 'DEFORMABLE_CCD_SANITIZED')}
        name = runners.PAGE_COMMANDS.name
        with unittest.mock.patch.dict(os.environ, environment, clear=True):
            busy, _, alone = run_tests.find_runners(arguments)
            self.assertNotIn(name, [r.name for r in busy])
            with unittest.mock.patch.object(runners, 'bare_root', side_effect=runners.CannotMake('no root')), \
                    unittest.mock.patch.object(runners, 'PAGE_COMMANDS', return_value=(runners.Result(), None)) as commands:
                result, _ = alone[0](self.path)
                commands.assert_called_once()
            self.assertEqual((result.failed, result.skipped), (0, 1))
            self.assertIn(name, [r.name for r in run_tests.find_runners(unittest.mock.Mock(
                build=self.path, filter='', emulator='', fuzzers=None, pages=None, only='commands'))[0]])
        with unittest.mock.patch.dict(os.environ, {**environment, 'DEFORMABLE_CCD_SANITIZED': 'thread'}, clear=True):
            busy, _, alone = run_tests.find_runners(arguments)
            self.assertEqual(([r.name for r in busy].count(name), alone), (1, []))

    def test_commands_that_ran_before_are_counted_once(self):
        (self.path / 'gtest_suites.txt').write_text('')
        log = self.path / 'pages.log'
        arguments = unittest.mock.Mock(build=self.path, filter='', emulator='', fuzzers=None, pages=log, only='')
        with unittest.mock.patch.dict(os.environ, {'DEFORMABLE_CCD_IN_BARE_ROOT': '1'}):
            busy, _, alone = run_tests.find_runners(arguments)
        names = [runner.name for runner in busy]
        self.assertEqual((names.count(runners.PAGE_COMMANDS.name), names.count(runners.PagesRunner.name), alone), (0, 1, []))

        def counted(text):
            log.write_text(text)
            result, _ = runners.PagesRunner(log)(self.path)
            return result.passed, result.failed, result.skipped
        self.assertEqual(counted('Ran 6 tests in 1.0s\n\nOK (skipped=1)\n'), (6, 0, 1))
        self.assertEqual(counted('FAIL: test_x\nRan 6 tests in 1.0s\n\nFAILED (failures=1)\n'), (6, 1, 0))
        self.assertEqual(counted('Ran 6 tests in 1.0s\n'), (7, 1, 0))  # it ended in between
        self.assertEqual(counted('Traceback'), (1, 1, 0))

    def newcomer(self, demo, verdict):
        """A checkout with the real newcomer.sh, whose demo and tests of the pages are these; its path."""
        checkout = self.path / 'checkout'
        for folder in ('scripts/lib', 'test/package'):
            (checkout / folder).mkdir(parents=True, exist_ok=True)
        for name in ('common.sh', 'newcomer.sh'):
            shutil.copy(CHECKOUT / 'scripts/lib' / name, checkout / 'scripts/lib')
        for script, words in (('demo', 'mkdir -p build; echo the demo; ' + demo), ('build', 'mkdir build/tools')):
            (checkout / 'scripts' / script).write_text('#!/bin/sh\n%s\n' % words)
            (checkout / 'scripts' / script).chmod(0o755)
        (checkout / 'test/package/commands_test.py').write_text(textwrap.dedent('''
            import os, unittest
            class T(unittest.TestCase):
                def test_demo_and_build_were_before(self): assert os.path.isdir('../../build/tools')
                def test_verdict(self): %s
            ''') % verdict)
        return checkout

    def bare(self, demo, verdict):
        """What the runner counts where the bare root holds such a checkout, which is gone afterwards."""
        checkout = self.newcomer(demo, verdict)

        @contextlib.contextmanager
        def bare_root(_release):
            root = unittest.mock.Mock(path=lambda name: checkout / name, run=lambda command, **more: subprocess.run(
                command, shell=True, cwd=checkout, check=False, **more))
            yield root
            shutil.rmtree(checkout)
        with unittest.mock.patch.object(runners, 'bare_root', bare_root), \
                unittest.mock.patch.dict(os.environ, {'DEFORMABLE_CCD_WORKSPACE': str(checkout / 'build')}):
            result, log = runners.BareRootRunner()(self.path)
        return result, log.read_text()

    def test_the_bare_root_counts_the_demo_and_the_commands(self):
        result, log = self.bare('true', 'pass')
        self.assertEqual((result.passed, result.failed, result.skipped), (3, 0, 0))
        self.assertRegex(result.notes[-1], r'^scripts/demo took \d+ s, downloads included$')
        self.assertIn('Ran 2 tests', log)

    def test_a_command_that_fails_in_the_bare_root_failed(self):
        result, log = self.bare('true', 'self.fail("no such command")')
        self.assertEqual((result.passed, result.failed, result.skipped), (2, 1, 0))
        self.assertIn('no such command', log)

    def test_without_the_demo_no_command_runs_in_the_bare_root(self):
        result, log = self.bare('echo it broke; exit 3', 'pass')
        self.assertEqual((result.passed, result.failed, result.skipped), (0, 1, 0))
        self.assertEqual(result.notes, ['scripts/demo ended with status 3 in a bare root'])
        self.assertIn('it broke', log)
        self.assertNotIn('Ran ', log)

    def fuzz(self, coverages, runs):
        """The result of a decoder's fuzzer whose rounds reach these coverages, the last one again and again."""
        (self.path / 'coverages').write_text('\n'.join(str(c) for c in coverages) + '\n')
        binary = self.path / 'thing_fuzz'
        binary.write_text(textwrap.dedent('''\
            #!/bin/sh
            cd "$(dirname "$0")"; echo round >>rounds
            echo "#9 DONE cov: $(sed -n "$(wc -l <rounds)p; \\$p" coverages | head -n 1) ft: 1"
            echo "stat::number_of_executed_units: %d"''') % runs)
        binary.chmod(0o755)
        with unittest.mock.patch.object(runners.FuzzRunner, 'ROUND_S', 600):
            result, _ = runners.FuzzRunner(binary)(self.path)
        return result.passed, result.failed, len((self.path / 'rounds').read_text().split())

    def test_a_fuzzer_goes_on_until_a_round_brings_nothing(self):
        self.assertEqual(self.fuzz([5, 7, 9, 9], 10**6), (1, 0, 4))

    def test_coverage_that_comes_and_goes_is_nothing_new(self):
        self.assertEqual(self.fuzz([5, 9, 7], 10**6), (1, 0, 3))

    def test_a_fuzzer_has_a_least_number_of_runs(self):
        self.assertEqual(self.fuzz([5], 10**6 // 4), (1, 0, 4))

    def test_a_fuzzer_that_still_finds_code_failed(self):
        self.assertEqual(self.fuzz(range(1, 100), 10**6), (0, 1, runners.FuzzRunner.MAX_ROUNDS))

    def test_a_fuzzer_with_too_few_runs_failed(self):
        self.assertEqual(self.fuzz([5], 1), (0, 1, runners.FuzzRunner.MAX_ROUNDS))


if __name__ == '__main__':
    unittest.main()
