#!/usr/bin/env python3
"""Whether the frequencies of a film reach the right branches of a scan of the same tree.

  scan_film_sway.py ARBORCAM FILM_DIR... [--work DIR]

Why: a filmed branch that lies on the wrong scanned one gives it a frequency that nobody measured on it. FILM_DIR and --work as for
scan_film.py. One row a film, and one of all together:

  answers                pieces of the filmed tree with a frequency whose true branch is known: the deepest one that 60 % of their points
                         are on, with what it carries (films_told.py)
  right, wrong, none     of these, given to scanned pieces at least half of which are of that true branch; to others; to none
  pieces, of_right       scanned pieces that have a frequency; of these, pieces of the true branch that it was measured on
  hz_right               of these, pieces whose own true branch has that frequency within 2 %
  could                  scanned pieces of all true branches that the film has an answer for
  all                    scanned pieces
"""
import argparse, json, re
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

import cloud_score, films_told, scan_film

NEAR_M = 0.05  # a scanned piece is of the true branch whose bark most of its places are this near to
STEP_M = 0.02
HZ_WITHIN = 0.02
COLUMNS = ["answers", "right", "wrong", "none", "pieces", "of_right", "hz_right", "could", "all"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arborcam", type=Path)
    parser.add_argument("films", type=Path, nargs="+")
    parser.add_argument("--work", type=Path, default=Path("scan_film"))
    args = parser.parse_args()
    total = Counter()
    print(f"{'film':<10}" + "".join(f"{c:>9}" for c in COLUMNS))
    for film in args.films:
        scan_film.row(args.arborcam.resolve(), film, args.work)
        seed = re.search(r"\d{5}", film.name).group()
        scan = args.work / "scans" / film.name
        if not scan.exists():
            print(f"{film.name:<10} not found")
            continue
        row = score(film, args.work / "clouds" / seed, args.work / "captures" / film.name, scan)
        total.update(row)
        print(line(film.name, row), flush=True)
    print(line("all", total))


def line(name, row):
    return f"{name:<10}" + "".join(f"{row[c]:>9}" for c in COLUMNS)


def score(film, cloud, capture, scan):
    truth = films_told.Film(film)
    filmed, true_of_filmed = answers(truth, capture)
    pieces = scanned_pieces(scan, json.loads((cloud / "truth.json").read_text()))
    given = defaultdict(list)
    for node, true in pieces:
        if node["identifiable"] == "true":
            given[sway(node)].append(true)
    row = Counter(answers=len(true_of_filmed), all=len(pieces))
    for node, true in true_of_filmed.items():
        labels = given.get(sway(filmed[node]), [])
        row["none" if not labels else "right" if 2 * labels.count(true) >= len(labels) else "wrong"] += 1
    measured_on = {sway(filmed[node]): true for node, true in true_of_filmed.items()}
    for node, true in pieces:
        row["could"] += true in measured_on.values()
        if node["identifiable"] == "true" and sway(node) in measured_on:
            row["pieces"] += 1
            row["of_right"] += measured_on[sway(node)] == true
            row["hz_right"] += true is not None and abs(float(node["frequency_hz"]) / truth.branches[true]["freq_hz"] - 1) < HZ_WITHIN
    return row


def sway(node):
    """What tells a filmed branch's answer from those of others."""
    return node["frequency_hz"], node["frequency_lo_hz"], node["damping_ratio"]


def answers(truth, capture):
    """Nodes of the film by number, and the true branch of each that has an answer."""
    nodes = {row["node_id"]: row for row in films_told.rows(capture / "nodes.csv")}
    of_node = films_told.by_node(films_told.followed_points(truth, capture), nodes)
    known = {}
    for name, node in nodes.items():
        if node["identifiable"] == "true" and not node["copy_of"] and of_node.get(name):
            true = films_told.branch_of(truth, of_node[name])
            if true is not None:
                known[name] = true
    return nodes, known


def scanned_pieces(scan, truth):
    """Each piece of the scanned tree that moves on its own, and its true branch or None."""
    nodes = films_told.rows(scan / "nodes.csv")
    at = {n["node_id"]: np.array([float(n["x"]), -float(n["z"]), float(n["y"])]) for n in nodes}
    foot = np.array(json.loads((scan / "capture.json").read_text())["scan"]["foot_m"])
    true, places = cloud_score.true_tubes(truth), defaultdict(list)
    for n in nodes:
        if n["parent_id"]:
            a, b = at[n["parent_id"]], at[n["node_id"]]
            count = max(int(np.linalg.norm(b - a) / STEP_M), 1)
            places[n["moves_with"] or n["node_id"]].append(foot + a + (np.arange(count)[:, None] + 0.5) / count * (b - a))
    pieces = []
    for n in nodes:
        if n["node_id"] in places:
            off, label = true.off(np.concatenate(places[n["node_id"]]))
            near = Counter(label[off < NEAR_M].tolist())
            pieces.append((n, near.most_common(1)[0][0] if near else None))
    return pieces


if __name__ == "__main__":
    main()
