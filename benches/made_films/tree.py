"""A made-up tree at rest: branches with their shape, frequency and pull. Metres; x right, y up, z towards the viewer."""
from dataclasses import dataclass

import numpy as np

BRANCHES = 60
GOLDEN_ANGLE_RAD = 2.4
# Angle of the pulled branch against its parent, by depth: thin branches give way more.
PULL_RAD = (0.056, 0.085, 0.120, 0.140, 0.145)


@dataclass
class Habit:
    """What differs between a bare and a leafy tree."""
    trunk_hz: float
    highest_hz: float
    trunk_damping: float
    damping_per_level: float  # share of the trunk's that each level adds
    trunk_radius_m: float
    twig_radius_m: float
    pull: float  # how far it is pulled, against PULL_RAD

    @staticmethod
    def draw(rng, leafy):
        # Leaves add mass and drag: slower, and damped about twice as much.
        if leafy:
            return Habit(rng.uniform(0.45, 0.60), 3.3, rng.uniform(0.030, 0.040), 0.55, rng.uniform(0.14, 0.18), 0.010, 1.4)
        return Habit(rng.uniform(0.58, 0.80), 4.4, rng.uniform(0.018, 0.026), 0.35, rng.uniform(0.18, 0.23), 0.013, 1.2)


@dataclass
class Branch:
    id: int
    parent: int
    depth: int
    attach_frac: float
    nodes_m: np.ndarray  # (N, 3), evenly spaced along the branch
    radius_base_m: float
    radius_tip_m: float
    freq_hz: float
    damping: float
    e1: np.ndarray = None  # the two axes about which the base turns, both square to the branch
    e2: np.ndarray = None
    pull_rad: np.ndarray = None  # (2,), about e1 and e2

    @property
    def length_m(self):
        return float(np.linalg.norm(np.diff(self.nodes_m, axis=0), axis=1).sum())

    def radius_m(self, frac):
        return self.radius_base_m + (self.radius_tip_m - self.radius_base_m) * frac

    def at(self, frac):
        """Point and direction at this fraction of the length."""
        segments = len(self.nodes_m) - 1
        k = min(int(frac * segments), segments - 1)
        step = self.nodes_m[k + 1] - self.nodes_m[k]
        return self.nodes_m[k] + (frac * segments - k) * step, unit(step)


def unit(v):
    return v / np.linalg.norm(v)


def grow(rng, leafy):
    """The branches, each parent before its children, and the horizontal direction in which the tree is pulled."""
    habit = Habit.draw(rng, leafy)
    lean = np.array([rng.choice([-1, 1]) * rng.uniform(0.05, 0.35), 1.0, rng.normal(0, 0.15)])
    trunk = Branch(0, -1, 0, 0.0, wander(rng, np.zeros(3), lean, rng.uniform(5.6, 6.6), 0.05), habit.trunk_radius_m,
                   0.12 * habit.trunk_radius_m, habit.trunk_hz, habit.trunk_damping)
    everything, level = [trunk], [trunk]
    for depth in range(1, 5):
        level = [child for parent in level for child in shoots(rng, parent, trunk, habit)]
        everything += level
    kept = prune(rng, everything)
    azimuth = rng.uniform(-0.6, 0.6) + (np.pi if rng.random() < 0.5 else 0)
    pull_direction = np.array([np.cos(azimuth), 0.0, np.sin(azimuth)])
    for b in kept:
        b.e1, b.e2 = turning_axes(b.at(0.0)[1])
        b.pull_rad = habit.pull * pull(rng, b, pull_direction)
    return kept, pull_direction


def raise_frequencies(branches, times):
    """Of all branches but the trunk."""
    for b in branches[1:]:
        b.freq_hz *= times


def prune(rng, everything):
    """Keep the larger branches and some of the small ones, none without its parent, and number them."""
    rank = {}
    for b in everything:
        chance = b.length_m * rng.lognormal(0, 0.9)
        rank[id(b)] = np.inf if b.parent == -1 else min(chance, rank[id(b.parent)])
    # A branch that only ties with its parent comes after it: the sort is stable.
    kept = {id(b) for b in sorted(everything, key=lambda b: -rank[id(b)])[:BRANCHES]}
    kept = [b for b in everything if id(b) in kept]
    number = {id(b): i for i, b in enumerate(kept)}
    for b in kept:
        b.parent = number[id(b.parent)] if b.parent != -1 else -1
        b.id = number[id(b)]
    return kept


def wander(rng, base, direction, length_m, restless, rise=0.25):
    """A crooked line of even steps that slowly turns upwards."""
    segments = int(np.clip(round(length_m / 0.2), 4, 16))
    nodes, direction = [np.asarray(base, float)], unit(np.asarray(direction, float))
    for _ in range(segments):
        nodes.append(nodes[-1] + direction * length_m / segments)
        direction = unit(direction + rng.normal(0, restless, 3) + np.array([0, rise / segments, 0]))
    return np.array(nodes)


def shoots(rng, parent, trunk, habit):
    """The children of one branch. The trunk forks low into leaders; all others bear shorter shoots towards their tip."""
    depth, parent_m = parent.depth + 1, parent.length_m
    leaders = rng.integers(1, 3) if depth == 1 else 0
    fracs = fork_fracs(rng, leaders, parent_m, depth)
    azimuth = rng.uniform(0, 2 * np.pi)
    for k, frac in enumerate(fracs):
        leader = k < leaders
        azimuth += GOLDEN_ANGLE_RAD + rng.normal(0, 0.3)
        length_m = parent_m * (rng.uniform(0.75, 0.88) if leader else (1.15 - frac) * rng.uniform(0.25, 0.90))
        if length_m < 0.20:
            continue
        base, along = parent.at(frac)
        side1, side2 = turning_axes(along)
        away = rng.uniform(0.5, 0.8) if leader else rng.uniform(0.6, 1.15)
        sideways = np.cos(azimuth) * side1 + np.sin(azimuth) * side2
        if k == 0 and leader:
            # The trunk leans away from its first leader: the two make the fork of the tree.
            sideways = np.array([-np.sign(trunk.nodes_m[-1, 0]), 0.0, 0.4 * sideways[2]])
        direction = np.cos(away) * along + np.sin(away) * unit(sideways) * (1, 1, 0.7)
        radius = max(min(0.9 * parent.radius_m(frac), 0.034 * length_m * rng.uniform(0.85, 1.15)), habit.twig_radius_m)
        # A beam's frequency falls with its length; a child is never slower than what carries it.
        freq = habit.trunk_hz * (trunk.length_m / length_m) ** 0.53 * rng.lognormal(0, 0.07)
        freq = min(max(freq, 1.12 * parent.freq_hz), habit.highest_hz * rng.uniform(0.9, 1.0))
        damping = habit.trunk_damping * (1 + habit.damping_per_level * depth) * rng.uniform(0.8, 1.3)
        yield Branch(-1, parent, depth, float(frac), wander(rng, base, direction, length_m, 0.07, rise=0.6), radius,
                     max(0.2 * radius, habit.twig_radius_m), freq, float(np.clip(damping, 0.02, 0.15)))


def fork_fracs(rng, leaders, parent_m, depth):
    """Where along a branch its children start."""
    if depth == 1:
        return np.r_[rng.uniform(0.12, 0.28, leaders), np.sort(rng.uniform(0.33, 0.95, rng.integers(4, 7)))]
    count = int(round(1.4 * parent_m + 1))
    return np.linspace(0.25, 0.95, count) + rng.uniform(-0.05, 0.05, count)


def turning_axes(along):
    """e1, e2 square to the branch with e1 x e2 = along; e1 moves an upright branch to the right."""
    across = np.array([1.0, 0, 0]) if abs(along[1]) > 0.9 else np.array([0, 1.0, 0])
    e1 = unit(np.cross(along, across))
    return e1, np.cross(along, e1)


class Rope:
    """Where the tree is pulled, and how strongly: Hu et al. (sect. 5.4) pull one branch, and compare places and forces."""

    SHAKEN = 0.5  # of the usual pull: what the release shakes of a branch that does not carry the rope

    def __init__(self, branch=None, force=1.0):
        self.branch, self.force = branch, force

    def bend(self, branches):
        carries, at = set(), self.branch
        while at is not None and at >= 0:
            carries.add(at)
            at = branches[at].parent
        for b in branches:
            b.pull_rad = self.force * (1.0 if not carries or b.id in carries else self.SHAKEN) * b.pull_rad


def pull(rng, branch, pull_direction):
    """The angles of the pulled branch: about the axis of the pull's torque, a little off, for no two are loaded alike."""
    torque = np.cross(branch.at(0.0)[1], pull_direction)
    angle = np.arctan2(torque @ branch.e2, torque @ branch.e1) + (rng.normal(0, 0.35) if branch.depth else 0.0)
    size = PULL_RAD[branch.depth] * (rng.lognormal(0, 0.25) if branch.depth else rng.uniform(0.9, 1.15))
    return size * np.array([np.cos(angle), np.sin(angle)])
