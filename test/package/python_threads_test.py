"""The Python module lets other threads and Ctrl-C in."""
import signal
import subprocess
import sys
import textwrap
import threading
import time
import unittest

import numpy as np

from python_test import FACES, SANITIZED, PythonTestCase, two_triangles

if not SANITIZED:
    import dccd

# A step of a minute: triangles that fly through each other, a few million pairs a second.
LONG_STEP = '''
import threading, time
import numpy as np, dccd
random = np.random.default_rng(0)
t0, t1 = (np.repeat(random.uniform(0, 30, (30000, 3)), 3, axis=0) + random.uniform(0, 2, (90000, 3)) for _ in range(2))
body = dccd.Body(t0, t1, np.arange(90000).reshape(-1, 3))
'''


class ThreadsTest(PythonTestCase):
    def start(self, program):
        # Whoever started this in the background of a shell has Ctrl-C ignored, and so have its children.
        process = subprocess.Popen([sys.executable, '-c', LONG_STEP + textwrap.dedent(program)], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True,
                                   preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        return process

    def test_ctrl_c_ends_a_long_step(self):
        process = self.start('''
            print('begun', flush=True)
            try:
                dccd.detect(body)
            except KeyboardInterrupt:
                print('interrupted', flush=True)
            small = dccd.Body([[0, 0, 0], [1, 0, 0], [0, 1, 0]], triangles=[[0, 1, 2]])
            print(dccd.detect(small).clear)''')
        self.assertEqual(process.stdout.readline(), 'begun\n')
        time.sleep(1)
        self.assertIsNone(process.poll())
        started = time.monotonic()
        process.send_signal(signal.SIGINT)
        said, errors = process.communicate(timeout=60)
        self.assertEqual((said, errors, process.returncode), ('interrupted\nTrue\n', '', 0))
        self.assertLess(time.monotonic() - started, 10)

    def test_ctrl_c_ends_a_stream(self):
        process = self.start('''
            stream = dccd.Stream(dccd.Body(mesh=body.mesh), max_vertex_step_m=0)
            stream.push(body.t0, 0.0), stream.push(body.t1, 0.1)
            print(stream.next().status, flush=True)
            try:
                stream.next()
            except KeyboardInterrupt:
                print('interrupted')
            try:
                stream.next()
            except RuntimeError as error:
                print(error)''')
        self.assertEqual(process.stdout.readline(), 'FIRST_FRAME\n')
        time.sleep(1)
        process.send_signal(signal.SIGINT)
        said, errors = process.communicate(timeout=60)
        self.assertEqual((said, errors), ('interrupted\nthis stream was interrupted; make a new one\n', ''))

    def test_a_handler_that_raises_nothing_ends_nothing(self):
        process = self.start('''
            import signal
            signal.signal(signal.SIGINT, lambda *_: print('handled', flush=True))
            print('begun', flush=True)
            outcome = dccd.detect(body, step_budget_ms=3000)
            print(outcome.status)''')
        self.assertEqual(process.stdout.readline(), 'begun\n')
        time.sleep(.5)
        process.send_signal(signal.SIGINT)
        said, errors = process.communicate(timeout=60)
        self.assertEqual((said, errors), ('handled\nDEADLINE\n', ''))

    def test_other_threads_run_meanwhile(self):
        process = self.start('''
            ticks = []
            def tick():
                while not done: ticks.append(time.sleep(.01))
            done = False
            thread = threading.Thread(target=tick)
            thread.start()
            outcome = dccd.detect(body, step_budget_ms=2000)
            n, done = len(ticks), True
            thread.join()
            print(n > 20, outcome.status, outcome.proved, outcome.complete)''')
        said, errors = process.communicate(timeout=120)
        self.assertEqual((said, errors), ('True DEADLINE False False\n', ''))

    def test_many_threads_may_be_the_first(self):
        """Types of arrays are made when the first asks, which once waited for itself: two of three such starts hung."""
        for _ in range(5):
            process = self.start('''
                import sys
                sys.setswitchinterval(1e-6)
                together, seen = threading.Barrier(8), []
                small = dccd.Body([[0, 0, 0], [1, 0, 0], [0, 1, 0]], triangles=[[0, 1, 2]])
                def ask():
                    together.wait()
                    outcome = dccd.detect(small)
                    seen.append((len(outcome.contacts), len(outcome.intersections), len(outcome.clearances)))
                threads = [threading.Thread(target=ask) for _ in range(8)]
                for thread in threads: thread.start()
                for thread in threads: thread.join()
                print(set(seen), len(seen))''')
            said, errors = process.communicate(timeout=60)
            self.assertEqual((said, errors), ('{(0, 0, 0)} 8\n', ''))

    def test_threads_may_share_a_history_and_a_stream(self):
        t0, t1 = two_triangles()
        body, history, wrong = dccd.Body(t0, t1, FACES), dccd.History(), []
        stream = dccd.Stream(dccd.Body(mesh=body.mesh), max_vertex_step_m=0)

        def work(thread):
            for i in range(200):
                if len(dccd.detect(body, history=history).contacts) != 3:
                    wrong.append(i)
                stream.push(t0, .001 * i + .0001 * thread)
                stream.next()

        threads = [threading.Thread(target=work, args=(n,)) for n in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(wrong, [])


if __name__ == '__main__':
    unittest.main()
