"""A film as a depth camera gives it: a pinhole 2 m before the tree, colour and depth in a folder of the RGB-D benchmark of TU Munich.

The tree of the seed is made smaller until it fills the picture at that distance. Depth has what real depth has:
  noise     normal, 1.425 mm at 1 m and growing with the square of the distance (Khoshelham and Elberink 2012), alike in pixels
            that touch
  flying    a pixel at an edge lies between what is before and behind
  holes     the shadow of the projector beside what is near (nothing is measured there), and blobs here and there; sky has none
  clock     its own: each image 2 to 8 ms after the colours, and one in fifty is missing
Chance is drawn from a generator of its own: tree, motion and colours of a seed are the same with other depth.
"""
import json
from dataclasses import dataclass

import cv2
import numpy as np

from . import picture
from .picture import FPS, HEIGHT, WIDTH

SEED_KEY = 0x64657074
DISTANCE_M = 2.0
FOCAL_PX = 525.0
UNIT_M = 1 / 5000
NOISE_PER_M = 1.425e-3
FINE = 2  # depth is drawn this many times larger: the pixels of an edge mix what is in them
BASELINE_M = 0.075  # from projector to camera
BLOBS, BLOB_PX = 12, (2, 6)
LOST_SHARE, LATE_S = 0.02, (0.002, 0.008)
FIRST_S = 1305031102.0  # a calendar time, as in the benchmark's own films


@dataclass
class Pinhole(picture.Camera):
    """Of the same scale at the foot's distance as the orthographic camera, whose place it takes."""

    @staticmethod
    def like(camera):
        return Pinhole(camera.px_per_m, camera.centre_m)

    @property
    def distance(self):
        """From the foot, in the tree's own metres."""
        return FOCAL_PX / self.px_per_m

    @property
    def shrink(self):
        """Real metres for each of the tree's own."""
        return DISTANCE_M / self.distance

    def project(self, points_m):
        scale = FOCAL_PX / (self.distance - points_m[..., 2])
        u = WIDTH / 2 - 0.5 + scale * (points_m[..., 0] - self.centre_m[0])
        v = HEIGHT / 2 - 0.5 - scale * (points_m[..., 1] - self.centre_m[1])
        return np.stack([u, v], axis=-1)

    def depth_m(self, points_m):
        return self.shrink * (self.distance - points_m[..., 2])

    def seen_m(self, points_m):
        """Real places in the camera's axes: x right, y down, z away."""
        x = points_m[..., 0] - self.centre_m[0]
        y = self.centre_m[1] - points_m[..., 1]
        return self.shrink * np.stack([x, y, self.distance - points_m[..., 2]], axis=-1)

    def as_file(self):
        return dict(width=WIDTH, height=HEIGHT, fx=FOCAL_PX, fy=FOCAL_PX, cx=WIDTH / 2 - 0.5, cy=HEIGHT / 2 - 0.5)


class DepthFilm:
    """Colour and depth images of a film, with their lists."""

    def __init__(self, folder, seed, camera):
        self.folder, self.camera = folder, camera
        self.rng = np.random.default_rng([SEED_KEY, seed])
        # A wall behind the tree, or the sky.
        self.behind_m = DISTANCE_M * self.rng.uniform(1.4, 2.5) if self.rng.random() < 0.5 else 0.0
        self.rgb, self.depth = [], []
        for name in ("rgb", "depth"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        (folder / "camera.json").write_text(json.dumps(camera.as_file()))

    def colours(self, f, image):
        name = f"rgb/{f:05}.jpg"
        cv2.imwrite(str(self.folder / name), image, [cv2.IMWRITE_JPEG_QUALITY, 95])
        self.rgb.append(f"{FIRST_S + f / FPS:.6f} {name}")

    def depths(self, f, skin, vertices_m):
        late_s, is_lost = self.rng.uniform(*LATE_S), self.rng.random() < LOST_SHARE
        seen = self.measured(self.rendered(skin, vertices_m))
        if not is_lost:
            name = f"depth/{f:05}.png"
            cv2.imwrite(str(self.folder / name), seen)
            self.depth.append(f"{FIRST_S + f / FPS + late_s:.6f} {name}")

    def close(self):
        for name, lines in (("rgb", self.rgb), ("depth", self.depth)):
            head = f"# {name} images of a made film\n# timestamp filename\n"
            (self.folder / f"{name}.txt").write_text(head + "\n".join(lines) + "\n")

    def rendered(self, skin, vertices_m):
        """True depth, m, FINE times as large; 0 for the sky."""
        canvas = np.full((FINE * HEIGHT, FINE * WIDTH), self.behind_m, np.float32)
        corners = self.camera.project(vertices_m)[skin.facets]
        d1, d2 = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        seen = np.flatnonzero((d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0] < 0) | skin.two_sided)
        depth_m = self.camera.depth_m(vertices_m)[skin.facets].mean(axis=1)
        fixed = np.round(((corners + 0.5) * FINE - 0.5) * 16).astype(np.int32)
        for i in seen[np.argsort(-depth_m[seen], kind="stable")]:
            cv2.fillConvexPoly(canvas, fixed[i], float(depth_m[i]), cv2.LINE_8, 4)
        return canvas

    def measured(self, true_m):
        """What the sensor makes of it: counts, 0 where it sees nothing."""
        parts = true_m.reshape(HEIGHT, FINE, WIDTH, FINE).transpose(0, 2, 1, 3).reshape(HEIGHT, WIDTH, -1)
        nothing = (parts == 0).any(axis=2)
        depth_m = parts.mean(axis=2)
        noise = cv2.GaussianBlur(self.rng.normal(0, 1, depth_m.shape), (3, 3), 0.6)
        depth_m = depth_m + noise / noise.std() * NOISE_PER_M * depth_m**2
        depth_m[nothing | self.shadow(depth_m)] = 0
        for _ in range(BLOBS):
            at = (int(self.rng.integers(WIDTH)), int(self.rng.integers(HEIGHT)))
            cv2.circle(depth_m, at, int(self.rng.integers(*BLOB_PX)), 0.0, -1)
        return np.clip(np.round(depth_m / UNIT_M), 0, 65535).astype(np.uint16)

    def shadow(self, depth_m):
        """Where the projector does not reach what is behind: to the left of what is near."""
        if self.behind_m == 0:
            return np.zeros(depth_m.shape, bool)
        near = depth_m < 0.5 * (DISTANCE_M + self.behind_m)
        width = FOCAL_PX * BASELINE_M * (1 / DISTANCE_M - 1 / self.behind_m)
        shaded = np.zeros_like(near)
        for k in range(1, max(int(width), 1) + 1):
            shaded[:, :-k] |= near[:, k:]
        return shaded & ~near

