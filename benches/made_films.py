#!/usr/bin/env python3
"""Films of made-up swaying trees whose true motion is known.

  made_films.py OUT_DIR NAME SEED leaves|bare release|held|wind [--seconds S] [--bad KIND]...

Why: a capture can be scored only against a film whose motion is known, and what is tuned on two films fits those two.
Each seed is another tree, with frequencies, pull and background of its own; the same seed gives the same film.

  release   let go with the first frame, 11 s          held   let go after about 1 s, 11 s          wind   red gusts, 14 s

Writes to OUT_DIR/NAME, 640x360 at 30 frames/s:
  video.mkv      MJPEG, as a USB camera delivers it
  outline.json   a rough polygon around the tree in frame 0
  truth.json     camera (orthographic), motion, and of each branch the parent, rest shape (m), undamped Hz, damping ratio,
                 radius at each point of the rest shape (px), whether it is seen there; of a film in wind also the mean shape
  wood.png       how much of each pixel shows this tree's wood at rest, 0 to 255; leaves.png: the same of its leaves
  wood_mean.png, leaves_mean.png   of a film in wind, in which the tree is never at rest: the same in its mean pose
  truth_markers.json, markers.json   with --markers: coloured discs on the branches, a board hides one of them for a second; where
                 each is in every frame; the windows and parents that a user would give
  rgb.txt, depth.txt, rgb/, depth/, camera.json   with --depth: the film as a depth camera gives it, in place of video.mkv; a pinhole
                 2 m before the tree, real metres (see made_films/depth.py)
  grid.npz       up to 2500 surface points seen in frame 0: pix0 (K, 2), branch (K), pos_2d (frames, K, 2), px

Pixels: the centre of the top left one is (0, 0), u right, v down. Metres: x right, y up, z towards the viewer, foot at 0.
--acts-back makes the tree one structure (made_films/structure.py): its modes are in truth.json, with those in which each branch
turns; a branch's freq_hz is that which it would have alone. The rope pulls at the trunk or at --rope-at, and bends what lies below it.
--tag hangs a printed tag beside the tree, which stands still whatever its background does.
--bad makes a film hard, and may be given several times. The tree and its motion are those of the seed without it, and all
truth is that of the camera and the tree at the beginning of the film:
BAD_KINDS

The steps are in made_films/: tree, motion, surface, scenery, bad_input (with bad_camera and walker), picture, truth. A tree is drawn as thousands of
small coloured facets that ride on its branches, four times too large and averaged down, so that it moves by parts of a
pixel: the centroid of a drawn facet is within about 0.03 px of where it should be. No cast shadows, no motion blur, no
exposure changes.

Needs numpy, scipy, opencv-python-headless and the ffmpeg program. About 10 s of one core for a bare tree, 20 s with leaves.
"""
import argparse, json
from pathlib import Path

import cv2
import numpy as np

from made_films import bad_input, depth, markers, motion, picture, scenery, structure, surface, tag, tree, truth

DEFAULT_SECONDS = {"release": 11.0, "held": 11.0, "wind": 14.0}


def main():
    kinds = "\n".join(f"  {kind:<15} {what}" for kind, what in bad_input.KINDS.items())
    about = __doc__.replace("BAD_KINDS", kinds)
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out_dir", type=Path)
    parser.add_argument("name")
    parser.add_argument("seed", type=int)
    parser.add_argument("look", choices=["leaves", "bare"])
    parser.add_argument("mode", choices=["release", "held", "wind"])
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--bad", action="append", default=[], choices=bad_input.KINDS)
    parser.add_argument("--markers", type=int, default=0, metavar="NUMBER", help="so many coloured markers at most")
    parser.add_argument("--depth", action="store_true", help="a depth camera films it, in real metres")
    parser.add_argument("--tag", action="store_true", help="a tag of 36 px hangs beside the tree (with --depth of 0.137 m)")
    parser.add_argument("--force", type=float, default=1.0, help="times as strong a pull")
    parser.add_argument("--roll", type=float, default=0.0, metavar="DEG", help="the camera is rolled: the tree leans to the right in the picture")
    parser.add_argument("--rope-at", type=int, metavar="BRANCH", help="the rope is on this branch (its id in truth.json): it and what "
                        "carries it are bent, the others are only shaken by the release; without it all are bent, or with --acts-back the trunk")
    parser.add_argument("--acts-back", nargs="?", type=float, const=1.0, metavar="TIMES", help="branches act back on what carries them; "
                        "TIMES the usual frequency of each branch but the trunk, which it would have alone")
    args = parser.parse_args()
    if args.acts_back is not None and not args.acts_back > 0:
        parser.error("--acts-back needs TIMES above 0")
    seconds = args.seconds or DEFAULT_SECONDS[args.mode]
    rope = tree.Rope(args.rope_at, args.force)
    make(args.out_dir / args.name, args.seed, args.look == "leaves", args.mode, round(seconds * picture.FPS), args.bad, args.markers,
         args.depth, rope, args.roll, args.tag, args.acts_back)


def make(folder, seed, leafy, mode, frames, bad_kinds, n_markers=0, has_depth=False, rope=None, roll_deg=0.0, has_tag=False,
         higher=None):
    rng, bad = np.random.default_rng(seed), bad_input.BadInput(bad_kinds, leafy)
    branches, pull_direction = tree.grow(rng, leafy)
    rope = rope or tree.Rope()
    whole = None
    if higher is not None:
        tree.raise_frequencies(branches, higher)
        whole = structure.Structure(branches)
    if whole and mode != "wind":
        whole.pull(pull_direction, rope)
    else:
        rope.bend(branches)
    theta_rad, drive = motion.sway(rng, branches, mode, np.arange(frames) / picture.FPS, whole)
    theta_rad = bad.sways(theta_rad)
    pose = motion.Pose(branches, theta_rad)
    camera = picture.Camera.framing(rng, pose.points_m)
    camera.roll_deg = roll_deg
    camera = depth.Pinhole.like(camera) if has_depth else camera
    skin = bad.more_leaves(seed, branches, pose, surface.cover(rng, branches, pose, leafy))
    background = scenery.scenery(rng, leafy, picture.WIDTH, picture.HEIGHT)
    bad.set_up(seed, background, skin, camera, frames)

    bad.tag_px = tag.place(picture.reach_px(pose, camera)) if has_tag else None
    hidden = bad.hides()
    put_on = markers.put_on(n_markers, branches, pose, camera, skin, frames, hidden)
    skin = surface.join([skin, *(m.skin for m in put_on)])
    if put_on:
        board = markers.board_before(put_on[-1], frames)
        bad.boards = [] if board is None else [board]
    seen = truth.facet_map(skin, pose, camera, hidden)
    pix0, branch, pos_2d = truth.grid(rng, skin, pose, camera, seen, frames)
    drive.update(pull_direction=truth.rounded(pull_direction), leaf_flutter_rad=surface.FLUTTER_RAD if leafy else 0.0)
    calm = surface.without_flutter(skin)
    rest = motion.Pose(branches, np.zeros((1, len(branches), 2)))
    seen_at_rest = truth.facet_map(calm, rest, camera, hidden)
    facts = truth.widths(branches, skin, rest, camera, seen_at_rest)
    pictures = dict(zip(["wood.png", "leaves.png"], truth.masks(skin, seen_at_rest)))
    if mode == "wind":
        mean = motion.Pose(branches, theta_rad.mean(axis=0)[None])
        seen_in_mean = truth.facet_map(calm, mean, camera, hidden)
        pictures |= dict(zip(["wood_mean.png", "leaves_mean.png"], truth.masks(skin, seen_in_mean)))
        for b, fact in zip(branches, facts):
            fact["mean_polyline"] = truth.rounded(mean.points_m[0, mean.first[b.id] : mean.first[b.id + 1]])
    film = dict(clip=folder.name, renderer="benches/made_films.py", tree=f"made up, seed {seed}", fps=float(picture.FPS),
                width=picture.WIDTH, height=picture.HEIGHT, n_frames=frames, coordinates=truth.COORDINATES,
                camera=truth.of_camera(camera), motion=drive, bad_input=bad_kinds,
                camera_shift_px=[truth.rounded(bad.moves.shift_px(f / picture.FPS)) for f in range(frames)],
                branches=truth.of_branches(branches, pose, camera, branch, facts))
    if whole:
        film.update(modes=whole.as_truth())
        for fact, modes in zip(film["branches"], whole.modes_of_branches(theta_rad)):
            fact["modes"] = modes

    folder.mkdir(parents=True, exist_ok=True)
    out = depth.DepthFilm(folder, seed, camera) if has_depth else None
    picture.film(folder / "video.mkv", rng, background, skin, pose, camera, frames, bad, out)
    for name, mask in pictures.items():
        cv2.imwrite(str(folder / name), mask)
    np.savez_compressed(folder / "grid.npz", pix0=pix0, branch=branch, pos_2d=pos_2d)
    (folder / "outline.json").write_text(json.dumps(truth.outline(seen)))
    (folder / "truth.json").write_text(json.dumps(film))
    if put_on:
        (folder / "truth_markers.json").write_text(json.dumps(markers.as_truth(put_on, board, put_on[-1])))
        (folder / "markers.json").write_text(json.dumps(markers.as_file(put_on)))


if __name__ == "__main__":
    main()
