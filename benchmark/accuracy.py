#!/usr/bin/env python3
"""What accuracy costs in time: every rung on whole steps and per pair, as CSV, JSON, a table and a plot.

The whole step: check_step on the real scenes; answers are held against the scenes' truth before a time is printed.
Per pair: accuracy_pairs on hard queries and on what the filters leave of the scenes, FCL's elementary tests in the same run.
"""
import argparse
import csv
import gzip
import json
import os
import platform
import subprocess
import sys
import tempfile

RUNGS = [
    ("screen", ["--accuracy", "screen"]),
    ("fast", ["--accuracy", "fast"]),
    ("conservative 1e-3", ["--accuracy", "conservative", "--tolerance", "1e-3"]),
    ("conservative 1e-6", ["--accuracy", "conservative", "--tolerance", "1e-6"]),
    ("conservative 1e-9", ["--accuracy", "conservative", "--tolerance", "1e-9"]),
    ("exact 2^-10", ["--accuracy", "exact", "--toc-bits", "10"]),
    ("exact 2^-32", ["--accuracy", "exact", "--toc-bits", "32"]),
    ("exact 2^-52", ["--accuracy", "exact", "--toc-bits", "52"]),
]
STEP_COLUMNS = ["scene", "rung", "reported", "missed", "false", "undecided", "max_toc_error", "best_ms", "median_ms"]


def normal(kind, v):
    """A pair whatever the order of its vertices."""
    if kind == "VF":
        return (kind, v[0]) + tuple(sorted(v[1:]))
    return (kind,) + tuple(sorted((tuple(sorted(v[:2])), tuple(sorted(v[2:])))))


def truth(scene_dir):
    pairs = set()
    for kind, name in (("VF", "vf.txt.gz"), ("EE", "ee.txt.gz")):
        with gzip.open(os.path.join(scene_dir, name), "rt") as lines:
            for line in lines:
                if line.startswith("#"):
                    continue
                row = [int(x) for x in line.split()]
                if row[4]:
                    pairs.add(normal(kind, row[:4]))
    return pairs


def contacts(path):
    with open(path, newline="") as f:
        return {normal(r["kind"], [int(r["v%d" % i]) for i in range(4)]): r for r in csv.DictReader(f)}


def check_step(tools, scene_dir, arguments, repeat, folder):
    frames = [os.path.join(scene_dir, "frame_%d.ply" % i) for i in (0, 1)]
    out, stats = os.path.join(folder, "contacts.csv"), os.path.join(folder, "stats.json")
    done = subprocess.run([os.path.join(tools, "check_step"), *frames, "--contacts", out, "--stats", stats,
                           "--no-start-state", "--repeat", str(repeat), *arguments], stdout=subprocess.DEVNULL)
    if done.returncode not in (0, 3):  # 3: not proved, as nothing is without the start state
        sys.exit("check_step ended with %d" % done.returncode)
    with open(stats) as f:
        return contacts(out), json.load(f)


def whole_steps(tools, scenes, repeat):
    rows, stages = [], {}
    with tempfile.TemporaryDirectory() as folder:
        for scene in scenes:
            name, true_pairs = os.path.basename(scene.rstrip("/")), truth(scene)
            finest, _ = check_step(tools, scene, RUNGS[-1][1], 1, folder)
            for rung, arguments in RUNGS:
                found, stats = check_step(tools, scene, arguments, repeat, folder)
                missed, false = len(true_pairs - found.keys()), 0
                undecided, error = 0, 0.0
                for pair, row in found.items():
                    if row["certainty"] == "undecided":
                        undecided += 1
                    elif pair not in true_pairs:
                        false += 1
                    if pair in finest:
                        error = max(error, abs(float(finest[pair]["toc_lower"]) - float(row["toc_lower"])))
                if rung.startswith("exact") and (missed or false or undecided):
                    sys.exit("%s on %s: %d missed, %d false, %d undecided; no time is printed for wrong answers"
                             % (rung, name, missed, false, undecided))
                rows.append(dict(zip(STEP_COLUMNS, [name, rung, len(found), missed, false, undecided, error,
                                                    stats["ms"]["total"]["best"], stats["ms"]["total"]["median"]])))
                stages["%s, %s" % (name, rung)] = {"ms": stats["ms"], "pairs": stats["pairs"], "tiers": stats["tiers"],
                                                   "simd_target": stats["simd_target"]}
                print("%-11s %-18s %7d reported %5d missed %6d false %7d undecided  toc error %-9.2g %8.1f ms (median %.1f)"
                      % (name, rung, len(found), missed, false, undecided, error, rows[-1]["best_ms"], rows[-1]["median_ms"]),
                      flush=True)
    return rows, stages


def per_pair(tools, queries, scenes, repeat):
    arguments = [queries] + [a for s in scenes for a in
                             ("--scene", os.path.basename(s.rstrip("/")), os.path.join(s, "frame_0.ply"), os.path.join(s, "frame_1.ply"))]
    text = subprocess.run([os.path.join(tools, "accuracy_pairs"), *arguments, "--repeat", str(repeat)], check=True,
                          stdout=subprocess.PIPE, universal_newlines=True).stdout
    print(text, end="")
    return list(csv.DictReader(text.splitlines()))


def recordings(tools, bags):
    """Every rung over whole recordings (mesh against itself and an octomap), by analyze_bag's own table."""
    rows = []
    for bag in bags:
        name = os.path.splitext(os.path.basename(bag))[0]
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([os.path.join(tools, "analyze_bag"), bag, "--report", folder, "--quiet"], check=True,
                           stdout=subprocess.DEVNULL)
            with open(os.path.join(folder, "report.json")) as f:
                report = json.load(f)
        for r in report["rungs"]:
            rows.append({"recording": name, **r})
            print("%-14s %-13s %5d steps %7d reported %5d missed %6d false %7d undecided  toc error %-9.2g %7.2f ms (95 %%: %.2f)"
                  % (name, r["rung"], r["steps"], r["contacts"], r["missed"], r["false"], r["undecided"], r["max_toc_error"],
                     r["median_ms"], r["p95_ms"]), flush=True)
    return rows


def write_csv(path, rows):
    with open(path, "w", newline="") as f:
        writer = csv.DictWriter(f, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def plot_steps(axes, steps):
    """A line a rung and scene: from the best run to the median one; what is wrong stands beside it."""
    rungs = list(dict.fromkeys(r["rung"] for r in steps))
    scenes = list(dict.fromkeys(r["scene"] for r in steps))
    for k, scene in enumerate(scenes):
        for r in (r for r in steps if r["scene"] == scene):
            y = rungs.index(r["rung"]) + 0.28 * (k - 0.5 * (len(scenes) - 1))
            first = r["rung"] == rungs[0]
            axes.plot([r["best_ms"], r["median_ms"]], [y, y], color="C%d" % k, marker="|", linewidth=4, solid_capstyle="butt",
                      label=scene if first else None)
            wrong = ["%d missed" % r["missed"]] * (r["missed"] > 0) + ["%d false" % r["false"]] * (r["false"] > 0)
            wrong += ["all undecided"] * (r["undecided"] == r["reported"] > 0)
            axes.annotate(", ".join(wrong + ["TOC to %.0e" % max(r["max_toc_error"], 2.0 ** -52)]), (r["median_ms"], y), xytext=(6, -3),
                          textcoords="offset points", fontsize=7, color="firebrick" if wrong else "dimgray")
    axes.set_yticks(range(len(rungs)), rungs)
    axes.invert_yaxis()
    low, high = min(r["best_ms"] for r in steps), max(r["median_ms"] for r in steps)
    axes.set(xscale="log", xlim=(0.85 * low, 2.1 * high), xlabel="whole step, one thread: best to median [ms]",
             title="A step with 92,230 and one with 146,480 triangles")
    axes.legend(fontsize=8, loc="lower right")


def plot_pairs(axes, pairs):
    rungs = list(dict.fromkeys(r["rung"] for r in pairs))
    for k, source in enumerate(dict.fromkeys(r["source"] for r in pairs)):
        for kind, marker in (("VF", "^"), ("EE", "o")):
            mine = [r for r in pairs if r["source"] == source and r["kind"] == kind]
            wrong = [int(r["missed"]) + int(r["false_contacts"]) for r in mine]
            x, y = [float(r["median_ns"]) for r in mine], [rungs.index(r["rung"]) for r in mine]
            axes.plot(x, y, color="C%d" % k, marker=marker, linestyle="none", fillstyle="none", label="%s, %s" % (source, kind))
            axes.plot([v for v, n in zip(x, wrong) if n], [v for v, n in zip(y, wrong) if n], color="C%d" % k, marker=marker,
                      linestyle="none")
    axes.set_yticks(range(len(rungs)), rungs)
    axes.invert_yaxis()
    axes.set(xscale="log", xlabel="elementary test, median of a pair [ns]", title="Filled: some answers are wrong")
    axes.legend(fontsize=7, loc="upper right")


def plot(steps, pairs, folder):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import matplotlib.ticker
    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4.8))
    plot_steps(left, steps)
    plot_pairs(right, pairs)
    for axes in (left, right):
        axes.xaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
        axes.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())
        axes.xaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda value, _: "%g" % value))
        axes.grid(True, axis="x", linewidth=0.3)
    figure.tight_layout()
    for ending in ("svg", "png"):
        figure.savefig(os.path.join(folder, "accuracy." + ending), dpi=130)


def markdown(rows):
    lines = ["| scene | rung | reported | missed | false | undecided | worst TOC error | ms, best | ms, median |",
             "|---|---|--:|--:|--:|--:|--:|--:|--:|"]
    for r in rows:
        lines.append("| %s | %s | %d | %d | %d | %d | %.1e | %.1f | %.1f |" % tuple(r[c] for c in STEP_COLUMNS))
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tools", required=True, help="folder of check_step and accuracy_pairs")
    parser.add_argument("--data", required=True, help="folder with ccd_queries/ and scenes/")
    parser.add_argument("--bag", action="append", default=[], help="a recording, repeatable; needs analyze_bag among the tools")
    parser.add_argument("--out", required=True, help="folder for the results")
    parser.add_argument("--repeat", type=int, default=15)
    a = parser.parse_args()
    os.makedirs(a.out, exist_ok=True)
    scenes = [os.path.join(a.data, "scenes", s) for s in ("cloth-ball", "n-body")]
    steps, stages = whole_steps(a.tools, scenes, a.repeat)
    bags = recordings(a.tools, a.bag)
    pairs = per_pair(a.tools, os.path.join(a.data, "ccd_queries"), scenes, a.repeat)
    write_csv(os.path.join(a.out, "accuracy_steps.csv"), steps)
    write_csv(os.path.join(a.out, "accuracy_pairs.csv"), pairs)
    if bags:
        write_csv(os.path.join(a.out, "accuracy_recordings.csv"), bags)
    with open(os.path.join(a.out, "accuracy.json"), "w") as f:
        json.dump({"machine": platform.processor() or platform.machine(), "repeat": a.repeat, "steps": steps, "stages": stages,
                   "recordings": bags, "pairs": pairs}, f, indent=1)
    with open(os.path.join(a.out, "accuracy.md"), "w") as f:
        f.write(markdown(steps))
    plot(steps, pairs, a.out)
    print("results: " + a.out)


if __name__ == "__main__":
    main()
