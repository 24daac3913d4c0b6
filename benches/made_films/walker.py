"""A person who walks to and fro in front of the tree: head, body, arms and legs as thick lines. Pixels, seconds."""
import cv2
import numpy as np

from .picture import FINE, FOOT_V_PX, SHIFT, WIDTH

TALL_M, SPEED_M_S, STRIDE_HZ = 1.75, 1.4, 0.95
NEARER = 1.15  # nearer to the camera than the tree, and so larger
OFF_PX = 60.0  # as far beyond the picture's edge does the person turn round


class Walker:
    def __init__(self, rng, px_per_m):
        self.px_per_m = NEARER * px_per_m
        self.from_left, self.start_s = rng.random() < 0.5, rng.uniform(0.5, 1.5)
        self.coat, self.legs = (tuple(map(float, rng.uniform(30, 200, 3))) for _ in range(2))

    def foot_px(self, time_s):
        """Where the person stands."""
        way, span = self.px_per_m * SPEED_M_S * max(time_s - self.start_s, 0.0), WIDTH + 2 * OFF_PX
        there = span - abs(way % (2 * span) - span)
        u = there if self.from_left else span - there
        return np.array([u - OFF_PX, FOOT_V_PX + 16])

    def draw(self, canvas, time_s):
        """Draws the person on the fine canvas."""
        swing = 0.45 * np.sin(2 * np.pi * STRIDE_HZ * time_s)
        foot = self.foot_px(time_s)
        at = lambda right_m, up_m: foot + self.px_per_m * np.array([right_m, -up_m])
        hip, neck, head = at(0, 0.88), at(0, 1.42), at(0, TALL_M - 0.12)
        for side in (-1, 1):
            knee, ankle = at(0.42 * np.sin(side * swing), 0.46), at(0.85 * np.sin(side * swing), 0.05)
            self.line(canvas, [hip, knee, ankle], 0.15, self.legs)
        self.line(canvas, [hip, neck], 0.34, self.coat)
        dark = tuple(0.5 * c for c in self.coat)
        for up_m in (1.0, 1.15, 1.3):
            self.line(canvas, [at(-0.12, up_m), at(0.12, up_m)], 0.04, dark)
        for side in (-1, 1):
            self.line(canvas, [at(0, 1.36), at(0.5 * np.sin(-side * swing), 0.85)], 0.10, dark)
        self.line(canvas, [head, head], 0.22, (120.0, 150.0, 190.0))

    def line(self, canvas, places_px, wide_m, colour):
        fixed = np.round(((np.array(places_px) + 0.5) * FINE - 0.5) * (1 << SHIFT)).astype(np.int32)
        cv2.polylines(canvas, [fixed], False, colour, round(wide_m * self.px_per_m * FINE), cv2.LINE_8, SHIFT)
