"""Processes around a ROS master: a port for it, waiting for what they do, their end. For the scripts, tests and benchmarks."""
import os
import signal
import socket
import subprocess
import time

# Sanitizers make what is waited for this much slower.
SLOW = 20 if os.environ.get('DEFORMABLE_CCD_SANITIZED') else 1


def free_port():
    with socket.socket() as probe:
        probe.bind(('localhost', 0))
        return probe.getsockname()[1]


def wait_for(done, seconds, what, pause_s=0.01):
    """Returns when done() is true; raises TimeoutError naming `what` when it is not in time."""
    end = time.monotonic() + seconds * SLOW
    while not done():
        if time.monotonic() > end:
            raise TimeoutError('waited %g s for %s' % (seconds * SLOW, what))
        time.sleep(pause_s)


def stop(process):
    """Ends it as Ctrl-C would, roslaunch with its nodes; what does not end is killed with its session."""
    if process.poll() is not None:
        return
    process.send_signal(signal.SIGINT)
    try:
        process.wait(timeout=20 * SLOW)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
