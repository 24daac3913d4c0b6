#!/usr/bin/env python3
"""pyOMA2's SSI on the signals of benches/sway.rs, beside our answers.

  cargo bench --bench sway -- DIR && sway_pyoma.py DIR        (pip install pyoma-2)

SSI gets the points of one branch at a time, and the number of modes that they have: the branch and all that carry it, and one
to spare. Of its poles the nearest to the truth is taken, which we cannot do: the comparison favours it. Errors are compared on the branches that both have an answer for.
"""
import csv, logging, os, sys, warnings
from pathlib import Path

os.environ["TQDM_DISABLE"] = "1"
import numpy as np
from pyoma2.algorithms import SSI
from pyoma2.setup import SingleSetup

warnings.filterwarnings("ignore")
logging.disable(logging.CRITICAL)


def signals(path):
    by = {}
    with open(path, newline="") as f:
        for r in csv.DictReader(f):
            p = by.setdefault(int(r["branch"]), {}).setdefault(r["point"], [[], [], []])
            for column, key in zip(p, ("time_s", "u_px", "v_px")):
                column.append(float(r[key]))
    return by


def ssi(points, start_s, modes):
    t = np.array(next(iter(points.values()))[0])
    keep = t >= start_s
    data = np.array([c for p in points.values() for c in p[1:]]).T[keep]
    # Every third frame: sway is slow, and SSI resolves it better so.
    data = data[::3] - data[::3].mean(0)
    order = 2 * (modes + 1)
    setup = SingleSetup(data, fs=1 / np.median(np.diff(t)) / 3)
    algorithm = SSI(name="ssi", method="cov", br=20, ordmax=order, ordmin=order)
    setup.add_algorithms(algorithm)
    setup.run_by_name("ssi")
    r = algorithm.result
    f, z = r.Fn_poles[:, -1], r.Xi_poles[:, -1]
    return f[np.isfinite(f)], z[np.isfinite(f)]


def main(directory):
    for name in [n for n in ("release", "decay", "wind") if (directory / f"{n}.csv").exists()]:
        rows = list(csv.DictReader(open(directory / f"{name}.csv", newline="")))
        ours, theirs, found = [], [], 0
        for tree in sorted({r["tree"] for r in rows}, key=int):
            by = signals(directory / f"{name}_{int(tree):02}.csv")
            for r in (r for r in rows if r["tree"] == tree):
                true = float(r["true_hz"]), float(r["true_damping"])
                try:
                    f, z = ssi(by[int(r["branch"])], 0.5 if name == "release" else 0.0, int(r["modes"]))
                except Exception:
                    f = z = np.array([])
                if not len(f):
                    continue
                k = np.argmin(abs(f - true[0]))
                found += 1
                if r["hz"]:
                    theirs.append((abs(f[k] / true[0] - 1), abs(z[k] / true[1] - 1)))
                    d = float(r["damping"])
                    ours.append((abs(float(r["hz"]) / true[0] - 1), abs(d / true[1] - 1)))
        o, t = np.array(ours), np.array(theirs)
        print(f"{name}: {len(rows)} branches, SSI has a pole for {found}, both for {len(o)}")
        for who, e in (("arborcam", o), ("pyOMA2  ", t)):
            q = np.nanquantile(e, [0.5, 0.9], axis=0)
            print(f"  {who} frequency {100 * q[0, 0]:.2f} % (nine in ten {100 * q[1, 0]:.2f} %), "
                  f"damping {100 * q[0, 1]:.1f} % ({100 * q[1, 1]:.1f} %)")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
