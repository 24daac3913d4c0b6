"""A tree from a point cloud against the true one: length, volume, who grows from whom, points on its surface."""
import numpy as np
from scipy.spatial import cKDTree

STEP_M = 0.005
NEAR_M = 0.03  # a place of the model is of the true branch whose bark is no farther
RUN_M = 0.08  # the branch below is the first that the model follows for so long, below the lowest place of a branch
FOUND_SHARE = 0.5  # of a branch, for it to be found
ON_SURFACE_M = 0.01
NEAR_CLOUD_M = 0.02  # the model's bark is on the cloud if a point is no farther


class Tubes:
    """Places along tapered tubes, with the tube and the radius of each."""

    def __init__(self, starts, ends, r0, r1, tube):
        parts = []
        for a, b, ra, rb, t in zip(starts, ends, r0, r1, tube):
            n = max(int(np.ceil(np.linalg.norm(b - a) / STEP_M)), 1)
            f = (np.arange(n) + 0.5) / n
            parts.append(np.c_[a + f[:, None] * (b - a), ra + f * (rb - ra), np.full(n, t)])
        all_parts = np.concatenate(parts)
        self.at, self.radius, self.tube = all_parts[:, :3], all_parts[:, 3], all_parts[:, 4].astype(int)
        self.tree = cKDTree(self.at)
        self.length = float(sum(np.linalg.norm(b - a) for a, b in zip(starts, ends)))
        self.volume = float(sum(np.pi / 3 * np.linalg.norm(b - a) * (ra * ra + ra * rb + rb * rb)
                                for a, b, ra, rb in zip(starts, ends, r0, r1)))

    def off(self, points, k=24):
        """Distance of points from the bark (below 0: inside), and the tube that is nearest so."""
        far, which = self.tree.query(points, k=min(k, len(self.at)))
        off = far - self.radius[which]
        best = np.argmin(off, axis=1)
        row = np.arange(len(points))
        return off[row, best], self.tube[which[row, best]]


def true_tubes(truth):
    rows = [(np.array(b["polyline"][k]), np.array(b["polyline"][k + 1]), b["radius"][k], b["radius"][k + 1], b["id"])
            for b in truth["branches"] for k in range(len(b["polyline"]) - 1)]
    return Tubes(*zip(*rows))


def model_tubes(parent, at, radius):
    """Of the segments of a treefile, each with its parent's index, where it ends (m) and its radius (m): cylinders, as RayCloudTools has
    them. The true tubes taper."""
    rows = [(at[p], at[i], radius[i], radius[i], i)
            for i, p in enumerate(parent) if p >= 0 and np.linalg.norm(at[i] - at[p]) > 1e-9]
    return Tubes(*zip(*rows))


def score(truth, points, parent, at, radius):
    true, model = true_tubes(truth), model_tubes(parent, at, radius)
    tree_points = points[true.off(points)[0] < NEAR_M]
    on_surface = np.abs(model.off(tree_points)[0]) <= ON_SURFACE_M
    to_cloud, _ = cKDTree(tree_points).query(model.at)
    near = np.abs(to_cloud - model.radius) <= NEAR_CLOUD_M
    right, found = topology(truth, true, model, parent, at)
    return dict(length=model.length / true.length - 1, volume=model.volume / true.volume - 1,
                parents=float(np.mean(right)), found=float(np.mean(found)), surface=float(np.mean(on_surface)), near=float(np.mean(near)),
                branches=len(right), nodes=len(parent))


def topology(truth, true, model, parent, at):
    off, label = true.off(model.at)
    label = np.where(off < NEAR_M, label, -1)
    place_of = {}  # the places of each piece of the model, from its base
    for k, piece in enumerate(model.tube):
        place_of.setdefault(piece, []).append(k)
    right, found = [], []
    for b in truth["branches"]:
        if b["parent"] < 0:
            continue
        line = np.array(b["polyline"])
        own = true.at[true.tube == b["id"]]
        parent_off = np.min(np.linalg.norm(own[:, None] - true.at[true.tube == b["parent"]][None], axis=2), axis=1)
        outside = own[parent_off > NEAR_M + 0.02]
        if len(outside) == 0:
            continue
        mine = np.flatnonzero(label == b["id"])
        seen = 0.0
        if len(mine):
            seen = np.mean(cKDTree(model.at[mine]).query(outside)[0] < NEAR_M)
        found.append(seen >= FOUND_SHARE)
        right.append(bool(found[-1]) and below(b["id"], model, label, mine, parent, line, place_of) == b["parent"])
    return right, found


def below(own, model, label, mine, parent, line, place_of):
    """The branch that the model follows below the lowest place of one, on the way down from its middle."""
    middle = line[len(line) // 2]
    k = mine[np.argmin(np.linalg.norm(model.at[mine] - middle, axis=1))]
    piece = model.tube[k]
    way = [p for p in place_of[piece] if p <= k][::-1]
    while parent[piece] >= 0:
        piece = parent[piece]
        way += place_of.get(piece, [])[::-1]
    labels = label[way]
    run, last = 0.0, None
    for found in labels[np.flatnonzero(labels == own)[-1] + 1:]:
        run = run + STEP_M if found == last else STEP_M
        last = found
        if found >= 0 and run >= RUN_M:
            return last
    return last
