"""Pages, tables and plots of the benchmarks that are not the paper's."""

import csv
import os

from .paper_report import table


def write_rows(path, header, rows):
    with open(path, "w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(header)
        writer.writerows(rows)


def save(folder, name, text):
    with open(os.path.join(folder, name + ".md"), "w") as out:
        out.write(text)
    return text


def pyplot():
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    return plt


def write_kernels(folder, result):
    medians = {}
    for b in result["benchmarks"]:
        name = b["run_name"]
        medians.setdefault(name, {})[b.get("aggregate_name", "median")] = b
    rows = []
    for name, by_aggregate in medians.items():
        b = by_aggregate["median"]
        unit = "pair" if "ns_per_pair" in b else "vertex"
        deviation = by_aggregate.get("stddev", {}).get("real_time", 0.0) / max(1e-12, b["real_time"])
        rows.append([name, "%.2f ns a %s" % (b["ns_per_" + unit], unit), "%.1f %%" % (100 * deviation),
                     "%.1f" % b["culled_percent"] if "culled_percent" in b else ""])
    header = ["kernel / order / kind", "median", "spread", "culled %"]
    write_rows(os.path.join(folder, "kernels.csv"), header, rows)
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(9, 0.3 * len(rows) + 1))
    axis.barh([r[0] for r in rows], [float(r[1].split()[0]) for r in rows], color="#3182bd")
    axis.invert_yaxis()
    axis.set_xlabel("ns a pair (records: a vertex)")
    figure.tight_layout()
    figure.savefig(os.path.join(folder, "kernels.png"), dpi=120)
    plt.close(figure)
    return save(folder, "kernels", "# Kernels\n\n" + table(header, rows))


# What of the step's stages is a column: the rest of them have none of their own in a real scene.
STAGES = ("record", "bounds", "broad_phase", "planar", "elementary")
# Of which ratios the step's second table tells: setting, which ratio of it, words, at most (of threads: at least).
STEP_RATIOS = [("contacts alone", "whole_to_it", "whole / contacts alone", {"cloth-ball": "1.25", "n-body": "1.2"}, "1.3"),
               ("without patches", "to_contacts_alone", "whole without patches / contacts alone", {}, ""),
               ("without patches", "whole_to_it", "whole / without patches", {}, ""),
               ("first contact only", "it_to_whole", "first contact only / all", {}, "0.5"),
               ("on one thread", "it_to_whole", "one thread / two", {}, "at least 1.75")]


def write_step(folder, runs, sheets, peer):
    header = ["scene", "target", "threads", "contacts", "whole: best ms", "median ms", "contacts alone", "start state", "patches",
              "sort"] + [stage.replace("_", " ") for stage in STAGES] + ["page faults", "calibration"]
    lines, ratios = [], []
    for r in runs:
        whole = r["settings"]["whole"]["ms"]
        lines.append([r["case"], r["simd_target"], str(r["threads"]), str(r["contacts"]), "%.1f" % whole["total"]["best"],
                      "%.1f" % whole["total"]["median"], "%.1f" % r["settings"]["contacts alone"]["ms"]["total"]["median"]] +
                     ["%.1f" % whole[stage]["median"] for stage in ("start_state", "patches", "sort") + STAGES] +
                     ["%.0f" % r["settings"]["whole"]["page_faults"]["median"], "%.2f" % r["calibration_ms"]])
        for name, which, words, asked, usual in STEP_RATIOS:
            if name not in r["settings"]:
                continue
            ratio = r["settings"][name][which]
            ratios.append([r["case"], r["simd_target"], str(r["threads"]), words] +
                          ["%.3f" % ratio[k] for k in ("median", "low", "high")] + [asked.get(r["case"], usual)])
    for row in sheets:
        if row["case"] == "at rest in one plane":
            ratios.append(["two sheets of 60 x 60", "", str(row["threads"]), "at rest in one plane / crossing at t = 1/2"] +
                          ["%.3f" % row["to_reference"][k] for k in ("median", "low", "high")] + ["2"])
    ratios.append(["cloth-ball's first frame, %d pairs of faces cross" % peer["pairs_of_faces"], "", "1",
                   "start state / CGAL's self_intersections (%.0f ms)" % peer["cgal_ms"]["median"]] +
                  ["%.3f" % peer["ratio"][k] for k in ("median", "low", "high")] + [""])
    write_rows(os.path.join(folder, "step.csv"), header, lines)
    write_rows(os.path.join(folder, "ratios.csv"), ["scene", "target", "threads", "ratio", "median", "from", "to", "asked"], ratios)
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(9, 0.5 * len(lines) + 1.5))
    left = [0.0] * len(lines)
    labels = ["%s, %s, %s thread(s)" % tuple(line[:3]) for line in lines]
    for column in range(7, len(header) - 2):
        values = [float(line[column]) for line in lines]
        axis.barh(labels, values, left=left, label=header[column])
        left = [a + b for a, b in zip(left, values)]
    axis.invert_yaxis()
    axis.set_xlabel("ms, summed over the workers")
    axis.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(os.path.join(folder, "step.png"), dpi=120)
    plt.close(figure)
    return save(folder, "step", "# The whole step, exact\n\nContacts, `initial` marks, start state and patches as in the node: every answer "
                "is proved, its contacts are those of the truth. Milliseconds; stages are medians, summed over the workers. Calibration: a "
                "fixed scalar kernel on one core.\n\n" + table(header, lines) + "\nRatios of runs in turns, medians with their 95 % "
                "intervals:\n\n" + table(["scene", "target", "threads", "ratio", "median", "from", "to", "asked: at most"], ratios))


def write_sheets(folder, sheets):
    """Whole steps of two sheets; what has no contact has crossings alone, by rounding."""
    header = ["two sheets", "contacts", "crossings", "whole step, ms", "ns a contact", "to crossing at t = 1/2", "from", "to"]
    lines, costs = [], []
    for row in sheets:
        ns = 1e6 * row["ms"]["total"]["median"] / row["contacts"] if row["contacts"] else None
        costs += [(ns, row["case"])] if ns else []
        lines.append([row["case"], str(row["contacts"]), str(row["crossings"]), "%.2f" % row["ms"]["total"]["median"],
                      "%.0f" % ns if ns else "–"] + ["%.2f" % row["to_reference"][k] for k in ("median", "low", "high")])
    write_rows(os.path.join(folder, "sheets.csv"), header, lines)
    return save(folder, "sheets", "# Ordinary input as whole steps\n\nPer contact the dearest (%s) takes %.1f times what the cheapest (%s) "
                "takes; at most 4 is asked.\n\n" % (max(costs)[1], max(costs)[0] / min(costs)[0], min(costs)[1]) + table(header, lines))


def write_cliffs(folder, result):
    """Steps against their neighbours: the first of each row is the one in question."""
    def lines_of(rows):
        for row in rows:
            first = row["steps"][0]
            for step in row["steps"][1:]:
                yield [row["name"], first["name"], "%.1f" % first["ms"], str(first["contacts"] + first["crossings"]), step["name"], "%.1f" % step["ms"],
                       str(step["contacts"] + step["crossings"]), "%.1f" % step["ratio"], "%g" % row["at_most"]]
    header = ["step", "as", "ms", "found", "beside", "ms", "found", "ratio", "asked"]
    lines = list(lines_of(result["rows"]))
    steps = [(row["name"], step["name"], step["over_budget_ms"]) for row in result["rows"] for step in row["steps"]]
    over = [[name, step, "%.2f" % ms] for name, step, ms in steps]
    write_rows(os.path.join(folder, "budget.csv"), ["step", "as", "most ms past a budget of 5 ms"], over)
    furthest = max(steps, key=lambda step: step[2])
    write_rows(os.path.join(folder, "neighbours.csv"), header, lines)
    found = list(lines_of(result["found"]))
    return save(folder, "neighbours", "# Steps against their neighbours\n\nProcessor time, bests in turns. The ratio is of the times a face, or, where "
                "all find something, a face and what is found.\n\n" + table(header, lines) + "\n\nOf 20 steps each with a budget of 5 ms none ran further past it than "
                "%.2f ms of processor time (%s, %s); 1 ms is asked.\n\nOf %d random scenes %d are dearer than asked.\n\n"
                % (furthest[2], furthest[0], furthest[1], result["scenes"], len(result["found"])) + (table(header, found) if found else ""))


def of_turns(ones, others):
    """Of runs in turns: median times of both, the median of the ratios of neighbours, and what these span."""
    ratios = sorted(one / other for one, other in zip(ones, others))
    middle = len(ratios) // 2
    times = [sorted(times)[middle] for times in (ones, others)]
    return ["%.*f" % (2 if time >= 1 else 4, time) for time in times] + ["%.3f" % ratios[i] for i in (middle, 0, -1)]


def write_rod(folder, rows):
    header = ["scene", "threads", "step, ms", "measuring rod, ms", "ratio", "from", "to"]
    lines = [[r["scene"], str(r["threads"])] + of_turns(r["ms"], r["rod_ms"]) for r in rows]
    write_rows(os.path.join(folder, "rod.csv"), header, lines)
    return save(folder, "rod", "# The step against the measuring rod\n\nMedians of bests, of nine steps and of the rod's eight, in turns.\n\n" +
                table(header, lines))


def write_scaling(folder, result):
    header = ["triangles", "threads", "candidates a triangle", "contacts a triangle", "best ms", "median ms",
              "median ns a triangle", "bytes a triangle"]
    rows, series = [], {}
    for r in result["runs"]:
        n = r["triangles"]
        per_triangle = 1e6 * r["ms"]["median"] / n
        rows.append(["%d" % n, str(r["threads"]), "%.1f" % (r["candidates"] / n), "%.2f" % (r["contacts"] / n),
                     "%.1f" % r["ms"]["best"], "%.1f" % r["ms"]["median"], "%.0f" % per_triangle,
                     "%.0f" % r["bytes_a_triangle"]])
        series.setdefault(r["threads"], []).append((n, per_triangle))
    write_rows(os.path.join(folder, "scaling.csv"), header, rows)
    held = [[r["body"], "%d" % r["triangles"], "%.0f" % r["bytes_a_triangle"]] for r in result["memory"]]
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(6, 4))
    for threads, points in series.items():
        axis.plot([p[0] for p in points], [p[1] for p in points], "o-", label="%d thread(s)" % threads)
    axis.set_xscale("log")
    axis.set_ylim(bottom=0)
    axis.set_xlabel("triangles")
    axis.set_ylabel("ns a triangle")
    axis.legend()
    figure.tight_layout()
    figure.savefig(os.path.join(folder, "scaling.png"), dpi=120)
    plt.close(figure)
    return save(folder, "scaling", "# Growth with the number of triangles\n\nGenerated scene: %s. Candidates are those "
                "out of the linear filter. Contacts are the same for every number of threads. Memory is what the detector "
                "holds after its runs, contacts included.\n\n" % result["scene"] +
                table(header, rows) + "\n\n## In a stream\n\n" + table(["a body", "triangles", "bytes a triangle"], held))


def write_clouds(folder, result):
    header = ["one thread, from bytes to the surface", "voxels", "best ms", "median ms", "required ms",
              "octomap_server's loop, median ms", "times faster (quartiles)"]
    rows = [[r["case"], str(r["voxels"]), "%.2f" % r["ms"]["best"], "%.2f" % r["ms"]["median"], "%g" % r["required_ms"],
             "%.0f" % r["server_ms"]["median"] if "server_ms" in r else "",
             "%(median).1f (%(quartile_1).1f to %(quartile_3).1f)" % r["ratio"] if "ratio" in r else ""] for r in result["runs"]]
    write_rows(os.path.join(folder, "clouds.csv"), header, rows)
    return save(folder, "clouds", "# Clouds to the map\n\n" + table(header, rows))


def write_octomap(folder, result):
    header = ["case", "triangles", "voxels", "contacts", "best ms", "median ms", "required ms", "triangulated median ms",
              "ratio", "with --forget, median ms", "ratio to it (quartiles)"]
    rows = []
    for r in result["runs"]:
        t = r.get("triangulated_ms")
        rows.append([r["case"], str(r["triangles"]), str(r["voxels"]), str(r["contacts"]), "%.3f" % r["ms"]["best"],
                     "%.3f" % r["ms"]["median"], "%g" % r["required_ms"], "%.2f" % t["median"] if t else "",
                     "%.1f" % (t["median"] / r["ms"]["median"]) if t else "",
                     "%.3f" % r["forget_ms"]["median"] if "forget_ms" in r else "",
                     "%(median).3f (%(quartile_1).3f to %(quartile_3).3f)" % r["forget_ratio"] if "forget_ms" in r else ""])
    write_rows(os.path.join(folder, "octomap.csv"), header, rows)
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(8, 0.45 * len(rows) + 1.2))
    axis.barh([r[0] for r in rows], [r["ms"]["median"] for r in result["runs"]], color="#3182bd", label="median")
    axis.plot([r["required_ms"] for r in result["runs"]], [r[0] for r in rows], "k|", markersize=14, label="required")
    axis.invert_yaxis()
    axis.set_xlabel("ms")
    axis.legend()
    figure.tight_layout()
    figure.savefig(os.path.join(folder, "octomap.png"), dpi=120)
    plt.close(figure)
    return save(folder, "octomap", "# Mesh against octomap\n\n" + table(header, rows))


def write_first(folder, rows):
    header = ["scene", "threads", "contacts", "first ones", "their TOC", "the first, ms", "all, ms", "ratio", "from", "to"]
    lines = [[r["scene"], str(r["threads"]), str(r["all"]), str(r["first"]), "%.2g" % float(r["toc"])] +
             of_turns(r["first_ms"], r["all_ms"]) for r in rows]
    write_rows(os.path.join(folder, "first.csv"), header, lines)
    return save(folder, "first", "# The first contact only\n\n" + table(header, lines))


TIERS = {
    "coincidence": "vertices of both features in one place at the start: a comparison of bits",
    "batch": "ordinary pairs: doubles with proved bounds, pairs as lanes",
    "in a plane": "all in a plane across an axis, at the start or throughout: doubles with proved bounds",
    "axis motion": "motion along one axis: integers of one or two words",
    "simple times": "features at rest, contacts at times such as 1/2 and 1/3, motion along one axis: the same integers",
    "double-double": "nearly parallel edges, slivers, grazing features",
    "fixed integers": "degenerate pairs whose coordinates are of similar size",
}
GROUPS = {"steps": "real steps", "queries": "hard queries", "families": "hard families", "sheets": "sheets"}


def write_tiers(folder, result):
    """Of each tier and group of inputs the input that is slowest without it, as a multiple of the time with it."""
    header = ["tier", "what it is for"] + list(GROUPS.values()) + ["slower by half"]
    lines = []
    for tier, purpose in TIERS.items():
        cells, slower = [], 0
        for group in GROUPS:
            ratios = [(r["seconds"][tier] / r["seconds"][""], r["name"]) for r in result["rows"] if r["group"] == group]
            worst = max(ratios, default=(0, "not measured"))
            slower += sum(ratio > 1.5 for ratio, _ in ratios)
            cells.append("%.3g (%s)" % worst)
        lines.append([tier, purpose] + cells + [str(slower)])
    write_rows(os.path.join(folder, "tiers.csv"), header, lines)
    return save(folder, "tiers", "# The tiers of `exact`, each left out\n\n" + table(header, lines))


def write_python(folder, rows):
    header = ["step", "triangles", "contacts", "the core, ms", "Python above it, ms", "least", "share"]
    lines = [[r["step"], str(r["triangles"]), str(r["contacts"]), "%.4g" % r["core_ms"], "%.2g" % r["over_ms"], "%.2g" % r["least_over_ms"],
              "%.2g %%" % (100 * r["over_ms"] / r["core_ms"])] for r in rows]
    write_rows(os.path.join(folder, "python.csv"), header, lines)
    return save(folder, "python", "# The Python module\n\n" + table(header, lines))


def write_budget(folder, result):
    header = ["input", "without, ms", "budget ms", "cut", "p50", "p95", "p99", "max", "allowed"]
    rows = []
    for r in result["runs"]:
        over = r["over_ms"]
        rows.append([r["input"], "%.0f" % r["whole_ms"], "%g" % r["budget_ms"], "%d of %d" % (r["cut"], r["steps"])] +
                    ["%.2f" % over[q] for q in ("p50", "p95", "p99", "max")] + ["%g" % max(1, 0.1 * r["budget_ms"])])
    write_rows(os.path.join(folder, "budget.csv"), header, rows)
    budgets = sorted({r["budget_ms"] for r in result["runs"]})
    lines = {}
    for r in result["runs"]:
        line = lines.setdefault(r["input"], [r["input"], "%.0f" % r["whole_ms"]] + [""] * len(budgets))
        line[2 + budgets.index(r["budget_ms"])] = "%.2f, %.2f" % (r["over_ms"]["p99"], r["over_ms"]["max"])
    return save(folder, "budget", "# How far a step runs over its budget\n\nProcessor time of the step's thread after the end of its "
                "budget [ms].\n\n" + table(["input", "without, ms"] + ["%g ms: 99 %%, max" % b for b in budgets], list(lines.values())))


def write_culling(folder, result):
    header = ["case", "triangles", "steps", "certified", "contacts", "pairs of clusters a step", "looked at", "without, median ms a step",
              "with, median ms", "ratio (quartiles)"]
    rows = []
    for r in result["runs"]:
        q = r["ratio"]
        rows.append([r["case"], str(r["triangles"]), str(r["steps"]), str(r["certified"]), str(r["contacts"]),
                     "%.0f" % r["cluster_pairs"], "%.0f" % r["looked_at"],
                     "%.3g" % r["without_ms"]["median"], "%.3g" % r["with_ms"]["median"],
                     "%.2f (%.2f to %.2f)" % (q["median"], q["quartile_1"], q["quartile_3"])])
    write_rows(os.path.join(folder, "culling.csv"), header, rows)
    return save(folder, "culling", "# Surfaces that do not fold\n\nThe step with and without the certificates of surfaces "
                "that do not fold, processor time of runs in turn.\n\n" + table(header, rows))


def write_clearance(folder, result):
    header = ["case", "triangles", "without, median ms", "with, median ms", "ratio (quartiles)"]
    peer_header = ["case", "peer", "once, ms", "a frame, median ms", "outside of the bounds, m"]
    rows, peer_rows = [], []
    for r in result["runs"]:
        q = r["ratio"]
        rows.append([r["case"], str(r["triangles"]), "%.3f" % r["without_ms"]["median"], "%.3f" % r["with_ms"]["median"],
                     "%.2f (%.2f to %.2f)" % (q["median"], q["quartile_1"], q["quartile_3"])])
        for p in r.get("peers", []):
            peer_rows.append([r["case"], p["name"], "%.1f" % p["once_ms"], "%.3f" % p["ms"]["median"], "%.2g" % p["outside_m"]])
    cell_header = ["case", "triangles", "pairs", "measured, %", "more with, median ms", "p99 ms", "promise and scale, median ms"]
    cell_rows = [[c["case"] + ("" if c["real_meshes"] else " (capsules)"), str(c["triangles"]), str(c["pairs"]), "%.0f" % (100 * c["measured"]),
                  "%.3f" % c["more_ms"]["median"], "%.3f" % c["more_p99_ms"], "%.4f" % c["promises_ms"]["median"]] for c in result["cells"]]
    write_rows(os.path.join(folder, "clearance.csv"), header, rows)
    write_rows(os.path.join(folder, "clearance_cells.csv"), cell_header, cell_rows)
    write_rows(os.path.join(folder, "clearance_peers.csv"), peer_header, peer_rows)
    return save(folder, "clearance", "# Clearance\n\nThe step with and without distances, processor time of runs in turn.\n\n" + table(header, rows) +
                "\n\nWhat distances take more in a cell: an arm of seven links, a cloth in its hand, a map of a table that changes in every "
                "second step, `clearance/max_m` 1. Asked for: 0.8 ms in the median, 2 ms in p99, 0.3 ms for promise and scale.\n\n" +
                table(cell_header, cell_rows) + "\n\nWhat others say of the distance at the end of the same steps.\n\n" + table(peer_header, peer_rows))


def write_effects(folder, result):
    flag, rope = result["flag"], result["rope"]
    ratio = flag["ratio"]
    header = ["what", "measured", "interval or spread", "to reach"]
    rows = [["flag in the wind, every effect auto / only self-collision", "%.4f" % ratio["median"],
             "%.4f to %.4f (95 %%, %d rounds)" % (ratio["low"], ratio["high"], ratio["rounds"]),
             "%g" % flag["required_ratio"]],
            ["the same, ms a step with every effect auto", "%.4f" % flag["auto_ms"]["median"],
             "%.4f to %.4f" % (flag["auto_ms"]["best"], flag["auto_ms"]["worst"]), ""],
            ["the same, ms a step with only self-collision", "%.4f" % flag["self_only_ms"]["median"],
             "%.4f to %.4f" % (flag["self_only_ms"]["best"], flag["self_only_ms"]["worst"]), ""],
            ["rope of %d points, %d voxels, ms a step" % (rope["points"], rope["voxels"]), "%.4f" % rope["ms"]["median"],
             "%.4f to %.4f" % (rope["ms"]["best"], rope["ms"]["worst"]), "%g" % rope["required_ms"]]]
    demo, step = result["patches"]["demo"], result["patches"].get("cloth-ball")
    rows.append(["the demo's step with patches / without", "%.4f" % demo["ratio"]["median"],
                 "%(low).4f to %(high).4f (95 %%, %(rounds)d rounds)" % demo["ratio"], "%g" % demo["required_ratio"]])
    if step:
        rows.append(["patches of cloth-ball, %d contacts, %d threads, ms" % (step["contacts"], step["threads"]),
                     "%.2f" % step["effect_ms"]["median"], "%.2f to %.2f" % (step["effect_ms"]["best"], step["effect_ms"]["worst"]),
                     "%g" % step["required_ms"]])
    write_rows(os.path.join(folder, "effects.csv"), header, rows)
    return save(folder, "effects", "# What effects cost\n\nBoth flag runs take turns in one process; the ratio is the median over "
                "rounds of the whole recording. The rope had %.1f pairs with itself, %.1f with the map and %.1f contacts a "
                "step.\n\n" % (rope["self_pairs_a_step"], rope["map_pairs_a_step"], rope["contacts_a_step"]) +
                table(header, rows))


def write_slow(folder, result):
    header = ["law", "its numbers", "sets tried", "runs", "with a contact", "arrived", "restarting arm: with a contact", "arrived",
              "mean speed m/s", "slower than speed_scale by m/s"]
    between = lambda interval: "%.3f ± %.3f" % tuple(interval)
    rows = [[row["law"], row["numbers"], str(row.get("tried", "")), str(row["seeds"]), str(row["contacts"][0]), str(row["arrived"][0]),
             str(row["contacts"][1]), str(row["arrived"][1]), between(row["mean_speed_m_s"]), between(row["ours_faster_by_m_s"])] if "seeds" in row else
            [row["law"], "all touch", str(row["tried"]), "", "", "", "", "", "", ""] for row in result["rows"]]
    write_rows(os.path.join(folder, "slow.csv"), header, rows)
    task_header = ["task", "scale", "runs", "with a contact", "arrived", "mean speed m/s", "of the free one"]
    tasks = [[row["task"], {"intended": "with ~intended", "bounds": "by bounds alone"}[how], str(row["seeds"]), str(row[how]["contacts"]),
              str(row[how]["arrived"]), between(row[how]["mean_speed_m_s"]), between(row[how]["share_of_free"])]
             for row in result["intended"] for how in ("intended", "bounds")]
    write_rows(os.path.join(folder, "intended.csv"), task_header, tasks)
    return save(folder, "slow", "# Slow down instead of stop\n\nA simulated arm carries a cloth over a post and up to a wall, %d times "
                "steadily, and as often creeping, at rest and setting off again. Of the other laws stand the numbers that are the fastest "
                "without a contact in either. Speeds are of the steady arm; ± is an interval of 95 %%. The latency, measured in the loop: at "
                "most %.3f s; the cloth: at most %.2f m/s.\n\n" % (result["seeds"], result["latency_s"], result["cloth_m_s"]) + table(header, rows) +
                "\nWhere bounds alone let the arm do nothing:\n\n" + table(task_header, tasks))


def write_latency(folder, result):
    """Table, histogram and page of benchmark/latency.py."""
    header = ["run", "vertices", "Hz", "frames", "answered", "dropped", "ran into the budget", "contacts (median)", "what",
              "median ms", "p99 ms", "worst ms"]
    rows = []
    plt = pyplot()
    figure, axes = plt.subplots(1, len(result["runs"]), figsize=(4 * len(result["runs"]), 3.2))
    for r, axis in zip(result["runs"], axes):
        name = r["name"].replace("_", " ") + (" of %.2f ms" % r["budget_ms"] if "budget_ms" in r else "")
        for key in ("step_ms", "latency_ms", "round_trip_ms"):
            v = r[key]
            if not v:  # the contacts went to another program
                continue
            rows.append([name, str(r["vertices"]), "%g" % r["rate_hz"], str(r["frames"]), str(r["answered"]),
                         str(r["dropped"]), str(r["deadline"]), str(r["contacts_median"]), key[:-3].replace("_", " "), "%.2f" % v[len(v) // 2],
                         "%.2f" % v[min(len(v) - 1, int(0.99 * len(v)))], "%.2f" % v[-1]])
        low = max(1e-3, r["latency_ms"][0])
        edges = [low * (max(r["latency_ms"][-1], 2 * low) / low) ** (i / 40) for i in range(41)]
        axis.hist(r["latency_ms"], bins=edges, color="#3182bd")
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_title(name, fontsize=9)
        axis.set_xlabel("message to published contacts [ms]")
        axis.set_ylabel("frames")
    figure.tight_layout()
    figure.savefig(os.path.join(folder, "latency.png"), dpi=120)
    figure.savefig(os.path.join(folder, "latency.svg"))
    plt.close(figure)
    write_rows(os.path.join(folder, "latency.csv"), header, rows)
    told = ("The tracked cloth and rope touch a map of 50,176 voxels on an idle machine; the others run beside %d busy "
            "processes on %d cores." % (result["busy_processes"], result["cores"]))
    text = "# Latency of the live node\n\n%s\n\n" % told
    lost = [r["name"] for r in result["runs"] if not r["adds_up"] or r["received"] != r["frames"]]
    text += "Counters add up, every frame is accounted for.\n\n" if not lost else "NOT ACCOUNTED FOR: %s\n\n" % ", ".join(lost)
    text += table(header, rows)
    with open(os.path.join(folder, "latency.svg")) as source:
        picture = source.read()
    cells = "".join("<tr>%s</tr>" % "".join("<td>%s</td>" % cell for cell in row) for row in [header] + rows)
    with open(os.path.join(folder, "latency.html"), "w") as page:
        page.write("<!doctype html><meta charset='utf-8'><title>Latency</title><h1>Latency of the live node</h1><p>%s</p>"
                   "<table border='1' cellpadding='4'>%s</table>%s" % (told, cells, picture[picture.index("<svg"):]))
    return save(folder, "latency", text)
