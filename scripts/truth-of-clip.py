#!/usr/bin/env python3
"""Make the small truth file beside a recording from a ground-truth clip: truth-of-clip.py GRID.npz OUT.truth

Needs numpy. Little-endian: number of points, number of frames (u32 each), the frames (u32), then for each frame and
point u and v (u16 each, in 1/64 px; 65535 where it is outside the picture). The frames are the first and the last 30.
"""
import sys
import numpy as np

POINTS, FRAMES, SEED = 1800, 30, 7

if len(sys.argv) != 3:
    sys.exit(__doc__)
positions = np.load(sys.argv[1])["pos_2d"].astype(float)
n_frames, n_points = positions.shape[:2]
points = np.sort(np.random.default_rng(SEED).permutation(n_points)[:POINTS])
frames = np.r_[0, np.arange(n_frames - FRAMES, n_frames)]
units = np.rint(positions[frames][:, points] * 64)
units[(units < 0) | (units > 65534)] = 65535
with open(sys.argv[2], "wb") as out:
    for array in ([len(points), len(frames)], frames):
        out.write(np.asarray(array, "<u4").tobytes())
    out.write(units.astype("<u2").tobytes())
