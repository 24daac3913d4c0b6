"""Coloured markers on the branches, as Hu et al. bind them on (sect. 4): discs of one hue that ride on their branches, and a
board that hides one of them for a second. Pixels; colours blue, green, red.

Chance is drawn from a generator of its own: tree, motion and noise of a seed are the same with and without markers.
"""
import numpy as np

from . import picture, surface, truth
from .picture import FINE, FPS

SEED_KEY = 0x6D61726B  # apart from the generators of bad input
RADIUS_PX = 4.0  # as large in the picture as the 3 cm of Hu et al. on a tree of 3 m
CORNERS = 12
RED_BGR = np.array([38.0, 30.0, 205.0])
TRUNK_FRACS, BRANCH_FRAC = (0.45, 0.95), 0.8
LEAST_APART_PX = 3.5 * RADIUS_PX  # centres, in every frame
LEAST_SEEN = 0.9  # share of a disc that is seen in frame 0
BOARD_S, BOARD_FROM_S, BOARD_MARGIN_PX, BOARD_BGR = 1.0, 4.0, 9.0, (122.0, 128.0, 131.0)
WINDOW_PX = 18  # side of the window that a user would draw around one


class Board:
    """An upright board of one colour that stands before the tree for a while."""

    def __init__(self, low_px, high_px, from_s, to_s):
        self.low_px, self.high_px, self.from_s, self.to_s = low_px, high_px, from_s, to_s

    def draw(self, canvas, time_s):
        if self.from_s <= time_s < self.to_s:
            (u0, v0), (u1, v1) = np.round(FINE * np.array([self.low_px, self.high_px])).astype(int)
            canvas[max(v0, 0) : v1, max(u0, 0) : u1] = BOARD_BGR


class Marker:
    """A disc on one branch, at a fraction of its length, that faces the viewer at rest."""

    def __init__(self, branch, frac, first_node, px_per_m):
        self.branch, self.frac = branch, frac
        self.parent = None  # another Marker
        segments = len(branch.nodes_m) - 1
        node = min(int(frac * segments), segments - 1)
        before_m = branch.radius_m(frac) + 0.02
        turn = np.arange(CORNERS) * 2 * np.pi / CORNERS
        rim = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1) * RADIUS_PX / px_per_m
        offset = np.concatenate([np.zeros((1, 3)), rim]) + [0, 0, before_m]
        k = np.arange(0, CORNERS, 2)
        facets = np.stack([0 * k, 1 + k, 1 + (k + 1) % CORNERS, 1 + (k + 2) % CORNERS], axis=-1)
        count, still = len(offset), np.zeros((len(offset), 3))
        self.skin = surface.Surface(
            np.full(count, first_node + node), np.full(count, frac * segments - node), offset, still, still[:, 0], still[:, 0],
            facets, np.tile(RED_BGR, (len(facets), 1)), np.full(len(facets), branch.id), np.zeros(len(facets), bool))

    def places_m(self, pose, frames):
        """(frames, 3) where its centre is, in the tree's metres."""
        return np.stack([self.skin.vertices_m(pose, f, 0.0)[0] for f in range(frames)])

    def places_px(self, pose, camera, frames):
        """(frames, 2) where its centre is."""
        return np.stack([camera.project(self.skin.vertices_m(pose, f, 0.0)[:1])[0] for f in range(frames)])


def put_on(number, branches, pose, camera, skin, frames, hidden):
    """At most so many markers, the trunk's first, that are seen and never meet; each a Marker with places and parent."""
    trunk = [(branches[0], frac) for frac in TRUNK_FRACS]
    others = sorted(branches[1:], key=lambda b: (b.depth, -b.length_m))
    chosen = []
    for branch, frac in trunk + [(b, BRANCH_FRAC) for b in others]:
        if len(chosen) == number:
            break
        marker = Marker(branch, frac, pose.first[branch.id], camera.px_per_m)
        marker.places = marker.places_px(pose, camera, frames)
        if hasattr(camera, "seen_m"):
            marker.seen_m = camera.seen_m(marker.places_m(pose, frames))
        inside = ((marker.places > 2 * WINDOW_PX) & (marker.places < np.array([picture.WIDTH, picture.HEIGHT]) - 2 * WINDOW_PX)).all()
        apart = all(np.linalg.norm(marker.places - m.places, axis=1).min() > LEAST_APART_PX for m in chosen)
        if inside and apart and is_seen(marker, [m.skin for m in chosen], skin, pose, camera, hidden):
            marker.parent = carrier(marker, chosen, branches)
            chosen.append(marker)
    return chosen


def is_seen(marker, other_skins, skin, pose, camera, hidden):
    """Whether nearly all of its disc is seen in frame 0."""
    whole = surface.join([skin, *other_skins, marker.skin])
    seen = truth.facet_map(whole, pose, camera, hidden)
    shown = (seen >= len(whole.facets) - len(marker.skin.facets)).sum()
    return shown >= LEAST_SEEN * np.pi * (FINE * RADIUS_PX) ** 2


def carrier(marker, chosen, branches):
    """The nearest marker towards the foot: on its own branch, or below the place where that leaves the one that carries it."""
    branch, below = marker.branch, marker.frac
    while True:
        on_it = [m for m in chosen if m.branch is branch and m.frac < below]
        if on_it:
            return max(on_it, key=lambda m: m.frac)
        if branch.parent < 0:
            return None
        branch, below = branches[branch.parent], branch.attach_frac


def board_before(marker, frames):
    """Hides one marker for a second."""
    f0, f1 = round(BOARD_FROM_S * FPS), round((BOARD_FROM_S + BOARD_S) * FPS)
    if f1 >= frames:
        return None
    there = marker.places[f0:f1]
    margin = RADIUS_PX + BOARD_MARGIN_PX
    return Board(there.min(axis=0) - margin, there.max(axis=0) + margin, f0 / FPS, f1 / FPS)


def names(markers):
    return [chr(ord("A") + k) for k in range(len(markers))]


def as_truth(markers, board, hidden):
    """What truth.json says: of each marker its branch, parent and places; which one the board hides, and when."""
    by_marker = dict(zip(map(id, markers), names(markers)))
    listed = [dict(name=by_marker[id(m)], branch=m.branch.id, frac=m.frac, parent=by_marker.get(id(m.parent)), freq_hz=m.branch.freq_hz,
                   damping=m.branch.damping, places_px=np.round(m.places, 3).tolist()) for m in markers]
    for entry, m in zip(listed, markers):
        if hasattr(m, "seen_m"):
            entry["places_m"] = np.round(m.seen_m, 5).tolist()
    return dict(radius_px=RADIUS_PX, markers=listed,
                hidden=None if board is None else dict(name=by_marker[id(hidden)], from_s=board.from_s, to_s=board.to_s))


def as_file(markers):
    """What a user would give: a window around each marker in frame 0, and its parent."""
    by_marker = dict(zip(map(id, markers), names(markers)))
    listed = []
    for m in markers:
        corner = np.round(m.places[0] - WINDOW_PX / 2)
        entry = dict(name=by_marker[id(m)], window_px=[float(corner[0]), float(corner[1]), WINDOW_PX, WINDOW_PX])
        listed.append(entry | ({} if m.parent is None else dict(parent=by_marker[id(m.parent)])))
    return dict(width=picture.WIDTH, height=picture.HEIGHT, markers=listed)
