"""What makes a film hard: things behind, before and on the tree, bad light, a camera that moves. Pixels; colours blue, green,
red.

Chance is drawn from a generator of its own: tree, motion and noise of a seed are the same with and without these.
"""
from dataclasses import dataclass, field

import cv2
import numpy as np

from . import bad_camera, motion, picture, scenery, surface, tag, tree, walker
from .picture import FINE, FPS, HEIGHT, WIDTH

KINDS = {
    "brown_wall": "a wall behind the tree, as brown as its bark",
    "fence": "upright and level slats behind the crown, of about the bark's colour",
    "second_tree": "another tree behind, that sways in wind of its own",
    "shadow": "blotches of shadow that wander over everything",
    "wire": "two dark wires in front of the crown",
    "full_foliage": "leaves on all branches and the trunk, so that hardly any wood is seen",
    "night": "an eighth of the light, the camera's noise as before",
    "fog": "a seventh of the contrast, the rest is grey",
    "no_background": "one colour behind the tree: no sky, no houses, no ground",
    "no_tree": "what stands behind the tree, and no tree",
    "calm": "a tree that stands still",
    "walker": "a person who walks through in front of the tree, and back",
    "exposure": "an exposure that the camera changes all the time",
    "drift": "all that stands behind the tree goes slowly to the right, as clouds do",
    "banding": "bands of light and dark that roll through the picture, as lamps on the mains make them",
    **bad_camera.KINDS,
}
# Each kind's chance is by its place in this list, so that a new kind, at its end, changes no film of another.
WITH_CHANCE = ["brown_wall", "fence", "fog", "full_foliage", "night", "second_tree", "shadow", "wire", "no_background", "walker",
               "exposure", "hand_held"]
DRIFT_PX_S = 2.0
EXPOSURE_DEPTH, BAND_DEPTH, BAND_HZ, BANDS = 0.35, 0.25, 2.1, 1.5
SHADE_LEAST, SHADE_PX_S, SHADE_SWAY_PX, SHADE_SWAY_HZ = 0.5, 12.0, 25.0, 0.35
CROWN_LEAVES, TRUNK_LEAVES = 5000, 1500


@dataclass
class OtherTree:
    skin: surface.Surface
    pose: motion.Pose
    camera: picture.Camera


@dataclass
class BadInput:
    """What there is of it in one film."""
    kinds: list
    leafy: bool
    behind: list = field(default_factory=list)  # OtherTree
    boards: list = field(default_factory=list)  # markers.Board
    wires: list = field(default_factory=list)  # (N, 2) lines in pixels
    wire_px: float = 2.2
    shade: np.ndarray = None  # share of the light that is left, repeated sideways without a seam
    walks: walker.Walker = None
    exposure_hz: float = 0.0
    moves: bad_camera.Moves = None
    tag_px: np.ndarray = None  # the upper left corner of a tag

    def more_leaves(self, seed, branches, pose, skin):
        if "full_foliage" not in self.kinds:
            return skin
        rng, everywhere = own_rng(seed, "full_foliage"), (1.0,) * 5
        crown = surface.foliage(rng, branches, pose.first, CROWN_LEAVES, everywhere)
        trunk = surface.foliage(rng, branches[:1], pose.first, TRUNK_LEAVES, everywhere)
        return surface.join([skin, *crown, *trunk])

    def set_up(self, seed, background, skin, camera, frames):
        """Paints what stands still behind the tree into the background, and makes what moves."""
        bark_bgr = skin.colour[~skin.two_sided].mean(axis=0)
        self.moves = bad_camera.Moves(self.kinds, frames / FPS, own_rng(seed, "hand_held"))
        if "no_background" in self.kinds:
            background[:] = own_rng(seed, "no_background").uniform(170, 225) * np.array([1.0, 0.97, 0.94])
        if "walker" in self.kinds:
            self.walks = walker.Walker(own_rng(seed, "walker"), camera.px_per_m)
        if "exposure" in self.kinds:
            self.exposure_hz = own_rng(seed, "exposure").uniform(0.25, 0.9)
        if "brown_wall" in self.kinds:
            wall(own_rng(seed, "brown_wall"), background, bark_bgr)
        if "fence" in self.kinds:
            slats(own_rng(seed, "fence"), background, bark_bgr)
        if "second_tree" in self.kinds:
            self.behind.append(second_tree(own_rng(seed, "second_tree"), self.leafy, camera, frames))
        if "wire" in self.kinds:
            self.wires = wires(own_rng(seed, "wire"))
        if "shadow" in self.kinds:
            self.shade = shade(own_rng(seed, "shadow"))

    def sways(self, theta_rad):
        """The angles of the tree's branches, of which a calm tree has none."""
        return 0 * theta_rad if "calm" in self.kinds else theta_rad

    def trees(self, skin, pose, camera):
        """What is drawn, from back to front."""
        own = [] if "no_tree" in self.kinds else [OtherTree(skin, pose, camera)]
        return self.behind + own

    def reaches_everywhere(self):
        """Whether more of the picture changes than where trees are."""
        return self.walks is not None or "no_tree" in self.kinds or "drift" in self.kinds

    def backdrop(self, background, time_s):
        """What is behind the tree at a time; what goes out of the picture comes in as its mirror image."""
        if "drift" in self.kinds:
            warp = np.float32([[1, 0, DRIFT_PX_S * time_s], [0, 1, 0]])
            background = cv2.warpAffine(background, warp, (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
        if self.tag_px is not None:
            background = background.copy()
            tag.paint(background, self.tag_px)
        return background

    def before_tree(self, canvas, time_s=None):
        """Draws what hangs in front on the fine canvas, and at a time who walks there."""
        if time_s is not None and self.walks is not None:
            self.walks.draw(canvas, time_s)
        for board in self.boards if time_s is not None else []:
            board.draw(canvas, time_s)
        for line in self.wires:
            fixed = np.round(((line + 0.5) * FINE - 0.5) * (1 << picture.SHIFT)).astype(np.int32)
            cv2.polylines(canvas, [fixed], False, (48, 45, 45), round(self.wire_px * FINE), cv2.LINE_8, picture.SHIFT)

    def hides(self):
        """(fine height, fine width) where something in front hides the tree."""
        canvas = np.full((FINE * HEIGHT, FINE * WIDTH, 3), 255, np.uint8)
        self.before_tree(canvas)
        return canvas[..., 0] < 255

    def light(self, image, time_s):
        """The frame as the camera shows it in this light."""
        image = self.moves.seen(image, time_s)
        if self.exposure_hz:
            image = image * np.exp(EXPOSURE_DEPTH * np.sin(2 * np.pi * self.exposure_hz * time_s))
        if "banding" in self.kinds:
            phase = BANDS * np.arange(HEIGHT) / HEIGHT - BAND_HZ * time_s
            image = image * (1 + BAND_DEPTH * np.sin(2 * np.pi * phase))[:, None, None]
        if self.shade is not None:
            shift = SHADE_PX_S * time_s + SHADE_SWAY_PX * np.sin(2 * np.pi * SHADE_SWAY_HZ * time_s)
            moved = cv2.warpAffine(self.shade, np.float32([[1, 0, shift % (2 * WIDTH)], [0, 1, 0]]), (WIDTH, HEIGHT),
                                   flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
            image = image * moved[..., None]
        if "fog" in self.kinds:
            image = image / 7 + np.array([218, 213, 208]) * 6 / 7
        if "night" in self.kinds:
            image = image / 8 * np.array([1.15, 1.0, 0.9]) + 8
        return image


def own_rng(seed, kind):
    """A generator for one kind, whatever others the film has."""
    return np.random.default_rng([seed, WITH_CHANCE.index(kind)])


def wall(rng, img, bark_bgr):
    """Down to the ground; smears of brightness and a grain as coarse as the bark's."""
    foot = int(0.74 * HEIGHT)
    texture = 0.08 * scenery.noise(rng, foot, WIDTH, 8) + 0.10 * scenery.noise(rng, foot, WIDTH, 220, octaves=2)
    img[:foot] = bark_bgr * (1 + texture)[..., None]


def slats(rng, img, bark_bgr):
    """From above the crown's middle to the ground."""
    gap, width, top, foot = rng.integers([24, 5, 30, 285], [36, 9, 60, 300])
    mask = np.zeros(img.shape[:2], bool)
    for u in range(int(rng.integers(gap)), WIDTH, gap):
        mask[top:foot, u : u + width] = True
    for v in np.linspace(top + 12, foot - 12, 4).astype(int):
        mask[v - width // 2 : v - width // 2 + width] = True
    hue = bark_bgr * rng.uniform(0.9, 1.2)
    img[mask] = (hue * (1 + 0.10 * scenery.noise(rng, *mask.shape, 150, octaves=2))[..., None])[mask]


def second_tree(rng, leafy, camera, frames):
    """Farther off, so that it is smaller and its foot is higher; its crown stands behind this one's."""
    branches, _ = tree.grow(rng, leafy)
    theta_rad, _ = motion.sway(rng, branches, "wind", np.arange(frames) / FPS)
    pose = motion.Pose(branches, theta_rad)
    scale = 0.8 * camera.px_per_m
    foot_px = camera.project(np.zeros(3)) + (rng.choice([-1, 1]) * rng.uniform(70, 120), -rng.uniform(12, 20))
    centre = ((WIDTH / 2 - 0.5 - foot_px[0]) / scale, (foot_px[1] - HEIGHT / 2 + 0.5) / scale)
    return OtherTree(surface.cover(rng, branches, pose, leafy), pose, picture.Camera(float(scale), centre))


def wires(rng):
    """Two that sag a little, from one side of the picture to the other."""
    u = np.linspace(-10, WIDTH + 10, 60)
    lines = []
    for height_px in rng.uniform([70, 140], [120, 200]):
        slope, sag_px = rng.uniform(-0.12, 0.12), rng.uniform(4, 14)
        v = height_px + slope * (u - WIDTH / 2) + sag_px * (1 - (2 * u / WIDTH - 1) ** 2)
        lines.append(np.stack([u, v], axis=-1))
    return lines


def shade(rng):
    dark = (scenery.noise(rng, HEIGHT, WIDTH, 7) > 0.3).astype(np.float32)
    light = 1 - (1 - SHADE_LEAST) * cv2.GaussianBlur(dark, None, 3.0)
    return np.hstack([light, light[:, ::-1]])
