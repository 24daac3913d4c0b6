"""Bark and leaves as small coloured facets of four corners that ride on the branches: the texture moves with the tree."""
from dataclasses import dataclass, replace

import numpy as np

from .tree import unit

GRAIN_M = 0.05  # side of a facet of bark, about two pixels
LIGHT = unit(np.array([0.5, 0.7, 0.6]))
LEAVES = 2600
LEAFY_PART = (0.3, 0.5, 0.9, 0.9, 0.9)  # the outer part of a branch that bears leaves, by depth
FLUTTER_RAD = 0.05


@dataclass
class Surface:
    node: np.ndarray  # (V,) the vertex lies between this node of the pose and the next
    weight: np.ndarray  # (V,) how far towards the next
    offset_m: np.ndarray  # (V, 3) from there, at rest
    flutter_m: np.ndarray  # (V, 3) further, for one rad of flutter
    flutter_hz: np.ndarray
    flutter_phase: np.ndarray
    facets: np.ndarray  # (F, 4) vertices
    colour: np.ndarray  # (F, 3) blue, green, red; 0..255
    branch: np.ndarray  # (F,)
    two_sided: np.ndarray  # (F,) leaves are seen from behind, bark is not

    def vertices_m(self, pose, frame, time_s):
        """(V, 3) in this frame."""
        flutter = np.sin(2 * np.pi * self.flutter_hz * time_s + self.flutter_phase)[:, None]
        offset = self.offset_m + FLUTTER_RAD * flutter * self.flutter_m
        ends = [pose.points_m[frame, n] + np.einsum("vij,vj->vi", pose.turns[frame, n], offset)
                for n in (self.node, self.node + 1)]
        return (1 - self.weight)[:, None] * ends[0] + self.weight[:, None] * ends[1]


def without_flutter(surface):
    return replace(surface, flutter_m=np.zeros_like(surface.flutter_m))


def cover(rng, branches, pose, leafy):
    """Bark on every branch and, on a leafy tree, leaves on the thinner ones."""
    bark_bgr = np.array([70, 88, 106]) * rng.uniform(0.8, 1.15) + rng.normal(0, 5, 3)
    parts = [bark(rng, b, pose.first[b.id], bark_bgr * (0.75 if leafy else 1)) for b in branches]
    if leafy:
        parts += foliage(rng, branches, pose.first)
    return join(parts)


def join(parts):
    starts = np.cumsum([0] + [len(p.node) for p in parts])
    whole = {name: np.concatenate([getattr(p, name) for p in parts]) for name in Surface.__annotations__}
    whole["facets"] = np.concatenate([p.facets + s for p, s in zip(parts, starts)])
    return Surface(**whole)


def bark(rng, b, first_node, bgr):
    """A tapered tube around the branch; ridges along it, patches and fine grain."""
    rings = max(int(np.ceil(b.length_m / GRAIN_M)), 4) + 1
    sides = int(np.clip(np.ceil(2 * np.pi * b.radius_base_m / GRAIN_M), 4, 28))
    frac, angle = np.linspace(0, 1, rings), np.arange(sides) * 2 * np.pi / sides
    normal, node, weight = np.zeros((rings, sides, 3)), np.zeros(rings, int), np.zeros(rings)
    segments, side = len(b.nodes_m) - 1, b.e1
    for r in range(rings):
        along = b.at(frac[r])[1]
        side = unit(side - (side @ along) * along)
        normal[r] = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * np.cross(along, side)
        node[r] = min(int(frac[r] * segments), segments - 1)
        weight[r] = frac[r] * segments - node[r]
    offset = normal * b.radius_m(frac)[:, None, None]
    ring, k = np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij")
    here, beside = ring * sides + k, ring * sides + (k + 1) % sides
    facets = np.stack([here, beside, beside + sides, here + sides], axis=-1).reshape(-1, 4)
    light = 0.55 + 0.55 * np.clip(normal[:-1] @ LIGHT, -0.4, 1)
    colour = bgr * (light * (1 + grain(rng, rings - 1, sides))).reshape(-1, 1)
    still = np.zeros((rings * sides, 3))
    return Surface(first_node + np.repeat(node, sides), np.repeat(weight, sides), offset.reshape(-1, 3), still, still[:, 0],
                   still[:, 0], facets, colour, np.full(len(facets), b.id), np.zeros(len(facets), bool))


def grain(rng, rings, sides):
    """Relative brightness of bark: single facets, patches of four, ridges along the branch, and some dark scars."""
    patches = np.repeat(rng.normal(0, 0.10, (rings // 4 + 1, sides)), 4, axis=0)[:rings]
    scars = np.where(rng.random((rings, sides)) < 0.03, -0.4, 0.0)
    return rng.normal(0, 0.13, (rings, sides)) + patches + rng.normal(0, 0.10, sides) + scars


def foliage(rng, branches, first, number=LEAVES, leafy_part=LEAFY_PART):
    share = np.array([b.length_m * leafy_part[b.depth] for b in branches])
    counts = rng.multinomial(number, share / share.sum())
    green = np.array([rng.uniform(25, 50), rng.uniform(120, 150), rng.uniform(70, 110)])
    top_m = max(b.nodes_m[-1, 1] for b in branches)
    for b, count in zip(branches, counts):
        for _ in range(count):
            yield leaf(rng, b, first[b.id], green, top_m, leafy_part[b.depth])


def leaf(rng, b, first_node, green_bgr, top_m, leafy_part):
    """Two halves along the midrib, each of a near and a far facet."""
    frac = 1 - leafy_part * rng.random()
    segments = len(b.nodes_m) - 1
    node = min(int(frac * segments), segments - 1)
    point, along = b.at(frac)
    # Leaves turn to the light and stand off the twig in all directions.
    facing = unit(LIGHT + rng.normal(0, 0.55, 3))
    midrib = rng.normal(0, 1, 3) + 0.6 * along
    midrib = unit(midrib - (midrib @ facing) * facing)
    length_m, width_m = rng.uniform(0.20, 0.30), rng.uniform(0.15, 0.24)
    stalk = unit(rng.normal(0, 1, 3)) * rng.uniform(0.02, 0.26)
    across, fold = np.cross(facing, midrib) * width_m, -0.15 * width_m * facing
    rib = [stalk + midrib * length_m * far for far in (0, 0.5, 1)]
    rim = [stalk + midrib * length_m * far + side * across + fold
           for far, side in ((0.25, 0.45), (0.7, 0.38), (0.25, -0.45), (0.7, -0.38))]
    offset = np.array(rib + rim)
    facets = np.array([[0, 1, 3, 3], [1, 2, 4, 3], [0, 5, 1, 1], [1, 5, 6, 2]])
    flutter = facing * (offset @ midrib)[:, None]
    every = lambda x: np.full(len(offset), x)
    return Surface(every(first_node + node), every(frac * segments - node), offset, flutter, every(rng.uniform(1.5, 5.0)),
                   every(rng.uniform(0, 2 * np.pi)), facets, leaf_colour(rng, point, facing, green_bgr, top_m),
                   np.full(4, b.id), np.ones(4, bool))


def leaf_colour(rng, point_m, facing, green_bgr, top_m):
    """(4, 3). The sun is above, to the right and in front: what lies deep in the crown is in the shade of the rest."""
    deep = np.clip(0.5 - 0.16 * (point_m @ LIGHT - 0.5 * top_m), 0, 1)
    shade = 0.4 if rng.random() < 0.15 + 0.5 * deep else 1.0
    light = (0.35 + 0.75 * abs(facing @ LIGHT)) * shade * rng.lognormal(0, 0.15)
    withered = rng.random() < 0.03
    hue = np.array([40, 110, 200]) if withered else green_bgr * rng.lognormal(0, [0.2, 0.08, 0.2])
    halves = np.array([1.12, 1.05, 0.88, 0.80])[:, None] * rng.lognormal(0, 0.08, (4, 1))
    return np.clip(hue * light * halves, 0, 255)
