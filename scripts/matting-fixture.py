#!/usr/bin/env python3
"""Makes tests/matting/: a picture, scribbles on it, and the matte that PyMatting finds.

    pip install pymatting pillow numpy
    scripts/matting-fixture.py

The picture is a part of the first frame of recordings/sparse_winter.mkv. `scribbles.png` is white on the tree, black on
the background, grey elsewhere; `alpha.png` is estimate_alpha_cf (closed-form matting, epsilon 1e-7, its own solver and
tolerance), 0 to 255. tests/matting.rs holds our matte to it.
"""
import subprocess
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw
from pymatting import estimate_alpha_cf

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "tests" / "matting"
LEFT, TOP, WIDTH, HEIGHT = 180, 60, 320, 280
TREE = [
    [(325, 328), (322, 290), (307, 240), (292, 180), (277, 120), (266, 80)],
    [(330, 285), (355, 225), (385, 160), (408, 95)],
    [(300, 240), (250, 215)],
    [(380, 200), (420, 165)],
]
BACKGROUND = [
    [(200, 75), (236, 140), (262, 165)],
    [(330, 70), (340, 120), (325, 190)],
    [(470, 75), (480, 180), (450, 230), (400, 300)],
    [(190, 200), (210, 265), (290, 300), (280, 334), (360, 336), (490, 320)],
]


def main():
    OUT.mkdir(exist_ok=True)
    crop = f"crop={WIDTH}:{HEIGHT}:{LEFT}:{TOP}"
    clip = ROOT / "recordings" / "sparse_winter.mkv"
    subprocess.run(["ffmpeg", "-v", "error", "-y", "-i", clip, "-frames:v", "1", "-vf", crop, OUT / "picture.png"], check=True)
    scribbles = Image.new("L", (WIDTH, HEIGHT), 128)
    draw = ImageDraw.Draw(scribbles)
    for strokes, shade, width in ((TREE, 255, 3), (BACKGROUND, 0, 7)):
        for stroke in strokes:
            draw.line([(u - LEFT, v - TOP) for u, v in stroke], fill=shade, width=width)
    scribbles.save(OUT / "scribbles.png", optimize=True)
    picture = np.asarray(Image.open(OUT / "picture.png").convert("RGB")) / 255.0
    alpha = estimate_alpha_cf(picture, np.asarray(scribbles) / 255.0)
    Image.fromarray(np.round(alpha * 255).astype(np.uint8)).save(OUT / "alpha.png", optimize=True)


main()
