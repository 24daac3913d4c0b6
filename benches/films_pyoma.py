#!/usr/bin/env python3
"""pyOMA2's SSI on the tracks of films in wind, beside our answers.

  films_pyoma.py CAPTURES_DIR FILM_DIR...        (pip install pyoma-2)

Each FILM_DIR is a folder as made_films.py writes it; its capture is the folder of the same name in CAPTURES_DIR. SSI-COV gets
the tracks of the capture as a user of a textbook would give them: the camera's motion taken off, points that are seen in most
frames, an even rate of 15 Hz, the principal motions of all points. Block rows, hard and soft criteria are pyOMA2's defaults.
Stable poles whose frequencies are close to one another are a mode, whose support is the number of model orders that have it.

pyOMA2 names no branch, so an answer of either is right here if it is within 2 % of the frequency of any true branch in view
(5 followed points), and a branch is found if any answer is within 2 % of it. Branches lie close together, so that much of this is
chance: by_chance is the share of the frequencies (on a scale of logarithms, from the slowest to the fastest branch in view) that
are within 2 % of one. One row a film, and one for all:

  in_view     true branches in view
  ours/theirs answers (theirs: modes whose support is 30 % of the largest one's, pyOMA2's own default for clusters)
  right       share of these that are right
  found       share of the branches in view that are found
  trunk       relative error of the fundamental, %: ours is the trunk's answer, theirs the slowest mode; '-' is none. An asterisk: our
              95 % interval holds the truth, and theirs is none

Last, with all films together: what pyOMA2 finds where so much more support is asked for that its share of right answers is ours.

Exit status: 0 done, 2 nothing run. Needs numpy and scipy.
"""
import argparse, csv, json, logging, os, sys, warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

os.environ["TQDM_DISABLE"] = "1"
import numpy as np
from pyoma2.algorithms import SSI
from pyoma2.setup import SingleSetup
from scipy.signal import decimate

from films_told import BRANCH_POINTS, RIGHT_WITHIN, Film, followed_points, relative_error, rows

warnings.filterwarnings("ignore")
logging.disable(logging.CRITICAL)

RATE_HZ, DECIMATED_BY = 30.0, 2
MIN_SEEN_SHARE = 0.8
MOTIONS = 8
MAX_ORDER, ORDER_STEP = 60, 2
BAND_HZ = (0.2, 5.0)  # what arborcam looks for by default, and what a tree has
SAME_MODE = 0.01  # stable poles that follow one another this closely are one mode
MIN_SUPPORT = 0.3


@dataclass
class Mode:
    hz: float
    support: int


@dataclass
class Told:
    """What one of the two says of a film."""
    answers_hz: list = field(default_factory=list)
    trunk_error: float = None
    holds: bool = False


@dataclass
class Compared:
    name: str
    in_view_hz: list
    trunk_hz: float
    ours: Told
    modes: list  # Mode, all of pyOMA2's

    def theirs(self, min_support):
        least = min_support * max((m.support for m in self.modes), default=0)
        kept = sorted(m.hz for m in self.modes if m.support >= least)
        return Told(kept, relative_error(kept[0], self.trunk_hz) if kept else None)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures_dir", type=Path)
    parser.add_argument("film_dir", type=Path, nargs="+")
    args = parser.parse_args()
    print("film      in_view by_chance | ours right found trunk  | theirs right found trunk", flush=True)
    films = []
    for folder in args.film_dir:
        capture = args.captures_dir / folder.resolve().name
        if not (capture / "nodes.csv").is_file():
            print(f"films_pyoma: {capture}: no capture", file=sys.stderr)
            continue
        films.append(compare(folder, capture))
        print(line(films[-1]), flush=True)
    if not films:
        sys.exit(2)
    summary(films)


def compare(folder, capture):
    film = Film(folder)
    on_branch = Counter(branch for branch, _ in followed_points(film, capture))
    in_view_hz = sorted(film.branches[b]["freq_hz"] for b, n in on_branch.items() if n >= BRANCH_POINTS)
    trunk_hz = next(b["freq_hz"] for b in film.branches.values() if b["parent"] not in film.branches)
    return Compared(folder.resolve().name, in_view_hz, trunk_hz, ours(capture, trunk_hz), ssi_modes(principal_motions(capture)))


def ours(capture, trunk_hz):
    told = Told()
    for row in rows(capture / "nodes.csv"):
        if row["identifiable"] != "true" or not row["frequency_hz"] or row.get("kind") == "copy":
            continue
        told.answers_hz.append(float(row["frequency_hz"]))
        if row["branch"] == "trunk" and told.trunk_error is None:
            told.trunk_error = relative_error(row["frequency_hz"], trunk_hz)
            told.holds = float(row["frequency_lo_hz"]) <= trunk_hz <= float(row["frequency_hi_hz"])
    return told


def principal_motions(capture):
    """(time, motion) at an even rate, the strongest motions of all points."""
    size = json.loads((capture / "capture.json").read_text())["source"]
    middle = np.array([(size["width"] - 1) / 2, (size["height"] - 1) / 2])
    camera = {row["frame"]: row for row in rows(capture / "camera.csv")}
    places = {}
    for table in ("tracks.csv", "left_out.csv"):
        for row in rows(capture / table) if (capture / table).is_file() else []:
            at_px = steady_px(np.array([float(row["u_px"]), float(row["v_px"])]), camera[row["frame"]], middle)
            places.setdefault(row["track_id"], []).append((float(row["time_s"]), *at_px))
    last_s = max(place[-1][0] for place in places.values())
    times_s = np.arange(0.0, last_s, 1 / RATE_HZ)
    signals = []
    for place in places.values():
        place = np.array(sorted(place))
        if len(place) >= MIN_SEEN_SHARE * len(times_s):
            signals += [np.interp(times_s, place[:, 0], place[:, k]) for k in (1, 2)]
    signals = np.array(signals).T
    signals -= signals.mean(axis=0)
    shares, strengths, _ = np.linalg.svd(signals, full_matrices=False)
    return decimate(shares[:, :MOTIONS] * strengths[:MOTIONS], DECIMATED_BY, axis=0)


def steady_px(filmed_px, camera, middle):
    """A place without the camera's motion (docs/files.md, camera.csv)."""
    roll = np.deg2rad(float(camera["roll_deg"]))
    back = np.array([[np.cos(roll), np.sin(roll)], [-np.sin(roll), np.cos(roll)]])
    shift = np.array([float(camera["dx_px"]), float(camera["dy_px"])])
    return middle + back @ (filmed_px - middle - shift) / float(camera["scale"])


def ssi_modes(motions):
    """The modes that stable poles make, without a limit on their support."""
    setup = SingleSetup(motions, fs=RATE_HZ / DECIMATED_BY)
    algorithm = SSI(name="ssi", method="cov", ordmax=MAX_ORDER, step=ORDER_STEP)
    setup.add_algorithms(algorithm)
    setup.run_by_name("ssi")
    result = algorithm.result
    is_stable = (result.Lab == 1) & np.isfinite(result.Fn_poles)
    is_stable &= (result.Fn_poles >= BAND_HZ[0]) & (result.Fn_poles <= BAND_HZ[1])
    order = np.nonzero(is_stable)[1]
    hz = result.Fn_poles[is_stable]
    modes, group = [], []
    for k in np.argsort(hz):
        if group and hz[k] > (1 + SAME_MODE) * hz[group[-1]]:
            modes.append(Mode(float(np.median(hz[group])), len(set(order[group]))))
            group = []
        group.append(k)
    if group:
        modes.append(Mode(float(np.median(hz[group])), len(set(order[group]))))
    return modes


def is_near(hz, others_hz):
    return any(abs(hz / other - 1) <= RIGHT_WITHIN for other in others_hz)


def right(told, film):
    return sum(is_near(hz, film.in_view_hz) for hz in told.answers_hz)


def found(told, film):
    return sum(any(relative_error(hz, truth) <= RIGHT_WITHIN for hz in told.answers_hz) for truth in film.in_view_hz)


def by_chance(film):
    """Share of the frequencies between the branches in view that are right."""
    if not film.in_view_hz:
        return float("nan")
    lo_hz, hi_hz = min(film.in_view_hz), max(film.in_view_hz)
    return np.mean([is_near(hz, film.in_view_hz) for hz in np.geomspace(lo_hz, hi_hz, 2000)])


def share(part, whole):
    return f"{part / whole:.2f}" if whole else "-"


def trunk(told):
    if told.trunk_error is None:
        return "-"
    return f"{100 * told.trunk_error:.1f}{'*' if told.holds else ''}"


def line(film):
    cells = []
    for told in (film.ours, film.theirs(MIN_SUPPORT)):
        n = len(told.answers_hz)
        cells.append(f"{n:4} {share(right(told, film), n):>5} {share(found(told, film), len(film.in_view_hz)):>5} {trunk(told):>6}")
    return f"{film.name:<9} {len(film.in_view_hz):7} {by_chance(film):9.2f} | {' | '.join(cells)}"


def pooled(films, tolds):
    """(answers, share of them right, share of branches found) over all films."""
    n = sum(len(told.answers_hz) for told in tolds)
    n_right = sum(right(told, film) for told, film in zip(tolds, films))
    n_found = sum(found(told, film) for told, film in zip(tolds, films))
    n_in_view = sum(len(film.in_view_hz) for film in films)
    return n, n_right / max(n, 1), n_found / max(n_in_view, 1)


def errors(tolds):
    known = [told.trunk_error for told in tolds if told.trunk_error is not None]
    return (f"fundamental of {len(known)} of {len(tolds)} films, {sum(e <= RIGHT_WITHIN for e in known)} within 2 %, "
            f"median error {100 * np.median(known):.1f} %" if known else "no fundamental")


def summary(films):
    our = [film.ours for film in films]
    n, precision, recall = pooled(films, our)
    print(f"all ours:   {n} answers, {precision:.2f} right, {recall:.2f} of the branches found; {errors(our)}, "
          f"{sum(told.holds for told in our)} intervals hold it")
    for min_support in (MIN_SUPPORT, *np.linspace(0.35, 1.0, 14)):
        their = [film.theirs(min_support) for film in films]
        n, their_precision, recall = pooled(films, their)
        if min_support == MIN_SUPPORT or their_precision >= precision:
            print(f"all theirs: support {min_support:.2f}: {n} modes, {their_precision:.2f} right, {recall:.2f} found; {errors(their)}")
        if their_precision >= precision:
            return
    print("all theirs: with no threshold of support is so large a share right")


if __name__ == "__main__":
    main()
