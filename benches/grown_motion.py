"""Whether grown trees sway with the frequencies of their example.

    arborcam grow EXAMPLE --count 10 --out TREES
    python3 benches/grown_motion.py EXAMPLE TREES

The dominant frequency of a branch is that of the largest peak in the spectrum (window of von Hann) of the angle of the line
from its parent, in the picture, in pieces of ten seconds; of the example one for each branch and piece, of each grown tree, which
moves in a loop of ten seconds, one for each branch. Copies are left out, and branches that turn by less than 0.05 degrees (root mean
square). Prints the distance of Kolmogorov and Smirnov between the two, the one above which they differ at 1 %, where the number
of independent values is that of the branches, and the medians. Needs numpy.
"""

import csv
import math
import sys
from pathlib import Path

import numpy as np

PIECE_S = 10.0
STEP_S = 1.0 / 30.0
LEAST_DEG = 0.05


def angles_of(folder):
    """Times, s, and the angle of each branch that is no copy, radians, by node."""
    parents = {}
    with open(folder / "nodes.csv", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if not row["copy_of"] and row["parent_id"] and not row["moves_with"]:
                parents[row["node_id"]] = row["parent_id"]
    times, places = [], {}
    with open(folder / "motion.csv", encoding="utf-8") as file:
        last = None
        for row in csv.DictReader(file):
            if row["frame"] != last:
                last = row["frame"]
                times.append(float(row["time_s"]))
            places.setdefault(row["node_id"], []).append((float(row["u_px"]), float(row["v_px"])))
    angles = {}
    for node, parent in parents.items():
        own, below = places.get(node, []), places.get(parent, [])
        # A tree that was refined has branches that begin later.
        if len(own) == len(below) == len(times):
            way = np.array(own) - np.array(below)
            angles[node] = np.unwrap(np.arctan2(way[:, 0], -way[:, 1]))
    return np.array(times), angles


def dominant_hz(folder):
    times, angles = angles_of(folder)
    found = []
    even = np.arange(0.0, PIECE_S, STEP_S)
    pieces = max(1, int((times[-1] - times[0] + STEP_S) / PIECE_S))
    for angle in angles.values():
        for piece in range(pieces):
            values = np.interp(times[0] + piece * PIECE_S + even, times, angle)
            values -= values.mean()
            if math.degrees(values.std()) < LEAST_DEG:
                continue
            energy = np.abs(np.fft.rfft(values * np.hanning(len(values)))) ** 2
            found.append((1 + int(np.argmax(energy[1:]))) / PIECE_S)
    return np.array(found), len(angles)


def ks(a, b):
    both = np.sort(np.concatenate([a, b]))
    shares = [np.searchsorted(np.sort(x), both, side="right") / len(x) for x in (a, b)]
    return np.abs(shares[0] - shares[1]).max()


def main():
    example, trees = map(Path, sys.argv[1:3])
    own, n = dominant_hz(example)
    found = [dominant_hz(tree) for tree in sorted(trees.glob("tree-*"))]
    grown, m = np.concatenate([f for f, _ in found]), sum(count for _, count in found)
    critical = 1.628 * math.sqrt((n + m) / (n * m))
    distance = ks(own, grown)
    told = "differ" if distance > critical else "do not differ"
    print(
        f"{example.name}: {n} branches, {m} of {len(found)} trees; dominant frequency {np.median(own):.2f} and "
        f"{np.median(grown):.2f} Hz; distance {distance:.2f}, at 1 % {critical:.2f}: they {told}"
    )


if __name__ == "__main__":
    main()
