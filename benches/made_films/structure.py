"""The tree as one structure: its branches act back on what carries them, so that all of it swings in each mode.

  M th'' + C th' + K th = K drive      th = the angles of all branches, small

M is that of the wood, moved as Pose moves it. A branch's stiffness is such that it would swing alone, with all that it carries stiff
on it, at its freq_hz, by the mean inertia of its two axes. Damping ratio of a mode: those of the branches, each weighted by its share of the strain energy.
Why: of trees whose branches do not act back each branch has a frequency of its own; Hu et al. (sect. 5.4) find one frequency in
nearly all of them.
"""
import numpy as np
from scipy.linalg import eigh

from . import motion

WOOD_KG_PER_M3 = 900.0
SMALL_RAD = 1e-5
ROPE_AT = 0.7  # of the trunk's length, where no branch has the rope
LARGEST_PULL_RAD = 0.6  # angles are small
MODE_COUNTS = 0.5


class Structure:
    """Modes of the tree: hz (undamped) and damping by mode, shapes (angles, modes) with shapes' M shapes = 1."""

    MODEL = ("M th''+C th'+K th=K drive, th=(th1,th2) of all branches, K diagonal, damping by modes; turned by th1*e1+th2*e2 in the "
             "parent's frame, at arc fraction s by ((1-flex)+flex*s)*th; children ride on the parent and act back on it")

    def __init__(self, branches):
        self.branches = branches
        self.moves_m = moves_per_rad(branches)
        mass = np.einsum("ink,n,jnk->ij", self.moves_m, masses_kg(branches), self.moves_m)
        inertia = np.diag(mass).reshape(-1, 2).mean(axis=1)
        alone_hz = np.array([b.freq_hz for b in branches])
        self.stiffness = ((2 * np.pi * alone_hz) ** 2 * inertia).repeat(2)
        square, self.shapes = eigh(np.diag(self.stiffness), mass)
        self.mass = mass
        self.hz = np.sqrt(square) / (2 * np.pi)
        energy = self.shapes**2 * self.stiffness[:, None]
        self.damping = np.array([b.damping for b in branches]).repeat(2) @ energy / energy.sum(axis=0)

    def pull(self, direction, rope):
        """Bends the branches by a rope at the trunk or at the middle of a branch. The trunk turns as far as usual, times the force."""
        at = 0 if rope.branch is None else rope.branch
        frac = ROPE_AT if rope.branch is None else 0.5
        first = sum(len(b.nodes_m) for b in self.branches[:at])
        node = first + round(frac * (len(self.branches[at].nodes_m) - 1))
        angles = (self.moves_m[:, node] @ direction / self.stiffness).reshape(-1, 2)
        size = rope.force * np.linalg.norm(self.branches[0].pull_rad) / np.linalg.norm(angles[0])
        most = size * np.linalg.norm(angles, axis=1).max()
        if most > LARGEST_PULL_RAD:
            raise SystemExit(f"the rope at branch {at} turns a branch by {most:.1f} rad: give a smaller --force")
        for b, angle in zip(self.branches, angles):
            b.pull_rad = size * angle

    def free_decay(self, start, time_s, release_s):
        """(frames, branches, 2): released from these angles, at rest, at release_s."""
        t = np.maximum(time_s - release_s, 0.0)[:, None]
        w = 2 * np.pi * self.hz
        wd = w * np.sqrt(1 - self.damping**2)
        swings = np.exp(-self.damping * w * t) * (np.cos(wd * t) + self.damping * w / wd * np.sin(wd * t))
        modal = swings * (self.shapes.T @ self.mass @ start.ravel())
        return (modal @ self.shapes.T).reshape(len(time_s), -1, 2)

    def driven(self, drive, dt):
        """(times, branches, 2) under this drive (times, branches, 2): the angles at which each branch would rest."""
        force = drive.reshape(len(drive), -1) * self.stiffness @ self.shapes
        modal = [motion.oscillator(2 * np.pi * f, z, x / (2 * np.pi * f) ** 2, dt) for f, z, x in zip(self.hz, self.damping, force.T)]
        return (np.stack(modal, axis=1) @ self.shapes.T).reshape(drive.shape)

    def as_truth(self):
        return [dict(freq_hz=round(float(f), 5), damping=round(float(z), 5)) for f, z in zip(self.hz, self.damping)]

    def modes_of_branches(self, theta_rad):
        """For each branch the modes in which it turns against its carrier at least MODE_COUNTS as far as in its largest, the largest first."""
        modal = theta_rad.reshape(len(theta_rad), -1) @ self.mass @ self.shapes
        turns = np.abs(self.shapes) * modal.std(axis=0)
        turns = np.hypot(turns[0::2], turns[1::2])
        return [[int(m) for m in np.argsort(-own) if own[m] >= MODE_COUNTS * own.max()] for own in turns]


def moves_per_rad(branches):
    """(angles, nodes, 3): how far each node of the tree moves by each angle, metres per radian."""
    angles = 2 * len(branches)
    one_each = SMALL_RAD * np.eye(angles).reshape(angles, -1, 2)
    rest = motion.Pose(branches, np.zeros((1, len(branches), 2)))
    return (motion.Pose(branches, one_each).points_m - rest.points_m) / SMALL_RAD


def masses_kg(branches):
    """(nodes,) of the wood, half of each segment at each of its ends."""
    parts = []
    for b in branches:
        segments = len(b.nodes_m) - 1
        middles = (np.arange(segments) + 0.5) / segments
        each = WOOD_KG_PER_M3 * np.pi * b.radius_m(middles) ** 2 * b.length_m / segments
        parts.append((np.r_[each, 0] + np.r_[0, each]) / 2)
    return np.concatenate(parts)
