//! Twigs by self-similarity: small, turned copies of the tree's own parts along its branches and at
//! their ends.

use super::curl::{Curve, square_to};
use super::habit::{Habit, Part};
use super::limb::{Grown, Limb, Room, Station};
use crate::config;
use crate::model::Skeleton;
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
        let by_place = || (other.host, other.seed).cmp(&(self.host, self.seed));
        self.reach_px.total_cmp(&other.reach_px).then_with(by_place)
    }
}
impl PartialOrd for Bud {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Adds twigs to the branches of `skeleton`, which are `grown`.
pub(super) fn add(
    grown: &mut Vec<Grown>,
    skeleton: &Skeleton,
    room: Room,
    wood: &config::Wood,
    seed: u64,
) {
    let least_px = wood.twig_px * f64::from(skeleton.image_size.width) / 640.0;
    if least_px <= 0.0 || !least_px.is_finite() {
        return;
    }
    let habit = Habit::of(skeleton);
    let whole_px = habit.reach_px.first().copied().unwrap_or(0.0);
    let maker = Maker {
        habit: &habit,
        least_px,
        longest_px: LONGEST * whole_px,
        curl: wood.curl,
        room,
    };
    let mut buds = BinaryHeap::new();
    for (k, host) in grown.iter().enumerate() {
        let node = &skeleton.nodes[host.limb.node.index()];
        if node.level > 1 {
            let beyond_px = habit.reach_px[host.limb.node.index()];
            maker.buds(
                &host.limb,
                k,
                beyond_px,
                whole_px,
                seed_of_part(seed, (1 << 32) + u64::from(node.name.0)),
                &mut buds,
            );
        }
    }
    let most = grown.len() + wood.max_twigs as usize;
    while let Some(bud) = buds.pop().filter(|_| grown.len() < most) {
        let first = grown.len();
        let reaches = maker.grow(bud, grown);
        grown.truncate(most);
        for (k, beyond_px) in (first..grown.len()).zip(reaches) {
            let seed = seed_of_part(bud.seed, k as u64 - first as u64);
            maker.buds(&grown[k].limb, k, beyond_px, f64::INFINITY, seed, &mut buds);
        }
    }
}

struct Maker<'a> {
    habit: &'a Habit,
    /// Reach of the shortest and of the longest twig, px.
    least_px: f64,
    longest_px: f64,
    curl: f64,
    room: Room<'a>,
}

impl Maker<'_> {
    /// Places for twigs along `limb` and at its end, with `beyond_px` of tree above it; where most
    /// of the tree, `whole_px`, is still above, most places stay empty: in the shade of the crown
    /// twigs are shed.
    fn buds(
        &self,
        limb: &Limb,
        host: usize,
        beyond_px: f64,
        whole_px: f64,
        seed: u64,
        into: &mut BinaryHeap<Bud>,
    ) {
        let length_px = limb.length();
        if length_px + beyond_px < 2.0 * self.least_px {
            return;
        }
        let mut random = generator(seed, 0);
        let mut turn = random.random_range(0.0..TAU);
        let mut way_px = 0.15 * length_px;
        let mut bud = |reach_px: f64, at: f64, turn: f64, k: u64| {
            into.push(Bud {
                reach_px,
                host,
                at,
                turn,
                seed: seed_of_part(seed, k),
            });
        };
        for k in 0.. {
            let above_px = length_px - way_px + beyond_px;
            let reach_px = (self.habit.ratio(&mut random) * above_px)
                .min(self.longest_px * random.random_range(0.7..1.0));
            way_px += (SPACING * reach_px).max(0.4 * self.least_px) * random.random_range(0.5..1.5);
            turn += GOLDEN + random.random_range(-0.4..0.4);
            let shaded = random.random::<f64>() < above_px / whole_px;
            if way_px >= length_px {
                break;
            }
            if reach_px >= self.least_px && !shaded {
                bud(reach_px, way_px / length_px, turn, k);
            }
        }
        if beyond_px <= 0.0 {
            let reach_px = (0.3 * length_px)
                .min(self.longest_px)
                .max(1.2 * self.least_px);
            bud(reach_px, 1.0, turn, u64::MAX);
            bud(0.8 * reach_px, 1.0, turn + PI, u64::MAX - 1);
        }
    }

    /// Grows a twig from `bud` and gives how far the tree reaches beyond each of its pieces, px.
    fn grow(&self, bud: Bud, grown: &mut Vec<Grown>) -> Vec<f64> {
        let host = &grown[bud.host].limb;
        let Some((a, b, s)) = host.between(bud.at) else {
            return Vec::new();
        };
        let Some(along) = (b.at - a.at).try_normalize(1e-9) else {
            return Vec::new();
        };
        let (from, riding, node) = (
            a.at + (b.at - a.at) * s,
            a.riding.towards(b.riding, s as f32),
            host.node,
        );
        let mut random = generator(bud.seed, 0);
        let plain = bud.reach_px < 2.0 * self.least_px;
        let part = self.habit.parts.choose(&mut random).filter(|_| !plain);
        let angle = self.habit.angle(&mut random) * if bud.at >= 1.0 { 0.5 } else { 1.0 };
        let roll =
            UnitQuaternion::from_axis_angle(&Vector3::y_axis(), random.random_range(0.0..TAU));
        for k in 0..TRIES {
            let reach_px = bud.reach_px * 0.85f64.powi(k as i32);
            let (sin, cos) = (bud.turn + f64::from(k) * GOLDEN).sin_cos();
            let side = square_to(along);
            let out = side * cos + along.cross(&side) * sin;
            let straight = along * angle.cos() + out * angle.sin();
            let Some(way) = (straight + Vector3::y() * (0.4 * self.habit.lift)).try_normalize(0.1)
            else {
                continue;
            };
            let turn = UnitQuaternion::rotation_between(&Vector3::y(), &way)
                .unwrap_or_else(UnitQuaternion::identity);
            let twig = self.placed(part, from, turn * roll, reach_px, way);
            if !twig.is_empty() {
                return self.append(
                    &twig,
                    &Stem {
                        bud,
                        from,
                        along,
                        riding,
                        node,
                    },
                    &mut random,
                    grown,
                );
            }
        }
        Vec::new()
    }

    /// Ends of the twig's pieces with their parents; without those that are too short or outside,
    /// and what they carry.
    fn placed(
        &self,
        part: Option<&Part>,
        from: Point3<f64>,
        turn: UnitQuaternion<f64>,
        reach_px: f64,
        way: Vector3<f64>,
    ) -> Vec<(Option<usize>, Point3<f64>)> {
        let fits = |a: Point3<f64>, b: Point3<f64>| (self.room)(&a, &b);
        let Some(part) = part else {
            let to = from + way * reach_px;
            return if reach_px >= self.least_px && fits(from, to) {
                vec![(None, to)]
            } else {
                Vec::new()
            };
        };
        let mut out: Vec<(Option<usize>, Point3<f64>)> = Vec::new();
        let mut place: Vec<Option<usize>> = Vec::new();
        for piece in &part.pieces {
            let before = piece.parent.map(|p| place[p]);
            let start = match before {
                None => Some(from),
                Some(before) => before.map(|k| out[k].1),
            };
            let to = from + turn * piece.to * reach_px;
            let kept =
                start.filter(|&start| fits(start, to) && (to - start).norm() >= self.least_px);
            place.push(kept.map(|_| out.len()));
            if kept.is_some() {
                out.push((before.flatten(), to));
            }
        }
        out
    }

    fn append(
        &self,
        twig: &[(Option<usize>, Point3<f64>)],
        stem: &Stem,
        random: &mut Generator,
        grown: &mut Vec<Grown>,
    ) -> Vec<f64> {
        let first = grown.len();
        let mut reaches = vec![0.0_f64; twig.len()];
        for &(before, to) in twig {
            let from = before.map_or(stem.from, |b| twig[b].1);
            let came = before.map_or(stem.along, |b| grown[first + b].limb.arrives());
            let along = (to - from).normalize();
            let leaves = (along + came * (0.5 * along.dot(&came).max(0.0)))
                .try_normalize(0.1)
                .unwrap_or(along);
            // Twigs turn up to the light.
            let arrives = (along + Vector3::y() * (0.3 * self.habit.lift))
                .try_normalize(0.1)
                .unwrap_or(along);
            let curve = Curve::new([from, to], leaves, arrives, self.curl, random);
            let station = |i: u32| {
                let at = curve.at(f64::from(i) / f64::from(PIECES));
                Station {
                    at,
                    radius: 0.0,
                    riding: stem.riding,
                }
            };
            let (parent, at) = before.map_or((stem.bud.host, stem.bud.at), |b| (first + b, 1.0));
            let stations = (0..=PIECES).map(station).collect();
            grown.push(Grown {
                limb: Limb {
                    node: stem.node,
                    parent: Some(parent),
                    twig: true,
                    stations,
                },
                at,
            });
        }
        for (k, &(before, _)) in twig.iter().enumerate().rev() {
            let through = grown[first + k].limb.length() + reaches[k];
            if let Some(b) = before {
                reaches[b] = reaches[b].max(through);
            }
        }
        reaches
    }
}

/// Where a twig leaves what carries it.
struct Stem {
    bud: Bud,
    from: Point3<f64>,
    along: Vector3<f64>,
    riding: super::limb::Riding,
    node: crate::model::NodeId,
}
