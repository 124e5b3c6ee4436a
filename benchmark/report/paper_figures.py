"""The figures of the paper's evaluation (Tables 1 to 4), as printed there, to stand beside what is measured."""

# Columns of Tables 1 and 2.
SCENES = ["clothball", "nbody between bodies", "nbody with self", "clothbone", "dragon", "lion"]

# Table 1: culling ratios in percent. NonPen is measured on what the primitive bounding volumes leave, planar on what
# the linear filter leaves.
TABLE_1 = {
    "BV": [53, 25, 26, 38, 37, 24],
    "linear": [95, 81, 96, 99, 90, 89],
    "NonPen": [77, 29, 82, 93, 55, 85],
    "planar": [63, 39, 39, 75, 41, 72],
    "BV + NonPen": [89, 46, 87, 96, 72, 87],
    "linear + planar": [98, 89, 97, 99, 94, 97],
}

# Table 2: milliseconds of the last stage.
TABLE_2 = {
    "BV + NonPen": [326, 1111, 1946, 188, 680, 23489],
    "linear + planar": [65, 329, 513, 30, 221, 1545],
    "acceleration": [5, 3.4, 3.8, 6.3, 3, 15],
}

# Tables 3 and 4: the same with every step cut into n parts; the key is n.
TABLE_3 = {  # N-body between bodies
    1: {"BV": 25, "linear": 81, "NonPen": 29, "planar": 39, "BV + NonPen": 47, "linear + planar": 89, "ms": (1111, 329)},
    2: {"BV": 38, "linear": 78, "NonPen": 32, "planar": 39, "BV + NonPen": 58, "linear + planar": 87, "ms": (201, 83)},
    3: {"BV": 47, "linear": 78, "NonPen": 35, "planar": 40, "BV + NonPen": 65, "linear + planar": 87, "ms": (83, 41)},
    4: {"BV": 53, "linear": 78, "NonPen": 38, "planar": 42, "BV + NonPen": 70, "linear + planar": 87, "ms": (47, 26)},
    5: {"BV": 57, "linear": 78, "NonPen": 41, "planar": 43, "BV + NonPen": 74, "linear + planar": 87, "ms": (32, 19)},
}
TABLE_4 = {  # clothball
    1: {"BV": 53, "linear": 95, "NonPen": 77, "planar": 63, "BV + NonPen": 89, "linear + planar": 98, "ms": (326, 65)},
    2: {"BV": 65, "linear": 94, "NonPen": 85, "planar": 73, "BV + NonPen": 95, "linear + planar": 98, "ms": (74, 29)},
    3: {"BV": 71, "linear": 93, "NonPen": 89, "planar": 77, "BV + NonPen": 97, "linear + planar": 98, "ms": (43, 21)},
    4: {"BV": 75, "linear": 93, "NonPen": 91, "planar": 79, "BV + NonPen": 98, "linear + planar": 98, "ms": (30, 17)},
}

# Survivors of BV + NonPen divided by those of linear + planar that this project asks for, per scene.
REQUIRED_SURVIVOR_RATIO = [4.2, 4.6, 3.6, 2.3, 4.2, 3.6]

LIMITATION = ("\"So the advantage of our methods may not be so distinctive or even shrink when the cost of elementary "
              "test declines.\" (the paper, Section 7)")
