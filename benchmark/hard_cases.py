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
INTEGERS = ["fixed_integer", "big_integer"]


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
    text = ['<rect width="100" height="100" fill="#fff"/>']
    for at, (_, colour, width) in zip(place, drawn):
        style = 'fill="none" stroke="%s" stroke-width="%s"' % (colour, width)
        if row["kind"] == "vertex-face":
            text.append('<polygon points="%s" %s/>' % (" ".join(at[1:]), style))
            text.append('<circle cx="%s" cy="%s" r="2.2" fill="%s"/>' % (*at[0].split(","), colour))
        else:
            text += ['<polyline points="%s" %s/>' % (" ".join(at[i:i + 2]), style) for i in (0, 2)]
    text += ['<line x1="%s" y1="%s" x2="%s" y2="%s" stroke="#bbb" stroke-width="0.5" stroke-dasharray="2"/>'
             % (*a.split(","), *b.split(",")) for a, b in zip(place[0], place[1])]
    return text


def picture_of_both(rows):
    """One pair beside the other."""
    text = ['<svg xmlns="http://www.w3.org/2000/svg" width="206" height="100" viewBox="0 0 206 100">', *picture(rows[0]),
            '<g transform="translate(106)">', *picture(rows[1]), "</g>", "</svg>", ""]
    return "\n".join(text)


def by_integers(row):
    """The share, in per cent, that no arithmetic of doubles decides."""
    return "%.0f" % (100 * sum(row["tiers"].get(t, 0) for t in INTEGERS) / sum(row["tiers"].values()))


def families(rows):
    """Of each family its two kinds, vertex-face first."""
    by_name = {}
    for row in rows:
        by_name.setdefault(row["family"], []).append(row)
    return [(name, sorted(both, key=lambda row: row["kind"] != "vertex-face")) for name, both in by_name.items()]


def of_both(rows, text_of):
    return ", ".join(text_of(row) for row in rows)


def microseconds(ns):
    return "%.2g" % (ns / 1000) if ns < 99500 else "%.0f" % (ns / 1000)


def hard_page(result, folder):
    lines = ["# Hard cases", "",
             "`scripts/benchmark hard_cases` makes this page from random pairs of each family (`test/support/generators.h`, with fixed seeds).",
             "The rational oracle of `oracle/`, which shares no code with `src/`, judges %d pairs of each family and kind; *wrong* counts verdicts"
             % result["hard"][0]["judged"],
             "among these. `exact` has no wrong verdict, and each of its times is in the cell that the oracle's time is in: otherwise the command",
             "fails. Of two figures the first is of a vertex and a face, the second of two edges. *Mean* and *worst* are of one pair on one core of",
             "%s (%s). *By integers* is the share of pairs that doubles do not decide."
             % (result["machine"].get("processor", "this machine"), result["machine"].get("simd_target", "best target")),
             "The pictures show a pair of each at t = 0 (grey), at t = 1 (black) and where it meets (red). Wide ranges are drawn by their logarithms.", "",
             "| | family | contacts | FCL wrong | `fast` wrong | `exact`: by integers, % | mean µs | worst µs |",
             "|---|---|--:|--:|--:|--:|--:|--:|"]
    for family, both in families(result["hard"]):
        with open(os.path.join(folder, family + ".svg"), "w") as out:
            out.write(picture_of_both(both))
        lines.append("| ![](hard_cases/%s.svg) | **%s** %s | %s | %s | %s | %s | %s | %s |" % (
            family, family, WHAT[family], *(of_both(both, lambda row, key=key: "%d" % row[key])
                                            for key in ("contacts", "fcl_wrong", "fast_wrong")),
            of_both(both, by_integers), *(of_both(both, lambda row, key=key: microseconds(row[key])) for key in ("exact_ns", "exact_worst_ns"))))
    return lines


def cliffs_page(result):
    def ratio(row):
        return row["exact_ns"] / row["perturbed"]["exact_ns"]

    worst = max(result["cliffs"], key=ratio)
    lines = ["", "## Ordinary input", "",
             "Sheets as people and simulators make them, and the same with the last bits of every coordinate changed (`scripts/benchmark cliffs`): "
             "nanoseconds a", "pair over the pairs whose boxes meet, of which about %d of each row and kind are judged. The largest ratio is %.1f (%s, %s)."
             % (result["cliffs"][0]["judged"], ratio(worst), worst["family"], worst["kind"]), "",
             "| two sheets | `exact` | perturbed | `fast` | `fast` wrong | FCL wrong | by integers, % |",
             "|---|--:|--:|--:|--:|--:|--:|"]
    for family, both in families(result["cliffs"]):
        lines.append("| %s | %s | %s | %s | %s | %s | %s |" % (
            family, of_both(both, lambda row: "%.0f" % row["exact_ns"]), of_both(both, lambda row: "%.0f" % row["perturbed"]["exact_ns"]),
            *(of_both(both, lambda row, key=key: "%.0f" % row[key])
                                                              for key in ("fast_ns", "fast_wrong", "fcl_wrong")), of_both(both, by_integers)))
    return lines


def margins_page(table):
    """What the test of the margins comes to; `scripts/benchmark hard_cases` leaves its whole table in margins.txt."""
    rows = [line.strip("| ").split(" | ") for line in table if line.startswith("| `")]
    held = [float(row[3]) for row in rows]
    return ["", "## Margins", "",
            "`scripts/test --long --only margins` cuts one of the %d margins at a time. With a tenth of it %d go wrong: the others"
            % (len(rows), sum(row[2] != "0" for row in rows)),
            "add up dozens of roundings, serve several quantities, or cover underflow. The largest part of a margin with which an input goes wrong is %g (%s)."
            % (max(held), " and ".join(row[0] for row, part in zip(rows, held) if part == max(held)))]


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
        out.write("\n".join(lines).strip() + "\n")
    print(path)


if __name__ == "__main__":
    main()
