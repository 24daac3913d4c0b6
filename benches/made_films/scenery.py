"""What stands still behind the tree: sky, buildings, ground, a fence and bushes, all made of noise. Pixels."""
import cv2
import numpy as np


def scenery(rng, leafy, width, height):
    """(height, width, 3) float, blue green red."""
    horizon = int(height * rng.uniform(0.68, 0.76))
    img = sky(rng, width, height, horizon)
    x = -int(rng.uniform(0, 80))
    while x < width:
        w = int(rng.uniform(90, 230))
        if rng.random() < 0.75:
            building(rng, img, x, w, horizon - int(rng.uniform(45, 130)), horizon)
        x += w + int(rng.uniform(0, 90))
    ground(rng, img, horizon, leafy)
    if rng.random() < 0.7:
        fence(rng, img, horizon + 4)
    for _ in range(rng.integers(2, 6)):
        bush(rng, img, (int(rng.uniform(0, width)), int(rng.uniform(horizon, height - 20))), leafy)
    return img


def noise(rng, height, width, cells, octaves=4, stretch=1.0):
    """Fractal noise of deviation 1; cells across the width, stretched sideways."""
    out = np.zeros((height, width), np.float32)
    for k in range(octaves):
        n = cells * 2**k
        grid = rng.normal(0, 1, (max(2, int(n * stretch * height / width) + 2), n + 2)).astype(np.float32)
        out += 0.6**k * cv2.resize(grid, (width, height), interpolation=cv2.INTER_CUBIC)
    return out / out.std()


def sky(rng, width, height, horizon):
    top, low = rng.uniform([190, 165, 140], [235, 205, 185]), rng.uniform([215, 205, 195], [240, 235, 232])
    mix = np.clip(np.arange(height) / horizon, 0, 1)[:, None, None]
    clouds = rng.uniform(3, 9) * noise(rng, height, width, 4, stretch=2.0)
    return (1 - mix) * top + mix * low + clouds[..., None]


def building(rng, img, x, w, top, foot):
    x0, x1 = max(x, 0), min(x + w, img.shape[1])
    if x1 - x0 < 8:
        return
    plaster_or_brick = [[60, 85, 150], [130, 150, 165], [95, 120, 160], [150, 150, 150]]
    hue = np.array(plaster_or_brick[rng.integers(4)]) * rng.uniform(0.8, 1.1)
    h = foot - top
    wall = 0.05 * noise(rng, h, w, 6) + 0.06 * noise(rng, h, w, w // 4, octaves=2, stretch=2.5)
    rows = (np.arange(h) % 4 == 0)[:, None] * -0.05
    face = hue * (1 + wall + rows)[..., None]
    step_x, step_y, win_w, win_h = rng.integers([30, 38, 14, 20], [46, 52, 22, 30])
    for wy in range(10, h - win_h, step_y):
        for wx in range(8, w - win_w, step_x):
            face[wy - 2 : wy + win_h + 1, wx - 1 : wx + win_w + 1] = 200
            glass = face[wy : wy + win_h, wx : wx + win_w]
            glass[:] = np.array([110, 80, 60]) * rng.uniform(0.4, 1.2) + np.linspace(0, 25, win_h)[:, None, None]
            glass[win_h // 2 - 1 : win_h // 2 + 1] = 215
            glass[:, win_w // 2 - 1 : win_w // 2 + 1] = 215
    img[top:foot, x0:x1] = face[:, x0 - x : x1 - x]


def ground(rng, img, horizon, leafy):
    h, w = img.shape[0] - horizon, img.shape[1]
    hue = np.array([60, 125, 95]) if leafy else rng.uniform(110, 150) * np.array([1.0, 1.0, 0.98])
    texture = 0.06 * noise(rng, h, w, 12, stretch=4) + 0.06 * noise(rng, h, w, 60, octaves=2, stretch=4)
    texture += 0.10 * noise(rng, h, w, 200, octaves=2, stretch=2)
    img[horizon:] = hue * rng.uniform(0.85, 1.1) * (1 + texture)[..., None]


def fence(rng, img, top):
    hue, gap, w = rng.uniform([100, 115, 130], [140, 155, 175]), int(rng.uniform(28, 44)), img.shape[1]
    mask = np.zeros(img.shape[:2], bool)
    for rail in (2, 15):
        mask[top + rail : top + rail + 4] = True
    for x in range(int(rng.uniform(0, gap)), w, gap):
        mask[top : top + 30, x : x + 5] = True
    img[mask] = (hue * (1 + 0.08 * noise(rng, *mask.shape, 150, octaves=2))[..., None])[mask]


def bush(rng, img, centre, leafy):
    h, w = img.shape[:2]
    y, x = np.mgrid[:h, :w]
    rx, ry = rng.uniform(18, 40), rng.uniform(10, 22)
    inside = ((x - centre[0]) / rx) ** 2 + ((y - centre[1]) / ry) ** 2 + 0.22 * noise(rng, h, w, 50, octaves=2) < 1
    hue = np.array([30, 75, 45]) if leafy else np.array([45, 65, 75])
    img[inside] = (hue * np.clip(np.exp(0.4 * noise(rng, h, w, 210, octaves=2)), 0.3, 2)[..., None])[inside]
