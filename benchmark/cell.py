#!/usr/bin/env python3
"""What a monitor makes of the map that one depth camera sees: recorded scenes, seen by a camera, against the truth.

Each scene of config/scenes gets a camera and a floor. One bag has the motion, the true map and the camera's. analyze_bag runs on
it with the true map, with the camera's, and with the camera's and the parameters of --own, if they are given.
"""
import argparse
import bisect
import collections
import csv
import json
import os
import subprocess
import sys
import tempfile

import numpy as np
import rosbag
import yaml

CHECKOUT = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))
RESOLUTION_M = 0.02
OCTOMAP, TRUTH_TOPIC, MAP_TOPIC, CLOUD_TOPIC = "octomap", "/truth/octomap", "/octomap_full", "/camera/points"
# Where each scene's camera is and what floor it looks down at. The cell was seen before the bodies came, twice: were it seen more often,
# what was free would need several hits to be occupied, and the map would show the bodies late.
CAMERA = {"width": 120, "height": 90, "lost_share": 0.02, "empty_clouds": 2}
CELLS = {
    "table_edge": ({"position_m": [0.9, 0.3, 1.35], "looks_at_m": [-0.1, 0, 0.85], "field_of_view_rad": 1.0},
                   # As far as the camera sees past the cloth: a ray that meets nothing clears nothing, and what was never free is in doubt.
                   {"min_m": [-8, -6, -0.04], "max_m": [1.5, 1.6, 0]}),
    # Along the crack, so that both of its walls are seen.
    "towel_in_crack": ({"position_m": [0, -0.55, 0.65], "looks_at_m": [0, 0, 0.25], "field_of_view_rad": 0.75},
                       {"min_m": [-0.7, -0.5, -0.04], "max_m": [0.5, 0.7, 0]}),
    "felt_and_finger": ({"position_m": [0.5, -0.6, 0.9], "looks_at_m": [0, 0, 0.5], "field_of_view_rad": 0.8},
                        {"min_m": [-2.6, -1, -0.04], "max_m": [1.2, 3, 0]}),
    "rope_through_ring": ({"position_m": [0.1, -0.6, 1.2], "looks_at_m": [-0.1, 0, 0.35], "field_of_view_rad": 1.0},
                          {"min_m": [-1.5, -0.6, -0.44], "max_m": [1.3, 1.5, -0.4]}),
}
# One at a time around the first.
SETTINGS = [{"noise_m": 0.003, "lag_s": 0.1, "rate_hz": 5.0}]
for name, values in (("noise_m", (0.0, 0.01)), ("lag_s", (0.0, 0.3)), ("rate_hz", (10.0, 30.0))):
    SETTINGS += [{**SETTINGS[0], name: value} for value in values]
FLYING_SHARE = 0.001  # of the pixels, along edges
LONGEST_TRAVEL_S = 0.5  # what barely moves may be as late as this
GAP_S = 0.25            # what comes back within this had not gone: patch_gap_s
COLUMNS = ("scene", "noise mm", "lag s", "maps/s", "own", "clear", "of true", "alarms true", "false", "false before", "missed",
           "in time", "first ms", "voxels", "blind %")
MEANING = """The columns are of contacts with the map:
- *clear, of true*: share of the steps that are clear with the true map; how many those are.
- *alarms true, false*: alarms that match one of the truth; the others. *False before* are those before the first true one. Two alarms match if they
  are of one body, within two voxels of each other, and their times overlap within a voxel's travel: its edge by the speed at which the two close, at most 0.5 s.
- *missed*: alarms of the truth that no alarm of the run matches.
- *in time*: share of the truth's alarms whose place the run first touches within a voxel's travel of the true time.
- *first*: how late the first contact is, in time and as the way closed in that time.
- *blind*: share of the voxels shown as own or in doubt that the true map has.
"""

FLYING_HEAD = """| the monitor's own map | proved %, no pixel flies | 0.1 % fly along edges | costs, at most 1 |
|---|--:|--:|--:|"""

Contact = collections.namedtuple("Contact", "time_s point patch speed_m_per_s body")
Step = collections.namedtuple("Step", "start_s end_s clear contacts")
Run = collections.namedtuple("Run", "steps alarms own proved_percent")


def derived_page(scene, setting):
    """The scene's page with a camera and a floor; and the parameters of the monitor."""
    with open(os.path.join(CHECKOUT, "config", "scenes", scene + ".yaml")) as stream:
        page = yaml.safe_load(stream)
    page.pop("expect")
    camera, floor = CELLS[scene]
    obstacle = page.setdefault("obstacle", {"topic": MAP_TOPIC, "solids": []})
    obstacle.update(topic=MAP_TOPIC, resolution_m=RESOLUTION_M, binary=False)
    obstacle["solids"].append({"box": floor})
    page["camera"] = {**CAMERA, **camera, **setting, "truth_topic": TRUTH_TOPIC,
                      # Faces lie within voxels; on the border between two, noise would decide which one is occupied.
                      "inset_m": RESOLUTION_M / 2}
    monitor = page["monitor"]
    monitor["octomap_topic"] = MAP_TOPIC
    monitor["effects"]["octomap"] = "auto"
    return page, monitor


def run_tool(tools, name, *words):
    done = subprocess.run([os.path.join(tools, name), *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, universal_newlines=True)
    if done.returncode not in (0, 3):  # 3: not all of it is proved
        sys.exit("%s %s ended with %d: %s" % (name, " ".join(words), done.returncode, done.stderr))


def analyse(tools, bag, monitor, folder, name, shows_own=False):
    """A run of the monitor over a bag: its steps with the contacts with the map, its alarms, and in each step the own voxels shown."""
    params, results, report = (os.path.join(folder, name + ending) for ending in (".yaml", "_results.bag", "_report"))
    with open(params, "w") as stream:
        yaml.safe_dump(monitor, stream)
    run_tool(tools, "analyze_bag", bag, "--params", params, "--output", results, "--report", report, "--quiet")
    with open(os.path.join(report, "steps.csv"), newline="") as stream:
        clear = {int(row["stamp_ns"]): row["clear"] == "1" for row in csv.DictReader(stream) if row["answered"] == "1"}
    with open(os.path.join(report, "report.json")) as stream:
        proof = json.load(stream)["proof"]
    steps, alarms, own = [], set(), []
    with rosbag.Bag(results) as stream:
        # Markers are long, and nobody asks for those of bodies without own voxels.
        topics = ["contacts", "patches"] + ["markers"] * shows_own
        for topic, message, _ in stream.read_messages(["/collision_monitor/" + name for name in topics]):
            if topic.endswith("/contacts") and message.answered:
                start_s, end_s = message.start.to_sec(), message.header.stamp.to_sec()
                found = [Contact(start_s if c.initial else start_s + c.toc_lower * (end_s - start_s),
                                 (c.point.x, c.point.y, c.point.z), c.patch, c.approach_speed, c.body[0])
                         for c in message.contacts if c.body[1] == c.OBSTACLE]
                steps.append(Step(start_s, end_s, clear[message.header.stamp.to_nsec()], found))
            elif topic.endswith("/patches"):
                alarms.update(p.id for p in message.patches if p.is_new and OCTOMAP in p.bodies)
            elif topic.endswith("/markers"):
                own += [(p.x, p.y, p.z) for m in message.markers if m.ns == "own" for p in m.points]
    return Run(steps, alarms, own, 100 * proof["proved"] / max(1, proof["steps"]))


class Touches:
    """When contacts of some patches touch near a place."""

    def __init__(self, run, patches=None):
        self.contacts = [c for step in run.steps for c in step.contacts if patches is None or c.patch in patches]
        self.contacts.sort(key=lambda c: c.time_s)
        self.times_s = [c.time_s for c in self.contacts]
        self.points = np.array([c.point for c in self.contacts]).reshape(-1, 3)

    def near(self, alarm, reach_m, from_s, to_s):
        """Sorted times at which the alarm's body touches within reach of where it began."""
        first, last = bisect.bisect_left(self.times_s, from_s), bisect.bisect_right(self.times_s, to_s)
        near = np.zeros(last - first, bool)
        for point in alarm.points:
            near |= ((self.points[first:last] - point) ** 2).sum(axis=1) <= reach_m * reach_m
        return [self.times_s[first + i] for i in np.flatnonzero(near) if self.contacts[first + i].body == alarm.body]

    def matches(self, alarm, reach_m):
        return bool(self.near(alarm, reach_m, alarm.time_s - alarm.travel_s, alarm.until_s + alarm.travel_s))


Beginning = collections.namedtuple("Beginning", "time_s points travel_s until_s body")


def beginnings(run, resolution_m):
    """Each alarm of a run: when and where it begins, how long a voxel's travel takes there, and how long it lives."""
    by_patch = collections.defaultdict(list)
    for step in run.steps:
        for contact in step.contacts:
            if contact.patch in run.alarms:
                by_patch[contact.patch].append((step, contact))
    found = []
    for contacts in by_patch.values():
        first = [c for step, c in contacts if step is contacts[0][0]]
        speed = max(c.speed_m_per_s for c in first)
        travel_s = min(resolution_m / speed, LONGEST_TRAVEL_S) if speed > 0 else LONGEST_TRAVEL_S
        found.append(Beginning(min(c.time_s for c in first), [c.point for c in first], travel_s, contacts[-1][1].time_s, first[0].body))
    return sorted(found)


def onsets(touches, alarm, reach_m):
    times = touches.near(alarm, reach_m, -np.inf, np.inf)
    return [t for before, t in zip([-np.inf] + times, times) if t - before > GAP_S]


def onset_error(true_touches, touches, alarm, reach_m):
    """How much later than the truth it begins to touch at the place of a true alarm [s]. The truth may touch there before, by another
    patch, and go on."""
    true_s = [alarm.time_s] + [t for t in onsets(true_touches, alarm, reach_m) if t <= alarm.time_s][-1:]
    return min((t - true for t in onsets(touches, alarm, reach_m) for true in true_s), key=abs)


def first_contact(run):
    return min((c for step in run.steps for c in step.contacts), key=lambda c: c.time_s, default=None)


def blind_percent(run, truth_voxels, resolution_m):
    """Of the voxels that were shown as own, those that the true map has."""
    if not run.own:
        return None
    own = [tuple(np.floor(np.asarray(p) / resolution_m).astype(int)) for p in run.own]
    return 100 * sum(key in truth_voxels for key in own) / len(own)


def judge(truth, run, truth_voxels, resolution_m):
    """Of one run, what the table says."""
    reach_m = 2 * resolution_m
    clear = {step.end_s for step in truth.steps if step.clear}
    row = {"clear": sum(step.clear and step.end_s in clear for step in run.steps), "clear_of": len(clear)}
    true_alarms, alarms = beginnings(truth, resolution_m), beginnings(run, resolution_m)
    true_touches, touches = Touches(truth), Touches(run, run.alarms)
    is_true = [true_touches.matches(a, reach_m) for a in alarms]
    row["true"], row["false"] = sum(is_true), len(is_true) - sum(is_true)
    first_s = true_alarms[0].time_s if true_alarms else np.inf
    row["false_before"] = sum(a.time_s < first_s - a.travel_s for a, good in zip(alarms, is_true) if not good)
    found = [a for a in true_alarms if touches.matches(a, reach_m)]
    row["missed"], row["true_alarms"] = len(true_alarms) - len(found), len(true_alarms)
    row["in_time"] = sum(abs(onset_error(true_touches, touches, a, reach_m)) <= a.travel_s for a in found)
    true_first, first = first_contact(truth), first_contact(run)
    if true_first and first:
        row["first_ms"] = 1e3 * (first.time_s - true_first.time_s)
        row["first_voxels"] = 1e-3 * row["first_ms"] * true_first.speed_m_per_s / resolution_m
    row["blind_percent"] = blind_percent(run, truth_voxels, resolution_m)
    return row


def measure_flying(tools, scene, own, folder):
    """The share of the steps that are proved where the monitor makes the map of the clouds, without and with flying pixels, as a line."""
    proved = []
    for share in (0.0, FLYING_SHARE):
        page, monitor, bag = record(tools, scene, {**SETTINGS[0], "flying_share": share}, folder)
        del monitor["octomap_topic"]
        monitor.update(own or {}, obstacle_cloud_topic=CLOUD_TOPIC, obstacle_resolution_m=page["obstacle"]["resolution_m"])
        proved.append(analyse(tools, bag, monitor, folder, "flying").proved_percent)
    return "| %s | %.1f | %.1f | %.1f |" % (scene, *proved, proved[0] - proved[1])


def occupied_voxels(solids, resolution_m):
    """The voxels whose middles lie in boxes or rings, as make_scene_bag maps them."""
    voxels = set()
    for solid in solids:
        if "box" in solid:
            low, high = (np.array(solid["box"][end], float) for end in ("min_m", "max_m"))
        else:
            ring = solid["ring"]
            center, axis = np.array(ring["center_m"], float), np.array(ring["axis"], float) / np.linalg.norm(ring["axis"])
            low, high = (center + sign * (ring["radius_m"] + ring["tube_radius_m"]) for sign in (-1, 1))
        keys = [np.arange(np.floor(a / resolution_m) - 1, np.floor(b / resolution_m) + 2) for a, b in zip(low, high)]
        grid = np.stack(np.meshgrid(*keys, indexing="ij"), axis=-1).reshape(-1, 3)
        middles = (grid + 0.5) * resolution_m
        if "box" in solid:
            inside = ((middles >= low) & (middles <= high)).all(axis=1)
        else:
            along = (middles - center) @ axis
            out = np.linalg.norm(middles - center - along[:, None] * axis, axis=1) - ring["radius_m"]
            inside = np.hypot(along, out) <= ring["tube_radius_m"]
        voxels.update(map(tuple, grid[inside].astype(int)))
    return voxels


def record(tools, scene, setting, folder):
    """A scene's page, its monitor and its bag."""
    page, monitor = derived_page(scene, setting)
    paths = page_path, bag = [os.path.join(folder, scene + ending) for ending in (".yaml", ".bag")]
    with open(page_path, "w") as stream:
        yaml.safe_dump(page, stream)
    run_tool(tools, "make_scene_bag", *paths, "--quiet")
    return page, monitor, bag


def measure(tools, scene, own, folder):
    """The rows of a scene."""
    rows, truth = [], None
    for setting in SETTINGS:
        page, monitor, bag = record(tools, scene, setting, folder)
        resolution_m = page["obstacle"]["resolution_m"]
        if truth is None:  # the motion does not depend on the camera
            truth = analyse(tools, bag, {**monitor, "octomap_topic": TRUTH_TOPIC}, folder, "truth")
            voxels = occupied_voxels(page["obstacle"]["solids"], resolution_m)
        for kind, more in (("without", {}), ("with", own)):
            if more is None:
                continue
            run = analyse(tools, bag, {**monitor, **more}, folder, kind, shows_own=kind == "with")
            row = judge(truth, run, voxels, resolution_m)
            rows.append({"scene": scene, **setting, "own": kind, **row})
            print(table_line(rows[-1]), flush=True)
    return rows


def table_line(row):
    number = lambda name, form: form % row[name] if row.get(name) is not None else "–"
    share = lambda part, whole: "%.0f %%" % (100 * row[part] / row[whole]) if row[whole] else "–"
    return "| %s |" % " | ".join([row["scene"], "%g" % (1e3 * row["noise_m"]), "%g" % row["lag_s"], "%g" % row["rate_hz"], row["own"],
                                  share("clear", "clear_of"), "%d" % row["clear_of"], "%d" % row["true"], "%d" % row["false"],
                                  "%d" % row["false_before"], "%d of %d" % (row["missed"], row["true_alarms"]),
                                  share("in_time", "true_alarms"), number("first_ms", "%.0f"), number("first_voxels", "%.1f"),
                                  number("blind_percent", "%.1f")])


def markdown(rows):
    head = ["| " + " | ".join(COLUMNS) + " |", "|---|--:|--:|--:|---|" + "--:|" * (len(COLUMNS) - 5)]
    return "\n".join(head + [table_line(row) for row in rows]) + "\n\n" + MEANING


def required(rows):
    """Of the settings that are to be met with own voxels, whether each point is, in Markdown."""
    lines = ["| required at 3 mm, 5 maps a second | lag s | clear, 95 % | false before the first true, none | found, 95 % | in time, 95 % |",
             "|---|--:|---|---|---|---|"]
    for row in rows:
        if row["own"] != "with" or (row["noise_m"], row["rate_hz"]) != (0.003, 5.0) or row["lag_s"] > 0.1:
            continue
        most = lambda part, whole: "yes" if part >= 0.95 * whole else "no, %d of %d" % (part, whole)
        lines.append("| %s |" % " | ".join([
            row["scene"], "%g" % row["lag_s"], most(row["clear"], row["clear_of"]),
            "no, %d" % row["false_before"] if row["false_before"] else "yes",
            most(row["true_alarms"] - row["missed"], row["true_alarms"]), most(row["in_time"], row["true_alarms"])]))
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tools", required=True, help="folder of make_scene_bag and analyze_bag")
    parser.add_argument("--out", required=True, help="folder for the results")
    parser.add_argument("--own", help="parameters of the monitor (YAML) that turn own voxels on; each bag is then run with and without")
    parser.add_argument("--scenes", nargs="+", default=sorted(CELLS), choices=sorted(CELLS), help="only these")
    a = parser.parse_args()
    own = None
    if a.own:
        with open(a.own) as stream:
            own = yaml.safe_load(stream)
    os.makedirs(a.out, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        rows = [row for scene in a.scenes for row in measure(a.tools, scene, own, folder)]
        flying = [measure_flying(a.tools, scene, own, folder) for scene in a.scenes]
    with open(os.path.join(a.out, "cell.json"), "w") as stream:
        json.dump(rows, stream, indent=1)
    text = "\n".join([markdown(rows), FLYING_HEAD, *flying, ""]) + ("\n" + required(rows) if own else "")
    with open(os.path.join(a.out, "cell.md"), "w") as stream:
        stream.write(text)
    print(text, end="")


if __name__ == "__main__":
    main()
