#!/usr/bin/env python3
"""The page of hard cases (doc/hard_cases.md) and its pictures, from what hard_cases_benchmark measured."""
import argparse
import json
import os

# Family of test/support/generators.h -> what is hard about it.
WHAT = {
    "general": "Random coordinates of one scale: what the others are to be compared with.",
    "small-grid": "Integers of -3 to 3: degenerate triangles, shared places, everything at once.",
    "grazing": "A contact on a vertex, an edge or inside at a dyadic time, tangential or with a double root; sometimes one unit in the last place off.",
    "at-the-ends": "The same at exactly t = 0 or t = 1.",
    "parallel": "Edges that stay parallel, faces that move along their own planes.",
    "collinear": "Everything on one line.",
    "sliver": "Degenerate triangles and edges: normals of nearly zero.",
    "turning": "Faces that turn over, edges that become parallel in mid-step.",
    "one-ulp": "Coordinates that move by one representable number, or not at all.",
    "huge-translation": "Far from the origin, with a tiny relative motion.",
    "coincident": "Duplicates: vertices of both features in the same place.",
    "at-rest": "Resting contact: no motion at all.",
    "coplanar": "Everything in one plane during the whole step.",
    "subnormal": "Coordinates below the smallest normal double.",
    "mixed-15": "Each coordinate of its own scale, 1e-15 to 1e15.",
    "mixed-150": "The same from 1e-150 to 1e150.",
    "extreme": "Coordinates near the largest double.",
}
TIERS = ["coincidence", "double_batch", "bernstein", "double_double", "fixed_integer", "big_integer"]


def flattened(point, scale):
    """A point in the picture's plane, seen from above at a slant; scale makes a coordinate of any size drawable."""
    x, y, z = (scale(v) for v in point)
    return x + 0.35 * y, z + 0.45 * y


def picture(row):
    """The pair at t = 0 (grey), at t = 1 (black) and, where it meets, at that time (red)."""
    x, toc = row["example"]["x"], row["example"]["toc"]
    values = sorted(abs(v) for frame in x for point in frame for v in point if v)
    wide = values and values[-1] > 1e6 * values[0]

    def scale(v):
        if not wide:
            return v / values[-1] if values else v  # what is next to the largest double, or the least, has a sum, too
        import math
        return math.copysign(1 + math.log10(abs(v) / values[0]), v) if v else 0.0
    frames = [(x[0], "#999", 1.2), (x[1], "#000", 1.2)]
    if row["contacts"]:
        at = [[a * (1 - toc) + b * toc for a, b in zip(p, q)] for p, q in zip(*x)]
        frames.append((at, "#c00", 1.6))
    drawn = [([flattened(p, scale) for p in frame], colour, width) for frame, colour, width in frames]
    points = [p for frame, _, _ in drawn for p in frame]
    low = [min(p[i] for p in points) for i in range(2)]
    size = max(max(max(p[i] for p in points) - low[i] for i in range(2)), 1e-300)
    place = [[("%.1f,%.1f" % (6 + 88 * (p[0] - low[0]) / size, 94 - 88 * (p[1] - low[1]) / size)) for p in frame] for frame, _, _ in drawn]
    text = ['<svg xmlns="http://www.w3.org/2000/svg" width="100" height="100" viewBox="0 0 100 100">',
            '<rect width="100" height="100" fill="#fff"/>']
    for at, (_, colour, width) in zip(place, drawn):
        style = 'fill="none" stroke="%s" stroke-width="%s"' % (colour, width)
        if row["kind"] == "vertex-face":
            text.append('<polygon points="%s" %s/>' % (" ".join(at[1:]), style))
            text.append('<circle cx="%s" cy="%s" r="2.2" fill="%s"/>' % (*at[0].split(","), colour))
        else:
            text += ['<polyline points="%s" %s/>' % (" ".join(at[i:i + 2]), style) for i in (0, 2)]
    text += ['<line x1="%s" y1="%s" x2="%s" y2="%s" stroke="#bbb" stroke-width="0.5" stroke-dasharray="2"/>'
             % (*a.split(","), *b.split(",")) for a, b in zip(place[0], place[1])]
    return "\n".join(text + ["</svg>", ""])


def tiers(row):
    total = sum(row["tiers"].values())
    return ", ".join("%s %.0f %%" % (t.replace("_", " "), 100 * row["tiers"][t] / total) for t in TIERS if row["tiers"].get(t, 0) * 200 >= total)


def microseconds(ns):
    return "%.2g" % (ns / 1000) if ns < 99500 else "%.0f" % (ns / 1000)


def hard_page(result, folder):
    lines = ["# Hard cases", "",
             "`scripts/benchmark hard_cases` makes this page from random pairs of each family (`test/support/generators.h`, with fixed seeds).",
             "The rational oracle of `oracle/`, which shares no code with `src/`, judges %d pairs of each family and kind. *Wrong* counts"
             % result["hard"][0]["judged"],
             "verdicts among these. `exact` has no wrong verdict, and each of its times is in the cell that the oracle's time is in: otherwise",
             "the command fails. *Mean* and *worst* are the time of one pair on one core of %s (%s)."
             % (result["machine"].get("processor", "this machine"), result["machine"].get("simd_target", "best target")),
             "Each picture shows one pair at t = 0 (grey), at t = 1 (black) and where it meets (red). Wide ranges are drawn by their logarithms.", "",
             "| | family | kind | contacts | FCL wrong | `fast` wrong | `exact`: tiers | mean µs | worst µs |",
             "|---|---|---|--:|--:|--:|---|--:|--:|"]
    for row in result["hard"]:
        name = "%s-%s.svg" % (row["family"], "vf" if row["kind"] == "vertex-face" else "ee")
        with open(os.path.join(folder, name), "w") as out:
            out.write(picture(row))
        share = lambda n: "%d of %d" % (n, row["judged"])  # noqa: E731
        lines.append("| ![%s](hard_cases/%s) | **%s** %s | %s | %s | %s | %s | %s | %s | %s |" % (
            row["family"], name, row["family"], WHAT[row["family"]] if row["kind"] == "vertex-face" else "", row["kind"],
            share(row["contacts"]), share(row["fcl_wrong"]), share(row["fast_wrong"]), tiers(row), microseconds(row["exact_ns"]),
            microseconds(row["exact_worst_ns"])))
    return lines


def cliffs_page(result):
    rows = [(r, r["exact_ns"] / r["perturbed"]["exact_ns"]) for r in result["cliffs"]]
    worst = max(rows, key=lambda r: r[1])
    lines = ["", "## Ordinary input", "",
             "Sheets as people and simulators make them, and the same with the last bits of every coordinate changed "
             "(`scripts/benchmark cliffs`):",
             "nanoseconds a pair over the pairs whose boxes meet. The largest ratio is %.1f (%s, %s)."
             % (worst[1], worst[0]["family"], worst[0]["kind"]), "",
             "| two sheets | kind | pairs | `exact` | perturbed | ratio | `fast` | `fast` wrong | FCL wrong | tiers |",
             "|---|---|--:|--:|--:|--:|--:|--:|--:|---|"]
    for row, ratio in rows:
        lines.append("| %s | %s | %d | %.0f | %.0f | %.1f | %.0f | %d of %d | %d of %d | %s |" % (
            row["family"], row["kind"], row["pairs"], row["exact_ns"], row["perturbed"]["exact_ns"], ratio, row["fast_ns"],
            row["fast_wrong"], row["judged"], row["fcl_wrong"], row["judged"], tiers(row)))
    return lines


def margins_page(table):
    return ["", "## Margins", "",
            "Each margin of `include/dccd/tolerances.h` covers rounding. Its derivation stands beside the code. This table shows that it is",
            "needed: the test cuts one margin at a time and asks exact arithmetic about inputs that aim at its bound. Some of these were found",
            "by search (`cut_margins --search`). With the whole margin no input may go wrong; with less of it, one must. The last column is the",
            "largest part of the margin with which one does. It is below a tenth where the bound adds up dozens of roundings, or where one margin",
            "serves several quantities: there search found no input that needs more. A 0 stands where the margin covers underflow: it is a normal",
            "number, and so far larger than what it covers. `scripts/test --long --only margins` runs the test.",
            ""] + table


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", help="JSON of hard_cases_benchmark")
    parser.add_argument("--out", required=True, help="folder for hard_cases.md and the folder hard_cases of pictures")
    parser.add_argument("--margins", help="what cut_margins printed")
    arguments = parser.parse_args()
    with open(arguments.results) as source:
        result = json.load(source)
    pictures = os.path.join(arguments.out, "hard_cases")
    os.makedirs(pictures, exist_ok=True)
    lines = (hard_page(result, pictures) if "hard" in result else []) + (cliffs_page(result) if "cliffs" in result else [])
    if arguments.margins:
        with open(arguments.margins) as table:
            lines += margins_page(table.read().splitlines())
    path = os.path.join(arguments.out, "hard_cases.md")
    with open(path, "w") as out:
        out.write("\n".join(lines).strip().replace("**  |", "** |") + "\n")
    print(path)


if __name__ == "__main__":
    main()
