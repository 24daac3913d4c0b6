#!/usr/bin/env python3
"""Draws what `arborcam render` does not: for scripts/pictures.sh.

    pictures.py terminal SCREEN.txt OUT.png    a screen as `tmux capture-pane -e` gives it
    pictures.py points CAPTURE OUT.png         the capture's frame with outline and points
    pictures.py sheet WOOD CAPTURE FRONT.png SIDE.png OUT.png
                                               film at rest, wood, traced branches, skeleton and model of one clip; WOOD is
                                               what `cargo bench --bench wood` writes
    pictures.py drawing DRAWING.svg SIDE OUT.png
                                               a drawing of docs/sketches (paths of M, Q and L, polylines, lines), SIDE px
    pictures.py photo PICTURE STROKES DOCUMENTS HEIGHT OUT.png
                                               a photograph with its strokes (crown red, branch blue), the masks (leaves green,
                                               wood brown), and the branches that were seen and those that were grown; of one
                                               tree or, with commas between the names, of several
    pictures.py markers FILM_DIR CAPTURE FIRST.png LATER.png LATER_FRAME OUT.png
                                               the first frame with the windows of its markers, a later one with where they
                                               are followed; below, of the first two markers, the way of the second one, the
                                               angle of its branch to that of the first, and its spectrum (needs numpy)
    pictures.py angles OUT.png PANEL...        angles of marked branches to the next ones over time, or their spectra, two panels a row; a
                                               PANEL is TITLE|time or spectrum|CURVE,CURVE..., a CURVE is FILM_DIR:CAPTURE:MARKER:LABEL,
                                               a MARKER the number of its branch in the film's truth.json, or TRUNK (needs numpy)
    pictures.py parameters FILM_DIR SMALL.json LARGE_DIR LARGE.json
                                               prints frequency and damping of marked branches by two forces as a table, from what
                                               `analyze --markers --json` says, beside Table 1 of Hu et al.
    pictures.py swaying PLY QSM.csv HEIGHT OUT.png
                                               the points of a scan beside its branches, these in the colour of the frequency that a film
                                               gave them, from the front (needs numpy)
    pictures.py fit PLY QSM.csv HEIGHT OUT.png
                                               a scanned tree, and its points over it, from the front (needs numpy)
    pictures.py triangles EXAMPLE TREES OUT.png
                                               the forks of an example and of the trees grown of it in the triangles of their
                                               angles and lengths, with the fitted Dirichlet densities (needs numpy, scipy)
"""

import csv
import json
import math
import re
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont, ImageOps

FONTS = Path("/usr/share/fonts/truetype/dejavu")
CELL = (9, 18)  # of the terminal, px
FINE = 2  # drawn larger, then scaled down: smooth letters and dots
LARGEST = 150_000  # bytes

TEXT, GROUND = (220, 220, 220), (16, 18, 20)
BASIC = [
    (0, 0, 0), (205, 49, 49), (13, 188, 121), (229, 229, 16), (36, 114, 200), (188, 63, 188), (17, 168, 205),
    (229, 229, 229), (102, 102, 102), (241, 76, 76), (35, 209, 139), (245, 245, 67), (59, 142, 234), (214, 112, 214),
    (41, 184, 219), (255, 255, 255),
]


def save(picture, out):
    """With as many colours as the size allows."""
    for colours in (256, 128, 64, 32):
        # The few bright dots are what is to be seen; other methods give them no colour of their own.
        few = picture.quantize(colours, method=Image.Quantize.MAXCOVERAGE, kmeans=1, dither=Image.Dither.NONE)
        few.save(out, optimize=True)
        if Path(out).stat().st_size <= LARGEST:
            return


def indexed(n):
    if n < 16:
        return BASIC[n]
    if n < 232:
        levels = (0, 95, 135, 175, 215, 255)
        return levels[(n - 16) // 36], levels[(n - 16) // 6 % 6], levels[(n - 16) % 6]
    return (8 + 10 * (n - 232),) * 3


class Pen:
    """Colours and weight of the letters that follow."""

    def __init__(self):
        self.reset()

    def reset(self):
        self.front, self.back, self.bold, self.reverse = TEXT, GROUND, False, False

    def read(self, codes):
        codes = [int(c or 0) for c in re.split("[;:]", codes)]
        while codes:
            code = codes.pop(0)
            if code == 0:
                self.reset()
            elif code in (1, 22):
                self.bold = code == 1
            elif code in (7, 27):
                self.reverse = code == 7
            elif code in (38, 48):
                kind = codes.pop(0)
                colour = tuple(codes[:3]) if kind == 2 else indexed(codes[0])
                del codes[: 3 if kind == 2 else 1]
                if code == 38:
                    self.front = colour
                else:
                    self.back = colour
            elif code == 39:
                self.front = TEXT
            elif code == 49:
                self.back = GROUND
            elif 30 <= code < 38 or 90 <= code < 98:
                self.front = BASIC[code - 30 if code < 38 else code - 82]
            elif 40 <= code < 48 or 100 <= code < 108:
                self.back = BASIC[code - 40 if code < 48 else code - 92]


def letter(draw, fonts, pen, x, y, w, h, c):
    front, back = (pen.back, pen.front) if pen.reverse else (pen.front, pen.back)
    draw.rectangle([x, y, x + w - 1, y + h - 1], fill=back)
    code = ord(c)
    if c == "▀":
        draw.rectangle([x, y, x + w - 1, y + h // 2 - 1], fill=front)
    elif 0x2581 <= code <= 0x2588:
        draw.rectangle([x, y + h - h * (code - 0x2580) // 8, x + w - 1, y + h - 1], fill=front)
    elif 0x2589 <= code <= 0x258F:
        draw.rectangle([x, y, x + w * (0x2590 - code) // 8 - 1, y + h - 1], fill=front)
    elif c == "░":
        draw.rectangle([x, y, x + w - 1, y + h - 1], fill=tuple((f + 3 * b) // 4 for f, b in zip(front, back)))
    elif c == "─":
        draw.rectangle([x, y + h // 2 - 1, x + w - 1, y + h // 2], fill=front)
    elif 0x2800 <= code <= 0x28FF:
        for bit, (column, row) in enumerate([(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (0, 3), (1, 3)]):
            if (code - 0x2800) >> bit & 1:
                cx, cy, r = x + w * (2 * column + 1) / 4, y + h * (2 * row + 1) / 8, 0.95 * FINE
                draw.ellipse([cx - r, cy - r, cx + r, cy + r], fill=front)
    elif c != " ":
        draw.text((x, y + h * 0.78), c, font=fonts[pen.bold], fill=front, anchor="ls")


def terminal(screen, out):
    lines = Path(screen).read_text(encoding="utf-8").rstrip("\n").split("\n")
    plain = [re.sub(r"\x1b\[[0-9;:]*m", "", line) for line in lines]
    columns = max(map(len, plain))
    w, h = CELL[0] * FINE, CELL[1] * FINE
    fonts = [ImageFont.truetype(str(FONTS / name), 15 * FINE) for name in ("DejaVuSansMono.ttf", "DejaVuSansMono-Bold.ttf")]
    picture = Image.new("RGB", (columns * w, len(lines) * h), GROUND)
    draw = ImageDraw.Draw(picture)
    pen = Pen()
    for row, line in enumerate(lines):
        column = 0
        for found in re.finditer(r"\x1b\[([0-9;:]*)m|(.)", line):
            if found.group(2) is None:
                pen.read(found.group(1))
            else:
                letter(draw, fonts, pen, column * w, row * h, w, h, found.group(2))
                column += 1
    size = (picture.width // FINE, picture.height // FINE)
    save(picture.resize(size, Image.LANCZOS), out)


PALETTE = [
    (86, 180, 233), (230, 159, 0), (0, 190, 120), (240, 228, 66), (225, 80, 140), (180, 130, 240), (255, 110, 60),
    (60, 120, 255),
]


def points(capture, out):
    capture = Path(capture)
    note = json.loads((capture / "capture.json").read_text())
    nodes = {n["node_id"]: n for n in csv.DictReader((capture / "nodes.csv").open())}
    children = {}
    for node in nodes.values():
        if int(node["n_tracks"]) > 0:
            children.setdefault(node["parent_id"], []).append(node["node_id"])
    # Main branches: follow the trunk up until there are some.
    mains = children.get("", [])
    while len(mains) < 4 and any(children.get(m) for m in mains):
        mains = [c for m in mains for c in children.get(m, [m])]

    def main(node):
        while node and node not in mains:
            node = nodes[node]["parent_id"]
        return node or None

    frame = note["picture"]["frame"]
    picture = Image.open(capture / note["picture"]["file"]).convert("RGB")
    scale = 1.5 * 960 / picture.width
    picture = picture.resize((round(picture.width * scale), round(picture.height * scale)), Image.BICUBIC)
    draw = ImageDraw.Draw(picture)
    at = lambda u, v: ((float(u) + 0.5) * scale, (float(v) + 0.5) * scale)
    outline = [at(u, v) for u, v in (note["outline"] or {}).get("polygon_px", [])]
    if outline:
        draw.line(outline + outline[:1], fill=(255, 214, 60), width=3)
    for row in csv.DictReader((capture / "tracks.csv").open()):
        if int(row["frame"]) == frame:
            branch = main(row["node_id"])
            colour = PALETTE[mains.index(branch) % len(PALETTE)] if branch else (235, 235, 235)
            (x, y), r = at(row["u_px"], row["v_px"]), 5 if branch else 3.5
            draw.ellipse([x - r - 1, y - r - 1, x + r + 1, y + r + 1], fill=(10, 10, 10))
            draw.ellipse([x - r, y - r, x + r, y + r], fill=colour)
    save(picture.resize((960, 960 * picture.height // picture.width), Image.LANCZOS), out)


KIND_COLOURS = {"measured": (240, 228, 66), "traced": (0, 220, 140), "shoot": (230, 120, 220)}


def sheet(wood, capture, front, side, out):
    wood, capture = Path(wood), Path(capture)
    note = json.loads((capture / "capture.json").read_text())
    rest = wood / "rest.png"
    film = Image.open(rest if rest.is_file() else capture / note["picture"]["file"]).convert("RGB")
    is_found = (wood / "branches.csv").is_file()
    none = Image.new("RGB", film.size, GROUND)
    mask = Image.open(wood / "wood.png").convert("RGB") if is_found else none
    traced = on_film(film, graph(rows(wood / "branches.csv"), "node", "parent")) if is_found else none
    seen = [n for n in rows(capture / "nodes.csv") if n["kind"] in KIND_COLOURS]
    skeleton = on_film(film, graph(seen, "node_id", "parent_id"))
    models = [ImageOps.pad(Image.open(name).convert("RGB"), film.size, color="white") for name in (front, side)]
    missing = "" if is_found else ": none was found"
    moment = "film at rest" if rest.is_file() else "film, first frame"
    top = [(film, moment), (mask, "probability of wood" + missing), (traced, "traced branches" + missing)]
    kinds = ", ".join(f"{kind} {sum(n['kind'] == kind for n in seen)}" for kind in KIND_COLOURS)
    low = [(skeleton, "skeleton: " + kinds), (models[0], "model from the front"), (models[1], "from the side")]
    canvas = Image.new("RGB", (3 * film.width, 2 * film.height), GROUND)
    pen, font = ImageDraw.Draw(canvas), ImageFont.truetype(str(FONTS / "DejaVuSansMono.ttf"), 14)
    for k, cells in enumerate((top, low)):
        for column, (picture, title) in enumerate(cells):
            x = column * film.width
            canvas.paste(picture, (x, k * film.height))
            box = pen.textbbox((x + 8, k * film.height + 6), title, font=font)
            pen.rectangle([box[0] - 4, box[1] - 3, box[2] + 4, box[3] + 3], fill=GROUND)
            pen.text((x + 8, k * film.height + 6), title, font=font, fill=TEXT)
    canvas.save(out, optimize=True)


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def graph(nodes, name, parent_name):
    """Pieces of line from node to parent in px, with their colour."""
    by_name = {n[name]: n for n in nodes}
    place = lambda n: (float(n["u_px"]), float(n["v_px"]))
    ends = [(n, by_name[n[parent_name]]) for n in nodes if n[parent_name] in by_name]
    return [(place(n), place(parent), KIND_COLOURS[n.get("kind", "traced")]) for n, parent in ends]


def on_film(film, pieces):
    """Thin lines over the film, dimmed, with a dot at each node."""
    large = Image.eval(film.resize((film.width * FINE, film.height * FINE), Image.BICUBIC), lambda grey: grey * 6 // 10)
    draw = ImageDraw.Draw(large)
    at = lambda p: tuple((x + 0.5) * FINE for x in p)
    for p, q, colour in pieces:
        draw.line([at(p), at(q)], fill=colour, width=3)
    for p, _, colour in pieces:
        (x, y), r = at(p), 2.5
        draw.ellipse([x - r, y - r, x + r, y + r], fill=colour)
    return large.resize(film.size, Image.LANCZOS)


def drawing(svg, side, out):
    """A square drawing; its trunk in orange, as in Li 2011 fig. 9."""
    root = ElementTree.parse(svg).getroot()
    scale = FINE * int(side) / float(root.get("width"))
    picture = Image.new("RGB", (FINE * int(side),) * 2, "white")
    draw = ImageDraw.Draw(picture)
    draw_strokes(draw, root, scale, 1.0)
    picture.resize((int(side),) * 2, Image.LANCZOS).save(out)


def photo(picture, strokes, trees, height, out):
    """strokes and trees are lists of files and of documents, with commas between them."""
    height, trees = int(height), [Path(tree) for tree in trees.split(",")]
    picture = Image.open(picture).convert("RGB")
    wide = max(3, picture.width // 200)
    drawn = picture.copy()
    draw = ImageDraw.Draw(drawn)
    for name in filter(None, strokes.split(",")):
        lines = json.loads(Path(name).read_text())
        crown = lines.get("polygon_px", [])
        polyline = lambda points, colour: draw.line([tuple(p) for p in points], fill=colour, width=wide, joint="curve")
        if crown:
            polyline(crown + crown[:1], (220, 40, 40))
        for line in [lines] + lines.get("strokes", []):
            if "polyline_px" in line:
                polyline(line["polyline_px"], (40, 80, 230))
    masks = Image.new("RGB", picture.size, "white")
    branches = Image.new("RGB", picture.size, "white")
    draw = ImageDraw.Draw(branches)
    for tree in trees:
        for name, colour in (("leaves.png", (60, 140, 60)), ("wood.png", (110, 75, 45))):
            mask = Image.open(tree / name).convert("L").point(lambda level: 255 * (level > 127))
            masks.paste(colour, (0, 0), mask)
        draw_branches(draw, tree)
    width = round(height * (9 / 8 if len(trees) == 1 else picture.width / picture.height))
    row = Image.new("RGB", (3 * width, height), "white")
    for k, part in enumerate((drawn, masks, branches)):
        row.paste(ImageOps.fit(part, (width, height), Image.LANCZOS), (k * width, 0))
    row.save(out)


def draw_branches(draw, document):
    """Those that were seen over those that were grown."""
    colours = {"traced": (110, 75, 45), "grown": (230, 150, 40)}
    nodes = {n["node_id"]: n for n in rows(document / "nodes.csv")}
    for node in sorted(nodes.values(), key=lambda n: n["kind"] == "traced"):
        if node["parent_id"]:
            ends = [(float(n["u_px"]), float(n["v_px"])) for n in (node, nodes[node["parent_id"]])]
            draw.line(ends, fill=colours[node["kind"]], width=max(3, round(2 * float(node["radius"]))))


def cloud(ply, document, side, out):
    """The points of a scan from the front, in the picture of its tree; what lies on the ground is left out."""
    import numpy as np

    raw, side = Path(ply).read_bytes(), int(side)
    points = np.frombuffer(raw[raw.index(b"end_header\n") + 11 :], "<f8").reshape(-1, 3)
    note = json.loads((Path(document) / "capture.json").read_text())
    points = points - note["scan"]["foot_m"]
    points = points[points[:, 2] > 0.1]
    size = max(note["source"]["width"], note["source"]["height"])
    scale = side / (size * note["model"]["metres_per_px"])
    top = points[:, 2].max()
    u = (side / 2 + scale * (points[:, 0] - (points[:, 0].min() + points[:, 0].max()) / 2)).astype(int).clip(0, side - 1)
    v = (0.05 * side + scale * (top - points[:, 2])).astype(int).clip(0, side - 1)
    dark = np.zeros((side, side))
    np.add.at(dark, (v, u), 1)
    grey = 255 * np.exp(-dark / 4)
    Image.fromarray(grey.astype(np.uint8)).convert("RGB").save(out)


NO_GROUND_M = 0.35  # above the foot, on a slope
TRUNK_RADII = 1.3  # nearer to the trunk's middle there is no ground
WOOD, POINT, UNKNOWN = (150, 118, 90), (30, 80, 210), (190, 190, 190)


class Scanned:
    """A scan and the cylinders of its tree (`export --format qsm`), as both are seen from the front: x to the right, z up, m."""

    def __init__(self, ply, qsm, height):
        import numpy as np

        raw, self.height = Path(ply).read_bytes(), int(height)
        points = np.frombuffer(raw[raw.index(b"end_header\n") + 11 :], "<f8").reshape(-1, 3)
        self.cylinders = rows(qsm)
        lowest = min(self.cylinders, key=lambda c: float(c["startZ"]))
        foot = float(lowest["startZ"])
        off_trunk = np.hypot(points[:, 0] - float(lowest["startX"]), points[:, 1] - float(lowest["startY"]))
        on_trunk = (off_trunk < TRUNK_RADII * float(lowest["radius"])) & (points[:, 2] > foot)
        self.points = points[(points[:, 2] > foot + NO_GROUND_M) | on_trunk]
        self.low, self.top = self.points[:, 0].min() - 0.2, self.points[:, 2].max() + 0.2
        self.px_per_m = (self.height - 1) / (self.top - foot + 0.1)
        self.width = int((self.points[:, 0].max() + 0.2 - self.low) * self.px_per_m)

    def panel(self):
        """An empty one, drawn larger, and a pen on it."""
        panel = Image.new("RGB", (FINE * self.width, FINE * self.height), "white")
        return panel, ImageDraw.Draw(panel)

    def at(self, x, z):
        return FINE * (x - self.low) * self.px_per_m, FINE * (self.top - z) * self.px_per_m

    def wood(self, pen, colour_of):
        for c in self.cylinders:
            ends = [self.at(float(c[f"{end}X"]), float(c[f"{end}Z"])) for end in ("start", "end")]
            width = max(round(2 * FINE * float(c["radius"]) * self.px_per_m), 2)
            pen.line(ends, fill=colour_of(c), width=width)
            for (u, v), r in zip(ends, (width / 2 - 1,) * 2):
                pen.ellipse([u - r, v - r, u + r, v + r], fill=colour_of(c))

    def dots(self, pen, colour, share):
        for x, _, z in self.points[::share]:
            pen.point(self.at(x, z), fill=colour)


def beside(panels, size, out):
    """Panels of one size in a row, scaled down."""
    row = Image.new("RGB", (len(panels) * size[0], size[1]), "white")
    for k, panel in enumerate(panels):
        row.paste(panel.resize(size, Image.LANCZOS), (k * size[0], 0))
    save(row, out)


def fit(ply, qsm, height, out):
    """Hu et al. fig. 14: the tree, and how its points lie on it."""
    scan = Scanned(ply, qsm, height)
    panels = []
    for with_points in (False, True):
        panel, pen = scan.panel()
        scan.wood(pen, lambda cylinder: WOOD)
        if with_points:
            scan.dots(pen, POINT, 4)
        panels.append(panel)
    beside(panels, (scan.width, scan.height), out)


def swaying(ply, qsm, height, out):
    """What a film said of the branches of a scan."""
    scan = Scanned(ply, qsm, height)
    dots, pen = scan.panel()
    scan.dots(pen, (60, 60, 60), 2)
    hz_of = lambda cylinder: round(float(cylinder["frequency_hz"]), 2) if cylinder["frequency_hz"] else None
    known = sorted({hz_of(c) for c in scan.cylinders} - {None})
    colours = {hz: spectral(k / max(len(known) - 1, 1)) for k, hz in enumerate(known)} | {None: UNKNOWN}
    branches, pen = scan.panel()
    scan.wood(pen, lambda cylinder: colours[hz_of(cylinder)])
    font = ImageFont.truetype(str(FONTS / "DejaVuSans.ttf"), 12 * FINE)
    for k, hz in enumerate(known):
        # Where the tree is not: beside the trunk.
        at = FINE * scan.width - 12, FINE * (scan.height - 17 * (len(known) - k) - 6)
        pen.text(at, f"{hz:.2f} Hz", fill=colours[hz], font=font, anchor="ra")
    beside([dots, branches], (scan.width, scan.height), out)


def spectral(share):
    """From blue, the slowest, to red."""
    import colorsys

    return tuple(round(200 * c) for c in colorsys.hsv_to_rgb(0.66 * (1 - share), 1, 1))


MARKER_BLUE, MARKER_YELLOW, AXES = (40, 90, 230), (255, 220, 0), (120, 120, 120)
FIRST_MARKER = 1_000_000_000


def markers(film, capture, first, later, later_frame, out):
    """Hu et al. figs 2, 3, 6 and 7 for a made film."""
    import numpy as np

    windows, seen = seen_markers(capture)
    pictures = [Image.open(path).convert("RGB") for path in (first, later)]
    font = ImageFont.truetype(str(FONTS / "DejaVuSans.ttf"), 11)
    draw = ImageDraw.Draw(pictures[0])
    for window in windows:
        u, v, width, height = window["window_px"]
        draw.rectangle((u, v, u + width, v + height), outline=MARKER_BLUE)
        draw.text((u + width + 2, v), window["name"], fill=MARKER_BLUE, font=font)
    draw = ImageDraw.Draw(pictures[1])
    for k, window in enumerate(windows):
        if int(later_frame) in seen.get(k, {}):
            u, v, _ = seen[k][int(later_frame)]
            draw.ellipse((u - 7, v - 7, u + 7, v + 7), outline=MARKER_YELLOW)
            draw.text((u + 9, v - 12), window["name"], fill=(0, 0, 0), font=font)
    frames = sorted(set(seen[0]) & set(seen[1]))
    lower, upper = (np.array([seen[k][f][:2] for f in frames]) for k in (0, 1))
    time_s = np.array([seen[0][f][2] for f in frames])
    angle_deg = angle_to(upper, lower, foot_of(film))
    hz, power = spectrum(time_s, angle_deg)
    width, height = pictures[0].size
    picture = Image.new("RGB", (2 * width, height + 230), "white")
    for k, part in enumerate(pictures):
        picture.paste(part, (k * width, 0))
    draw, part = ImageDraw.Draw(picture), 2 * width // 3
    name = windows[1]["name"]
    shown = hz <= 5
    curve(draw, (0, height, part, 230), upper[:, 0], -upper[:, 1], f"way of {name}, px", font)
    curve(draw, (part, height, part, 230), time_s, angle_deg, f"angle of {windows[0]['name']}-{name} to its parent, degrees, by s", font)
    curve(draw, (2 * part, height, part, 230), hz[shown], power[shown], "its spectrum, degrees, by Hz", font)
    save(picture, out)


def seen_markers(capture):
    """The windows of a capture's markers, and where and when each was seen in which frame: {number: {frame: (u, v, s)}}."""
    windows = json.loads((Path(capture) / "capture.json").read_text())["config"]["markers"]["windows"]
    seen = {}
    for row in rows(Path(capture) / "tracks.csv"):
        if int(row["track_id"]) >= FIRST_MARKER:
            place = float(row["u_px"]), float(row["v_px"]), float(row["time_s"])
            seen.setdefault(int(row["track_id"]) - FIRST_MARKER, {})[int(row["frame"])] = place
    return windows, seen


def foot_of(film):
    import numpy as np

    outline = json.loads((Path(film) / "outline.json").read_text())["polygon_px"]
    return np.array(max(outline, key=lambda p: p[1]), float)


def angle_to(upper, lower, below):
    """Signed angle of upper - lower to lower - below, degrees off its mean (Hu et al. eq. 1, which has no sign)."""
    import numpy as np

    turn = lambda a: np.unwrap(np.arctan2(a[:, 0], -a[:, 1]))
    angle_deg = np.degrees(turn(upper - lower) - turn(lower - below))
    return angle_deg - angle_deg.mean()


def spectrum(time_s, angle_deg):
    import numpy as np

    even_s = np.linspace(time_s[0], time_s[-1], len(time_s))
    power = np.abs(np.fft.rfft(np.interp(even_s, time_s, angle_deg), 8 * len(time_s))) * 2 / len(time_s)
    return np.fft.rfftfreq(8 * len(time_s), even_s[1] - even_s[0]), power


def marker_on(film, branch):
    """The name of the marker on a branch of a made film; on the trunk the lowest."""
    on = [m for m in json.loads((Path(film) / "truth_markers.json").read_text())["markers"] if m["branch"] == int(branch)]
    return min(on, key=lambda m: m["frac"])["name"] if on else None


def marker_angle(film, capture, branch):
    """When a marked branch had which angle to the one that carries it, by markers: s, degrees."""
    import numpy as np

    windows, seen = seen_markers(capture)
    number = {window["name"]: k for k, window in enumerate(windows)}
    parent = {window["name"]: window.get("parent") for window in windows}
    chain = [marker_on(film, branch)]
    if chain[0] is None:
        sys.exit(f"pictures: no marker of {film} is on branch {branch}")
    while len(chain) < 3 and chain[-1] and parent[chain[-1]]:
        chain.append(parent[chain[-1]])
    seen = [seen[number[name]] for name in chain]
    frames = sorted(set.intersection(*map(set, seen)))
    foot, places = foot_of(film), [np.array([one[f][:2] for f in frames]) for one in seen]
    # Below the last marker is the foot, and below that the ground.
    places += [np.tile(foot, (len(frames), 1)), np.tile(foot + [0.0, 100.0], (len(frames), 1))]
    return np.array([seen[0][f][2] for f in frames]), angle_to(*places[:3])


COLOURS = [(40, 90, 230), (210, 60, 40), (30, 150, 70), (150, 80, 190)]
PANEL = 470, 190  # px
HIGHEST_HZ = 4.0


def angles(out, *panels):
    """Hu et al. figs 6, 7 and 9 to 12 for made films: panels of curves."""
    import numpy as np

    font = ImageFont.truetype(str(FONTS / "DejaVuSans.ttf"), 11)
    width, height = PANEL
    picture = Image.new("RGB", (2 * width, height * ((len(panels) + 1) // 2)), "white")
    draw = ImageDraw.Draw(picture)
    for k, panel in enumerate(panels):
        title, kind, curves = panel.split("|")
        lines = []
        for one in curves.split(","):
            film, capture, branch, label = one.split(":")
            time_s, angle_deg = marker_angle(film, capture, branch)
            if kind == "spectrum":
                released_s = json.loads((Path(film) / "truth.json").read_text())["motion"]["release_time_s"]
                free = time_s > released_s
                hz, power = spectrum(time_s[free], angle_deg[free] - angle_deg[free].mean())
                time_s, angle_deg = hz[hz <= HIGHEST_HZ], power[hz <= HIGHEST_HZ]
            lines.append((label, time_s, angle_deg))
        low = 0.0 if kind == "spectrum" else min(y.min() for _, _, y in lines)
        high = max(y.max() for _, _, y in lines)
        units = "degrees, by Hz" if kind == "spectrum" else "degrees, by s"
        box = (width * (k % 2), height * (k // 2), width, height)
        for line, (label, x, y) in enumerate(lines):
            # The first draws the frame; all have its axes.
            curve(draw, box, x, y, f"{title}, {units}" if line == 0 else None, font, (low, high), COLOURS[line % len(COLOURS)])
            if len(lines) > 1:
                at = box[0] + width - 20, box[1] + 30 + 14 * line
                draw.text(at, label, fill=COLOURS[line % len(COLOURS)], font=font, anchor="ra")
    save(picture, out)


HU_TABLE_1 = {  # branch: small force Hz, damping; large force Hz, damping
    "A": (1.46, 0.104, 1.46, 0.120), "C": (1.46, 0.086, 1.46, 0.081), "D": (1.46, 0.072, 1.46, 0.075), "E": (1.46, 0.072, 1.46, 0.074),
    "B": (1.46, 0.084, 1.39, 0.077), "I": (1.46, 0.133, 1.46, 0.096), "H": (1.46, 0.069, 1.46, 0.191), "F": (1.39, 0.077, 1.46, 0.094),
    "G": (1.39, 0.089, 1.46, 0.141), "J": (1.46, 0.241, 1.46, 0.093),
}


def parameters(small_film, small, large_film, large):
    found = [by_branch(film, answers) for film, answers in ((small_film, small), (large_film, large))]
    common = [b for b in found[0] if b in found[1]]
    print("| Hu et al.: branch | small force f, Hz | ξ | large force f, Hz | ξ | ours: branch | small force f, Hz | ξ | large force f, Hz | ξ |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name, branch in zip(HU_TABLE_1, common):
        ours = [f"{x:.2f}" if k % 2 == 0 else f"{x:.3f}" for one in found for k, x in enumerate(one[branch])]
        theirs = HU_TABLE_1[name]
        print(f"| {name} | {theirs[0]:.2f} | {theirs[1]:.3f} | {theirs[2]:.2f} | {theirs[3]:.3f} | {branch} | {' | '.join(ours)} |")


def by_branch(film, answers):
    """Largest peak and half-power damping of each marked branch, by its number in the film's truth."""
    marked = {m["name"]: m for m in json.loads((Path(film) / "truth_markers.json").read_text())["markers"]}
    branches = json.loads(Path(answers).read_text())["captures"][0]["branches"]
    lowest = {b["branch"]: marked[b["branch"]] for b in branches if b["branch"] == marker_on(film, marked[b["branch"]]["branch"])}
    told = {b["branch"]: (b["spectrum_peak_hz"], b["half_power_damping"]) for b in branches}
    return {m["branch"]: told[name] for name, m in lowest.items() if None not in told[name]}


def curve(draw, box, x, y, title, font, bounds=None, colour=MARKER_BLUE):
    """One line in a box (left, top, width, height) with its extremes, or within bounds; without a title only the line."""
    left, top, width, height = box
    inner = left + 46, top + 24, left + width - 14, top + height - 26
    (x0, x1), (y0, y1) = (x.min(), x.max()), bounds or (y.min(), y.max())
    to = lambda a, b: (inner[0] + (a - x0) / (x1 - x0) * (inner[2] - inner[0]), inner[3] - (b - y0) / (y1 - y0) * (inner[3] - inner[1]))
    draw.line([to(a, b) for a, b in zip(x, y)], fill=colour, width=1)
    if title is None:
        return
    draw.rectangle(inner, outline=AXES)
    draw.text((inner[0], top + 6), title, fill=(0, 0, 0), font=font)
    for value, at, anchor in ((y0, (inner[0] - 4, inner[3]), "rs"), (y1, (inner[0] - 4, inner[1]), "rt"),
                              (x0, (inner[0], inner[3] + 4), "lt"), (x1, (inner[2], inner[3] + 4), "rt")):
        draw.text(at, f"{abs(value) if anchor[0] == 'r' and title.startswith('way') else value:.1f}", fill=AXES, font=font, anchor=anchor)


def draw_strokes(draw, element, scale, width):
    width = float(element.get("stroke-width", width))
    line = stroke_of(element)
    if line:
        colour = (224, 128, 32) if element.get("id") == "trunk" else (96, 96, 96)
        line = [(u * scale, v * scale) for u, v in line]
        draw.line(line, fill=colour, width=max(1, round(width * scale)), joint="curve")
    for child in element:
        draw_strokes(draw, child, scale, width)


def stroke_of(element):
    """Points of a stroke; none of what is no stroke."""
    tag = element.tag.split("}")[-1]
    if tag == "line":
        return [(float(element.get("x" + k)), float(element.get("y" + k))) for k in "12"]
    if tag not in ("path", "polyline"):
        return []
    words = re.findall(r"[MLQ]|-?[\d.]+", element.get("d") or element.get("points"))
    numbers = [float(word) for word in words if word not in "MLQ"]
    places = list(zip(numbers[::2], numbers[1::2]))
    if "Q" not in words:
        return places
    start, bend, end = places
    shares = [k / 20 for k in range(21)]
    on_curve = lambda t, k: (1 - t) ** 2 * start[k] + 2 * t * (1 - t) * bend[k] + t * t * end[k]
    return [(on_curve(t, 0), on_curve(t, 1)) for t in shares]


SIDE, EDGE = 340, 44  # of a triangle and around it, px


def triangles(example, trees, out):
    """Li 2011 fig. 8: rings the example's forks and their mirror images, dots those of the trees."""
    sys.path.insert(0, str(Path(__file__).parent.parent / "benches"))
    import grown_features as features
    import numpy as np

    ratios_of = lambda tree: features.ratios(*features.fork_tree(*features.nodes_of(Path(tree))))
    own = ratios_of(example)
    grown = np.concatenate([ratios_of(tree) for tree in sorted(Path(trees).iterdir())])
    panels = []
    for names, columns in ((("left", "between", "right"), (0, 1)), (("stem", "left", "right"), (2, 3))):
        shares = [np.column_stack([r[:, columns[0]], r[:, columns[1]], 1 - r[:, columns].sum(1)]) for r in (own, grown)]
        panels.append(triangle(*shares, names))
    width, height = panels[0].size
    picture = Image.new("RGB", (2 * width, height), "white")
    for k, panel in enumerate(panels):
        picture.paste(panel, (k * width, 0))
    save(picture, out)


def triangle(own, grown, names):
    import numpy as np

    fine = FINE * SIDE
    high = int(fine * 3**0.5 / 2)
    edge = FINE * EDGE
    picture = Image.new("RGB", (fine + 2 * edge, high + 2 * edge), "white")
    draw = ImageDraw.Draw(picture)
    corners = np.array([(edge, edge + high), (edge + fine / 2, edge), (edge + fine, edge + high)])
    # Log densities of the fit over the triangle; lines at shares of the highest.
    alpha = dirichlet(np.clip(own, 1e-4, 1))
    u, v = np.meshgrid(np.arange(picture.width), np.arange(picture.height))
    top = (edge + high - v) / high
    right = (u - edge) / fine - top / 2
    places = np.stack([1 - top - right, top, right])
    inside = places.min(0) > 1e-3
    log = np.where(inside, ((alpha - 1)[:, None, None] * np.log(np.maximum(places, 1e-3))).sum(0), -np.inf)
    levels = [0.9, 0.7, 0.5, 0.3, 0.1]
    band = np.zeros(log.shape, int)
    for share in levels:
        band += log > log.max() + np.log(share)
    shade = np.array([(255 - 16 * k, 255 - 10 * k, 255 - 3 * k) for k in range(len(levels) + 1)], np.uint8)
    picture.paste(Image.fromarray(shade[band]), (0, 0), Image.fromarray(np.uint8(255 * inside)))
    draw.polygon([tuple(c) for c in corners], outline=(90, 90, 90), width=2)
    for rows, radius, colour, is_ring in ((grown, 2.0, (60, 110, 180), False), (own, 5.0, (200, 60, 30), True)):
        for x, y in rows[:, [0, 1, 2]] @ corners[[0, 1, 2]]:
            box = [x - radius, y - radius, x + radius, y + radius]
            draw.ellipse(box, outline=colour, width=2) if is_ring else draw.ellipse(box, fill=colour)
    font = ImageFont.truetype(str(FONTS / "DejaVuSans.ttf"), 13 * FINE)
    draw.text((edge, edge + high + 8), names[0], fill=TEXT_DARK, font=font, anchor="mt")
    draw.text((edge + fine / 2, edge - 8), names[1], fill=TEXT_DARK, font=font, anchor="ms")
    draw.text((edge + fine, edge + high + 8), names[2], fill=TEXT_DARK, font=font, anchor="mt")
    return picture.resize((picture.width // FINE, picture.height // FINE), Image.LANCZOS)


TEXT_DARK = (40, 40, 40)


def dirichlet(shares):
    """Maximum likelihood, as src/grow/dirichlet.rs finds it."""
    import numpy as np
    from scipy.optimize import minimize
    from scipy.special import gammaln

    mean_log = np.log(shares).mean(0)
    minus = lambda log: -(gammaln(np.exp(log).sum()) - gammaln(np.exp(log)).sum() + (np.exp(log) - 1) @ mean_log)
    return np.exp(minimize(minus, np.log(10 * shares.mean(0))).x)


if __name__ == "__main__":
    commands = {
        "terminal": (terminal, 2), "points": (points, 2), "sheet": (sheet, 5), "drawing": (drawing, 3),
        "photo": (photo, 5), "cloud": (cloud, 4), "markers": (markers, 6), "triangles": (triangles, 3), "angles": (angles, None),
        "parameters": (parameters, 4), "swaying": (swaying, 4), "fit": (fit, 4),
    }
    command, count = commands.get(sys.argv[1] if len(sys.argv) > 1 else "", (None, 0))
    if command is None or len(sys.argv) != 2 + (len(sys.argv) - 2 if count is None else count):
        sys.exit(__doc__)
    command(*sys.argv[2:])
