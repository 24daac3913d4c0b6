#!/usr/bin/env python3
"""What is left of a built arborcam's answers when films, and the tracks of captures, are disturbed.

  degraded_films.py PROGRAM FILM_DIR... [--out DIR] [--only KIND]...

Why: films are made with a camera that stands still, and loses nothing. In the field it trembles, codes and adjusts itself; and an
answer that depends on a twentieth of a pixel was chance. Each FILM_DIR is a folder as made_films.py writes it. Films are disturbed
by made_films/degraded.py, which says what each kind is, and replayed:

  tremble  h264  exposure  crop  half_rate

A row for each film, one for each kind, which is compared with the films as they are ('as_filmed'):

  told, answers, right, in_95   as in films_told.py
  kept       told, as a part of that of the films as they are
  tripod     answers that are not right, and within 2 % of a frequency of the tripod

A film of which PROGRAM makes no capture has its branches, and no answer. Then the captures of the films as they are, whose tracks are
disturbed and analysed anew (`arborcam analyze`), with the same tree:

  noise      0.05 px (one standard deviation) added to each place, ten draws
  left_out   one point in twenty left out, three draws
  later      the first second is not analysed (--from 1)

A row for each: the Jaccard index of the answers with those of the undisturbed tracks, which is the share that stays the same of the
nodes that have an answer in either: a node's answer is the same within 2 %. Median and least of the draws; last the median over
films of each film's median. Of a film without an answer in either there is none, '-'.

Films and captures are left in --out (default: a folder that is thrown away), in KIND-FILM and captures/KIND-FILM, and are used where they
are there. Exit status: 0 done, 1 PROGRAM failed on a film as it is, 2 nothing run. Needs numpy, scipy, opencv-python-headless and ffmpeg.
"""
import argparse, csv, io, shutil, subprocess, sys, tempfile
from pathlib import Path

import numpy as np

from films_told import RIGHT_WITHIN, Film, ReplayFailed, Told, compare, pooled, refuse, refuse_unless_films, replay, rows, share
from made_films import degraded

AS_FILMED = "as_filmed"
NOISE_PX, LEFT_OUT_SHARE, LATER_S = 0.05, 0.05, 1.0
DRAWS = {"noise": 10, "left_out": 3, "later": 1}
TABLES = ["tracks.csv", "left_out.csv"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("film_dir", type=Path, nargs="+")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--only", action="append", choices=[*degraded.KINDS, *DRAWS], metavar="KIND")
    args = parser.parse_args()
    program = shutil.which(args.program) or refuse(f"{args.program}: no program that can be run; build it, or give its path")
    refuse_unless_films(args.film_dir)
    chosen = args.only or [*degraded.KINDS, *DRAWS]
    with tempfile.TemporaryDirectory(prefix="degraded_films_") as scratch:
        out = args.out or Path(scratch)
        films = replay_as_filmed(program, args.film_dir, out)
        compare_films(program, films, out, [kind for kind in degraded.KINDS if kind in chosen])
        compare_tracks(program, films, out, [kind for kind in DRAWS if kind in chosen])
    sys.exit(len(films) < len(args.film_dir))


def capture_of(out, kind, folder):
    return out / "captures" / f"{kind}-{folder.resolve().name}"


def replay_as_filmed(program, folders, out):
    """The score of each film as it is; those of which there is no capture are left out."""
    films = {}
    for folder in folders:
        try:
            films[folder] = told_of(program, folder, capture_of(out, AS_FILMED, folder))
        except ReplayFailed as e:
            print(f"degraded_films: {folder}: {e}", file=sys.stderr, flush=True)
    return films or refuse("no capture of any film")


def told_of(program, folder, capture):
    if not capture.is_dir():
        capture.parent.mkdir(parents=True, exist_ok=True)
        replay(program, folder, capture)
    return compare(Film(folder), capture)


def compare_films(program, films, out, kinds):
    """A row for each film as it is and disturbed, and for all of them."""
    width = max(len(folder.resolve().name) for folder in films)
    print(f"{'film':<{width}} {'kind':<9} branches  told  kept answers right in_95 tripod", flush=True)
    of_kind = {kind: [] for kind in (AS_FILMED, *kinds)}
    for folder, as_filmed in films.items():
        for kind, tolds in of_kind.items():
            tolds.append(as_filmed if kind == AS_FILMED else told_of_disturbed(program, folder, out, kind, as_filmed))
            print(film_line(folder.resolve().name, width, kind, tolds[-1], as_filmed), flush=True)
    for kind, tolds in of_kind.items():
        print(film_line(f"all {len(films)}", width, kind, pooled(tolds), pooled(films.values())), flush=True)


def told_of_disturbed(program, folder, out, kind, as_filmed):
    disturbed = out / f"{kind}-{folder.resolve().name}"
    if not (disturbed / "truth.json").is_file():
        degraded.degrade(folder, disturbed, kind)
    try:
        return told_of(program, disturbed, capture_of(out, kind, folder))
    except ReplayFailed as e:
        print(f"degraded_films: {disturbed}: {e}", file=sys.stderr, flush=True)
        return Told(branches=as_filmed.branches)


def film_line(name, width, kind, told, as_filmed):
    recall = len(told.hz_errors) / max(told.branches, 1)
    undisturbed = len(as_filmed.hz_errors) / max(as_filmed.branches, 1)
    tripod = [hz for hz, right in zip(told.answers_hz, told.right) if not right and is_tripods(hz)]
    return (f"{name:<{width}} {kind:<9} {told.branches:8} {share(len(told.hz_errors), told.branches):>5} {share(recall, undisturbed):>5}"
            f" {len(told.right):7} {share(sum(told.right), len(told.right)):>5} {share(sum(told.in_interval), len(told.in_interval)):>5}"
            f" {len(tripod):6}")


def is_tripods(hz):
    return any(abs(hz / own - 1) <= RIGHT_WITHIN for own in degraded.TRIPOD_HZ)


def compare_tracks(program, films, out, kinds):
    """A row for each film and each way in which its tracks are disturbed."""
    if not kinds:
        return
    width = max(len(folder.resolve().name) for folder in films)
    print(f"\n{'film':<{width}} {'kind':<9} answers median least", flush=True)
    medians = {kind: [] for kind in kinds}
    for folder in films:
        capture = capture_of(out, AS_FILMED, folder)
        undisturbed = answers(program, capture)
        for kind in kinds:
            draws = range(DRAWS[kind])
            indices = [jaccard(undisturbed, disturbed_answers(program, capture, kind, draw)) for draw in draws]
            known = [index for index in indices if index is not None]
            medians[kind] += [np.median(known)] if known else []
            found = f"{np.median(known):6.3f} {min(known):5.3f}" if known else f"{'-':>6} {'-':>5}"
            print(f"{folder.resolve().name:<{width}} {kind:<9} {len(undisturbed):7} {found}", flush=True)
    for kind, of_films in medians.items():
        print(f"{f'all {len(of_films)}':<{width}} {kind:<9} {'':7} {f'{np.median(of_films):6.3f}' if of_films else f'{str():>5}-'}", flush=True)


def answers(program, capture, *options):
    """Hz by node."""
    done = subprocess.run([program, "analyze", capture, "--csv", *options], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"degraded_films: {capture}: no table from {program}, exit status {done.returncode}: {done.stderr.strip()}")
    return {row["node_id"]: float(row["frequency_hz"]) for row in csv.DictReader(io.StringIO(done.stdout)) if row["frequency_hz"]}


def disturbed_answers(program, capture, kind, draw):
    if kind == "later":
        return answers(program, capture, "--from", f"{LATER_S}")
    rng = np.random.default_rng(draw)
    tables = {name: table for name in TABLES if (capture / name).is_file() and (table := rows(capture / name))}
    if kind == "noise":
        add_noise(tables, rng)
    else:
        leave_out(tables, rng)
    with tempfile.TemporaryDirectory(prefix="degraded_films_") as scratch:
        for file in capture.resolve().iterdir():
            if file.name in tables:
                write_table(Path(scratch) / file.name, tables[file.name])
            else:
                (Path(scratch) / file.name).symlink_to(file)
        return answers(program, scratch)


def add_noise(tables, rng):
    for row in (row for table in tables.values() for row in table):
        for axis in ("u_px", "v_px"):
            row[axis] = f"{float(row[axis]) + NOISE_PX * rng.normal():.4f}"


def leave_out(tables, rng):
    points = sorted({row["track_id"] for table in tables.values() for row in table})
    out = set(rng.choice(points, round(LEFT_OUT_SHARE * len(points)), replace=False))
    for table in tables.values():
        # A table whose points are all left out keeps one place, so that it has a head.
        table[:] = [row for row in table if row["track_id"] not in out] or table[:1]


def write_table(path, table):
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, table[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)


def jaccard(one, other):
    """Share of the nodes with an answer in either that have the same one in both; None where there is no answer."""
    same = sum(node in other and abs(other[node] / hz - 1) <= RIGHT_WITHIN for node, hz in one.items())
    either = len(one.keys() | other.keys())
    return same / either if either else None


if __name__ == "__main__":
    main()
