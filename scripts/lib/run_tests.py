#!/usr/bin/env python3
"""Runs every test that the build made and adds the results up.

Runners: gtest binaries (listed by CMake in gtest_suites.txt, so that one that was not built counts as failed),
libFuzzer targets where they were built (--fuzzers),
Python unittest files (test/**/*_test.py), roslaunch-check on every launch file, rostest on test/ros/*.test, and the
README's first command with all others of the pages in a bare root.
The last line printed is `N passed, N failed, N skipped`.
"""
import argparse
import collections
import concurrent.futures
import os
import pathlib
import shutil
import sys
import threading
import time

from runners import (CHECKOUT, PAGE_COMMANDS, BareRootRunner, FuzzRunner, GtestRunner, LaunchCheckRunner, PagesRunner,
                     PythonRunner, Result, RostestRunner)


def sanitizer_reports(folder, result):
    """Each report that a sanitizer left in the folder is a failed test: of nodes and tools nobody reads the exit status."""
    for report in sorted(folder.glob('*')):
        head = ''.join('    | ' + line for line in report.read_text(errors='replace').splitlines(True)[:40])
        result.fail('a sanitizer\'s report: %s\n%s' % (report, head))


def find_runners(arguments):
    """All runners, in three lists: those that keep a core busy, the live ones, which mostly wait, and what takes all cores."""
    suites = (arguments.build / 'gtest_suites.txt').read_text().split()
    busy = []
    for suite in suites:
        # Shards let two cores share one long suite.
        shards = 1 if arguments.filter else max(1, min(4, os.cpu_count() or 1))
        busy += [GtestRunner(arguments.build / 'gtest' / suite, shard, shards, arguments.filter, arguments.emulator)
                 for shard in range(shards)]
    if arguments.filter or arguments.emulator:
        return busy, [], []
    if arguments.fuzzers:
        busy += [FuzzRunner(arguments.fuzzers / name)
                 for name in (arguments.fuzzers / 'fuzz_targets.txt').read_text().split()]
    python = [PythonRunner(p) for p in sorted((CHECKOUT / 'test').rglob('*_test.py'))
              if 'ros' not in p.relative_to(CHECKOUT / 'test').parts]
    on_live_nodes = [runner for runner in python if runner.path.parent.name in ('attacks', 'faults')]
    python = [runner for runner in python if runner not in on_live_nodes]
    launch = [LaunchCheckRunner(p) for p in sorted((CHECKOUT / 'launch').rglob('*.launch'))]
    live = [RostestRunner(p) for p in sorted((CHECKOUT / 'test' / 'ros').glob('*.test'))]
    # In a bare root there is no root to be made, and a sanitizer looks at nothing that a stranger's build does.
    inside = os.environ.get('DEFORMABLE_CCD_IN_BARE_ROOT') or os.environ.get('DEFORMABLE_CCD_SANITIZED')
    if (arguments.pages or not inside) and not arguments.only:
        python = [runner for runner in python if runner.name != PAGE_COMMANDS.name]
    if arguments.pages:
        python.append(PagesRunner(arguments.pages))
    # The shards, which are short, come last, so that all cores are done at about the same time.
    return python + busy, launch + live + on_live_nodes, [] if inside else [BareRootRunner()]


def run_all(work, busy, live):
    """Calls work(runner) for each of both lists. Live tests have deadlines of their own, so only one runs at a time, beside a
    thread a core that computes: most of their time they wait."""
    busy, live = collections.deque(busy), collections.deque(live)

    def take(queue):
        while True:
            try:
                runner = queue.popleft()
            except IndexError:
                return
            work(runner)

    queues = [live] + [busy] * (os.cpu_count() or 1)
    with concurrent.futures.ThreadPoolExecutor(len(queues)) as pool:
        for future in [pool.submit(take, queue) for queue in queues]:
            future.result()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('--build', type=pathlib.Path, required=True, help='build folder of the package')
    parser.add_argument('--fuzzers', type=pathlib.Path, help='build folder of the libFuzzer targets')
    parser.add_argument('--emulator', default='', help='command that runs the gtest binaries; no others are run then')
    parser.add_argument('--pages', type=pathlib.Path, help="what the tests of the pages' commands printed, where they have run")
    parser.add_argument('--only', default='')
    parser.add_argument('--filter', default='')
    arguments = parser.parse_args()
    logs = arguments.build / 'test_logs'
    shutil.rmtree(logs, ignore_errors=True)
    logs.mkdir(parents=True)

    total = Result()
    lock = threading.Lock()

    def work(runner):
        started = time.monotonic()
        try:
            result, log = runner(logs)
        except Exception as error:  # a runner that cannot start is a failed test, not the end of the run
            result, log = Result(), None
            result.fail('%s: %s' % (runner.name, error))
        with lock:
            print('%-44s %5d passed %3d failed %3d skipped  %6.1f s' % (
                runner.name, result.passed, result.failed, result.skipped, time.monotonic() - started), flush=True)
            for note in result.notes:
                print('    ' + note, flush=True)
            if result.failed and log:
                print('    output: %s; its end:' % log)
                print(''.join('    | ' + line for line in log.read_text(errors='replace').splitlines(True)[-40:]),
                      flush=True)
            total.passed += result.passed
            total.failed += result.failed
            total.skipped += result.skipped

    busy, live, alone = [[r for r in group if arguments.only in r.name] for group in find_runners(arguments)]
    run_all(work, busy, live)
    for runner in alone:
        work(runner)
    reports = os.environ.get('DEFORMABLE_CCD_SANITIZER_REPORTS')
    if reports:
        found = Result()
        sanitizer_reports(pathlib.Path(reports), found)
        print('\n'.join(found.notes), flush=True)
        total.failed += found.failed
    # A runner or a filter that nothing matches must not read as held.
    if not total.passed + total.failed + total.skipped:
        total.fail('no test ran')
        print('no test ran')
    print('%d passed, %d failed, %d skipped' % (total.passed, total.failed, total.skipped), flush=True)
    return 1 if total.failed else 0


if __name__ == '__main__':
    sys.exit(main())
