#!/usr/bin/env python3
"""How many branches' sway a built arborcam tells from films whose truth is known, and how well.

  films_told.py PROGRAM FILM_DIR...

Why: a change to the sway is judged by many films at once, as what helps on one may harm on another.
Each FILM_DIR is a folder as made_films.py writes it: video.mkv, outline.json, truth.json, grid.npz. PROGRAM replays the
video into a capture that is thrown away, and what the capture says is held against the truth: a line for each film, and
one for all of them, in which each branch and each answer counts alike, whatever film it is from.

  branches   true branches that at least 5 followed points are on (the branch itself, not what it carries)
  told       share of these whose frequency is given by a right answer
  answers    captured nodes with a frequency, called identifiable, that hold a followed point
  right      share of the answers within 2 % of the node's branch, or of one that carries it (trunk included)
  in_95      share of the 95 % intervals that hold the truth; right or wrong, the nearest of these branches is meant
  hz_err     median relative error of the frequency, over the branches told, by the nearest answer to each
  zeta_err   the same of the damping ratio, by the same answers where they have one
  seconds    of the clock, PROGRAM alone; for all films their sum

Shares and errors are parts of 1; '-' is nothing to take them of. A point is followed if it was born in frames 0 to 5
within 2.5 px of a known surface point: the nearest one's branch is its branch. Points are born on whole pixels and the
known ones lie on even pixels, so that two are often equally near; then scipy's k-d tree chooses, and the other choice moved
`branches` by up to two on 14 films. A node's branch is the deepest with at least 60 % of the node's points on it or on what it
carries. Frequencies are undamped, Hz.

Exit status: 0 done, 1 PROGRAM failed on a film (the others are told), 2 nothing run. Needs numpy and scipy.
"""
import argparse, csv, json, shutil, subprocess, sys, tempfile, time
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

LAST_BIRTH_FRAME, NEAR_PX = 5, 2.5
BRANCH_POINTS, NODE_SHARE, RIGHT_WITHIN = 5, 0.6, 0.02
FILM_FILES = ["video.mkv", "outline.json", "truth.json", "grid.npz"]


@dataclass
class Told:
    branches: int = 0
    answers_hz: list = field(default_factory=list)
    right: list = field(default_factory=list)
    in_interval: list = field(default_factory=list)
    hz_errors: list = field(default_factory=list)
    zeta_errors: list = field(default_factory=list)
    seconds: float = 0.0


class Film:
    def __init__(self, folder):
        with np.load(folder / "grid.npz") as grid:
            self.point_branch, self.points_px = grid["branch"], grid["pos_2d"].astype(float)
        self.branches = {b["id"]: b for b in json.loads((folder / "truth.json").read_text())["branches"]}
        self.near = {}

    def carriers(self, branch):
        """The branch itself, what carries it, and so on to the trunk."""
        return climb(branch, lambda b: self.branches[b]["parent"], self.branches)

    def branch_at(self, frame, place_px):
        """The branch seen at a place, or None away from all known points."""
        if frame >= len(self.points_px):
            return None
        if frame not in self.near:
            self.near[frame] = cKDTree(self.points_px[frame])
        distance_px, nearest = self.near[frame].query(place_px)
        return int(self.point_branch[nearest]) if distance_px <= NEAR_PX else None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("film_dir", type=Path, nargs="+")
    args = parser.parse_args()
    program = shutil.which(args.program) or refuse(f"{args.program}: no program that can be run; build it, or give its path")
    refuse_unless_films(args.film_dir)

    width = max(len("all 999 of 999"), *(len(f.resolve().name) for f in args.film_dir))
    print(f"{'film':<{width}} branches  told answers right in_95 hz_err zeta_err seconds", flush=True)
    tolds = []
    for folder in args.film_dir:
        with tempfile.TemporaryDirectory(prefix="films_told_") as scratch:
            capture = Path(scratch) / "capture"
            try:
                seconds = replay(program, folder, capture)
            except ReplayFailed as e:
                print(f"films_told: {folder}: {e}", file=sys.stderr, flush=True)
                continue
            tolds.append(compare(Film(folder), capture))
        tolds[-1].seconds = seconds
        print(line(folder.resolve().name, tolds[-1], width), flush=True)
    print(line(f"all {len(tolds)} of {len(args.film_dir)}", pooled(tolds), width))
    sys.exit(len(tolds) < len(args.film_dir))


def refuse_unless_films(folders):
    for folder in folders:
        for name in FILM_FILES:
            if not (folder / name).is_file():
                refuse(f"{folder / name} is missing; benches/made_films.py makes films")


def refuse(why):
    print(f"{Path(sys.argv[0]).stem}: {why}", file=sys.stderr)
    sys.exit(2)


class ReplayFailed(Exception):
    pass


def replay(program, folder, capture):
    """Seconds that it took."""
    start_s = time.monotonic()
    film = [folder / "video.mkv", "--outline", folder / "outline.json"]
    command = [program, "replay", *film, "--fast", "--headless", "--out", capture]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    seconds = time.monotonic() - start_s
    if done.returncode or not (capture / "nodes.csv").is_file() or not (capture / "tracks.csv").is_file():
        said = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise ReplayFailed(f"no capture from {program}, exit status {done.returncode}: {said}")
    return seconds


def compare(film, capture):
    nodes = {row["node_id"]: row for row in rows(capture / "nodes.csv")}
    points = followed_points(film, capture)
    on_branch = Counter(branch for branch, _ in points)
    targets = {b for b, n in on_branch.items() if n >= BRANCH_POINTS}
    of_node = by_node(points, nodes)

    told, best = Told(branches=len(targets)), {}
    for node, branches in of_node.items():
        answer = nodes[node]
        if answer["identifiable"] != "true" or not answer["frequency_hz"]:
            continue
        meant = [film.branches[b] for b in film.carriers(branch_of(film, branches))]
        errors = {b["id"]: relative_error(answer["frequency_hz"], b["freq_hz"]) for b in meant}
        told.answers_hz.append(float(answer["frequency_hz"]))
        told.right.append(any(e <= RIGHT_WITHIN for e in errors.values()))
        if meant and answer["frequency_lo_hz"] and answer["frequency_hi_hz"]:
            truth_hz = film.branches[min(errors, key=errors.get)]["freq_hz"]
            told.in_interval.append(float(answer["frequency_lo_hz"]) <= truth_hz <= float(answer["frequency_hi_hz"]))
        for b, error in errors.items():
            if b in targets and error <= min(RIGHT_WITHIN, best.get(b, (np.inf,))[0]):
                best[b] = error, answer["damping_ratio"]
    told.hz_errors = [error for error, _ in best.values()]
    told.zeta_errors = [relative_error(zeta, film.branches[b]["damping"]) for b, (_, zeta) in best.items() if zeta]
    return told


def by_node(points, nodes):
    """What (what, node) points say, by node: each holds its own points and those of all nodes that it carries."""
    of_node = defaultdict(list)
    for what, node in points:
        for n in climb(node, lambda n: nodes[n]["parent_id"], nodes):
            of_node[n].append(what)
    return of_node


def found_points(capture):
    """(row of its birth, captured node or "") of each point; the node is the last that it was put to."""
    births, last_node = {}, {}
    # The sway is that of all points, those that were left out of the tree among them.
    tables = [table for name in ("tracks.csv", "left_out.csv") if (table := capture / name).is_file()]
    seen = [row for table in tables for row in rows(table)]
    for row in sorted(seen, key=lambda row: int(row["frame"])):
        births.setdefault(row["track_id"], row)
        if row["node_id"]:
            last_node[row["track_id"]] = row["node_id"]
    return [(birth, last_node.get(track, "")) for track, birth in births.items()]


def followed_points(film, capture):
    """(true branch, captured node or "") of each point that counts."""
    points = []
    for birth, node in found_points(capture):
        if int(birth["frame"]) <= LAST_BIRTH_FRAME:
            branch = film.branch_at(int(birth["frame"]), [float(birth["u_px"]), float(birth["v_px"])])
            if branch is not None:
                points.append((branch, node))
    return points


def branch_of(film, branches):
    """The deepest branch that carries most of these, or None. Of one depth there is never more than one."""
    carried = Counter(c for b in branches for c in film.carriers(b))
    mostly = [c for c, n in carried.items() if n >= NODE_SHARE * len(branches)]
    return max(mostly, key=lambda c: len(film.carriers(c)), default=None)


def climb(start, parent_of, known):
    """From one to the root, as a list; nothing from one that is not known."""
    path = []
    while start in known:
        path.append(start)
        start = parent_of(start)
    return path


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def relative_error(answer, truth):
    return abs(float(answer) / truth - 1)


def pooled(tolds):
    total = Told()
    for told in tolds:
        for name, value in vars(told).items():
            setattr(total, name, getattr(total, name) + value)
    return total


def share(part, whole):
    return f"{part / whole:.3f}" if whole else "-"


def line(name, told, width):
    middle = lambda errors, digits: f"{np.median(errors):.{digits}f}" if errors else "-"
    return (f"{name:<{width}} {told.branches:8} {share(len(told.hz_errors), told.branches):>5} {len(told.right):7}"
            f" {share(sum(told.right), len(told.right)):>5} {share(sum(told.in_interval), len(told.in_interval)):>5}"
            f" {middle(told.hz_errors, 4):>6} {middle(told.zeta_errors, 3):>8} {told.seconds:7.1f}")


if __name__ == "__main__":
    main()
