"""Scenes, bags and commands for the tests of bags and of fleets."""
import sqlite3

from checkout import CHECKOUT, TOOLS, run

TABLES = ('contacts.csv', 'steps.csv', 'patches.csv', 'events.csv')


def make_scene(folder, name, scene, *words):
    """Bag and parameters."""
    bag, params = folder / (name + '.bag'), folder / (name + '.yaml')
    ran = run(TOOLS / 'make_scene_bag', CHECKOUT / 'config/scenes' / (scene + '.yaml'), bag, '--quiet', '--monitor-config', params, *words)
    assert ran.returncode == 0, ran.stderr
    return bag, params


def fleet(*words, environment=None):
    # By the Python that ROS is installed for, whatever stands first in PATH.
    return run('/usr/bin/python3', TOOLS / 'analyze_fleet', *words, env=environment)


def rows_of(out, query):
    with sqlite3.connect(str(out / 'fleet.sqlite')) as database:
        return database.execute(query).fetchall()
