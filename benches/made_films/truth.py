"""What is known of a made film: the points of its grid, the outline, and every branch."""
import cv2
import numpy as np

from . import picture
from .picture import FINE, FPS, HEIGHT, WIDTH

GRID_STEP_PX, GRID_POINTS = 2, 2500
COORDINATES = "x right, y up, z toward viewer; metres; trunk foot = origin. pixels: centre of top-left pixel = (0,0), v down"


def facet_map(surface, pose, camera, hidden):
    """(fine height, fine width) facet seen at each fine pixel of the pose's frame 0, -1 where there is none or it is hidden."""
    canvas = np.zeros((FINE * HEIGHT, FINE * WIDTH, 3), np.uint8)
    # The number of a facet, from 1, as a colour.
    numbers = [(float(n & 255), float(n >> 8 & 255), float(n >> 16)) for n in range(1, len(surface.facets) + 1)]
    picture.draw(canvas, surface, surface.vertices_m(pose, 0, 0.0), camera, numbers)
    canvas[hidden] = 0
    return canvas.astype(np.int64) @ np.array([1, 256, 65536]) - 1


def masks(surface, seen):
    """How much of each pixel shows wood, and how much leaves, 0 to 255; seen is a facet_map."""
    is_leaf = surface.two_sided[seen]
    shares = [(seen >= 0) & ~is_leaf, (seen >= 0) & is_leaf]
    return [cv2.resize(255 * s.astype(np.uint8), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA) for s in shares]


def widths(branches, surface, rest, camera, seen):
    """Of each branch the radius at its nodes, px, and whether its own bark is seen there at rest."""
    listed = []
    for b in branches:
        nodes_px = camera.project(rest.points_m[0, rest.first[b.id] : rest.first[b.id + 1]])
        fine = np.round((nodes_px + 0.5) * FINE - 0.5).astype(int)
        inside = ((fine >= 0) & (fine < (FINE * WIDTH, FINE * HEIGHT))).all(axis=1)
        facet = np.where(inside, seen[tuple(np.where(inside[:, None], fine, 0).T[::-1])], -1)
        own = (facet >= 0) & (surface.branch[facet] == b.id) & ~surface.two_sided[facet]
        frac = np.linspace(0, 1, len(nodes_px))
        listed.append(dict(rest_radius_px=rounded(camera.px_per_m * b.radius_m(frac)), rest_seen=own.astype(int).tolist()))
    return listed


def grid(rng, surface, pose, camera, seen, frames):
    """Surface points seen in frame 0, on even pixels, and where each of them is in every frame."""
    v, u = np.mgrid[0:HEIGHT:GRID_STEP_PX, 0:WIDTH:GRID_STEP_PX].reshape(2, -1)
    # The centre of a pixel lies between four fine ones: all of them must show the same branch.
    four = np.stack([seen[FINE * v + a, FINE * u + b] for a in (1, 2) for b in (1, 2)])
    branch = np.where(four >= 0, surface.branch[four], -1)
    kept = np.flatnonzero((branch[0] >= 0) & (branch == branch[0]).all(axis=0))
    kept = np.sort(rng.choice(kept, min(GRID_POINTS, len(kept)), replace=False))
    pix0, facet = np.stack([u[kept], v[kept]], axis=-1).astype(float), four[0, kept]
    vertices_px = lambda f: camera.project(surface.vertices_m(pose, f, f / FPS))
    corners, weights = barycentric(vertices_px(0), surface.facets[facet], pix0)
    pos = np.stack([np.einsum("kc,kcd->kd", weights, vertices_px(f)[corners]) for f in range(frames)])
    # Where the weights had to be limited the point lies beside its pixel: it moves alike.
    pos += pix0 - pos[0]
    return pix0.astype(np.float32), surface.branch[facet].astype(np.int32), pos.astype(np.float32)


def barycentric(uv, quads, points):
    """The better of a quad's two triangles for each point: its corners (K, 3) and their weights (K, 3)."""
    halves = [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
    weights = [triangle_weights(*(uv[h[:, k]] for k in range(3)), points) for h in halves]
    second = (weights[1].min(axis=1) > weights[0].min(axis=1))[:, None]
    # A facet seen edge-on, or not quite reaching the pixel, must not be extrapolated far.
    chosen = np.clip(np.where(second, weights[1], weights[0]), -0.5, 1.5)
    return np.where(second, halves[1], halves[0]), chosen / chosen.sum(axis=1, keepdims=True)


def triangle_weights(a, b, c, points):
    cross = lambda p, q: p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    area = cross(b - a, c - a)
    flat = np.abs(area) < 1e-9
    area = np.where(flat, 1.0, area)
    w1, w2 = cross(points - a, c - a) / area, cross(b - a, points - a) / area
    # A triangle without area loses against any other, and its limited weights are even.
    return np.where(flat[:, None], -1e9, np.stack([1 - w1 - w2, w1, w2], axis=-1))


def outline(seen):
    """A rough polygon around the tree with a margin, as drawn by hand."""
    tree = cv2.resize((seen >= 0).astype(np.uint8), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    disc = lambda d: cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (d, d))
    wide = cv2.copyMakeBorder(tree, 40, 40, 40, 40, cv2.BORDER_CONSTANT)
    wide = cv2.erode(cv2.dilate(wide, disc(41)), disc(27))[40:-40, 40:-40]
    contours, _ = cv2.findContours(wide, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    polygon = cv2.approxPolyDP(max(contours, key=cv2.contourArea), 3.0, True)[:, 0]
    return {"frame": 0, "width": WIDTH, "height": HEIGHT, "polygon_px": polygon.tolist()}


def rounded(x):
    return np.round(np.asarray(x, float), 4).tolist()


def of_camera(camera):
    if hasattr(camera, "seen_m"):
        return dict(type="pinhole", centre_xy=rounded(camera.centre_m), focal_px=camera.as_file()["fx"], distance=rounded(camera.distance),
                    real_metres=float(camera.shrink), px_per_m_at_z0=rounded(camera.px_per_m),
                    projection="s=focal_px/(distance-z); u=W/2-.5+s*(x-cx); v=H/2-.5-s*(y-cy); depth=(distance-z)*real_metres")
    rolled = dict(roll_deg=camera.roll_deg) if camera.roll_deg else {}
    return rolled | dict(type="ortho", center_xy=rounded(camera.centre_m), px_per_m_at_z0=rounded(camera.px_per_m), distance_m=45.0,
                focal_px=None, projection="u=W/2-.5+s*(x-cx); v=H/2-.5-s*(y-cy); s=px_per_m_at_z0")


def of_branches(branches, pose, camera, grid_branch, more):
    """The list in truth.json; more has further facts of each. A branch is major if five points of the grid lie on it."""
    visible = np.bincount(grid_branch, minlength=len(branches))
    listed = []
    for b in branches:
        ends_px = camera.project(b.nodes_m[[0, -1]])
        tip_px = camera.project(pose.points_m[:, pose.first[b.id + 1] - 1])
        excursion_px = np.linalg.norm(tip_px - ends_px[1], axis=1).max()
        listed.append(dict(
            id=b.id, parent=b.parent, depth=b.depth, attach_frac=rounded(b.attach_frac), length=rounded(b.length_m),
            radius_base=rounded(b.radius_base_m), radius_tip=rounded(b.radius_tip_m), freq_hz=rounded(b.freq_hz),
            damping=rounded(b.damping), e1=rounded(b.e1), e2=rounded(b.e2), theta0=rounded(b.pull_rad),
            rest_base=rounded(b.nodes_m[0]), rest_tip=rounded(b.nodes_m[-1]), rest_polyline=rounded(b.nodes_m),
            rest_base_2d=rounded(ends_px[0]), rest_tip_2d=rounded(ends_px[1]), max_tip_excursion_px=rounded(excursion_px),
            visible_grid_points_f0=int(visible[b.id]), major=bool(visible[b.id] >= 5)) | more[b.id])
    return listed
