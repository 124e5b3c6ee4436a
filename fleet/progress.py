"""Snakemake's messages as lines of progress with the time that is left (--log-handler-script)."""
import os
import time

STARTED = time.time()


def say(text):
    """Not where Snakemake writes its own messages; a terminal that has gone ends nothing."""
    try:
        os.write(int(os.environ['FLEET_PROGRESS']), ('analyze_fleet: %s\n' % text).encode())
    except (KeyError, OSError):
        pass


def log_handler(message):
    if message.get('level') == 'progress':
        done, total = message['done'], message['total']
        left_s = int((time.time() - STARTED) * (total - done) / done) if done else 0
        say('%d of %d jobs, about %d:%02d:%02d left' % (done, total, left_s // 3600, left_s // 60 % 60, left_s % 60))
    elif message.get('level') == 'job_error':
        say('job %s failed: %s' % (message.get('name'), ' '.join(map(str, message.get('output') or []))))
    elif message.get('level') == 'error' and 'WorkflowError' in str(message.get('msg')):  # as where a cluster refuses a job
        say(' '.join(str(message['msg']).split()))
