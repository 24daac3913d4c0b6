"""How the tree moves: each branch a damped oscillator relative to its parent, children riding on their parents.

  th'' + 2 zeta w th' + w^2 (th - drive) = 0      th = (th1, th2) in rad about e1, e2; w = 2 pi freq_hz, undamped

A branch also bends: what lies at the fraction s of its length is turned by ((1 - FLEX) + FLEX s) th.
"""
import numpy as np
from scipy.signal import lsim
from scipy.spatial.transform import Rotation

FLEX = 0.6
GUST_BETA = 5 / 3  # the wind's power falls as f^-beta (Kolmogorov)
SPIN_UP_S = 12.0


MODEL = ("branch i: th''+2*zeta*w*th'+w^2*(th-drive_i(t))=0, th=(th1,th2), w=2*pi*freq_hz (undamped); turned by "
         "th1*e1+th2*e2 in the parent's frame, at arc fraction s by ((1-flex)+flex*s)*th; children ride on the parent")


def sway(rng, branches, mode, time_s, structure=None):
    """(frames, branches, 2) angles in rad, and what truth.json says of the drive. With a structure branches act back on their parents."""
    said = dict(mode="wind" if mode == "wind" else "release", release_time_s=None, release_frame=None, wind_beta=None,
                wind_gust_signal=None, flex=FLEX, model=structure.MODEL if structure else MODEL)
    if mode == "wind":
        theta, gust = wind_driven(rng, branches, time_s, structure)
        return theta, said | dict(wind_beta=GUST_BETA, wind_gust_signal=np.round(gust, 4).tolist())
    release_s = round(rng.uniform(0.8, 1.2), 3) if mode == "held" else 0.0
    frame_s = time_s[1] - time_s[0]
    said.update(release_time_s=release_s, release_frame=round(release_s / frame_s, 3))
    if structure:
        return structure.free_decay(np.array([b.pull_rad for b in branches]), time_s, release_s), said
    return free_decay(branches, time_s, release_s), said


def free_decay(branches, time_s, release_s):
    """Angles of a tree that is held pulled until release_s and then let go."""
    t = np.maximum(time_s - release_s, 0.0)
    out = []
    for b in branches:
        w, z = 2 * np.pi * b.freq_hz, b.damping
        wd = w * np.sqrt(1 - z * z)
        out.append((np.exp(-z * w * t) * (np.cos(wd * t) + z * w / wd * np.sin(wd * t)))[:, None] * b.pull_rad)
    return np.stack(out, axis=1)


def wind_driven(rng, branches, time_s, structure=None):
    """Angles under gusts, and the gust signal (mean 0, deviation 1) at the given times."""
    dt = time_s[1] - time_s[0]
    spin_up = int(SPIN_UP_S / dt)
    long_s = np.arange(spin_up + len(time_s)) * dt
    gust = red_noise(rng, len(long_s), dt)
    drives = []
    for b in branches:
        # The gust meets the branches one after the other, and each has some turbulence of its own.
        delay_s = 0.25 + b.nodes_m[-1, 0] / 12.0
        common = 0.45 + 0.40 * np.interp(long_s - delay_s, long_s, gust)
        own = 0.20 * np.stack([red_noise(rng, len(long_s), dt) for _ in range(2)], axis=1)
        drives.append(common[:, None] * b.pull_rad + own * np.linalg.norm(b.pull_rad))
    if structure:
        return structure.driven(np.stack(drives, axis=1), dt)[spin_up:], gust[spin_up:]
    out = []
    for b, drive in zip(branches, drives):
        swings = [oscillator(2 * np.pi * b.freq_hz, b.damping, drive[:, k], dt) for k in range(2)]
        out.append(np.stack(swings, axis=1)[spin_up:])
    return np.stack(out, axis=1), gust[spin_up:]


def oscillator(w, damping, drive, dt):
    """x of x'' + 2 damping w x' + w^2 (x - drive) = 0 from rest at 0, at steps of dt."""
    system = ([[0, 1], [-w * w, -2 * damping * w]], [[0], [w * w]], [[1, 0]], [[0]])
    return lsim(system, drive, np.arange(len(drive)) * dt)[1]


def red_noise(rng, count, dt):
    hz = np.fft.rfftfreq(count, dt)
    amplitude = np.where(hz > 0.05, np.maximum(hz, 0.05) ** (-GUST_BETA / 2), 0)
    x = np.fft.irfft(amplitude * np.exp(2j * np.pi * rng.random(len(hz))), count)
    return (x - x.mean()) / x.std()


class Pose:
    """Where every node of every branch is, and how it is turned against rest: points_m (T, N, 3), turns (T, N, 3, 3)."""

    def __init__(self, branches, theta_rad):
        # Branch b owns the nodes first[b] .. first[b + 1].
        self.first = np.cumsum([0] + [len(b.nodes_m) for b in branches])
        frames = len(theta_rad)
        self.points_m = np.zeros((frames, self.first[-1], 3))
        self.turns = np.zeros((frames, self.first[-1], 3, 3))
        for b in branches:
            segments = len(b.nodes_m) - 1
            base, turn = self.carrier(branches, b)
            vector = theta_rad[:, b.id] @ np.stack([b.e1, b.e2])
            middles = turn[:, None] @ bend(vector, (np.arange(segments) + 0.5) / segments)
            steps = np.einsum("tkij,kj->tki", middles, np.diff(b.nodes_m, axis=0))
            here = slice(self.first[b.id], self.first[b.id + 1])
            self.points_m[:, here] = base[:, None] + np.cumsum(np.pad(steps, ((0, 0), (1, 0), (0, 0))), axis=1)
            self.turns[:, here] = turn[:, None] @ bend(vector, np.arange(segments + 1) / segments)

    def carrier(self, branches, b):
        """Base point and turn that the parent gives to this branch."""
        frames = len(self.points_m)
        if b.parent < 0:
            return np.tile(b.nodes_m[0], (frames, 1)), np.tile(np.eye(3), (frames, 1, 1))
        segments = len(branches[b.parent].nodes_m) - 1
        k = min(int(b.attach_frac * segments), segments - 1)
        w = b.attach_frac * segments - k
        i = self.first[b.parent] + k
        turn = self.turns[:, i + int(w > 0.5)]
        return (1 - w) * self.points_m[:, i] + w * self.points_m[:, i + 1], turn


def bend(vector, fracs):
    """(T, K, 3, 3) rotations at these fractions of a branch whose tip turns by vector (T, 3)."""
    scaled = ((1 - FLEX) + FLEX * fracs)[None, :, None] * vector[:, None]
    return Rotation.from_rotvec(scaled.reshape(-1, 3)).as_matrix().reshape(*scaled.shape[:2], 3, 3)
