#!/usr/bin/env python3
"""What a built arborcam makes of bad input: films that are hard, cut, moved or without a tree, each with what is expected of it.

  bad_films.py PROGRAM [OUT_DIR] [SEED]... [--only CASE]...

Why: nobody films a test pattern. Whatever a film shows, no frequency may be told that is not the tree's, and the verdict has to
name what is wrong. CASES below holds what is expected of each kind of film; where a case fails, the program is at fault or
the expectation is, and both are to be looked into.

Each SEED is another tree, odd ones bare, even ones in leaf (default 1 2). Films are made by made_films.py and edited by
made_films/edits.py into OUT_DIR/CASE-SEED (default: a folder that is thrown away), and made once: a film that is there is used.
What PROGRAM makes of each is left in OUT_DIR/captures, with what it says. One row a film:

  exit       PROGRAM's exit status, and where another was expected, that
  answers    captured nodes with a frequency, called identifiable
  right      answers within 2 % of the node's branch, or of one that carries it (trunk included), as films_told.py has it
  wrong      answers that are not the branch's: neither within 2 % of a branch that is seen within 5 px of one of the node's points,
             or of one that carries it, nor with one of these in their 95 % interval
  foreign    answers that are not the tree's: of a node most of whose points are on nothing of the tree's, or of a film without a
             tree that sways
  verdict    as PROGRAM says it
  failed     what was not as expected; 'pass' where nothing was

A point of a node is put to the branch that is seen where and when the point was found, as in films_told.py, but in all frames
before the camera was moved. Between right and wrong lie answers that are as uncertain as they say, and those of another branch
beside the node's. A film fails that has a foreign answer. A good film has a wrong one at times, one answer in twelve after a release
and more in wind, so that one more than in another film says nothing: a film fails that has more of them than chance
allows, at 5 %, by Fisher's exact test (1935) of its answers against those of the clean film of the same tree; where only a short part
of it counts, against those of that part of the clean film, too. The last row is the same test of the answers of all films against those of
all clean ones, each counted once: what a single film is too small to show.

Exit status: 0 all as expected, 1 not. Needs what made_films.py needs.
"""
import argparse, csv, json, re, shutil, subprocess, sys, tempfile
from dataclasses import dataclass, field
from pathlib import Path

from scipy.stats import fisher_exact

from films_told import RIGHT_WITHIN, Film, branch_of, by_node, found_points, relative_error, rows
from made_films import bad_camera, edits
from made_films.picture import FPS

RELEASE_S, WIND_S = 12.0, 30.0
# A point as far from all that is seen of the tree is not on it: twigs too thin for the known points lie nearer, px.
OFF_TREE_PX = 8.0
# A point follows what is seen around it: half the side of a patch by which it is known again, px.
WINDOW_PX = 5.0
STARTING_S = 0.2  # the time in which a camera that never stands still has not moved yet
BY_CHANCE = 0.05  # a film that is no worse fails as often
CLEAN = {"release": "clean", "wind": "clean_wind"}


@dataclass(frozen=True)
class Case:
    """A kind of film, and what is expected of it."""
    bad: tuple = ()  # of made_films.py
    edit: str = ""
    mode: str = "release"
    outline: bool = True  # is given
    sways: bool = True  # there is a tree that does
    known_s: float = float("inf")  # until then points are where the truth has them
    exits: tuple = (0,)
    grades: tuple = ("good", "fair", "poor")
    names: tuple = ()  # each is found in the verdict
    never: tuple = ("film cut",)  # none is
    warns: str = ""  # is found in what PROGRAM says
    twin: str = ""  # a case without what is bad in this one, beside the clean one


NO_TREE = dict(sways=False, exits=(1,), grades=("poor",), names=("no tree found",))
MOVED = dict(exits=(0,), grades=("fair", "poor"), names=(r"camera moved at \d",), warns="turned, zoomed, refocused or covered")
STILL = ("camera moved", "shakes", "nothing around the tree")
STEADY = STILL + ("film cut",)
CUT = dict(grades=("fair", "poor"), never=STILL, warns="the film is cut, or its picture stands still")
CHANGE_S = {"release": bad_camera.CHANGE_SHARE * RELEASE_S, "wind": bad_camera.CHANGE_SHARE * WIND_S}
CASES = {
    "clean": Case(grades=("good", "fair"), never=STEADY),
    "clean_wind": Case(mode="wind", grades=("good", "fair"), never=STEADY),
    # What stands around and behind.
    "no_background": Case(("no_background",), grades=("fair", "poor"), names=("nothing around the tree",)),
    "all_background": Case(("no_tree",), **NO_TREE, never=STEADY),
    "all_background_auto": Case(("no_tree",), outline=False, **NO_TREE),
    "second_tree": Case(("second_tree",), never=STEADY),
    "second_tree_auto": Case(("second_tree",), outline=False, never=STEADY,
                             grades=("fair", "poor"), names=("two trunks",)),
    "second_tree_wind": Case(("second_tree",), mode="wind", never=STEADY),
    "brown_wall": Case(("brown_wall",), never=STEADY),
    "fence": Case(("fence",), never=STEADY),
    "wire": Case(("wire",), never=STEADY),
    # What walks through.
    "walker": Case(("walker",), never=STEADY),
    "walker_auto": Case(("walker",), outline=False, never=STEADY),
    "walker_wind": Case(("walker",), mode="wind", never=STEADY),
    "walker_alone": Case(("no_tree", "walker"), **NO_TREE, never=STEADY),
    "walker_alone_auto": Case(("no_tree", "walker"), outline=False, **NO_TREE),
    "walker_calm": Case(("calm", "walker"), **NO_TREE, never=STEADY),
    # Little motion.
    "calm": Case(("calm",), sways=False, exits=(1,), grades=("poor",), names=("no tree found", "moves by"), never=STEADY),
    "calm_auto": Case(("calm",), outline=False, **NO_TREE),
    # Light.
    "night": Case(("night",), grades=("fair", "poor"), names=("too dark",), never=("camera moved", "shakes")),
    "fog": Case(("fog",), never=("camera moved", "shakes")),
    "shadow": Case(("shadow",), never=STEADY),
    "exposure": Case(("exposure",), never=STEADY + ("too dark",)),
    "exposure_wind": Case(("exposure",), mode="wind", never=STEADY + ("too dark",)),
    "banding": Case(("banding",), never=STEADY + ("too dark",)),
    "rolling_shutter": Case(("rolling_shutter",), grades=("good", "fair"), never=STEADY),
    # The camera's motion.
    "pan": Case(("pan",), known_s=CHANGE_S["release"], **MOVED),
    "pan_wind": Case(("pan",), mode="wind", known_s=CHANGE_S["wind"], **MOVED),
    "pan_auto": Case(("pan",), outline=False, known_s=CHANGE_S["release"], **MOVED),
    "zoom": Case(("zoom",), known_s=CHANGE_S["release"], **MOVED),
    "focus": Case(("focus",), known_s=CHANGE_S["release"], **MOVED),
    "covered": Case(("covered",), known_s=CHANGE_S["release"], **MOVED),
    "hand_held": Case(("hand_held",), known_s=STARTING_S, grades=("fair", "poor"), names=(r"shakes \d",), never=("camera moved",)),
    "hand_held_auto": Case(("hand_held",), outline=False, known_s=STARTING_S, exits=(0, 1), grades=("fair", "poor"),
                           names=(r"shakes \d|nothing around the tree",), never=("camera moved",)),
    "slow_pan": Case(("slow_pan",), known_s=STARTING_S, **MOVED),
    # Motion that is all the camera's.
    "only_pan": Case(("calm", "pan"), **NO_TREE),
    "only_pan_auto": Case(("calm", "pan"), outline=False, **NO_TREE),
    "only_zoom": Case(("calm", "zoom"), **NO_TREE),
    "only_zoom_auto": Case(("calm", "zoom"), outline=False, **NO_TREE),
    "only_focus": Case(("calm", "focus"), **NO_TREE),
    "only_focus_auto": Case(("calm", "focus"), outline=False, **NO_TREE),
    "only_slow_pan": Case(("calm", "slow_pan"), **NO_TREE),
    "only_slow_pan_auto": Case(("calm", "slow_pan"), outline=False, **NO_TREE),
    "only_hand": Case(("calm", "hand_held"), **NO_TREE),
    "only_hand_auto": Case(("calm", "hand_held"), outline=False, **NO_TREE),
    # Edited films.
    "jump_cut": Case(edit="jump_cut", known_s=edits.CUT_S[0], names=(f"film cut or stalled at {edits.CUT_S[0]} s",), twin="short", **CUT),
    "jump_cut_wind": Case(edit="jump_cut", mode="wind", known_s=edits.CUT_S[0],
                          names=(f"film cut or stalled at {edits.CUT_S[0]} s",), **CUT),
    "stalled": Case(edit="stalled", known_s=edits.STALL_S[0], names=(f"film cut or stalled at {edits.STALL_S[0]} s",), twin="short", **CUT),
    "short": Case(edit="shortened", twin="short", grades=("fair", "poor"), names=("s filmed",), never=STEADY),
    "joined": Case(edit="joined", known_s=edits.JOINED_S, grades=("fair", "poor"), names=(r"camera moved at \d",)),
    "variable_rate": Case(edit="variable_rate", grades=("good", "fair"), never=STEADY),
    "variable_rate_wind": Case(edit="variable_rate", mode="wind", grades=("good", "fair"), never=STEADY),
    "truncated": Case(edit="truncated", never=STEADY, warns="clip ends early"),
    "head_only": Case(edit="head_only", exits=(3,), grades=("",), warns="no frame"),
}


@dataclass
class Result:
    exit_status: int
    said: str
    verdict: str = ""
    answers: list = field(default_factory=list)  # Answer

    def wrong(self):
        return [a for a in self.answers if a.is_wrong]

    def foreign(self):
        return [a for a in self.answers if a.is_foreign]

    def failures(self, case, clean):
        """What is not as the case expects it."""
        grade = re.match(r"\w*", self.verdict)[0]
        failures = []
        if self.exit_status not in case.exits:
            failures.append(f"exit {self.exit_status}")
        if grade not in case.grades:
            failures.append(f"grade '{grade}'")
        failures += [f"does not name '{name}'" for name in case.names if not re.search(name, self.verdict)]
        failures += [f"names '{name}'" for name in case.never if re.search(name, self.verdict)]
        if case.warns not in self.said:
            failures.append(f"does not say '{case.warns}'")
        if self.foreign():
            failures.append(f"{len(self.foreign())} foreign")
        if (own := Wrong.of([self])).is_more_than(clean):
            failures.append(f"{own.wrong} of {own.answers} wrong, and {clean.wrong} of {clean.answers} in the clean film")
        return failures


@dataclass
class Wrong:
    """How many of some answers are wrong."""
    wrong: int
    answers: int

    @classmethod
    def of(cls, results):
        return cls(sum(len(r.wrong()) for r in results), sum(len(r.answers) for r in results))

    def is_more_than(self, clean):
        """Whether it is a larger share than in clean films, beyond what chance makes."""
        table = [[self.wrong, self.answers - self.wrong], [clean.wrong, clean.answers - clean.wrong]]
        return fisher_exact(table, alternative="greater").pvalue < BY_CHANCE


@dataclass
class Place:
    """Where a point was found."""
    branch: int  # None where it is not sure
    near: set  # the branches that are seen around
    is_off: bool  # nothing of the tree is


@dataclass
class Answer:
    node: str
    hz: float
    is_right: bool = False
    is_wrong: bool = False
    is_foreign: bool = False


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("out_dir", type=Path, nargs="?")
    parser.add_argument("seed", type=int, nargs="*", default=[1, 2])
    parser.add_argument("--only", action="append", choices=CASES, metavar="CASE")
    args = parser.parse_args()
    program = shutil.which(args.program) or sys.exit(f"bad_films: {args.program}: no program that can be run")
    with tempfile.TemporaryDirectory(prefix="bad_films_") as scratch:
        failed = run(program, args.out_dir or Path(scratch), args.seed, args.only or CASES)
    sys.exit(failed > 0)


def run(program, out_dir, seeds, names):
    """Runs the cases, and gives how many films failed."""
    failed, results = 0, {}
    print("film                       exit answers right wrong foreign  failed | verdict", flush=True)
    for name in names:
        for seed in seeds:
            case = CASES[name]
            references = sorted({CLEAN[case.mode], case.twin} - {""}) if case.sways else []
            for film in {(n, seed): None for n in [name, *references]}:
                if film not in results:
                    results[film] = replay(program, out_dir, *film)
            result = results[name, seed]
            failures = result.failures(case, Wrong.of([results[n, seed] for n in references]))
            failed += bool(failures)
            counts = [len(result.answers), sum(a.is_right for a in result.answers), len(result.wrong()), len(result.foreign())]
            print(f"{f'{name} {seed}':<27}{result.exit_status:4} {counts[0]:7} {counts[1]:5} {counts[2]:5} {counts[3]:7}"
                  f"  {', '.join(failures) or 'pass'} | {result.verdict or '-'}", flush=True)
            for a in result.wrong() + result.foreign():
                print(f"    wrong: node {a.node}, {a.hz:.3f} Hz", flush=True)
    return failed + summarise(results)


def summarise(results):
    """Prints how many answers are wrong in all films beside all clean ones, in wind and after a release; how many of these failed."""
    failed = 0
    for mode, clean_name in CLEAN.items():
        bad = Wrong.of([r for (name, _), r in results.items() if name != clean_name and CASES[name].sways and CASES[name].mode == mode])
        clean = Wrong.of([r for (name, _), r in results.items() if name == clean_name])
        is_worse = bad.is_more_than(clean)
        failed += is_worse
        print(f"all, {mode}: {bad.wrong} of {bad.answers} answers wrong, and {clean.wrong} of {clean.answers} in clean films: "
              f"{'more than by chance' if is_worse else 'pass'}", flush=True)
    return failed


def film_of(out_dir, name, seed):
    """The folder of a film, which is made if it is not there."""
    case = CASES[name]
    # Cases that differ in the outline alone have one film.
    first = next(n for n, c in CASES.items() if (c.bad, c.edit, c.mode) == (case.bad, case.edit, case.mode))
    folder = out_dir / f"{first}-{seed}"
    if (folder / "truth.json").is_file():
        return folder
    if case.edit:
        edit(case, folder, out_dir, seed)
        return folder
    seconds = WIND_S if case.mode == "wind" else RELEASE_S
    look = "bare" if seed % 2 else "leaves"
    options = [option for kind in case.bad for option in ("--bad", kind)]
    maker = Path(__file__).with_name("made_films.py")
    subprocess.run([sys.executable, maker, out_dir, folder.name, str(seed), look, case.mode, "--seconds", str(seconds), *options],
                   check=True)
    return folder


def edit(case, folder, out_dir, seed):
    """Makes a film of a clean one."""
    source = film_of(out_dir, CLEAN[case.mode], seed)
    folder.mkdir(parents=True, exist_ok=True)
    videos = [source / "video.mkv"]
    if case.edit == "joined":
        videos.append(film_of(out_dir, CLEAN[case.mode], seed + 2) / "video.mkv")
    getattr(edits, case.edit)(*videos, folder / "video.mkv")
    # The truth is there last: it says that the film is whole.
    for name in ("outline.json", "grid.npz", "truth.json"):
        shutil.copy(source / name, folder / name)


def replay(program, out_dir, name, seed):
    """What the program makes of a film."""
    case, folder, capture = CASES[name], film_of(out_dir, name, seed), out_dir / "captures" / f"{name}-{seed}"
    shutil.rmtree(capture, ignore_errors=True)
    capture.parent.mkdir(parents=True, exist_ok=True)
    outline = ["--outline", folder / "outline.json"] if case.outline else []
    command = [program, "replay", folder / "video.mkv", *outline, "--fast", "--headless", "--out", capture]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    capture.with_suffix(".txt").write_text(done.stderr)
    result = Result(done.returncode, done.stderr)
    if (capture / "capture.json").is_file():
        verdict = json.loads((capture / "capture.json").read_text())["verdict"]
        reasons = "; ".join(verdict["reasons"])
        result.verdict = f"{verdict['grade']}: {reasons}" if reasons else verdict["grade"]
        result.answers = answers(Film(folder), case, capture)
    return result


def answers(film, case, capture):
    """Every frequency that a capture gives, held against the truth."""
    nodes = {row["node_id"]: row for row in rows(capture / "nodes.csv")}
    of_node = by_node(points(film, case, capture), nodes)
    judged = []
    for node, row in nodes.items():
        if row["identifiable"] == "true" and row["frequency_hz"] and row.get("kind") != "copy":
            judged.append(judge(film, case, row, of_node[node]))
    return judged


def judge(film, case, row, places):
    """Places: where the node's points were found."""
    hz, lo_hz, hi_hz = (float(row[name] or "nan") for name in ("frequency_hz", "frequency_lo_hz", "frequency_hi_hz"))
    if not case.sways or not places:
        # Of a node all of whose points came after the camera was moved nothing is known.
        return Answer(row["node_id"], hz, is_foreign=not case.sways)
    on_tree = [place for place in places if place.near]
    if 2 * len(on_tree) <= len([place for place in places if place.near or place.is_off]):
        return Answer(row["node_id"], hz, is_foreign=True)
    on = [place.branch for place in on_tree if place.branch is not None]
    is_right = bool(on) and any(is_near(film, b, hz) for b in film.carriers(branch_of(film, on)))
    meant = {carrier for place in on_tree for b in place.near for carrier in film.carriers(b)}
    is_trees = any(is_near(film, b, hz) or lo_hz <= film.branches[b]["freq_hz"] <= hi_hz for b in meant)
    return Answer(row["node_id"], hz, is_right, not is_trees)


def is_near(film, branch, hz):
    return relative_error(hz, film.branches[branch]["freq_hz"]) <= RIGHT_WITHIN


def points(film, case, capture):
    """(place, node) of each followed point that was found while the truth is known; the node is the last it was put to."""
    for birth, node in found_points(capture):
        if float(birth["time_s"]) <= case.known_s:
            if (place := place_of(film, birth)) is not None:
                yield place, node


def place_of(film, birth):
    """What is seen of the tree where a point was found; None where the film is over in truth."""
    frame, place_px = round(float(birth["time_s"]) * FPS), [float(birth["u_px"]), float(birth["v_px"])]
    if frame >= len(film.points_px):
        return None
    branch = film.branch_at(frame, place_px)
    known = film.near[frame]
    near = set(film.point_branch[known.query_ball_point(place_px, WINDOW_PX)].tolist())
    return Place(branch, near, known.query(place_px)[0] > OFF_TREE_PX)


if __name__ == "__main__":
    main()
