#!/usr/bin/env python3
"""A real cell, live on this machine: what the monitor takes of a core, how late its answers are, how many are proved.

An arm (the data's ur5e, carried by robot_state_publisher), a cloth of 600 vertices in its hand, a depth camera of
640 x 480 above a table, 2 cm. One process publishes and measures (cell_publisher.cpp). Each row is a run of its own.
"""
import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import rosgraph
import rosparam

CHECKOUT = pathlib.Path(__file__).resolve().parents[1]
sys.path.append(str(CHECKOUT / 'scripts/lib'))
sys.path.append(str(CHECKOUT / 'benchmark'))
from report.paper_report import table  # noqa: E402  (the path must be set first)
from ros_process import free_port, stop, wait_for  # noqa: E402

MONITOR = '/collision_monitor'
PARAMETERS = {
    'fixed_frame': 'world',
    'bodies': {'cloth': {'topic': '/tracker/cloth', 'topology': {'source': 'grid', 'rows': 20, 'cols': 30}}},
    'robot': {'description': '/robot_description', 'holds': {'cloth': ['wrist_3_link']}},
    'own_voxels_m': 'auto',
}
CLOUDS = {'obstacle_cloud_topic': '/camera/depth/color/points', 'obstacle_resolution_m': 0.02, 'obstacle_max_range_m': 2.0,
          'octomap_timeout_s': 1.0}
IMAGES = {**CLOUDS, 'obstacle_cloud_topic': '/camera/depth/image_rect_raw'}
# A server whose maps come later than a second after their clouds is to be measured, too.
MAPS = {'octomap_topic': '/octomap_binary', 'octomap_timeout_s': 5.0}
# Distances, promises and scale. The hand goes at 0.25 m/s at most, the hem a little faster.
DISTANCES = {'max_speed_m_s': 0.6, 'clearance': {'max_m': 1.0},
             'speed_scale': {'reaction_time_s': 0.15, 'stopping_time_s': 0.3, 'uncertainty_m': 0.02}}
INPUTS = {'clouds': (CLOUDS, ['--clouds']), 'images': (IMAGES, ['--images']), 'server': (MAPS, ['--clouds'])}
# What is asked for: by camera rate, share of a core [%] without and with distances.
SHARES = {15: (35, 40), 30: (60, 65)}


def rows_of(arguments):
    """Name of a row, its input, camera rate, whether distances are on."""
    rows = [('%s_%d_%s' % (which, rate, 'with' if distances else 'without'), which, rate, distances)
            for which in ('clouds', 'images', 'server') for rate in (15, 30) for distances in (False, True)]
    if arguments.rows:
        unknown = set(arguments.rows) - {row[0] for row in rows}
        if unknown:
            sys.exit('cell_live: no row %s; there are %s' % (', '.join(sorted(unknown)), ', '.join(row[0] for row in rows)))
        return [row for row in rows if row[0] in arguments.rows]
    return [row for row in rows if row[1] == 'clouds' or row[3]]


def package_of(data, folder):
    """A package ur_description with the meshes that the URDF names."""
    package = pathlib.Path(folder) / 'ur_description'
    shutil.rmtree(package, ignore_errors=True)
    (package / 'meshes/ur5e').mkdir(parents=True)
    (package / 'meshes/ur5e/collision').symlink_to(pathlib.Path(data).resolve() / 'robots/ur5e/meshes/collision')
    (package / 'package.xml').write_text(
        '<package format="2"><name>ur_description</name><version>0.0.0</version><description>the meshes of the data'
        '</description><maintainer email="nobody@example.com">nobody</maintainer><license>BSD</license></package>\n')


def measure(arguments, which, rate, distances, out):
    """One run; the processes end with it."""
    parameters, words = INPUTS[which]
    urdf = pathlib.Path(arguments.data) / 'robots/ur5e/ur5e.urdf'
    processes = []

    def start(*command):
        log = open(out.with_suffix('.log'), 'ab')
        processes.append(subprocess.Popen(command, stdout=log, stderr=log, start_new_session=True))
        return processes[-1]

    with tempfile.TemporaryDirectory(prefix='cell_live_') as home:
        port = free_port()
        os.environ.update(ROS_MASTER_URI='http://localhost:%d' % port, ROS_HOSTNAME='localhost', ROS_HOME=home, ROS_LOG_DIR=home)
        try:
            start('rosmaster', '--core', '-p', str(port))
            wait_for(rosgraph.is_master_online, 20, 'the master')
            rosparam.upload_params('/robot_description', urdf.read_text())
            rosparam.upload_params(MONITOR, {**PARAMETERS, **parameters, **(DISTANCES if distances else {}),
                                             **json.loads(arguments.parameters)})
            watched = {'robot_state_publisher': start('/usr/lib/robot_state_publisher/robot_state_publisher')
                       if os.path.exists('/usr/lib/robot_state_publisher/robot_state_publisher')
                       else start('rosrun', 'robot_state_publisher', 'robot_state_publisher')}
            if which == 'server':
                watched['octomap_server'] = start(arguments.tools + '/cell_octomap_server', '_resolution:=0.02', '_max_range:=2.0')
            watched['monitor'] = start(arguments.monitor, '__name:=' + MONITOR[1:])
            master = rosgraph.Master('/cell_live')
            wait_for(lambda: any(topic == MONITOR + '/stats' for topic, _ in master.getSystemState()[0]), 60, 'the monitor')
            cell = start(arguments.tools + '/cell_publisher', '--urdf', str(urdf), '--out', str(out), '--monitor', MONITOR,
                         '--camera-hz', str(rate), '--start-s', str(arguments.start_s), '--seconds', str(arguments.seconds),
                         *words, *arguments.cell.split(), *('--process=%s=%d' % (name, p.pid) for name, p in watched.items()))
            if arguments.perf:
                subprocess.run(['perf', 'record', '-o', arguments.perf, '-F', '999', '-p',
                                str(watched['monitor'].pid), '--', 'sleep', str(arguments.start_s + arguments.seconds + 10)])
            if cell.wait(timeout=120 + arguments.start_s + arguments.seconds) != 0:
                sys.exit('cell_live: the cell failed; see %s' % out.with_suffix('.log'))
        finally:
            for process in reversed(processes):
                stop(process)
    return json.loads(out.read_text())


def at_rank(values, share):
    return sorted(values)[min(len(values) - 1, int(share * len(values)))] if values else float('nan')


def line_of(row, r):
    _, which, rate, distances = row
    window_s, share = r['window_s'], r['share']
    others = share['machine'] - sum(s for name, s in share.items() if name != 'machine')
    percent = lambda value: '%.0f %%' % (100 * value)
    asked = '%d %%' % SHARES[rate][distances] if which != 'server' else ''
    return [which, str(rate), 'with' if distances else 'without', percent(share['monitor']), asked,
            '%d of %d' % (r['proved'], r['cloths_sent']), '%.1f %%' % (100 * r['proved'] / r['cloths_sent']),
            '%.1f' % (r['maps'] / window_s), '%.2f' % at_rank(r['latency_ms'], 0.5), '%.2f' % at_rank(r['latency_ms'], 0.99),
            '%.2f' % at_rank(r['step_ms'], 0.5), '%.1f %%' % (100 * r['scale_above_0']) if distances else '',
            percent(share['octomap_server']) if 'octomap_server' in share else '', percent(share['publisher']), percent(others)]


HEADER = ['input', 'camera Hz', 'distances', 'share of a core', 'at most', 'steps proved', 'asked: 99 %', 'maps/s', 'latency ms, median',
          'p99', 'step ms, median', 'scale above 0 (99 %)', 'octomap_server', 'publishers', 'others']
MEANING = """
Of the time measured: *share of a core* that the monitor took, *publishers* the cell's own process, *others* all else on this machine (a quiet one: next to
nothing but robot_state_publisher). *server*: the map comes from what stands for octomap_server. Asked of the latency with distances: median 1.5 ms, p99 5 ms.
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--tools', required=True, help='folder of cell_publisher and cell_octomap_server')
    parser.add_argument('--monitor', required=True, help='collision_monitor_node')
    parser.add_argument('--data', required=True, help='folder with robots/ur5e')
    parser.add_argument('--out', required=True, help='folder of the results')
    parser.add_argument('--rows', nargs='*', help='these alone, as clouds_15_with, images_30_without, server_15_with')
    parser.add_argument('--start-s', type=float, default=5)
    parser.add_argument('--seconds', type=float, default=20)
    parser.add_argument('--parameters', default='{}', help='JSON, over those of the monitor')
    parser.add_argument('--cell', default='', help='further words for cell_publisher')
    parser.add_argument('--perf', help='file for perf record of the monitor, start included; with one row alone')
    arguments = parser.parse_args()
    folder = pathlib.Path(arguments.out)
    folder.mkdir(parents=True, exist_ok=True)
    package_of(arguments.data, folder / 'packages')
    os.environ['ROS_PACKAGE_PATH'] = '%s:%s' % ((folder / 'packages').resolve(), os.environ.get('ROS_PACKAGE_PATH', ''))
    lines, reasons = [], []
    for row in rows_of(arguments):
        out = folder / (row[0] + '.json')
        for old in (out, out.with_suffix('.log')):
            old.unlink(missing_ok=True)
        result = measure(arguments, *row[1:], out)
        lines.append(line_of(row, result))
        for what in ('reasons', 'scale_reasons'):
            reasons += ['%s: %s' % (row[0], what)] + ['    %5d  %s' % (count, text) for text, count in
                                                      sorted(result[what].items(), key=lambda one: -one[1])[:6]]
    page = '# A real cell\n\n' + table(HEADER, lines) + MEANING
    (folder / 'cell_live.md').write_text(page)
    (folder / 'reasons.txt').write_text('\n'.join(reasons) + '\n')
    print(page)
    print('\n'.join(reasons), file=sys.stderr)


if __name__ == '__main__':
    main()
