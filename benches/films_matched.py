#!/usr/bin/env python3
"""Whether `arborcam analyze DIR... --csv` takes the same branch for the same one in films whose truth is known.

  films_matched.py PROGRAM FILM_DIR... [--captures DIR]

Why: captures of one tree are cut into branches differently, and a wrong pair is a difference of frequency that is none.
Each FILM_DIR is a folder as made_films.py writes it. Films of trees with the same branches are films of one tree: made with
one seed and look, in another mode, shaken or cropped. PROGRAM replays the films and analyses the captures of each tree
together with --trees same, in the order given. A line for each tree and one for all, in which each row counts alike:

  rows       rows of later captures whose true branch is known: as in films_told.py, the deepest branch with at least 60 %
             of the node's points on it or on what it carries
  twins      those whose true branch has a row in an earlier capture, too
  found      share of the twins that were matched with a row of the same true branch
  matched    rows that were matched with one of an earlier capture whose true branch is known
  right      share of these in which both have the same true branch
  alike      share of these that have at least half of their points on the same true branches: on few points the deepest
             branch with 60 % is a matter of chance. Of all pairs, matched or not, 3 to 21 % are alike
  trunk, place, mode   the same by what they were matched by: right of matched
  ratios     frequencies that stand beside one of the first capture
  same       share of these whose interval of the ratio holds 1, which is the truth

Shares are parts of 1; '-' is nothing to take them of. --captures keeps the captures in a folder and takes those that are
there. Exit status: 0 done, 1 PROGRAM failed on a tree (the others are printed), 2 nothing run. Needs numpy and scipy.
"""
import argparse, csv, io, json, shutil, subprocess, sys, tempfile
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from films_told import Film, ReplayFailed, branch_of, by_node, followed_points, refuse, refuse_unless_films, replay, rows

WAYS = ["trunk", "place", "mode"]
ALIKE = 0.5


@dataclass
class Matched:
    rows: int = 0
    twins: list = field(default_factory=list)
    right: dict = field(default_factory=lambda: {way: [] for way in WAYS})
    alike: list = field(default_factory=list)
    same: list = field(default_factory=list)


@dataclass
class Node:
    true: int | None  # its branch
    on: Counter  # its points by the true branch that they are on

    def is_alike(self, other):
        shared = sum(min(n / self.on.total(), other.on[b] / other.on.total()) for b, n in self.on.items())
        return shared >= ALIKE


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("film_dir", type=Path, nargs="+")
    parser.add_argument("--captures", type=Path)
    args = parser.parse_args()
    program = shutil.which(args.program) or refuse(f"{args.program}: no program that can be run; build it, or give its path")
    refuse_unless_films(args.film_dir)
    trees = of_one_tree(args.film_dir)
    for films in trees:
        if len(films) < 2:
            refuse(f"{films[0]} is the only film of its tree; give at least two")

    names = ["+".join(f.resolve().name for f in films) for films in trees]
    width = max(len("all 99 of 99"), *(len(name) for name in names))
    ways = "".join(f"{way:>10}" for way in WAYS)
    print(f"{'films':<{width}}  rows twins found matched right alike{ways} ratios  same", flush=True)
    told = []
    with tempfile.TemporaryDirectory(prefix="films_matched_") as scratch:
        captures = args.captures or Path(scratch)
        captures.mkdir(parents=True, exist_ok=True)
        for name, films in zip(names, trees):
            try:
                told.append(of_tree(program, films, captures))
            except ReplayFailed as e:
                print(f"films_matched: {name}: {e}", file=sys.stderr, flush=True)
                continue
            print(line(name, told[-1], width), flush=True)
    print(line(f"all {len(told)} of {len(trees)}", pooled(told), width))
    sys.exit(len(told) < len(trees))


def of_one_tree(folders):
    """The films, those of one tree together."""
    trees = defaultdict(list)
    for folder in folders:
        branches = json.loads((folder / "truth.json").read_text())["branches"]
        trees[tuple((b["id"], b["parent"], b["freq_hz"]) for b in branches)].append(folder)
    return list(trees.values())


def of_tree(program, films, captures):
    dirs = []
    for folder in films:
        dirs.append(captures / folder.resolve().name)
        if not dirs[-1].is_dir():
            replay(program, folder, dirs[-1])
    done = subprocess.run([program, "analyze", *dirs, "--csv", "--trees", "same"], capture_output=True, text=True)
    if done.returncode:
        raise ReplayFailed(f"no table from {program}, exit status {done.returncode}: {done.stderr.strip()}")
    truth = {d.name: true_nodes(Film(film), d) for film, d in zip(films, dirs)}
    return compare(list(csv.DictReader(io.StringIO(done.stdout))), truth, dirs[0].name)


def true_nodes(film, capture):
    """Every node that holds a point."""
    nodes = {row["node_id"]: row for row in rows(capture / "nodes.csv")}
    of_node = by_node(followed_points(film, capture), nodes)
    return {node: Node(branch_of(film, branches), Counter(branches)) for node, branches in of_node.items()}


def compare(table, truth, first):
    """Rows of later captures against what earlier ones have shown."""
    told, seen, first_seen = Matched(), defaultdict(set), {}
    captures = list(truth)
    for row in table:
        node, when = truth[row["capture"]].get(row["node_id"]), captures.index(row["capture"])
        known = first_seen.setdefault(row["tree_branch"], node)
        if row["frequency_to_first_lo"]:
            told.same.append(float(row["frequency_to_first_lo"]) <= 1 <= float(row["frequency_to_first_hi"]))
        if node is None or node.true is None:
            continue
        is_twin = any(captures.index(c) < when for c in seen[node.true])
        seen[node.true].add(row["capture"])
        if row["capture"] == first:
            continue
        told.rows += 1
        is_matched = row["matched_by"] in WAYS
        is_right = is_matched and known is not None and known.true == node.true
        if is_twin:
            told.twins.append(is_right)
        if is_matched and known is not None and known.true is not None:
            told.right[row["matched_by"]].append(is_right)
            told.alike.append(node.is_alike(known))
    return told


def pooled(tolds):
    total = Matched()
    for told in tolds:
        total.rows += told.rows
        total.twins += told.twins
        total.alike += told.alike
        total.same += told.same
        for way in WAYS:
            total.right[way] += told.right[way]
    return total


def line(name, told, width):
    share = lambda parts: f"{sum(parts) / len(parts):.3f}" if parts else "-"
    matched = [right for way in WAYS for right in told.right[way]]
    ways = "".join(f"{sum(told.right[way]):>4} of {len(told.right[way]):<2}" for way in WAYS)
    return (f"{name:<{width}} {told.rows:5} {len(told.twins):5} {share(told.twins):>5} {len(matched):7} {share(matched):>5}"
            f" {share(told.alike):>5} {ways} {len(told.same):6} {share(told.same):>5}")


if __name__ == "__main__":
    main()
