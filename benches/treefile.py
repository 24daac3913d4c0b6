"""Reads a treefile of RayCloudTools, treetools and arborcam: a tree as segments, each with its parent."""
from dataclasses import dataclass

import numpy as np


def read(path):
    """Of the segments of its first tree, each with its parent's index (-1: none), where it ends (m) and its radius (m)."""
    names, line = [text for text in path.read_text().splitlines() if text and not text.startswith("#")][:2]
    names = names.replace(" ", "").split(",")
    of_tree = names.index("x")
    cells = [cell for cell in line.replace(" ", "").split(",") if cell]
    rows = np.array([float(cell) for cell in cells[of_tree:]]).reshape(-1, len(names) - of_tree)
    column = {name: k for k, name in enumerate(names[of_tree:])}
    return rows[:, column["parent_id"]].astype(int), rows[:, [column[a] for a in "xyz"]], rows[:, column["radius"]]


@dataclass
class Branch:
    """Segments that go on in one another. Its wood tapers from place to place, as made trees' does."""
    id: int
    parent: int
    depth: int
    nodes_m: np.ndarray  # (N, 3); x right, y up, z towards the viewer
    radii_m: np.ndarray  # (N,)
    freq_hz: float = 0.0  # a treefile says nothing of these
    damping: float = 0.0

    @property
    def length_m(self):
        return float(np.linalg.norm(np.diff(self.nodes_m, axis=0), axis=1).sum())

    def radius_m(self, frac):
        return np.interp(frac, np.linspace(0, 1, len(self.radii_m)), self.radii_m)


def branches(path):
    """The branches of its first tree, each parent before its children, the foot at 0. A branch goes on in its thickest segment."""
    parent, at, radius = read(path)
    at = at - at[0]
    y_up = np.stack([at[:, 0], at[:, 2], -at[:, 1]], axis=1)
    above = [[] for _ in parent]
    for segment, below in enumerate(parent):
        if below >= 0:
            above[below].append(segment)
    found, begin = [], [(0, first, -1, 0) for first in above[0]]
    while begin:
        base, segment, carrier, depth = begin.pop(0)
        chain, own = [base, segment], len(found)
        while above[segment]:
            thickest = max(above[segment], key=lambda s: radius[s])
            begin += [(segment, other, own, depth + 1) for other in above[segment] if other != thickest]
            chain.append(thickest)
            segment = thickest
        radii = np.r_[radius[chain[1]], radius[chain[1:]]]
        found.append(Branch(own, carrier, depth, y_up[chain], radii))
    return found
