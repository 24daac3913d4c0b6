"""A film as the field delivers it: from a tripod that trembles, coded, with an exposure that breathes, cropped, at half the rate.

Other than in edits.py the pictures change, and the truth with them. All frames but those of a lower rate are cropped by CROP_PX
on every side and coded anew, so that no edge of the picture shows; `crop` has nothing else, and is what the others compare with.
Pixels, seconds.
"""
import json, subprocess

import cv2
import numpy as np
from scipy.signal import lsim

from . import edits, motion

KINDS = {
    "tremble": "the tripod trembles in wind, by 1.5 px rms sideways and 0.9 px up and down",
    "h264": "coded as a telephone does, H.264 at a constant rate factor of 28",
    "exposure": "an exposure that breathes by 12 % in 4 s, and falls by 10 % after 60 % of the film",
    "crop": "16 px less on every side",
    "half_rate": "every second frame is left out",
}
CROP_PX = 16
TREMBLE_PX = (1.5, 0.9)
TRIPOD = (((2.3, 0.03), (4.7, 0.05)), ((3.4, 0.03),))  # (Hz, damping ratio) of its modes, sideways, and up and down
TRIPOD_HZ = [hz for modes in TRIPOD for hz, _ in modes]
GAIN_DEPTH, GAIN_PERIOD_S, GAIN_STEP, GAIN_STEP_SHARE = 0.12, 4.0, 0.10, 0.6
H264 = ["-c:v", "libx264", "-preset", "veryfast", "-crf", "28", "-pix_fmt", "yuv420p"]
MJPEG = ["-c:v", "mjpeg", "-q:v", "3", "-pix_fmt", "yuvj422p"]


def degrade(source, folder, kind):
    """Writes video.mkv, outline.json, grid.npz and truth.json, which is last: it says that the film is whole.

    Camera and truth are those of the first frame, as in made_films.py. The tripod's motion is drawn by the name of the source.
    """
    folder.mkdir(parents=True, exist_ok=True)
    truth = json.loads((source / "truth.json").read_text())
    outline = json.loads((source / "outline.json").read_text())
    with np.load(source / "grid.npz") as stored:
        grid = dict(stored)
    shifts_px = np.zeros((truth["n_frames"], 2))
    if kind == "half_rate":
        edits.half_rate(source / "video.mkv", folder / "video.mkv")
        grid["pos_2d"] = grid["pos_2d"][::2]
        truth |= dict(fps=truth["fps"] / 2, n_frames=len(grid["pos_2d"]))
    else:
        if kind == "tremble":
            shifts_px = tremble_px(np.random.default_rng(list(source.resolve().name.encode())), truth["n_frames"], truth["fps"])
        picture = np.array([truth["width"], truth["height"]])
        film(source / "video.mkv", folder / "video.mkv", kind, picture, shifts_px, truth["fps"])
        move(truth, outline, grid, shifts_px, picture - 2 * CROP_PX)
    truth["degraded"] = kind
    np.savez_compressed(folder / "grid.npz", **grid)
    (folder / "outline.json").write_text(json.dumps(outline))
    (folder / "truth.json").write_text(json.dumps(truth))


def tremble_px(rng, frames, fps):
    """(frames, 2) by how much the picture is aside of its first frame: modes of the tripod in gusts of wind."""
    time_s = np.arange(frames) / fps
    sides = []
    for modes, rms_px in zip(TRIPOD, TREMBLE_PX):
        motion_px = sum(driven(rng, hz, damping, time_s) for hz, damping in modes)
        sides.append(rms_px * motion_px / motion_px.std())
    shifts_px = np.stack(sides, axis=1)
    return shifts_px - shifts_px[0]


def driven(rng, hz, damping, time_s):
    """One mode in a wind of its own, deviation 1."""
    w = 2 * np.pi * hz
    gust = motion.red_noise(rng, len(time_s), time_s[1])
    system = ([[0, 1], [-w * w, -2 * damping * w]], [[0], [w * w]], [[1, 0]], [[0]])
    mode = lsim(system, gust, time_s)[1]
    return mode / mode.std()


def film(video, out, kind, picture, shifts_px, fps):
    """Reads a video, and writes it frame by frame as it then looks; picture is its width and height."""
    (width, height), inner = picture, np.s_[CROP_PX:-CROP_PX, CROP_PX:-CROP_PX]
    given = subprocess.Popen(["ffmpeg", "-v", "error", "-i", video, "-f", "rawvideo", "-pix_fmt", "bgr24", "-"], stdout=subprocess.PIPE)
    size = f"{width - 2 * CROP_PX}x{height - 2 * CROP_PX}"
    coder = H264 if kind == "h264" else MJPEG
    made = subprocess.Popen(["ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "bgr24", "-s", size, "-r", f"{fps}", "-i", "-",
                             *coder, "-threads", "1", "-fflags", "+bitexact", out], stdin=subprocess.PIPE)
    for frame, shift_px in enumerate(shifts_px):
        image = np.frombuffer(given.stdout.read(3 * width * height), np.uint8).reshape(height, width, 3)
        if shift_px.any():
            warp = np.column_stack([np.eye(2), shift_px])
            image = cv2.warpAffine(image, warp, (int(width), int(height)), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        if kind == "exposure":
            image = np.clip(image * gain(frame, len(shifts_px), fps) + 0.5, 0, 255).astype(np.uint8)
        made.stdin.write(np.ascontiguousarray(image[inner]).tobytes())
    given.stdout.close()
    made.stdin.close()
    if given.wait() or made.wait():
        raise SystemExit(f"ffmpeg could not make {out} of {video}")


def gain(frame, frames, fps):
    breath = 1 + GAIN_DEPTH * np.sin(2 * np.pi * frame / fps / GAIN_PERIOD_S)
    return breath - GAIN_STEP * (frame > GAIN_STEP_SHARE * frames)


def move(truth, outline, grid, shifts_px, picture):
    """Moves all that is given in pixels to where it is in the cropped picture. The camera's middle stays the picture's."""
    (width, height) = map(int, picture)
    for known in (truth, outline):
        known.update(width=width, height=height)
    outline["polygon_px"] = np.clip(np.array(outline["polygon_px"]) - CROP_PX, 0, picture - 1).tolist()
    grid["pix0"] = grid["pix0"] - np.float32(CROP_PX)
    grid["pos_2d"] = (grid["pos_2d"] - CROP_PX + shifts_px[:, None]).astype(np.float32)
    for branch in truth["branches"]:
        for end in ("rest_base_2d", "rest_tip_2d"):
            branch[end] = [x - CROP_PX for x in branch[end]]
