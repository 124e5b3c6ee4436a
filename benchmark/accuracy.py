#!/usr/bin/env python3
"""What accuracy costs in time: every rung on whole steps and per pair, as CSV, JSON, a table and a plot.

The whole step: step_settings runs all settings in turns on the real scenes; answers are held against the scenes' truth
before a time is printed. Per pair: accuracy_pairs on hard queries and on what the filters leave of the scenes, `fast` and
FCL's elementary tests in the same run.
"""
import argparse
import csv
import gzip
import json
import math
import os
import platform
import subprocess
import sys
import tempfile

STEP_COLUMNS = ["scene", "setting", "contacts", "missed", "false", "undecided", "toc_error", "best_ms", "median_ms",
                "ratio_low", "ratio", "ratio_high", "rounds"]
# Measured apart, on a machine of this kind: one core, the same steps, all contacts. Seconds and false contacts.
APART = {"cloth-ball": [("additive CCD (ipc-toolkit)", 3.3, 137872), ("Tight-Inclusion 1e-6", 47.0, 20)],
         "n-body": [("additive CCD (ipc-toolkit)", 2.0, None), ("Tight-Inclusion 1e-6", 29.9, None)]}
# The same of hard queries: microseconds a pair, wrong answers of 7,279.
APART_HARD = [("additive CCD (ipc-toolkit)", 3.4, 573), ("Tight-Inclusion 1e-3", 65.0, 454), ("Tight-Inclusion 1e-6", 4570.0, 222)]
HARD_QUERIES_APART = 7279


def write_truth(scene_dir, path):
    """The scene's contacts and, where others found them, their times, as step_settings reads them."""
    with open(path, "w") as out:
        for kind, name in (("VF", "vf.txt.gz"), ("EE", "ee.txt.gz"), ("VF", "toc_vf.txt.gz")):
            if not os.path.exists(os.path.join(scene_dir, name)):
                continue
            with gzip.open(os.path.join(scene_dir, name), "rt") as lines:
                for line in lines:
                    row = line.split()
                    if line.startswith("#"):
                        continue
                    if name.startswith("toc"):
                        out.write("%s %s\n" % (kind, " ".join(row[:5])))
                    elif int(row[4]):
                        out.write("%s %s\n" % (kind, " ".join(row[:4])))


def whole_steps(tools, scenes, repeat):
    """All settings in turns within one process, held against the scenes' truth."""
    rows, details = [], {}
    for scene in scenes:
        name = os.path.basename(scene.rstrip("/"))
        with tempfile.TemporaryDirectory() as folder:
            truth, stats = os.path.join(folder, "truth.txt"), os.path.join(folder, "stats.json")
            write_truth(scene, truth)
            frames = [os.path.join(scene, "frame_%d.ply" % i) for i in (0, 1)]
            done = subprocess.run([os.path.join(tools, "step_settings"), *frames, "--truth", truth, "--stats", stats,
                                   "--rounds", str(repeat)], stdout=subprocess.PIPE, universal_newlines=True)
            if done.returncode != 0:
                sys.exit("step_settings ended with %d" % done.returncode)
            print(name + ": " + done.stdout, flush=True)
            with open(stats) as f:
                details[name] = json.load(f)
        for setting, s in sorted(details[name].items(), key=lambda item: item[0]):
            if setting.startswith("exact") and (s["missed"] or s["false"] or s["undecided"]):
                sys.exit("%s on %s: %d missed, %d false, %d undecided; no time is printed for wrong answers"
                         % (setting, name, s["missed"], s["false"], s["undecided"]))
            rows.append(dict(zip(STEP_COLUMNS, [name, setting, s["contacts"], s["missed"], s["false"], s["undecided"], s["toc_error"],
                                                s["ms"]["total"]["best"], s["ms"]["total"]["median"], s["ratio"]["low"],
                                                s["ratio"]["median"], s["ratio"]["high"], s["rounds"]])))
    order = ["conservative 1e-3", "conservative 1e-6", "conservative 1e-9", "exact 2^-10", "exact 2^-32", "exact 2^-52"]
    rows.sort(key=lambda r: (r["scene"], order.index(r["setting"])))
    return rows, details


def add_second_run(rows, again):
    """What the same settings took in another process, and whether both runs' intervals of the ratio have a value in common."""
    for row, other in zip(rows, again):
        row.update({"again_" + name: other[name] for name in ("median_ms", "ratio_low", "ratio", "ratio_high")})
        row["agree"] = row["ratio_low"] <= other["ratio_high"] and other["ratio_low"] <= row["ratio_high"]
        if not row["agree"]:
            print("%s on %s: the two runs do not agree" % (row["setting"], row["scene"]), flush=True)


def with_rivals(details, pairs):
    """A row for each scene and rival: its elementary tests in the place of ours, behind the same filters."""
    rows = []
    for scene, rival in ((scene, rival) for scene in details for rival in ("fast", "FCL")):
        exact = details[scene]["exact 2^-32"]
        mine = [r for r in pairs if r["source"] == scene + " survivors" and r["rung"] == rival]
        if not mine:
            continue
        tests_ms = sum(int(r["pairs"]) * float(r["median_ns"]) * 1e-6 for r in mine)
        rows.append({"scene": scene, "setting": rival + "'s tests", "missed": sum(int(r["missed"]) for r in mine),
                     "false": sum(int(r["false_contacts"]) for r in mine), "toc_error": max(float(r["max_toc_error"]) for r in mine),
                     "median_ms": exact["ms"]["total"]["median"] - exact["ms"]["elementary"]["median"] + tests_ms})
    return rows


def per_pair(tools, queries, scenes, repeat):
    arguments = [queries] + [a for s in scenes for a in
                             ("--scene", os.path.basename(s.rstrip("/")), os.path.join(s, "frame_0.ply"), os.path.join(s, "frame_1.ply"))]
    text = subprocess.run([os.path.join(tools, "accuracy_pairs"), *arguments, "--repeat", str(repeat)], check=True,
                          stdout=subprocess.PIPE, universal_newlines=True).stdout
    print(text, end="")
    return list(csv.DictReader(text.splitlines()))


def studies(tools, bags, out):
    """What fewer frames, triangles and voxels do to first contacts."""
    found = {}
    for given in bags:
        bag, _, params = given.partition(":")
        name = os.path.splitext(os.path.basename(bag))[0]
        folder = os.path.join(out, name)
        command = [os.path.join(tools, "analyze_bag"), bag, "--report", folder, "--accuracy-study"]
        done = subprocess.run(command + (["--params", params] if params else []), stdout=subprocess.DEVNULL)
        if done.returncode not in (0, 3):  # 3: not all of the recording is proved
            sys.exit("analyze_bag ended with %d" % done.returncode)
        with open(os.path.join(folder, "report.json")) as f:
            found[name] = json.load(f)["study"]
        print("%s: %s" % (name, found[name]["sentence"]), flush=True)
    return found


def study_tables(found):
    lines = []
    for name, study in found.items():
        lines += ["", "*%s.* %s" % (name, study["sentence"]), "",
                  "| varied | | ms a second | time | patches missed, invented | error, median | 95 % | early, late | vertices missed, invented | "
                  "error, median | 95 % |", "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|"]
        for r in study["rows"]:
            lines.append("| %s | %s | %.3g | %.0f %% | %d, %d of %d | %.2g | %.3g | %.3g, %.3g | %d, %d of %d | %.2g | %.3g |" % (
                r["varied"], r["setting"], r["ms_per_s"], 100 * r["share_of_time"], r["patches_missed"], r["patches_invented"],
                r["patches_touched"], r["patches_median_ms"], r["patches_p95_ms"], r["patches_early_ms"], r["patches_late_ms"],
                r["vertices_missed"], r["vertices_invented"], r["vertices_touched"], r["vertices_median_ms"], r["vertices_p95_ms"]))
    return "\n".join(lines) + "\n" if lines else ""


def write_csv(path, rows):
    with open(path, "w", newline="") as f:
        writer = csv.DictWriter(f, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def front(rows):
    """Those that nobody beats in both time and error, of those that get nothing wrong."""
    best, kept = float("inf"), []
    for r in sorted((r for r in rows if not r["missed"] and not r["false"] and not r.get("undecided")), key=lambda r: r["median_ms"]):
        if r["toc_error"] < best:
            best = r["toc_error"]
            kept.append(r)
    return kept


def short_names(settings):
    """Marks that lie on one another share a label: "conservative 1e-3, 1e-6"."""
    rungs = {}
    for setting in settings:
        rung, _, more = setting.partition(" ")
        rungs.setdefault(rung, []).append(more)
    return "; ".join((rung + " " + ", ".join(more)).strip() for rung, more in rungs.items())


def label(axes, rows, line):
    """A name beside each mark, below the front's line where that goes on beside it; one name for marks that are nearer to each other
    than a name is high."""
    groups = []
    for r in sorted(rows, key=lambda r: r["median_ms"]):
        near = [g for g in groups if abs(math.log10(g[0]["toc_error"] / r["toc_error"])) < 0.8
                and r["median_ms"] < 1.25 * g[0]["median_ms"]]
        near[0].append(r) if near else groups.append([r])
    for group in groups:
        goes_on = any(a is group[0] and b["median_ms"] > 1.25 * a["median_ms"] for a, b in zip(line, line[1:]))
        axes.annotate(short_names(r["setting"] for r in rows if r in group), (max(r["median_ms"] for r in group), group[0]["toc_error"]),
                      xytext=(10, -11 if goes_on else -3), textcoords="offset points", fontsize=7)


def plot_recordings(axes, studies):
    """What each rung takes on recordings as a user has them, and below what else can be had coarser: a mark a recording."""
    def shown(study):
        return sorted((r for r in study["rows"] if r["varied"] in ("rung", "frames", "mesh", "map")), key=lambda r: r["varied"] != "rung")

    settings = list(dict.fromkeys((r["varied"], r["setting"]) for study in studies.values() for r in shown(study)))
    for k, (name, study) in enumerate(studies.items()):
        for r in shown(study):
            at = 100 * r["share_of_time"], settings.index((r["varied"], r["setting"])) + 0.3 * (k / max(1, len(studies) - 1) - 0.5)
            axes.plot(*at, color="C%d" % (k + 2), marker="o", linestyle="none", label=None if r["varied"] != "rung" else name)
            if r["patches_missed"] or r["patches_invented"]:
                axes.annotate("%d missed, %d invented" % (r["patches_missed"], r["patches_invented"]), at, xytext=(6, -3), textcoords="offset points", fontsize=7)
    axes.set_yticks(range(len(settings)))
    axes.set_yticklabels(" ".join(s) for s in settings)
    axes.invert_yaxis()
    axes.axvline(100, color="black", linewidth=0.8)
    axes.set(xscale="log", xlim=(None, 200 * max(r["share_of_time"] for study in studies.values() for r in shown(study))), xlabel="time on a recording [% of its most accurate setting's]", title="Rungs on recordings, and what else can be had coarser")
    names = dict(zip(*reversed(axes.get_legend_handles_labels())))
    axes.legend(names.values(), names.keys(), fontsize=8)


def plot_errors(axes, scene, steps, colour):
    """Time across, error up, of one real step. A mark a setting."""
    mine = [r for r in steps if r["scene"] == scene]
    line = front(mine)
    axes.plot([r["median_ms"] for r in line], [r["toc_error"] for r in line], color=colour, linewidth=0.8, drawstyle="steps-post")
    for r in mine:
        axes.plot(r["median_ms"], r["toc_error"], color=colour, linestyle="none", markersize=6, marker="o" if r["setting"].startswith("exact") else "s")
    label(axes, mine, line)
    times = [r["median_ms"] for r in mine]
    axes.set(yscale="log", xscale="log", xlim=(0.85 * min(times), 2.2 * max(times)), title="Rungs on one step of " + scene,
             xlabel="whole step, one thread, median [ms]")


def plot_wrong(axes, steps, rivals):
    """The same times against the number of wrong answers, with what others were measured at."""
    for k, scene in enumerate(dict.fromkeys(r["scene"] for r in steps)):
        for r in [r for r in steps + rivals if r["scene"] == scene]:
            for what, marker in (("missed", "x"), ("false", "o")):
                axes.plot(r["median_ms"], r[what], color="C%d" % k, marker=marker, fillstyle="none", linestyle="none")
        axes.plot([], [], color="C%d" % k, marker="o", linestyle="none", label=scene)
        for name, seconds, false in APART.get(scene, []):
            if false is None:
                continue
            axes.plot(1e3 * seconds, false, color="C%d" % k, marker="o", fillstyle="none", linestyle="none", alpha=0.5)
            axes.annotate(name + ", measured apart", (1e3 * seconds, false), xytext=(-6, -11), ha="right", textcoords="offset points", fontsize=7)
    axes.annotate("conservative, exact", (max(r["median_ms"] for r in steps), 0), xytext=(9, 1), textcoords="offset points", fontsize=7)
    axes.legend(fontsize=8, loc="center")
    for r in rivals:
        axes.annotate(r["setting"], (r["median_ms"], max(r["missed"], r["false"])), xytext=(7, 0), textcoords="offset points", fontsize=7)
    axes.set_yscale("symlog", linthresh=1)
    axes.set_ylim(bottom=-0.3)
    axes.set(xscale="log", xlabel="whole step, one thread, median [ms]", ylabel="x missed, o invented")


def plot_hard(axes, pairs):
    """One pair at a time, of those that are made to be hard: microseconds against the share of wrong answers."""
    mine = [r for r in pairs if r["source"] == "hard queries"]
    right = []  # rungs without a wrong answer share a label
    for rung in dict.fromkeys(r["rung"] for r in mine):
        rows = [r for r in mine if r["rung"] == rung]
        count = sum(int(r["pairs"]) for r in rows)
        us = sum(int(r["pairs"]) * float(r["median_ns"]) for r in rows) / count * 1e-3
        wrong = sum(int(r["missed"]) + int(r["false_contacts"]) for r in rows) / count
        axes.plot(us, wrong, color="C2", marker="o" if rung.startswith("exact") else "^" if rung == "FCL" else "s", linestyle="none")
        if wrong:
            axes.annotate(rung, (us, wrong), xytext=(8, -2), textcoords="offset points", fontsize=7)
        else:
            right.append((us, rung))
    if right:
        axes.annotate(short_names(rung for _, rung in right), (max(right)[0], 0), xytext=(8, -2), textcoords="offset points", fontsize=7)
    for k, (name, us, wrong) in enumerate(APART_HARD):
        axes.plot(us, wrong / HARD_QUERIES_APART, color="C2", marker="o", fillstyle="none", linestyle="none", alpha=0.5)
        # They lie at about one height: names to the left and to the right in turns.
        axes.annotate(name + ", measured apart", (us, wrong / HARD_QUERIES_APART), xytext=((8, -2) if k % 2 else (-8, -2)),
                      ha="left" if k % 2 else "right", textcoords="offset points", fontsize=7)
    axes.set_yscale("symlog", linthresh=1e-3)
    axes.set_ylim(bottom=-3e-4)
    axes.set(xscale="log", xlabel="one pair of the hard queries [us]", ylabel="share of wrong answers")


def plot(found, folder):
    import matplotlib
    matplotlib.use("Agg")
    matplotlib.rcParams["svg.fonttype"] = "none"  # names as text, a tenth of the file
    import matplotlib.pyplot as plt
    import matplotlib.ticker
    figure = plt.figure(figsize=(9, 13))
    grid = figure.add_gridspec(4, 2, height_ratios=(4, 4, 3, 3))
    plot_recordings(figure.add_subplot(grid[0, :]), found["studies"])
    upper = []
    for k, scene in enumerate(list(dict.fromkeys(r["scene"] for r in found["steps"]))[:2]):
        upper.append(figure.add_subplot(grid[1, k], sharey=upper[0] if upper else None))
        plot_errors(upper[k], scene, found["steps"], "C%d" % k)
    upper[0].set_ylabel("largest error of a time of contact [step]")
    wrong, hard = (figure.add_subplot(grid[row, :]) for row in (2, 3))
    plot_wrong(wrong, found["steps"], found["rivals"])
    plot_hard(hard, found["pairs"])
    wrong.set_title("Rivals, on the same steps")
    hard.set_title("Rivals, on hard pairs")
    for axes in figure.axes:
        axes.xaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 1.5, 2, 3, 5, 6, 8) if axes in upper else (1, 5) if axes is hard else (1, 2, 5)))
        axes.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())
        axes.xaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda value, _: "%g" % value))
        axes.grid(True, linewidth=0.3)
        for name in axes.texts:  # readable on the front's line
            name.set_bbox({"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.5})
    figure.tight_layout()
    for ending in ("svg", "png"):
        figure.savefig(os.path.join(folder, "accuracy." + ending), dpi=110)


def markdown(rows, rivals, pairs):
    """The tables of doc/accuracy.md."""
    lines = ["| scene | setting | contacts | missed | false | undecided | error of the TOC up to | median ms | ratio, 95 % | again: ms | ratio, 95 % |",
             "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|"]
    for r in rows:
        lines.append("| %s | `%s` | %d | %d | %d | %d | %.0e | %.1f | %.3f [%.3f, %.3f] | %.1f | %.3f [%.3f, %.3f] |" %
                     tuple(r[c] for c in ("scene", "setting", "contacts", "missed", "false", "undecided", "toc_error", "median_ms",
                                          "ratio", "ratio_low", "ratio_high", "again_median_ms", "again_ratio", "again_ratio_low",
                                          "again_ratio_high")))
    lines += ["", "| scene | | missed | false | error of the TOC up to | median ms |", "|---|---|--:|--:|--:|--:|"]
    for r in rivals:
        lines.append("| %s | %s | %d | %d | %.0e | %.1f |" %
                     tuple(r[c] for c in ("scene", "setting", "missed", "false", "toc_error", "median_ms")))
    columns = [(s, k) for s in dict.fromkeys(r["source"] for r in pairs) for k in ("VF", "EE")]
    lines += ["", "| ns | " + " | ".join("%s, %s" % c for c in columns) + " |", "|---|" + "--:|" * len(columns)]
    for rung in dict.fromkeys(r["rung"] for r in pairs):
        cells = []
        for column in columns:
            r = next(r for r in pairs if (r["source"], r["kind"], r["rung"]) == (*column, rung))
            wrong = int(r["missed"]) + int(r["false_contacts"])
            cells.append("%.0f" % float(r["median_ns"]) + (" (%s wrong)" % format(wrong, ",") if wrong else ""))
        lines.append("| %s | %s |" % (rung, " | ".join(cells)))
    return "\n".join(lines) + "\n"


def measured(a):
    scenes = [os.path.join(a.data, "scenes", s) for s in ("cloth-ball", "n-body")]
    steps, details = whole_steps(a.tools, scenes, a.rounds)
    add_second_run(steps, whole_steps(a.tools, scenes, a.rounds)[0])
    pairs = per_pair(a.tools, os.path.join(a.data, "ccd_queries"), scenes, a.repeat)
    return {"machine": platform.processor() or platform.machine(), "repeat": a.repeat, "steps": steps, "rivals": with_rivals(details, pairs),
            "stages": details, "pairs": pairs, "studies": studies(a.tools, a.study, a.out)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tools", help="folder of step_settings, accuracy_pairs and, for --study, analyze_bag")
    parser.add_argument("--data", required=True, help="folder with ccd_queries/ and scenes/")
    parser.add_argument("--study", action="append", default=[],
                        help="a recording, or RECORDING:PARAMETERS, to study with fewer frames, vertices and voxels; repeatable")
    parser.add_argument("--out", required=True, help="folder for the results")
    parser.add_argument("--repeat", type=int, default=15, help="of the elementary tests alone")
    parser.add_argument("--rounds", type=int, default=60, help="at most, of the whole step; fewer where the ratios are known to 2 %%")
    parser.add_argument("--reuse", action="store_true", help="measure nothing: draw what accuracy.json in that folder has")
    a = parser.parse_args()
    os.makedirs(a.out, exist_ok=True)
    path = os.path.join(a.out, "accuracy.json")
    if not a.reuse:
        with open(path, "w") as f:
            json.dump(measured(a), f, indent=1)
    with open(path) as f:
        found = json.load(f)
    write_csv(os.path.join(a.out, "accuracy_steps.csv"), found["steps"])
    write_csv(os.path.join(a.out, "accuracy_pairs.csv"), found["pairs"])
    with open(os.path.join(a.out, "accuracy.md"), "w") as f:
        f.write(markdown(found["steps"], found["rivals"], found["pairs"]) + study_tables(found["studies"]))
    plot(found, a.out)
    print("results: " + a.out)


if __name__ == "__main__":
    main()
