#!/usr/bin/env python3
"""Writes a recorded motion (a PLY of its first frame, and all positions) as the bag that a tracker would have recorded."""
import argparse
import gzip
import os
import struct

import genpy
import rosbag
from deformable_ccd.msg import MeshStamped
from geometry_msgs.msg import Point
from shape_msgs.msg import MeshTriangle


def read_faces(path):
    """Vertex count and triangles of a binary little-endian PLY with vertices of three doubles."""
    with open(path, "rb") as source:
        data = source.read()
    head, body = data.split(b"end_header\n", 1)
    counts = {line.split()[1]: int(line.split()[2]) for line in head.decode().splitlines() if line.startswith("element")}
    faces = struct.iter_unpack("<Biii", body[24 * counts["vertex"]:])
    return counts["vertex"], [face[1:] for face in faces]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", help="with frame_0.ply and positions.f64.gz")
    parser.add_argument("bag")
    parser.add_argument("--rate", type=float, default=30, help="frames a second")
    arguments = parser.parse_args()
    vertices, faces = read_faces(os.path.join(arguments.folder, "frame_0.ply"))
    triangles = [MeshTriangle(face) for face in faces]
    with gzip.open(os.path.join(arguments.folder, "positions.f64.gz"), "rb") as source, \
            rosbag.Bag(arguments.bag, "w", compression=rosbag.Compression.LZ4) as bag:
        for number in range(1000000):
            frame = source.read(24 * vertices)
            if len(frame) < 24 * vertices:
                break
            message = MeshStamped(vertices=[Point(*at) for at in struct.iter_unpack("<3d", frame)], triangles=triangles)
            message.header.stamp, message.header.frame_id = genpy.Time.from_sec(1000 + number / arguments.rate), "world"
            bag.write("/mesh", message, message.header.stamp)


if __name__ == "__main__":
    main()
