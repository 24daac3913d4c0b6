#!/usr/bin/env python3
"""How well a built arborcam finds the camera's motion by a tag beside the tree, and without it.

  tag_told.py ARBORCAM FILM_DIR... [--out DIR]

FILM_DIR are films of made_films.py --tag, with or without --bad hand_held, drift or no_background. Each is replayed with `--tag`
and without. One row a film and replay:
  shown by   frames in which camera.csv says seen, foot, or nothing
  err px     how far the camera's shift in the middle of the picture is from the true one: median, 95 % of the frames, largest
  crown px   the same where the tree is highest, where a wrong turn counts most, 95 %
  said       whether a warning says that the surroundings move against the tag
"""
import argparse, csv, json, subprocess, tempfile
from pathlib import Path

import numpy as np

SIZE_M = 0.16


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arborcam", type=Path)
    parser.add_argument("films", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, help="keeps the captures there")
    args = parser.parse_args()
    print(f"{'film':<12}{'':<8}{'seen':>6}{'foot':>6}{'none':>6}{'err px':>9}{'95 %':>7}{'worst':>7}{'crown':>7}  said")
    with tempfile.TemporaryDirectory() as work:
        for film in args.films:
            for name, tag in (("tag", ["--tag", str(SIZE_M)]), ("no tag", [])):
                row(args.arborcam.resolve(), film, (args.out or Path(work)) / f"{film.name}-{name.replace(' ', '-')}", name, tag)


def row(arborcam, film, out, name, tag):
    truth = json.loads((film / "truth.json").read_text())
    true_px = np.array(truth["camera_shift_px"])
    done = subprocess.run([arborcam, "replay", film / "video.mkv", "--outline", film / "outline.json", "--fast", "--headless", *tag,
                           "--out", out], check=True, capture_output=True, text=True)
    with open(out / "camera.csv") as f:
        rows = list(csv.DictReader(f))
    frames = [int(r["frame"]) for r in rows]
    shift = np.array([[float(r["dx_px"]), float(r["dy_px"])] for r in rows])
    turn = np.radians([float(r["roll_deg"]) for r in rows])
    scale = np.array([float(r["scale"]) for r in rows])
    crown = np.array(min(json.loads((film / "outline.json").read_text())["polygon_px"], key=lambda p: p[1])) - [319.5, 179.5]
    off = shift - true_px[frames]
    turned = scale[:, None] * np.stack([np.cos(turn) * crown[0] - np.sin(turn) * crown[1],
                                        np.sin(turn) * crown[0] + np.cos(turn) * crown[1]], axis=-1) - crown
    middle, at_crown = np.hypot(*off.T), np.hypot(*(off + turned).T)
    shown = [r["background"] for r in rows]
    nothing = len(rows) - shown.count("seen") - shown.count("foot")
    print(f"{film.name:<12}{name:<8}{shown.count('seen'):>6}{shown.count('foot'):>6}{nothing:>6}{np.median(middle):>9.3f}"
          f"{np.quantile(middle, 0.95):>7.2f}{middle.max():>7.2f}{np.quantile(at_crown, 0.95):>7.2f}  {'yes' if 'against the tag' in done.stderr else 'no'}",
          flush=True)


if __name__ == "__main__":
    main()
