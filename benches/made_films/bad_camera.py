"""A camera that moves, loses its focus or is covered, and one that reads its lines one after the other. Pixels, seconds."""
import cv2
import numpy as np

from .picture import FPS, HEIGHT, WIDTH

KINDS = {
    "pan": "the camera is turned aside by a fifth of the picture's width after 60 % of the film",
    "zoom": "the picture is drawn a third larger from then on",
    "focus": "the camera loses its focus then",
    "covered": "something is laid over the lens then",
    "slow_pan": "the camera turns slowly from the first to the last frame",
    "hand_held": "the camera is held in a hand, which trembles and sways by some pixels",
    "rolling_shutter": "lines are read one after the other, the last one 25 ms after the first",
}
CHANGE_SHARE, CHANGE_S = 0.6, 0.7  # when it happens, as a share of the film, and how long it takes
PAN_PX, ZOOM, BLUR_PX, SLOW_PAN_PX_S = 0.2 * WIDTH, 4 / 3, 6.0, 6.0
HAND_PX, HAND_HZ = (3.0, 1.2, 0.5), (0.25, 0.8, 2.5)
READOUT_S = 0.025


class Moves:
    """What the camera does in one film."""

    def __init__(self, kinds, seconds, rng):
        self.kinds, self.change_s = kinds, CHANGE_SHARE * seconds
        self.hand_hz = np.array(HAND_HZ)[:, None] * rng.uniform(0.8, 1.25, (3, 2))
        self.hand_phase = rng.uniform(0, 2 * np.pi, (3, 2))

    def changed(self, time_s):
        """How far the change has gone, 0 to 1, without a jerk."""
        t = np.clip((time_s - self.change_s) / CHANGE_S, 0, 1)
        return t * t * (3 - 2 * t)

    def shift_px(self, time_s):
        """By how much the picture has gone aside, against its first frame."""
        shift = np.zeros(2)
        if "pan" in self.kinds:
            shift[0] += PAN_PX * self.changed(time_s)
        if "slow_pan" in self.kinds:
            shift[0] += SLOW_PAN_PX_S * time_s
        if "hand_held" in self.kinds:
            sway = lambda t: np.array(HAND_PX) @ np.sin(2 * np.pi * self.hand_hz * t + self.hand_phase)
            shift += sway(time_s) - sway(0.0)
        return shift

    def seen(self, image, time_s):
        """The frame as it is seen; beyond the picture's edge the scene goes on as its mirror image."""
        shift, zoom = self.shift_px(time_s), 1.0
        if "zoom" in self.kinds:
            zoom += (ZOOM - 1) * self.changed(time_s)
        if shift.any() or zoom != 1.0:
            centre = np.array([WIDTH - 1, HEIGHT - 1]) / 2
            warp = np.column_stack([zoom * np.eye(2), (1 - zoom) * centre + shift])
            image = cv2.warpAffine(image, warp, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        blur_px = BLUR_PX * self.changed(time_s)
        if "focus" in self.kinds and blur_px > 0.1:
            image = cv2.GaussianBlur(image, None, blur_px)
        if "covered" in self.kinds:
            image = image * (1 - 0.97 * self.changed(time_s))
        return image

    def vertices_m(self, skin, pose, camera, frame):
        """The vertices of a tree as they are when their line is read."""
        here = skin.vertices_m(pose, frame, frame / FPS)
        if "rolling_shutter" not in self.kinds or frame + 1 == len(pose.points_m):
            return here
        late = READOUT_S * FPS * np.clip(camera.project(here)[:, 1] / HEIGHT, 0, 1)
        return here + late[:, None] * (skin.vertices_m(pose, frame + 1, (frame + 1) / FPS) - here)
