//! Twigs by self-similarity: small, turned copies of the tree's own parts along its branches and at
//! their ends.

use super::branches::side_departure;
use super::branching::{BranchingStatistics, Part};
use super::curl::{Curve, square_to};
use super::limb::{CenterlineSample, Grown, Limb};
use super::skin::SkinWeights;
use crate::config;
use crate::model::{NodeId, Skeleton};
use crate::random::{Generator, generator, seed_of_part};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand::seq::IndexedRandom;
use std::collections::BinaryHeap;
use std::f64::consts::{PI, TAU};

/// Straight pieces of a twig's middle line.
const PIECES: u32 = 4;
/// A twig leaves the last one behind it by this share of its own reach, on the average.
const SPACING: f64 = 0.4;
/// No twig reaches farther than this share of what the whole tree reaches.
const LONGEST: f64 = 0.2;
/// Places about a branch that are tried before a twig that would leave the envelope is given up.
const TRIES: u32 = 5;
/// Places along one limb, and places that wait in all: a branch of a damaged table may be a million
/// times as long as the shortest twig. Trees have some hundreds and some ten thousands.
const MOST_PLACES: u64 = 1 << 16;
const MOST_BUDS: usize = 1 << 20;
/// Angle from twig to twig about their branch: the golden angle, in which buds stand.
const GOLDEN: f64 = PI * 0.763_932_022_500_210_3;

/// A place for a twig. The longest are taken first, so that a bound on their number leaves out the
/// smallest everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bud {
    reach_px: f64,
    host: usize,
    at: f64,
    turn: f64,
    seed: u64,
}

impl Eq for Bud {}
impl Ord for Bud {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let by_place = (other.host, other.seed).cmp(&(self.host, self.seed));
        self.reach_px.total_cmp(&other.reach_px).then(by_place)
    }
}
impl PartialOrd for Bud {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Whether a twig may grow from one point to another, model axes at rest, px.
pub type GrowthConstraint<'a> = &'a dyn Fn(&Point3<f64>, &Point3<f64>) -> bool;

/// Adds twigs to the branches of `skeleton`, which are `grown`.
pub(super) fn add(
    grown: &mut Vec<Grown>,
    skeleton: &Skeleton,
    room: GrowthConstraint,
    wood: &config::Wood,
    seed: u64,
) {
    let least_px = wood.twig_px * f64::from(skeleton.image_size.width) / 640.0;
    if least_px <= 0.0 || !least_px.is_finite() {
        return;
    }
    let branching = BranchingStatistics::of(skeleton);
    let whole_px = branching.reach_px.first().copied().unwrap_or(0.0);
    let maker = Maker {
        branching: &branching,
        least_px,
        longest_px: LONGEST * whole_px,
        curl: wood.curl,
        room,
    };
    let mut buds = BinaryHeap::new();
    for (k, branch) in grown.iter().enumerate() {
        let id = branch.limb.node.index();
        let node = &skeleton.nodes[id];
        if node.level > 1 {
            let host = Host {
                limb: &branch.limb,
                index: k,
                beyond_px: branching.reach_px[id],
                whole_px,
            };
            let seed = seed_of_part(seed, (1 << 32) + u64::from(node.name.0));
            maker.add_buds(&host, seed, &mut buds);
        }
    }
    let most = grown.len() + wood.max_twigs as usize;
    while let Some(bud) = buds.pop().filter(|_| grown.len() < most) {
        let first = grown.len();
        let reaches = maker.grow(bud, grown);
        grown.truncate(most);
        for (k, beyond_px) in (first..grown.len()).zip(reaches) {
            let host = Host {
                limb: &grown[k].limb,
                index: k,
                beyond_px,
                whole_px: f64::INFINITY,
            };
            maker.add_buds(&host, seed_of_part(bud.seed, (k - first) as u64), &mut buds);
        }
    }
}

/// A limb that may carry twigs.
struct Host<'a> {
    limb: &'a Limb,
    index: usize,
    /// How far the tree reaches above it, px.
    beyond_px: f64,
    /// How far the whole tree does, px. Where most of it is still above, most places stay empty: in
    /// the shade of the crown twigs are shed. Infinite for what has no shade.
    whole_px: f64,
}

impl Host<'_> {
    fn bud(&self, reach_px: f64, at: f64, turn: f64, seed: u64) -> Bud {
        Bud {
            reach_px,
            host: self.index,
            at,
            turn,
            seed,
        }
    }
}

struct Maker<'a> {
    branching: &'a BranchingStatistics,
    /// Reach of the shortest and of the longest twig, px.
    least_px: f64,
    longest_px: f64,
    curl: f64,
    room: GrowthConstraint<'a>,
}

impl Maker<'_> {
    /// Places for twigs along a limb and at its end.
    fn add_buds(&self, host: &Host, seed: u64, into: &mut BinaryHeap<Bud>) {
        let length_px = host.limb.length();
        let beyond_px = host.beyond_px;
        if length_px + beyond_px < 2.0 * self.least_px {
            return;
        }
        let mut random = generator(seed, 0);
        let mut turn = random.random_range(0.0..TAU);
        let mut way_px = 0.15 * length_px;
        for k in 0..MOST_PLACES {
            let above_px = length_px - way_px + beyond_px;
            let reach_px = (self.branching.ratio(&mut random) * above_px)
                .min(self.longest_px * random.random_range(0.7..1.0));
            way_px += (SPACING * reach_px).max(0.4 * self.least_px) * random.random_range(0.5..1.5);
            turn += GOLDEN + random.random_range(-0.4..0.4);
            let shaded = random.random::<f64>() < above_px / host.whole_px;
            if way_px >= length_px || into.len() >= MOST_BUDS {
                break;
            }
            if reach_px >= self.least_px && !shaded {
                into.push(host.bud(reach_px, way_px / length_px, turn, seed_of_part(seed, k)));
            }
        }
        if beyond_px <= 0.0 {
            let reach_px = (0.3 * length_px)
                .min(self.longest_px)
                .max(1.2 * self.least_px);
            let seeds = [u64::MAX, u64::MAX - 1].map(|part| seed_of_part(seed, part));
            into.push(host.bud(reach_px, 1.0, turn, seeds[0]));
            into.push(host.bud(0.8 * reach_px, 1.0, turn + PI, seeds[1]));
        }
    }

    /// Grows a twig from `bud` and gives how far the tree reaches beyond each of its pieces, px.
    fn grow(&self, bud: Bud, grown: &mut Vec<Grown>) -> Vec<f64> {
        let Some(stem) = Stem::of(bud, &grown[bud.host].limb) else {
            return Vec::new();
        };
        let mut random = generator(bud.seed, 0);
        let plain = bud.reach_px < 2.0 * self.least_px;
        let part = self.branching.parts.choose(&mut random).filter(|_| !plain);
        let angle = self.branching.angle(&mut random) * if bud.at >= 1.0 { 0.5 } else { 1.0 };
        let roll =
            UnitQuaternion::from_axis_angle(&Vector3::y_axis(), random.random_range(0.0..TAU));
        for k in 0..TRIES {
            let reach_px = bud.reach_px * 0.85f64.powi(k as i32);
            let straight = stem.leaving_at(angle, bud.turn + f64::from(k) * GOLDEN);
            let lifted = straight + Vector3::y() * (0.4 * self.branching.lift);
            let Some(way) = lifted.try_normalize(0.1) else {
                continue;
            };
            let turn = UnitQuaternion::rotation_between(&Vector3::y(), &way)
                .unwrap_or_else(UnitQuaternion::identity);
            let twig = match part {
                Some(part) => self.placed(part, stem.from, turn * roll, reach_px),
                None => self.placed_alone(stem.from, way, reach_px),
            };
            if !twig.is_empty() {
                return self.append(&twig, &stem, &mut random, grown);
            }
        }
        Vec::new()
    }

    /// A twig of one piece, if there is room for it.
    fn placed_alone(&self, from: Point3<f64>, way: Vector3<f64>, reach_px: f64) -> Vec<TwigPiece> {
        let to = from + way * reach_px;
        if reach_px >= self.least_px && (self.room)(&from, &to) {
            vec![TwigPiece { parent: None, to }]
        } else {
            Vec::new()
        }
    }

    /// The pieces of a twig that is a copy of `part`; without those that are too short or outside,
    /// and what they carry.
    fn placed(
        &self,
        part: &Part,
        from: Point3<f64>,
        turn: UnitQuaternion<f64>,
        reach_px: f64,
    ) -> Vec<TwigPiece> {
        let mut out: Vec<TwigPiece> = Vec::new();
        let mut place: Vec<Option<usize>> = Vec::new();
        for piece in &part.pieces {
            let parent = piece.parent.map(|p| place[p]);
            let start = match parent {
                None => Some(from),
                Some(parent) => parent.map(|k| out[k].to),
            };
            let to = from + turn * piece.to * reach_px;
            let fits = start.is_some_and(|start| {
                (self.room)(&start, &to) && (to - start).norm() >= self.least_px
            });
            place.push(fits.then_some(out.len()));
            if fits {
                out.push(TwigPiece {
                    parent: parent.flatten(),
                    to,
                });
            }
        }
        out
    }

    fn append(
        &self,
        twig: &[TwigPiece],
        stem: &Stem,
        random: &mut Generator,
        grown: &mut Vec<Grown>,
    ) -> Vec<f64> {
        let first = grown.len();
        for &TwigPiece { parent, to } in twig {
            let from = parent.map_or(stem.from, |b| twig[b].to);
            let came = parent.map_or(stem.along, |b| grown[first + b].limb.arrives());
            let along = (to - from).normalize();
            let leaves = side_departure(along, came);
            // Twigs turn up to the light.
            let arrives = (along + Vector3::y() * (0.3 * self.branching.lift))
                .try_normalize(0.1)
                .unwrap_or(along);
            let curve = Curve::new([from, to], leaves, arrives, self.curl, random);
            let (parent, at) = parent.map_or((stem.bud.host, stem.bud.at), |b| (first + b, 1.0));
            grown.push(Grown {
                limb: Limb {
                    node: stem.node,
                    parent: Some(parent),
                    twig: true,
                    made_up: true,
                    samples: centerline(&curve, stem.skin),
                },
                at,
            });
        }
        let mut reaches = vec![0.0_f64; twig.len()];
        for (k, piece) in twig.iter().enumerate().rev() {
            let through = grown[first + k].limb.length() + reaches[k];
            if let Some(b) = piece.parent {
                reaches[b] = reaches[b].max(through);
            }
        }
        reaches
    }
}

/// A piece of a twig: where it ends, and the earlier piece that it grows from the end of.
#[derive(Clone, Copy, Debug)]
struct TwigPiece {
    parent: Option<usize>,
    to: Point3<f64>,
}

/// The middle line of a piece of a twig, all of which moves with `skin`; how thick it is is not
/// known yet.
fn centerline(curve: &Curve, skin: SkinWeights) -> Vec<CenterlineSample> {
    let mut samples = Vec::with_capacity(PIECES as usize + 1);
    for i in 0..=PIECES {
        samples.push(CenterlineSample {
            at: curve.at(f64::from(i) / f64::from(PIECES)),
            radius: 0.0,
            skin,
        });
    }
    samples
}

/// Where a twig leaves what carries it.
struct Stem {
    bud: Bud,
    from: Point3<f64>,
    /// Direction of the carrier there, of length 1.
    along: Vector3<f64>,
    skin: SkinWeights,
    node: NodeId,
}

impl Stem {
    /// `None` where the carrier has no direction.
    fn of(bud: Bud, host: &Limb) -> Option<Self> {
        let (a, b, s) = host.between(bud.at)?;
        Some(Self {
            bud,
            from: a.at + (b.at - a.at) * s,
            along: (b.at - a.at).try_normalize(1e-9)?,
            skin: a.skin.towards(b.skin, s as f32),
            node: host.node,
        })
    }

    /// The direction at `angle` to the carrier, `turn` around it, radians.
    fn leaving_at(&self, angle: f64, turn: f64) -> Vector3<f64> {
        let (sin, cos) = turn.sin_cos();
        let side = square_to(self.along);
        let out = side * cos + self.along.cross(&side) * sin;
        self.along * angle.cos() + out * angle.sin()
    }
}
