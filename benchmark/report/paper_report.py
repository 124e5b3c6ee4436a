"""Makes Tables 1 to 4, Figure 13 and Equation 13's model out of paper_benchmark's JSON, beside the paper's figures."""

import csv
import os

from . import paper_figures as paper

PLANAR_FORMS = {"linear + planar": "linear+planar", "linear + planar, branch-free": "linear+planar_branch_free"}


def percent(part, whole):
    return 100.0 * part / whole if whole else 0.0


def culled(measurement, pipeline, filter_number=None):
    """Percent culled by one filter of what it got, or by the whole pipeline of the candidates."""
    p = measurement["pipelines"][pipeline]
    if filter_number is None:
        return 100.0 - percent(p["survivors"], measurement["candidates"])
    f = p["filters"][filter_number]
    return 100.0 - percent(f["out"], f["in"])


def culling(measurement):
    """The rows of Table 1, in percent, with the forms that the paper does not have."""
    return {
        "BV": culled(measurement, "bv", 0),
        "linear": culled(measurement, "linear", 0),
        "NonPen": culled(measurement, "bv+nonpen", 1),
        "NonPen, batched": culled(measurement, "bv+nonpen_batched", 1),
        "planar": culled(measurement, "linear+planar", 1),
        "planar, branch-free": culled(measurement, "linear+planar_branch_free", 1),
        "fused (ours)": culled(measurement, "linear+fused", 1),
        "BV + NonPen": culled(measurement, "bv+nonpen"),
        "BV + NonPen, batched": culled(measurement, "bv+nonpen_batched"),
        "linear + planar": culled(measurement, "linear+planar"),
        "linear + planar, branch-free": culled(measurement, "linear+planar_branch_free"),
        "linear + fused (ours)": culled(measurement, "linear+fused"),
        "normal cones (ours)": culled(measurement, "cones+linear+planar", 0),
        "normal cones + linear + planar": culled(measurement, "cones+linear+planar"),
        "normal cones + linear + fused (ours)": culled(measurement, "cones+linear+fused"),
    }


def milliseconds(measurement, pipeline):
    return measurement["pipelines"][pipeline]["total_ms"]["median"]


def survivor_ratio(measurement, pipeline):
    kept = measurement["pipelines"][pipeline]["survivors"]
    return measurement["pipelines"]["bv+nonpen"]["survivors"] / kept if kept else float("inf")


def equation_13(measurement, pipeline):
    """Cost reduction: alpha - beta from the unit costs (the model), and from the times of the whole (measured)."""
    p = measurement["pipelines"][pipeline]
    n = measurement["candidates"]
    plain_ms = measurement["pipelines"]["elementary"]["elementary_ms"]["median"]
    filter_ms = sum(f["ms"]["median"] for f in p["filters"]) * measurement["steps"]
    per_elementary = plain_ms * measurement["steps"] / n
    beta = filter_ms / n / per_elementary
    alpha = 1.0 - p["survivors"] / n
    total_ms = p["total_ms"]["median"]
    return {"alpha": alpha, "beta": beta, "model": alpha - beta, "measured": 1.0 - total_ms / plain_ms}


def table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def beside(value, of_paper, unit="%"):
    text = "%.1f %s" % (value, unit)
    return text if of_paper is None else text + " [%g]" % of_paper


def table_1(results):
    header = ["culled"] + [r["title"] for r in results]
    rows = []
    for name in culling(results[0]["measurements"][0]):
        row = [name]
        for r in results:
            of_paper = paper.TABLE_1[name][r["column"]] if name in paper.TABLE_1 else None
            row.append(beside(culling(r["measurements"][0])[name], of_paper))
        rows.append(row)
    return table(header, rows)


def truth_lines(results):
    lines = []
    for r in results:
        m = r["measurements"][0]
        contacts = m["true_contacts"]
        if not contacts:
            continue
        false = m["candidates"] - contacts
        shares = []
        for name, pipeline in PLANAR_FORMS.items():
            kept = m["pipelines"][pipeline]["survivors"] - contacts
            shares.append("%s %.2f %% of the false candidates" % (name, 100.0 - percent(kept, false)))
        lines.append("- %s: %s true contacts, so the ceiling is %.2f %% of all candidates; %s."
                     % (r["title"], "{:,}".format(contacts), 100.0 - percent(contacts, m["candidates"]),
                        "; ".join(shares)))
    return "\n".join(lines) + "\n" if lines else ""


def table_ratios(results):
    header = ["survivors of BV + NonPen divided by those of"] + [r["title"] for r in results]
    rows = []
    for name, pipeline in list(PLANAR_FORMS.items()) + [("linear + fused (ours)", "linear+fused")]:
        rows.append([name] + ["%.2f" % survivor_ratio(r["measurements"][0], pipeline) for r in results])
    rows.append(["asked for"] + ["%g" % paper.REQUIRED_SURVIVOR_RATIO[r["column"]] for r in results])
    return table(header, rows)


def table_2(results):
    header = ["ms a step, last stage"] + [r["title"] for r in results]
    named = [("BV + NonPen (as published)", "bv+nonpen"), ("BV + NonPen, batched", "bv+nonpen_batched"),
             ("linear + planar", "linear+planar"), ("linear + planar, branch-free", "linear+planar_branch_free"),
             ("linear + fused (ours)", "linear+fused"), ("elementary test alone", "elementary"),
             ("FCL with its own filter", "fcl_filtered")]
    rows = []
    for name, pipeline in named:
        row = [name]
        for r in results:
            t = r["measurements"][0]["pipelines"][pipeline]["total_ms"]
            of_paper = paper.TABLE_2.get(name.replace(" (as published)", ""))
            text = "%.1f (%.1f to %.1f)" % (t["median"], t["best"], t["worst"])
            row.append(text + (" [%g]" % of_paper[r["column"]] if of_paper else ""))
        rows.append(row)
    for rival, rival_name in (("bv+nonpen", "as published"), ("bv+nonpen_batched", "batched")):
        for name, pipeline in PLANAR_FORMS.items():
            row = ["%s against the rival %s" % (name, rival_name)]
            for r in results:
                m = r["measurements"][0]
                first = name == "linear + planar" and rival == "bv+nonpen"
                of_paper = paper.TABLE_2["acceleration"][r["column"]] if first else None
                row.append(beside(milliseconds(m, rival) / max(1e-9, milliseconds(m, pipeline)), of_paper, "x"))
            rows.append(row)
    return table(header, rows)


def table_fractions(result, of_paper):
    header = ["step cut into"] + [str(m["fraction"]) for m in result["measurements"]]
    rows = []
    for name in ("BV", "linear", "NonPen", "planar", "planar, branch-free", "BV + NonPen", "linear + planar",
                 "linear + planar, branch-free", "linear + fused (ours)"):
        row = [name]
        for m in result["measurements"]:
            printed = of_paper.get(m["fraction"], {}).get(name)
            row.append(beside(culling(m)[name], printed))
        rows.append(row)
    for i, (name, pipeline) in enumerate((("BV + NonPen", "bv+nonpen"), ("linear + planar", "linear+planar"))):
        row = ["ms, " + name]
        for m in result["measurements"]:
            printed = of_paper.get(m["fraction"], {}).get("ms")
            row.append(beside(milliseconds(m, pipeline), printed[i] if printed else None, "ms"))
        rows.append(row)
    return table(header, rows)


def table_model(results):
    header = ["cost reduction: model alpha - beta / measured"] + [r["title"] for r in results]
    rows = []
    for name, pipeline in (("BV", "bv"), ("BV + NonPen", "bv+nonpen"), ("linear", "linear"),
                           ("linear + planar", "linear+planar"),
                           ("linear + planar, branch-free", "linear+planar_branch_free"),
                           ("linear + fused (ours)", "linear+fused")):
        row = [name]
        for r in results:
            e = equation_13(r["measurements"][0], pipeline)
            row.append("%.3f - %.3f = %.3f / %.3f" % (e["alpha"], e["beta"], e["model"], e["measured"]))
        rows.append(row)
    return table(header, rows)


def differences(results):
    """A sentence for every scene and row of Table 1 that is more than 10 points from the paper's."""
    reasons = {
        "BV": "swept bounds depend on the motion per step, which is this sequence's own",
        "linear": "what the linear filter leaves is near-contacts, and this sequence has its own share of them",
        "NonPen": "it depends on how far features move beside their size, and on how crumpled the surface is",
        "planar": "it sees only what the linear filter leaves, which differs",
        "BV + NonPen": "both of its filters follow the motion per step",
        "linear + planar": "the share of near-contacts differs",
    }
    lines = []
    for r in results:
        found = culling(r["measurements"][0])
        for name, values in paper.TABLE_1.items():
            printed = values[r["column"]]
            if abs(found[name] - printed) > 10:
                lines.append("- %s, %s: %.0f %% instead of %d %%; %s." % (r["title"], name, found[name], printed,
                                                                        reasons[name]))
    return "\n".join(lines) + "\n" if lines else "No figure of Table 1 is more than 10 points from the paper's.\n"


def write_csv(path, results):
    with open(path, "w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(["scene", "fraction", "candidates", "pipeline", "stage", "in", "out", "ms_best", "ms_median",
                         "ms_worst"])
        for r in results:
            for m in r["measurements"]:
                for name, p in m["pipelines"].items():
                    stages = [(f["name"], f["in"], f["out"], f["ms"]) for f in p["filters"]]
                    stages.append(("elementary", p["survivors"], p["called_colliding"], p["elementary_ms"]))
                    stages.append(("total", m["candidates"], p["called_colliding"], p["total_ms"]))
                    for stage, pairs_in, pairs_out, ms in stages:
                        writer.writerow([r["title"], m["fraction"], m["candidates"], name, stage, pairs_in, pairs_out,
                                         ms["best"], ms["median"], ms["worst"]])


def plot_figure_13(path, results):
    """Time per stage for each combination, one group of bars a scene."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    shown = [("elementary", "none"), ("bv", "BV"), ("bv+nonpen", "BV+NonPen"), ("linear", "linear"),
             ("linear+planar", "linear+planar"), ("linear+planar_branch_free", "branch-free"), ("linear+fused", "ours")]
    colours = {"primitive_bv": "#9ecae1", "non_penetration": "#3182bd", "linear": "#fdae6b", "planar_paper": "#e6550d",
               "planar_branch_free": "#e6550d", "fused": "#a63603", "elementary": "#bdbdbd"}
    columns = 3
    rows = (len(results) + columns - 1) // columns
    figure, axes = plt.subplots(rows, columns, figsize=(5 * columns, 3.6 * rows), squeeze=False)
    for axis in axes.flat[len(results):]:
        axis.set_visible(False)
    for axis, r in zip(axes.flat, results):
        m = r["measurements"][0]
        for i, (pipeline, _) in enumerate(shown):
            p = m["pipelines"][pipeline]
            bottom = 0.0
            for name, ms in [(f["name"], f["ms"]["median"]) for f in p["filters"]] + \
                            [("elementary", p["elementary_ms"]["median"])]:
                axis.bar(i, ms, bottom=bottom, color=colours[name], width=0.8)
                bottom += ms
        axis.set_xticks(range(len(shown)))
        axis.set_xticklabels([label for _, label in shown], rotation=40, ha="right", fontsize=8)
        axis.set_title(r["title"], fontsize=10)
        axis.set_ylabel("ms a step")
    handles = [plt.Rectangle((0, 0), 1, 1, color=c) for c in ("#9ecae1", "#3182bd", "#fdae6b", "#e6550d", "#a63603",
                                                              "#bdbdbd")]
    figure.legend(handles, ["primitive BV", "non-penetration", "linear", "planar", "fused (ours)", "elementary test"],
                  loc="lower center", ncol=6)
    figure.suptitle("Time of the last stage per combination of filters (the paper's Figure 13)")
    figure.tight_layout(rect=(0, 0.05, 1, 1))
    figure.savefig(path + ".png", dpi=120)
    figure.savefig(path + ".svg")
    plt.close(figure)


def page(results):
    """The whole page, in Markdown."""
    m = results[0]["machine"]
    bounds = sorted({r["bounds"] for r in results})
    every = sorted({r["elementary_every"] for r in results})
    sizes = "; ".join("%s: %s triangles, %d step%s, %s candidates" % (
        r["title"], "{:,}".format(r["triangles"]), r["measurements"][0]["steps"],
        "s" if r["measurements"][0]["steps"] > 1 else "", "{:,}".format(r["measurements"][0]["candidates"]))
        for r in results)
    parts = [
        "# The paper's evaluation\n",
        "Machine: %s, %d threads, SIMD target %s, compiler %s; one thread used; calibration kernel %.2f ms.\n" % (
            m["processor"], m["threads"], m["simd_target"], m["compiler"], m["calibration_ms"]),
        "Candidate set: all feature pairs, each once, of pairs of triangles with overlapping swept bounds (%s), without "
        "those that share a vertex. Pairs of neighbouring features are among them: normal cones take some, in the rows that name these alone. %s.\n"
        % (", ".join(bounds), sizes),
        "In brackets: the paper's own figure, over its whole sequences, on its scenes and its machine. Scenes marked "
        "`real` are one step of those sequences; the others are generated and of their kind and size alone.\n",
        "Elementary test: FCL's cubic, timed on every %s-th chunk of candidates. Checked before printing: %s contacts, "
        "none rejected by any filter.\n" % (" or ".join(str(e) for e in every), "{:,}".format(
            sum(x["contacts_checked"] for r in results for x in r["measurements"]))),
        "## Table 1: culling ratios\n", table_1(results), truth_lines(results), table_ratios(results),
        "Where ours differs by more than 10 points:\n", differences(results),
        "## Table 2: time of the last stage\n", table_2(results),
        "Where the gain is smaller than the paper's: " + paper.LIMITATION + "\n",
    ]
    for title, key, of_paper in (("Table 3: varying time step, n-body between bodies", "table_3", paper.TABLE_3),
                                 ("Table 4: varying time step, cloth and ball", "table_4", paper.TABLE_4)):
        for r in results:
            if r.get(key) and len(r["measurements"]) > 1:
                parts += ["## %s (%s)\n" % (title, r["title"]), table_fractions(r, of_paper)]
    parts += ["## Equation 13: model and measurement\n",
              "Per candidate: alpha is the share culled, beta the filters' cost divided by the elementary test's. The "
              "model takes the survivors' elementary tests to cost as much as the average one; they cost more.\n",
              table_model(results), "## Figure 13\n", "![time per stage](figure_13.png)\n"]
    return "\n".join(parts)


def write(folder, results):
    """Writes paper.md, paper.csv, figure_13.png and .svg; returns the page."""
    text = page(results)
    with open(os.path.join(folder, "paper.md"), "w") as out:
        out.write(text)
    write_csv(os.path.join(folder, "paper.csv"), results)
    plot_figure_13(os.path.join(folder, "figure_13"), results)
    return text
