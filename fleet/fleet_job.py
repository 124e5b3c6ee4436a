"""One job of a fleet: a recording, or the database and page of all. Snakemake calls it.

A job that ends without an error has written its result, also where that is a failure: a bag that cannot be read stays so. A job
that was killed, or found no room to write, leaves no result and ends with 1, and so is computed again by the next run.
"""
import json
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import fleet_database  # noqa: E402
import fleet_tables  # noqa: E402

ANSWERED = (0, 3)  # analyze_bag: proved; answered, but not all of it is proved
ERROR = 1


def analyze(fleet, recording, folder):
    """Runs analyze_bag with its report in the folder, which is there afterwards only where it was answered. What it said and
    cost."""
    unfinished = folder.with_name(folder.name + '.part')
    shutil.rmtree(unfinished, ignore_errors=True)
    unfinished.parent.mkdir(parents=True, exist_ok=True)
    command = [fleet['tool'], *recording['bags'], '--report', str(unfinished), '--quiet',
               '--threads', str(fleet['threads']), *fleet['options']]
    start = time.time()
    ran = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, check=False)
    said = ran.stderr.decode(errors='replace').strip()
    if ran.returncode < 0:
        sys.exit('%s: analyze_bag was ended by %s' % (recording['name'], signal.Signals(-ran.returncode).name))
    if 'written' in said and ran.returncode not in ANSWERED:  # that is no property of the recording
        sys.exit('%s: %s' % (recording['name'], said))
    if ran.returncode not in (*ANSWERED, ERROR):
        sys.exit('%s: analyze_bag ended with %d: %s' % (recording['name'], ran.returncode, said))
    shutil.rmtree(folder, ignore_errors=True)  # only now, when there is something in its place
    if ran.returncode in ANSWERED:
        unfinished.replace(folder)
    else:
        shutil.rmtree(unfinished, ignore_errors=True)
    bag_bytes = sum(os.stat(bag).st_size for bag in recording['bags'])
    return {'exit': ran.returncode, 'said': said, 'headline': ran.stdout.decode(errors='replace').split('\n')[0],
            'seconds': round(time.time() - start, 3), 'bag_bytes': bag_bytes, 'version': fleet['version'],
            'max_memory_kb': resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss}


def compute_recording(fleet, name):
    recording = next(r for r in fleet['recordings'] if r['name'] == name)
    folder = pathlib.Path('recordings', name)
    result = analyze(fleet, recording, folder / 'report')
    result.update({'name': name, 'bags': recording['bags']})
    if result['exit'] in ANSWERED:
        result['tables'] = fleet_tables.of_report(folder / 'report')
    fleet_database.write_whole(folder / 'result.json', json.dumps(result, indent=1) + '\n')


def main():
    verb, config, *names = sys.argv[1:]
    fleet = json.loads(pathlib.Path(config).read_text())
    try:
        if verb == 'recording':
            compute_recording(fleet, *names)
        else:
            fleet_database.write(fleet, pathlib.Path('.'), *names)
    except OSError as error:
        sys.exit('%s: %s' % (' '.join([verb, *names]), error))


if __name__ == '__main__':
    main()
