"""Camera, drawing and the video file. Pixels: the centre of the top left one is (0, 0); u right, v down."""
import subprocess
from dataclasses import dataclass

import cv2
import numpy as np

WIDTH, HEIGHT, FPS = 640, 360, 30
FILM_WIDTH, FILM_HEIGHT = WIDTH, HEIGHT
ENLARGED = 1.0  # how many times as large as a frame of a film the picture is
FINE = 4  # the tree is drawn this many times larger and then averaged down
SHIFT = 4  # fractional bits of the corners of a facet on the fine picture
FOOT_V_PX, MARGIN_PX = 328.0, 8.0
NOISE_SIGMA = 2.5  # grey levels
MJPEG_QUALITY = 3  # ffmpeg's scale, 2 is best


def enlarge(factor):
    """Make pictures so many times as large; before the other modules are loaded."""
    global WIDTH, HEIGHT, ENLARGED, FOOT_V_PX, MARGIN_PX
    WIDTH, HEIGHT, ENLARGED = round(factor * WIDTH), round(factor * HEIGHT), factor
    FOOT_V_PX, MARGIN_PX = factor * FOOT_V_PX, factor * MARGIN_PX


@dataclass
class Camera:
    """Orthographic."""
    px_per_m: float
    centre_m: tuple
    roll_deg: float = 0.0  # of the tree in the picture, clockwise, about the foot

    @staticmethod
    def framing(rng, points_m):
        """Foot near the lower edge, the moving tree (T, N, 3) inside the picture."""
        half_width = np.abs(points_m[..., 0]).max()
        scale = min(ENLARGED * rng.uniform(44.0, 52.0), (FOOT_V_PX - MARGIN_PX) / points_m[..., 1].max(), (WIDTH / 2 - 40 * ENLARGED) / half_width)
        return Camera(float(scale), (float(rng.uniform(-0.8, 0.8)), float((FOOT_V_PX - HEIGHT / 2 + 0.5) / scale)))

    def project(self, points_m):
        cos, sin = np.cos(np.radians(self.roll_deg)), np.sin(np.radians(self.roll_deg))
        across, up = points_m[..., 0], points_m[..., 1]
        u = WIDTH / 2 - 0.5 + self.px_per_m * (cos * across + sin * up - self.centre_m[0])
        v = HEIGHT / 2 - 0.5 - self.px_per_m * (cos * up - sin * across - self.centre_m[1])
        return np.stack([u, v], axis=-1)


def fine_canvas(image):
    return cv2.resize(np.clip(image, 0, 255).astype(np.uint8), None, fx=FINE, fy=FINE, interpolation=cv2.INTER_NEAREST)


def draw(canvas, surface, vertices_m, camera, colours):
    """Paint the facets on the fine canvas, from back to front; colours is one tuple for each facet."""
    uv = camera.project(vertices_m)
    corners = uv[surface.facets]
    d1, d2 = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    towards_viewer = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0] < 0
    seen = np.flatnonzero(towards_viewer | surface.two_sided)
    order = seen[np.argsort(vertices_m[:, 2][surface.facets[seen]].sum(axis=1), kind="stable")]
    # The fine pixel k covers (k - 0.5 .. k + 0.5), of which FINE lie in one pixel of the film.
    fixed = np.round(((corners + 0.5) * FINE - 0.5) * (1 << SHIFT)).astype(np.int32)
    for i in order:
        cv2.fillConvexPoly(canvas, fixed[i], colours[i], cv2.LINE_8, SHIFT)


class Film:
    """Frames through ffmpeg into an MJPEG file, as a USB camera delivers them."""

    def __init__(self, path, rng):
        self.rng = rng
        self.bank = rng.normal(0, NOISE_SIGMA, (2 * HEIGHT, 2 * WIDTH, 3)).astype(np.float32)
        self.ffmpeg = subprocess.Popen(
            ["ffmpeg", "-v", "error", "-y",
             "-f", "rawvideo", "-pix_fmt", "bgr24", "-s", f"{WIDTH}x{HEIGHT}", "-r", str(FPS), "-i", "-",
             "-c:v", "mjpeg", "-q:v", str(MJPEG_QUALITY), "-pix_fmt", "yuvj422p", "-threads", "1",
             "-fflags", "+bitexact", str(path)],
            stdin=subprocess.PIPE)

    def noisy(self, image):
        y, x = self.rng.integers(HEIGHT), self.rng.integers(WIDTH)
        return np.clip(image + self.bank[y : y + HEIGHT, x : x + WIDTH] + 0.5, 0, 255).astype(np.uint8)

    def add(self, image):
        self.ffmpeg.stdin.write(self.noisy(image).tobytes())

    def close(self):
        self.ffmpeg.stdin.close()
        if self.ffmpeg.wait():
            raise SystemExit("ffmpeg could not write the film")


def film(path, rng, background, surface, pose, camera, frames, bad_input, depth_film=None):
    """Write the film, or with a depth camera its images. Only the part of the picture that a tree ever reaches is drawn anew in each frame."""
    trees = [(t.skin, t.pose, t.camera) for t in bad_input.trees(surface, pose, camera)]
    colours = [[tuple(map(float, c)) for c in np.clip(skin.colour, 0, 255)] for skin, _, _ in trees]
    behind, background = background, bad_input.backdrop(background, 0.0)
    clean, out = fine_canvas(background), Film(path, rng)
    image = np.clip(background, 0, 255).astype(np.float32)
    if bad_input.wires:
        bad_input.before_tree(clean)
        image = cv2.resize(clean, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA).astype(np.float32)
    canvas = clean.copy()
    reaches = [reach_px(pose, camera) for _, pose, camera in trees]
    if bad_input.reaches_everywhere():
        reaches.append(((0, 0), (WIDTH, HEIGHT)))
    x0, y0 = np.min([low for low, _ in reaches], axis=0)
    x1, y1 = np.max([high for _, high in reaches], axis=0)
    box = np.s_[FINE * y0 : FINE * y1, FINE * x0 : FINE * x1]
    for f in range(frames):
        if "drift" in bad_input.kinds:
            clean = fine_canvas(bad_input.backdrop(behind, f / FPS))
        canvas[box] = clean[box]
        for (skin, pose, camera), colour in zip(trees, colours):
            draw(canvas, skin, bad_input.moves.vertices_m(skin, pose, camera, f), camera, colour)
        bad_input.before_tree(canvas, f / FPS)
        image[y0:y1, x0:x1] = cv2.resize(canvas[box], (x1 - x0, y1 - y0), interpolation=cv2.INTER_AREA)
        if depth_film is None:
            out.add(bad_input.light(image, f / FPS))
            continue
        depth_film.colours(f, out.noisy(bad_input.light(image, f / FPS)))
        depth_film.depths(f, surface, surface.vertices_m(pose, f, f / FPS))
    out.close()
    if depth_film is not None:
        depth_film.close()
        path.unlink()


def reach_px(pose, camera):
    """The corners (u, v) of the box that the tree never leaves, whole pixels."""
    reach = camera.project(pose.points_m).reshape(-1, 2)
    # Leaves stand off their twig by up to half a metre.
    low = np.maximum(reach.min(0) - 0.6 * camera.px_per_m, 0).astype(int)
    return low, np.minimum(reach.max(0) + 0.6 * camera.px_per_m, (WIDTH, HEIGHT)).astype(int)
