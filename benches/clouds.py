#!/usr/bin/env python3
"""Trees from point clouds against the true ones.

  clouds.py ARBORCAM FIRST_SEED LAST_SEED [--treefiles FILE...] [--work DIR] [--method paths|colonisation] [--in-leaf] [--keep]
            [--thin POINTS] [options of made_clouds.py]

For each seed: a cloud by made_clouds.py, `arborcam cloud` and `arborcam export --format treefile` on it, and the figures of cloud_score.py:

  length, volume   of all wood, against the truth, minus 1
  parents          share of branches that grow from the right one; one that is not found counts as wrong
  surface          share of the tree's points no farther than 1 cm from the surface of the model
  near             share of the model's length whose bark has a point of the cloud within 2 cm
  points, s, MB    points of the cloud, time on the processor and largest memory of `arborcam cloud`

With --trees N (2 or more) a cloud is a plot of N trees. Each found tree is taken for the true one that most of its points are of, and gets
the figures above, and also:

  trees            found, of N
  right, wrong     share of the points of true trees that are given to the right tree, and to another; the rest is given to none

With --treefiles the tree of seed FIRST_SEED is that of the first file, and so on: trees of another program. With --thin so many points of
each cloud are taken by chance.

A cloud that gives no tree is counted and named. Claims are made on seeds that nothing was tuned on. Needs numpy and scipy.
"""
import argparse, json, os, shutil, subprocess, sys, tempfile
from pathlib import Path

import numpy as np

import cloud_score, made_clouds, treefile

HERE = Path(__file__).parent
SCORED_POINTS = 60_000


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arborcam")
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--treefiles", type=Path, nargs="+", default=[])
    parser.add_argument("--work", type=Path)
    parser.add_argument("--method", default="paths")
    parser.add_argument("--in-leaf", action="store_true", help="clouds with leaves, which arborcam takes off")
    parser.add_argument("--keep", action="store_true", help="keep clouds and trees in the folder --work")
    parser.add_argument("--trees", type=int, default=1)
    parser.add_argument("--thin", type=int, metavar="POINTS", help="so many points of a cloud, by chance, with the ground")
    args, of_cloud = parser.parse_known_args()
    if args.treefiles and (args.trees > 1 or len(args.treefiles) != args.last - args.first + 1):
        parser.error("--treefiles needs one file for each seed, and no --trees")
    of_cloud += ["--leaves"] if args.in_leaf else []
    of_cloud += ["--trees", str(args.trees)]
    how = ["--method", args.method] + (["--in-leaf"] if args.in_leaf else [])
    work = args.work or Path(tempfile.mkdtemp(prefix="clouds-"))
    rows, failed = [], []
    for seed in range(args.first, args.last + 1):
        folder = work / str(seed)
        if not (folder / "truth.json").exists():
            foreign = ["--treefile", args.treefiles[seed - args.first]] if args.treefiles else []
            subprocess.run([sys.executable, HERE / "made_clouds.py", work, str(seed), str(seed), *of_cloud, *foreign], check=True)
        if args.thin:
            folder = thinned(folder, args.thin)
        row = (run if args.trees == 1 else run_plot)(args.arborcam, folder, how)
        if row is None:
            failed.append(seed)
        else:
            rows.append(row)
            print(seed, " ".join(f"{k} {v:.3f}" for k, v in row.items()), flush=True)
        if not args.keep:
            shutil.rmtree(folder)
    print(f"\n{len(rows)} trees; none of {failed}" if failed else f"\n{len(rows)} trees")
    for key in rows[0]:
        values = np.abs([row[key] for row in rows])
        print(f"{key:9} mean of sizes {values.mean():.3f}  worst {values.max():.3f}  least {values.min():.3f}")


def run(arborcam, folder, how):
    tree = folder / f"tree-{how[1]}"
    used = cloud(arborcam, folder, tree, how)
    if used is None:
        return None
    points = read_points(folder / "cloud.ply")
    row = score(arborcam, tree, json.loads((folder / "truth.json").read_text()), points)
    return row | dict(points=len(points), **used)


def thinned(folder, count):
    """The folder of a part of its cloud."""
    points, tree = read_points(folder / "cloud.ply"), np.load(folder / "tree.npy")
    part = np.random.default_rng(count).choice(len(points), min(count, len(points)), False)
    thin = folder.with_name(f"{folder.name}-{count}")
    thin.mkdir(exist_ok=True)
    made_clouds.write(thin / "cloud.ply", points[part], "ply")
    np.save(thin / "tree.npy", tree[part])
    shutil.copy(folder / "truth.json", thin)
    return thin


def run_plot(arborcam, folder, how):
    plot = folder / f"plot-{how[1]}"
    used = cloud(arborcam, folder, plot, [*how, "--points"])
    if used is None or not (plot / "points.ply").exists():
        return None
    truth, points = json.loads((folder / "truth.json").read_text()), read_points(folder / "cloud.ply")
    true_tree, found = np.load(folder / "tree.npy"), read_trees(plot / "points.ply")
    is_tree = true_tree >= 0
    pairs = np.zeros((len(truth["trees"]), found.max() + 1), int)
    np.add.at(pairs, (true_tree[is_tree], found[is_tree]), 1)
    taken_for = {k: int(pairs[:, k].argmax()) for k in range(1, found.max() + 1)}
    right = sum(pairs[true, k] for k, true in taken_for.items() if pairs[true, 1:].argmax() + 1 == k) / is_tree.sum()
    rows = [score(arborcam, plot / f"tree-{k:04}", truth["trees"][true], points[true_tree == true])
            for k, true in taken_for.items() if (plot / f"tree-{k:04}").exists()]
    row = {key: float(np.mean(np.abs([r[key] for r in rows]))) for key in rows[0]}
    return row | dict(trees=len(taken_for), right=float(right), wrong=float(pairs[:, 1:].sum() / is_tree.sum() - right),
                      points=len(points), **used)


def cloud(arborcam, folder, out, how):
    """Time and memory of `arborcam cloud`; None where it failed."""
    shutil.rmtree(out, ignore_errors=True)
    child = subprocess.Popen([arborcam, "cloud", folder / "cloud.ply", "--out", out, *how], stderr=subprocess.PIPE)
    said = child.stderr.read().decode()
    _, status, used = os.wait4(child.pid, 0)
    if status:
        print(folder.name, said.strip())
        return None
    return dict(s=used.ru_utime + used.ru_stime, MB=used.ru_maxrss / 1024)


def score(arborcam, tree, truth, points):
    path = tree.with_suffix(".txt")
    path.unlink(missing_ok=True)
    subprocess.run([arborcam, "export", tree, "--format", "treefile", "--out", path], check=True, stderr=subprocess.DEVNULL)
    some = points[np.random.default_rng(0).choice(len(points), min(SCORED_POINTS, len(points)), False)]
    return cloud_score.score(truth, some, *treefile.read(path))


def read_points(path):
    raw = path.read_bytes()
    return np.frombuffer(raw[raw.index(b"end_header\n") + 11 :], "<f8").reshape(-1, 3)


def read_trees(path):
    """The numbers of trees in points.ply."""
    raw = path.read_bytes()
    rows = np.frombuffer(raw[raw.index(b"end_header\n") + 11 :], [("at", "<f8", 3), ("tree", "<i4")])
    return rows["tree"]


if __name__ == "__main__":
    main()
