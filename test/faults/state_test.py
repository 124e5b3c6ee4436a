"""What ~state and ~clear say while frames stop, steps take long, clocks stand or run, and the node ends: on meshes as large as
trackers send. Nothing that is said here rests on one more frame coming."""
import os
import pathlib
import signal
import struct
import subprocess
import sys
import threading
import time
import unittest

import rosbag
import rospy
from deformable_ccd.msg import ContactArray, State
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / 'scripts/lib'))
from ros_process import wait_for
from live_node import Cloud, LiveNodeTest, simulated_time

ROWS, COLS = 30, 40  # 1,200 vertices


class Sheet(Cloud):
    """A flat sheet that sinks slowly: every step of it is clear."""

    def __init__(self, rows=ROWS, cols=COLS):
        super().__init__(rows, cols)
        self.variants = [b''.join(struct.pack('<3d', 0.01 * c, 0.01 * r, 0.001 * z)
                                  for r in range(rows) for c in range(cols)) for z in range(4)]


class Stream:
    """Publishes frames 30 times a second, stamped so, until it is stopped."""

    def __init__(self, publisher, cloud, rate=30.0):
        self.publisher, self.cloud, self.rate = publisher, cloud, rate
        self.stop = threading.Event()
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        while not self.stop.wait(1 / self.rate):
            self.publisher.publish(self.cloud.message(100 + (self.cloud.count + 1) / self.rate))

    def end(self):
        self.stop.set()
        self.thread.join()


class StateTest(LiveNodeTest):
    def stream(self, cloud, rate=30.0):
        stream = Stream(self.publisher, cloud, rate)
        self.addCleanup(stream.end)
        return stream

    def wait_proved(self, proved=True, seconds=20):
        wait_for(lambda: self.states and self.states[-1].proved == proved, seconds, 'proved: %s' % proved)

    def wait_missing(self, words):
        wait_for(lambda: self.states and any(words in m for m in self.states[-1].missing), 20, words)
        self.assertFalse(self.states[-1].proved)
        self.assertFalse(self.states[-1].clear)
        wait_for(lambda: not self.clear[-1].data, 5, '~clear to be false')

    def wait_reason(self, words):
        wait_for(lambda: words in self.states[-1].reason, 20, words)

    def late_subscriber(self, name):
        """What somebody hears who comes only now."""
        heard = rospy.wait_for_message('/%s/state' % name, State, 10)
        self.assertEqual(rospy.wait_for_message('/%s/clear' % name, Bool, 10).data, heard.clear)
        return heard

    def assert_consistent(self):
        for state in list(self.states):
            self.assertEqual(state.proved, not state.missing, state)
            self.assertEqual(state.clear, state.proved and state.touching == State.NONE, state)
            self.assertTrue(state.reason)

    def test_a_tracker_that_falls_silent(self):
        self.start_node('silent')
        stream = self.stream(Sheet())
        self.wait_proved()
        state = self.states[-1]
        self.assertTrue(state.clear)
        self.assertTrue(state.checked_self)
        self.assertFalse(state.checked_map)
        self.assertGreater(state.holds_until, state.start)
        stream.end()
        last = 100 + stream.cloud.count / stream.rate
        self.wait_missing('no frame has come')
        self.wait_reason('/silent/mesh has fallen silent (see rostopic hz and rosnode ping)')
        late = self.late_subscriber('silent')
        self.assertFalse(late.proved)
        self.assertAlmostEqual(late.holds_until.to_sec(), last, 6)
        self.publisher.unregister()
        self.wait_reason('nobody publishes /silent/mesh any more; start its publisher again')
        self.publisher = self.advertise('/silent/mesh', PointCloud2)
        self.stream(stream.cloud)
        self.wait_proved()
        self.assertNotIn('nobody publishes', self.states[-1].reason)
        self.assert_consistent()

    def test_steps_that_take_longer_than_frames_come(self):
        self.start_node('slow', step_budget_ms=1e4, max_memory_mb=4096, answer_timeout_s=0.1, queue_size=1, max_step_s=1e6, max_contacts=10)
        cloud = Cloud(280, 280)
        # Of two frames at once, the node's queue of one may drop the first before it is taken: then there is no step.
        self.publisher.publish(cloud.message())
        wait_for(lambda: self.contacts, 20, 'the first frame to be taken')
        self.publisher.publish(cloud.message())
        wait_for(lambda: any(c.answered for c in self.contacts), 120, 'a step')
        step_s = max(s.total_ms for s in self.stats) * 1e-3
        self.assertGreater(step_s, 0.15, 'the cloth is too small for this machine')
        said = len(self.states)
        self.publisher.publish(cloud.message())
        wait_for(lambda: len(self.states) > said, step_s + 10, 'a word before the answer')
        self.assertIn('had no answer', self.states[said].missing[0])
        wait_for(lambda: self.states[-1].proved, 10 + 3 * step_s, 'the answer, which proves contacts')
        # It touches itself all over: that is one patch, which lasts.
        self.assertEqual(self.states[-1].touching, State.LASTING)
        # With a frame behind it that waits, an answer that comes is no proof any more.
        stream = self.stream(cloud, 100)
        wait_for(lambda: len(self.contacts) >= 6, 10 + 10 * step_s, 'more steps')
        said = len(self.states)
        answers = len(self.contacts)
        wait_for(lambda: len(self.contacts) >= answers + 3, 10 + 10 * step_s, 'more steps')
        # A publisher that is held up itself may leave a moment without a frame that waits.
        ends = {s.holds_until.to_nsec(): s for s in self.states[said:]}
        late = [s for s in ends.values() if 'had no answer' in s.reason]
        self.assertTrue(late, 'frames came while each of them was computed')
        stream.end()
        self.assert_consistent()

    def test_a_step_whose_budget_ran_out_is_cut(self):
        self.start_node('cut', step_budget_ms=20.0, max_memory_mb=4096, answer_timeout_s=1e3, max_step_s=1e6)
        cloud = Cloud(220, 220)
        for _ in range(2):
            self.publisher.publish(cloud.message())
        wait_for(lambda: any(c.answered for c in self.contacts), 60, 'an answer')
        self.assertEqual(self.contacts[-1].status, ContactArray.DEADLINE, self.contacts[-1].reason)
        self.wait_missing('the step budget ran out')

    def test_a_reset_while_a_step_is_computed(self):
        self.start_node('reset', step_budget_ms=1e4, max_memory_mb=4096, answer_timeout_s=1e3, max_step_s=1e6, max_contacts=10)
        cloud = Cloud(330, 330)  # a step that takes longer than it takes to ask
        rospy.wait_for_service('/reset/reset', 10)
        reset = rospy.ServiceProxy('/reset/reset', Trigger, persistent=True)
        for _ in range(2):
            self.publisher.publish(cloud.message())
        self.wait_proved(seconds=120)
        # On a machine that was held up, the step may have ended before it was asked: then another one is asked.
        for _ in range(5):
            self.publisher.publish(cloud.message())
            time.sleep(0.1)
            asked = threading.Thread(target=reset)
            said = len(self.states)
            asked.start()
            wait_for(lambda: any('reset' in s.reason for s in self.states[said:]), 2, 'a word at once')
            asked.join()
            wait_for(lambda: 'since the reset' in self.states[-1].reason, 60, 'the reset')
            since = [k for k in range(said, len(self.states)) if 'a reset was asked for' in ' '.join(self.states[k].missing)]
            if since:
                break
            for _ in range(2):
                self.publisher.publish(cloud.message())
            self.wait_proved(seconds=120)
        self.assertTrue(since, 'each of five steps ended before the reset was heard')
        self.assertFalse(any(s.proved for s in self.states[since[0]:]), 'the step that still ended proves nothing')
        self.assertTrue(self.states[-1].holds_until.is_zero())

    def test_a_newer_frame_of_a_static_body(self):
        """It voids what was said as soon as it comes, not with the next step."""
        bodies = {'bodies/cloth/topic': '/held/mesh', 'bodies/table/topic': '/held/table', 'bodies/table/motion': 'static',
                  'clock_body': 'cloth'}
        self.start_node('held', max_step_s=30.0, **bodies)
        table = self.advertise('/held/table', PointCloud2)
        cloth, below, through = Sheet(), Sheet(), Sheet()
        below.variants = [b''.join(struct.pack('<3d', 0.01 * c, 0.01 * r, -1.0) for r in range(ROWS) for c in range(COLS))]
        through.variants = [b''.join(struct.pack('<3d', 0.1 * c, 0.003 * r, 0.01 * (c % 2) - 0.004) for r in range(ROWS) for c in range(COLS))]
        table.publish(below.message(100))
        time.sleep(0.5)
        for k in range(3):
            self.step(cloth.message(100 + 0.1 * k))
        self.wait_proved()
        wait_for(lambda: self.clear[-1].data, 5, '~clear')
        said = len(self.contacts)
        table.publish(through.message(100.2))
        self.wait_missing("a newer frame of body 'table' came, which no step has used yet")
        self.assertEqual(len(self.contacts), said, 'there was no step')
        outcome = self.step(cloth.message(100.3))
        self.assertGreater(outcome.total_contacts + len(outcome.intersections), 0)
        self.wait_proved()
        self.assertFalse(self.states[-1].clear)
        self.assert_consistent()

    def test_simulated_time_without_a_clock(self):
        """The true clock is the last resort: a tracker that dies is noticed all the same."""
        with simulated_time():
            self.start_node('no_clock')
            stream = self.stream(Sheet())
            self.wait_proved()
            stream.end()
            self.wait_missing('no frame has come')
        self.assert_consistent()

    # rosbag play, at several rates and paused: the watchdog lives in the bag's time.

    @staticmethod
    def end_session(player):
        """rosbag play is a script that starts a program."""
        if player.poll() is None:
            os.killpg(player.pid, signal.SIGKILL)
        player.wait()

    def play(self, name, frames, rate, lasts_s=0, until=lambda state: state.proved):
        """Frames, then a clock that runs on; until a state says so."""
        path = os.path.join(self.folder, name + '.bag')
        cloud = Sheet()
        with rosbag.Bag(path, 'w') as bag:
            for i in range(frames):
                message = cloud.message(1000 + i / 30)
                bag.write('/%s/mesh' % name, message, message.header.stamp)
            if lasts_s:
                bag.write('/other', Bool(), rospy.Time.from_sec(1000 + lasts_s))
        with simulated_time():
            self.start_node(name)
            self.publisher.unregister()
            player = subprocess.Popen(['rosbag', 'play', '--clock', '-q', '-d', '1', '-r', str(rate), '--hz', '100',
                                       '__name:=player_' + name, path], stdin=subprocess.DEVNULL, start_new_session=True)
            self.addCleanup(self.end_session, player)
            wait_for(lambda: self.states and until(self.states[-1]), 30, 'what the bag is to lead to')
        return player

    def unproved_since_first(self):
        first = [s.proved for s in self.states].index(True)
        return [s.reason for s in self.states[first:] if not s.proved]

    def test_a_slow_bag(self):
        player = self.play('slowly', 14, 0.1)  # a frame each third of a second: of the steady clock most are late
        self.assertEqual(player.wait(60), 0)
        self.assertEqual(self.unproved_since_first(), [])
        self.assertTrue(self.states[-1].clear)

    def test_a_fast_bag(self):
        player = self.play('quickly', 400, 10)
        self.assertEqual(player.wait(60), 0)
        proved = sum(s.proved for s in self.states)
        self.assertGreater(proved, 10)

    def test_a_bag_that_stops_bringing_frames(self):
        """The clock runs on ten times as fast, so half a second without a frame is over in 50 ms."""
        player = self.play('ending', 30, 10, 20, lambda state: 'no frame has come' in state.reason)
        self.assertIsNone(player.poll(), 'while the bag still plays')

    def test_a_paused_bag(self):
        self.play('paused', 300, 1)
        pause = rospy.ServiceProxy('/player_paused/pause_playback', SetBool)
        pause(True)
        time.sleep(0.3)  # what was under way
        said = len(self.states)
        time.sleep(1.5)  # three times as long as frames may stay away
        self.assertEqual([s.reason for s in self.states[said:]], [])
        self.assertTrue(self.states[-1].proved)
        pause(False)
        wait_for(lambda: len(self.states) > said + 20, 20, 'steps')
        self.assertEqual(self.unproved_since_first(), [])


if __name__ == '__main__':
    unittest.main()
