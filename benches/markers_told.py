#!/usr/bin/env python3
"""How well a built arborcam follows coloured markers, and what frequencies it finds by them.

  markers_told.py ARBORCAM FILM_DIR... [--auto] [--out DIR]

Why: Hu et al. (sect. 5) measure trees by red markers. FILM_DIR are films of made_films.py --markers. Each is replayed with the
windows of its markers.json, or with --auto with `--markers auto`; then `analyze --markers` is asked for the branches by hand.
One row a film:
  markers   followed, of those that there are       err px    median and 95 % of the distance from the true place
  seen      share of the frames without the board   lost      markers that are not seen in the last two seconds
  other     share of the places that are more than a marker's width from the true one: they are on another thing
  board     px between the true place and the hidden marker's in the two seconds after the board, median
  first Hz  of the trunk's marker branch: by the analysis, by the largest peak of its angle's spectrum; true (damped). Of a tree whose
            branches act back: that of its first two modes which is nearer (the trunk swings to two sides)
  bins      branches but the trunk whose largest peak is in the bin of the trunk's, of the true angles in the picture; by the analysis; branches in which
            the two are in the same bin (Hu et al. Table 1; a bin is one over the length of the film)
A film with depth has a line more for each branch, on its angle in space to what carries it (`analyze --angles`) against that of the true places:
standard deviation of their difference in degrees, and as a share of that of the true angle. Both are turned to the side on which they agree better,
and means are taken off. At the end, for all films: branches with an answer, and how many are right. A branch of one marker may be two or three of the tree: an answer is
held against that true branch between the marker and its parent whose frequency is nearest. One with no true branch between is wrong.
Of a tree whose branches act back it is held against the nearest of the modes in which such branches turn against their carriers.
"""
import argparse, csv, json, subprocess, tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np

RIGHT_WITHIN = 0.02
FIRST_ID = 1_000_000_000
END_S = 2.0
FPS = 30


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arborcam", type=Path)
    parser.add_argument("films", type=Path, nargs="+")
    parser.add_argument("--auto", action="store_true")
    parser.add_argument("--out", type=Path, help="keeps the captures there")
    args = parser.parse_args()
    args.arborcam = args.arborcam.resolve()
    print(f"{'film':<12}{'markers':>9}{'err px':>8}{'95 %':>7}{'worst':>7}{'other':>8}{'seen':>7}{'lost':>6}{'board':>7}{'first Hz':>10}{'peak':>8}{'true':>8}{'bins':>18}")
    with tempfile.TemporaryDirectory() as work:
        rows = [row(args, film, (args.out or Path(work)) / film.name) for film in args.films]
    errors = np.concatenate([r["errors"] for r in rows])
    other = np.concatenate([r["other"] for r in rows])
    print(f"all films: median {np.median(errors):.2f} px, 95 % {np.quantile(errors, 0.95):.2f} px, on another thing {100 * other.mean():.2f} %, "
          f"seen {100 * np.mean([r['seen'] for r in rows]):.1f} %, lost {sum(r['lost'] for r in rows)} of {sum(r['markers'] for r in rows)}")
    for name in ("analysis", "peak"):
        off = np.array([r[name] - r["true_hz"][name] for r in rows])
        told = np.isfinite(off)
        print(f"first frequency by {name}: {told.sum()} of {len(off)}, largest error {np.abs(off[told]).max(initial=0):.4f} Hz, "
              f"within 0.01 Hz {np.sum(np.abs(off[told]) <= 0.01)}")
    bins = np.sum([r["bins"] for r in rows], axis=0)
    print("largest peak in the bin of the trunk's: true {0} of {3}, by the analysis {1}; in the right bin {2}".format(*bins))
    told = np.concatenate([r["answers"] for r in rows])
    print(f"branches with an answer: {len(told)} of {sum(r['markers'] for r in rows)}, within {RIGHT_WITHIN:.0%} {told[:, 0].sum():.0f}, "
          f"in its interval {told[:, 1].sum():.0f}, damping in its {np.nansum(told[:, 2]):.0f} of {np.isfinite(told[:, 2]).sum()}")


def row(args, film, out):
    truth = json.loads((film / "truth_markers.json").read_text())
    spec = "auto" if args.auto else str(film / "markers.json")
    video = film / "video.mkv"
    source = video if video.exists() else film
    subprocess.run([args.arborcam, "replay", source, "--outline", film / "outline.json", "--markers", spec, "--fast",
                    "--headless", "--out", out], check=True, capture_output=True)
    seen = places(out)
    matched = match(truth["markers"], seen)
    errors, shares, lost, board = [], [], 0, np.nan
    for marker in truth["markers"]:
        true_px = np.array(marker["places_px"])
        found = seen.get(matched.get(marker["name"]), {})
        frames = np.array(sorted(found), int)
        off = np.array([np.hypot(*(np.array(found[f]) - true_px[f])) for f in frames])
        errors.append(off)
        hidden = truth["hidden"] if truth["hidden"] and truth["hidden"]["name"] == marker["name"] else None
        free = len(true_px) - (0 if hidden is None else round(30 * (hidden["to_s"] - hidden["from_s"])))
        shares.append(len(frames) / free)
        lost += not (frames >= len(true_px) - 30 * END_S).any()
        if hidden is not None:
            after = (frames >= 30 * hidden["to_s"]) & (frames < 30 * (hidden["to_s"] + 2))
            board = np.median(off[after]) if after.any() else np.inf
    errors = np.concatenate(errors)
    other = errors > 2 * truth["radius_px"]
    trunk = truth["markers"][0]
    branches = study_of(args.arborcam, film, out)
    analysis, peak = frequencies(branches, trunk["name"])
    true_hz = first_hz(film, trunk, analysis)
    true_peak_hz = first_hz(film, trunk, peak)
    bins = same_bins(film, truth["markers"], branches)
    print(f"{film.name:<12}{len(matched):>5}/{len(truth['markers']):<3}{np.median(errors):>8.2f}{np.quantile(errors, 0.95):>7.2f}"
          f"{errors.max():>7.1f}{100 * other.mean():>7.1f}%{np.mean(shares):>7.2f}{lost:>6}{board:>7.2f}{analysis:>10.4f}{peak:>8.4f}{true_hz:>8.4f}"
          f"{'%d, %d, %d of %d' % tuple(bins):>18}", flush=True)
    for line in angles_in_space(args.arborcam, film, out, truth["markers"]):
        print("  " + line, flush=True)
    return dict(errors=errors, other=other, seen=np.mean(shares), markers=len(truth["markers"]), lost=lost, analysis=analysis, peak=peak, true_hz={"analysis": true_hz, "peak": true_peak_hz},
                answers=answers(film, branches), bins=bins)


def first_hz(film, trunk, told):
    """The true damped frequency of the trunk's marker; of two modes that which is nearer to what was told."""
    modes = json.loads((film / "truth.json").read_text()).get("modes", [trunk])[:2]
    damped = [m["freq_hz"] * np.sqrt(1 - m["damping"] ** 2) for m in modes]
    return min(damped, key=lambda hz: abs(hz - told))


def same_bins(film, markers, branches):
    """Of the branches but the trunk: those in the trunk's bin by the true angles, by the analysis, in the right bin, and all that have a peak."""
    truth = json.loads((film / "truth.json").read_text())
    foot = np.array(truth["branches"][0]["rest_base_2d"])
    film_s = truth["n_frames"] / truth["fps"]
    by_name = {m["name"]: m for m in markers}
    true = {m["name"]: largest_bin(angle_in_picture(m, by_name, foot)) for m in markers}
    told = {b["branch"]: round(b["spectrum_peak_hz"] * film_s) for b in branches if b["spectrum_peak_hz"] is not None}
    named = [m["name"] for m in markers if m["branch"] != 0 and m["name"] in told]
    trunk = markers[0]["name"]
    return np.array([sum(true[n] == true[trunk] for n in named), sum(told[n] == told.get(trunk) for n in named),
                     sum(true[n] == told[n] for n in named), len(named)])


def angle_in_picture(marker, by_name, foot):
    """Of a branch to what carries it, radians in each frame; of one that grows from the foot, to the upright."""
    parent = by_name.get(marker["parent"])
    if parent is None:
        return direction(np.array(marker["places_px"]) - foot)
    below = by_name.get(parent["parent"])
    joint = np.array(parent["places_px"])
    carrier = joint - (foot if below is None else np.array(below["places_px"]))
    return direction(np.array(marker["places_px"]) - joint) - direction(carrier)


def direction(way):
    return np.unwrap(np.arctan2(way[:, 1], way[:, 0]))


def largest_bin(angle):
    """Of the spectrum; the first two bins are drift."""
    amplitude = np.abs(np.fft.rfft(angle - angle.mean()))
    return 2 + int(np.argmax(amplitude[2:]))


def angles_in_space(arborcam, film, capture, markers):
    """A line for each marker of a film with depth."""
    if "places_m" not in markers[0]:
        return
    camera = json.loads((film / "truth.json").read_text())["camera"]
    x, y = camera["centre_xy"]
    foot = np.array([-x, y, camera["distance"]]) * camera["real_metres"]
    by_name = {m["name"]: m for m in markers}
    with tempfile.TemporaryDirectory() as work:
        table = Path(work) / "angles.csv"
        subprocess.run([arborcam, "analyze", capture, f"--markers={film / 'markers.json'}", "--angles", table], check=True, capture_output=True)
        rows = list(csv.DictReader(open(table)))
    for marker in markers:
        own = [r for r in rows if r["branch"] == marker["name"] and r["angle_in_space_deg"]]
        if not own:
            yield f"{marker['name']}: no angle"
            continue
        frames = np.array([round(FPS * float(r["time_s"])) for r in own])
        angles = true_angle(marker, by_name, foot)
        inside = frames < len(angles)
        true = angles[frames[inside]]
        measured = np.array([float(r["angle_in_space_deg"]) for r in own])[inside]
        off = min((measured - true).std(), (measured + true).std())
        sway = max(true.std(), 1e-9)
        yield f"{marker['name']}: {len(true)} angles, true sway {sway:.2f} deg, off by {off:.2f} deg ({100 * off / sway:.0f} %)"


def true_angle(marker, by_name, foot):
    """How far a branch has turned from where its carrier takes it, degrees, along the direction in which it sways most."""
    own = np.array(marker["places_m"])
    parent = by_name.get(marker["parent"])
    base = np.broadcast_to(foot, own.shape) if parent is None else np.array(parent["places_m"])
    way = own - base
    rest = unit(way.mean(0))
    if parent is not None:
        below = by_name.get(parent["parent"])
        carrier = base - (foot if below is None else np.array(below["places_m"]))
        way = np.array([turning(c, carrier.mean(0)) @ w for c, w in zip(carrier, way)])
    turns = np.array([turn(rest, w) for w in way])
    turns -= turns.mean(0)
    axis = np.linalg.svd(turns, full_matrices=False)[2][0]
    return np.degrees(turns @ axis)


def unit(v):
    return v / np.linalg.norm(v)


def turn(a, b):
    """The rotation vector from one direction to another."""
    axis = np.cross(unit(a), unit(b))
    size = np.linalg.norm(axis)
    return axis * (np.arctan2(size, unit(a) @ unit(b)) / size if size > 1e-12 else 1)


def turning(a, b):
    """The least rotation from one direction to another."""
    v = turn(a, b)
    angle = np.linalg.norm(v)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = v / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def places(capture):
    """By marker number: frame to place, px."""
    seen = defaultdict(dict)
    for name in ("tracks.csv", "left_out.csv"):
        if not (capture / name).exists():
            continue
        with open(capture / name) as f:
            for r in csv.DictReader(f):
                if int(r["track_id"]) >= FIRST_ID:
                    seen[int(r["track_id"]) - FIRST_ID][int(r["frame"])] = (float(r["u_px"]), float(r["v_px"]))
    return seen


def match(markers, seen):
    """Name of each true marker to the number of the one that is nearest in its first frame."""
    matched = {}
    for number, found in seen.items():
        frame = min(found)
        off = [np.hypot(*(np.array(m["places_px"][frame]) - found[frame])) for m in markers]
        if min(off) < 10:
            matched.setdefault(markers[int(np.argmin(off))]["name"], number)
    return matched


def study_of(arborcam, film, capture):
    """The branches by markers as `analyze --json` has them; none where it fails."""
    by = [] if not (film / "markers.json").exists() else [f"--markers={film / 'markers.json'}"]
    notes = json.loads((capture / "capture.json").read_text())["config"]["markers"]
    if notes["find"]:
        by = ["--markers"]
    done = subprocess.run([arborcam, "analyze", capture, *by, "--json"], capture_output=True, text=True)
    if done.returncode:
        print(done.stderr)
        return []
    return json.loads(done.stdout)["captures"][0]["branches"]


def frequencies(branches, name):
    """Of one marker's branch, Hz: by the analysis, and the peak of its angle's spectrum; no numbers where unknown."""
    if not branches:
        return np.nan, np.nan
    own = next((b for b in branches if b["branch"] == name), branches[0])
    number = lambda x: np.nan if x is None else float(x)
    return number((own["frequency_hz"] or {}).get("value")), number(own["spectrum_peak_hz"])


def answers(film, branches):
    """A row for each answer: right, within its interval, damping within its interval (NaN without); held against that true branch
    between the marker and its parent whose frequency is nearest."""
    truth = json.loads((film / "truth.json").read_text())
    true, modes = truth["branches"], truth.get("modes")
    markers = {m["name"]: m for m in json.loads((film / "truth_markers.json").read_text())["markers"]}
    rows = []
    for branch in branches:
        frequency, damping, marker = branch["frequency_hz"], branch["damping_ratio"], markers.get(branch["branch"])
        if frequency is None or marker is None:
            continue
        ends_on = markers[marker["parent"]]["branch"] if marker["parent"] else -1
        at, between = marker["branch"], []
        while at not in (-1, ends_on):
            between += [modes[m] for m in true[at]["modes"]] if modes else [true[at]]
            at = true[at]["parent"]
        if not between:
            rows.append((False, False, False))
            continue
        nearest = min(between, key=lambda b: abs(np.log(frequency["value"] / b["freq_hz"])))
        holds = lambda interval, value: interval["lo"] <= value <= interval["hi"]
        rows.append((
            abs(frequency["value"] / nearest["freq_hz"] - 1) <= RIGHT_WITHIN,
            holds(frequency, nearest["freq_hz"]),
            np.nan if damping is None else holds(damping, nearest["damping"]),
        ))
    return np.array(rows, float).reshape(-1, 3)


if __name__ == "__main__":
    main()
