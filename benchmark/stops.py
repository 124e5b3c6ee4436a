#!/usr/bin/env python3
"""What examples/stop_the_arm would have done: its rule over the results that analyze_bag writes of recorded scenes.

For each patch that begins and is not expected: whether the arm was told to stop before it began, and how long before. What
was not foreseen by any prediction is told apart: the straight way on from the last two frames did not lead there.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile

CHECKOUT = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))
sys.path.insert(0, os.path.join(CHECKOUT, "examples"))
COLUMNS = ("scene", "new patches", "stopped in time", "lead ms: median", "least", "late", "not foreseeable", "stops", "false stops",
           "share of time stopped")


def record(tools, scene, folder, look_ahead_s, loops):
    """The results of a scene, of `loops` rounds of it, as a bag."""
    import yaml
    name = os.path.splitext(os.path.basename(scene))[0]
    bag, params, out = (os.path.join(folder, name + ending) for ending in (".bag", ".yaml", "_results.bag"))
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.run([os.path.join(tools, "make_scene_bag"), scene, bag, "--monitor-config", params, "--quiet"], check=True, **quiet)
    with open(params) as stream:
        monitor = yaml.safe_load(stream)
    monitor["look_ahead_s"] = look_ahead_s
    monitor.setdefault("effects", {})["look_ahead"] = "auto"
    with open(params, "w") as stream:
        yaml.safe_dump(monitor, stream)
    if loops > 1:
        bag = looped(bag, loops)
    done = subprocess.run([os.path.join(tools, "analyze_bag"), bag, "--params", params, "--output", out, "--report",
                           os.path.join(folder, name), "--quiet"], **quiet)
    if done.returncode not in (0, 3):
        sys.exit("analyze_bag ended with %d on %s" % (done.returncode, name))
    return out


def looped(bag, loops):
    """The same messages again and again, as rosbag play --loop sends them: stamps go back at each turn."""
    import rosbag
    path = bag[:-4] + "_looped.bag"
    with rosbag.Bag(bag) as source, rosbag.Bag(path, "w") as target:
        duration = source.get_end_time() - source.get_start_time()
        for turn in range(loops):
            for topic, message, stamp in source.read_messages():
                target.write(topic, message, stamp + type(stamp - stamp).from_sec(turn * (duration + 1.0 / 30)))
    return path


def decisions(results, rule):
    """(time, reason) after each message, and the beginnings: (when told, message)."""
    import rosbag
    told, began = [], []
    with rosbag.Bag(results) as bag:
        for topic, message, stamp in bag.read_messages():
            now = stamp.to_sec()
            if topic.endswith("/state"):
                rule.on_state(now, message)
            elif topic.endswith("/time_to_contact"):
                rule.on_prediction(now, message)
            elif topic.endswith("/events") and message.kind == message.BEGAN and message.beginning == message.expected == 0:
                began.append((now, message))
            else:
                continue
            told.append((now, rule.reason_to_stop(now), rule.prediction[1]))
    return told, began


def judge(told, began, stopping_time_s):
    """Of one scene, what the table says."""
    stops, row = [], dict.fromkeys(("stopped", "late", "unforeseen"), 0)
    for now, reason, _ in told:
        if reason and (not stops or stops[-1][1] is not None):
            stops.append([now, None, reason])
        elif not reason and stops and stops[-1][1] is None:
            stops[-1][1] = now
    for stop in stops:
        stop[1] = told[-1][0] if stop[1] is None else stop[1]
    leads, seen = [], set()
    for now, event in began:
        # The stamps of a loop repeat, the time at which it was told does not: a step is told at its end.
        at = now - (event.header.stamp - event.earliest).to_sec()
        before = [stop for stop in stops if stop[0] < at <= stop[1]]
        if before:
            row["stopped"] += 1
            leads.append(at - before[0][0])
            seen.add(before[0][0])
            continue
        predictions = [p for t, _, p in told if t <= at and p is not None and p.answered]
        foreseen = predictions and predictions[-1].contact and predictions[-1].seconds <= stopping_time_s
        row["late" if foreseen else "unforeseen"] += 1
        seen.update(stop[0] for stop in stops if abs(stop[0] - at) < 0.1)
    threats = [stop for stop in stops if "contact" in stop[2] or "touches" in stop[2]]
    span = told[-1][0] - told[0][0] if told else 0
    row.update(patches=len(began), leads_ms=[1e3 * lead for lead in leads], stops=len(stops),
               false=sum(stop[0] not in seen for stop in threats),
               share=sum(stop[1] - stop[0] for stop in stops) / span if span else 0)
    return row


def markdown(rows):
    lines = ["| " + " | ".join(COLUMNS) + " |", "|---|" + "--:|" * (len(COLUMNS) - 1)]
    for name, r in rows.items():
        leads = r["leads_ms"]
        lines.append("| %s | %d | %d | %s | %s | %d | %d | %d | %d | %.0f %% |" % (
            name, r["patches"], r["stopped"], "%.0f" % statistics.median(leads) if leads else "–", "%.0f" % min(leads) if leads else "–",
            r["late"], r["unforeseen"], r["stops"], r["false"], 100 * r["share"]))
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tools", required=True, help="folder of make_scene_bag and analyze_bag")
    parser.add_argument("--out", required=True, help="folder for the results")
    parser.add_argument("--look-ahead", type=float, default=0.3, help="[s] horizon of the predictions")
    parser.add_argument("--stopping-time", type=float, default=0.15, help="[s] from a frame to the arm standing still")
    parser.add_argument("--hold", type=float, default=0.5, help="[s] how long a new contact, or the threat of one, holds the arm")
    parser.add_argument("--loops", type=int, default=3, help="of the demo's scene, one after the other")
    a = parser.parse_args()
    from stop_the_arm import StopRule
    rows = {}
    scenes = os.path.join(CHECKOUT, "config", "scenes")
    with tempfile.TemporaryDirectory() as folder:
        for name in sorted(n[:-5] for n in os.listdir(scenes) if n.endswith(".yaml")):
            loops = a.loops if name == "table_edge" else 1
            results = record(a.tools, os.path.join(scenes, name + ".yaml"), folder, a.look_ahead, loops)
            told, began = decisions(results, StopRule(a.stopping_time, max_age_s=0.2, hold_s=a.hold))
            rows[name + (", %d times" % loops if loops > 1 else "")] = judge(told, began, a.stopping_time)
    os.makedirs(a.out, exist_ok=True)
    with open(os.path.join(a.out, "stops.json"), "w") as stream:
        json.dump(rows, stream, indent=1)
    with open(os.path.join(a.out, "stops.md"), "w") as stream:
        stream.write(markdown(rows))
    print(markdown(rows), end="")


if __name__ == "__main__":
    main()
