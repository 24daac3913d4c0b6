//! The wood as cylinders, as tools for tree models from laser scans tell it (TreeQSM, Raumonen et
//! al. 2013; SimpleTree).

use super::chain::continuations;
use crate::model::{BotanicalBranches, Skeleton};
use crate::shape::{CenterlineSample, Limb};
use nalgebra::Point3;

/// A middle line is straight where it is off the straight line by less than this share of that, and tapers evenly where
/// its radius is off by less than this share of the thicker end: more than sums are rounded by, less than tables show.
const EVEN: f64 = 1e-6;

/// One straight piece of wood.
#[derive(Clone, Debug, PartialEq)]
pub struct Cylinder {
    /// Place in the table of the cylinder that it grows from; `None` at the ground.
    pub parent: Option<usize>,
    /// Model axes at rest, px.
    pub start: Point3<f64>,
    pub end: Point3<f64>,
    /// px.
    pub radius: f64,
    /// Number of the branch, from 0: limbs that go on in one another are one.
    pub branch: usize,
    /// 0 for the trunk, 1 for stems that begin at the foot beside it, one more for every branch that leaves.
    pub order: u32,
    /// The limb that it is a piece of.
    pub limb: usize,
    /// Nobody has seen it, as [`Limb::made_up`].
    pub made_up: bool,
}

/// The limbs as cylinders, parents first; each has the volume of what it stands for. One that lies wholly within what
/// carries it is only as thick as the next. What is straight and tapers evenly is one cylinder; pieces without length
/// are left out. Branches and orders are those of [`Skeleton::botanical_branches`]; a twig goes on in a branch that
/// ends where it begins, or leaves it.
pub fn cylinders_by_branch(limbs: &[Limb], skeleton: &Skeleton) -> Vec<Cylinder> {
    let branches = skeleton.botanical_branches();
    let mut goes_on = continuations(limbs);
    for next in &mut goes_on {
        *next = next.filter(|i| limbs[*i].twig);
    }
    for (i, limb) in limbs.iter().enumerate().filter(|(_, l)| !l.twig) {
        if let Some(p) = limb.parent.filter(|p| *p < i && !limbs[*p].twig)
            && branches.of(limb.node) == branches.of(limbs[p].node)
        {
            goes_on[p] = Some(i);
        }
    }
    let mut cylinders = pieces(limbs, &goes_on, &branches);
    thin_within_carriers(&mut cylinders);
    cylinders
}

/// A branch begins within what carries it, and is no thicker there than where it comes out.
fn thin_within_carriers(cylinders: &mut [Cylinder]) {
    // The first cylinder of the branch of each, as long as all so far lie wholly within the carrier.
    let mut begin: Vec<Option<usize>> = Vec::with_capacity(cylinders.len());
    for (i, own) in cylinders.iter().enumerate() {
        let first = match own.parent {
            Some(p) if cylinders[p].branch != own.branch => Some(i),
            Some(p) => begin[p],
            None => None,
        };
        begin.push(first.filter(|first| {
            let carrier = cylinders[*first]
                .parent
                .map_or(0.0, |p| cylinders[p].radius);
            (own.end - cylinders[*first].start).norm() < carrier
        }));
    }
    for i in (0..cylinders.len()).rev() {
        let own = &cylinders[i];
        let goes_on = own.parent.filter(|p| cylinders[*p].branch == own.branch);
        if let Some(p) = goes_on.filter(|p| begin[*p].is_some()) {
            cylinders[p].radius = cylinders[p].radius.min(cylinders[i].radius);
        }
    }
}

/// A branch among the cylinders.
#[derive(Clone, Copy)]
struct Numbered {
    branch: usize,
    order: u32,
}

/// The cylinders of limbs; `goes_on` holds the limb in which each goes on.
fn pieces(
    limbs: &[Limb],
    goes_on: &[Option<usize>],
    branches: &BotanicalBranches,
) -> Vec<Cylinder> {
    let mut out: Vec<Cylinder> = Vec::new();
    // The cylinders of every limb, and its branch.
    let mut of_limb: Vec<std::ops::Range<usize>> = Vec::with_capacity(limbs.len());
    let mut branch_of: Vec<Numbered> = Vec::with_capacity(limbs.len());
    let mut n_branches = 0;
    for (i, limb) in limbs.iter().enumerate() {
        let parent = limb.parent.filter(|&p| p < i);
        let own = match parent {
            Some(p) if goes_on[p] == Some(i) => branch_of[p],
            _ => {
                n_branches += 1;
                let order = match parent.filter(|_| limb.twig) {
                    Some(p) => branch_of[p].order + 1,
                    None => branches.order(limb.node),
                };
                Numbered {
                    branch: n_branches - 1,
                    order,
                }
            }
        };
        branch_of.push(own);
        let first = out.len();
        let mut before = parent.and_then(|p| nearest(&out, of_limb[p].clone(), limb));
        for pair in ends_of_even_pieces(&limb.samples).windows(2) {
            let cylinder = Cylinder {
                parent: before,
                start: pair[0].at,
                end: pair[1].at,
                radius: radius_by_volume(pair[0].radius, pair[1].radius),
                branch: own.branch,
                order: own.order,
                limb: i,
                made_up: limb.made_up,
            };
            if cylinder.is_sound() {
                before = Some(out.len());
                out.push(cylinder);
            }
        }
        // A limb that has none hands on its parent's.
        let own = if out.len() > first {
            first..out.len()
        } else {
            parent.map_or(0..0, |p| of_limb[p].clone())
        };
        of_limb.push(own);
    }
    out
}

/// The radius of the cylinder that has the volume of a frustum.
fn radius_by_volume(from: f64, to: f64) -> f64 {
    ((from * from + from * to + to * to) / 3.0).sqrt()
}

/// The first sample, the last, and those at which the middle line turns or tapers otherwise.
fn ends_of_even_pieces(samples: &[CenterlineSample]) -> Vec<&CenterlineSample> {
    let mut ends: Vec<&CenterlineSample> = samples.first().into_iter().collect();
    let mut from = 0;
    for to in 2..samples.len() {
        let between = &samples[from + 1..to];
        if !between
            .iter()
            .all(|sample| is_even(&samples[from], sample, &samples[to]))
        {
            from = to - 1;
            ends.push(&samples[from]);
        }
    }
    ends.extend(samples.last().filter(|_| samples.len() > 1));
    ends
}

/// Whether `between` lies where an even taper from one sample to the other has it.
fn is_even(from: &CenterlineSample, between: &CenterlineSample, to: &CenterlineSample) -> bool {
    let way = to.at - from.at;
    let share = (between.at - from.at).dot(&way) / way.norm_squared();
    let off = (between.at - (from.at + way * share)).norm();
    let radius_off = between.radius - (from.radius + (to.radius - from.radius) * share);
    (0.0..=1.0).contains(&share)
        && off <= EVEN * way.norm()
        && radius_off.abs() <= EVEN * from.radius.max(to.radius)
}

impl Cylinder {
    fn is_sound(&self) -> bool {
        let length = (self.end - self.start).norm();
        length > 1e-9 && length.is_finite() && self.radius.is_finite()
    }

    fn distance_to(&self, place: &Point3<f64>) -> f64 {
        let way = self.end - self.start;
        let t = ((place - self.start).dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
        (self.start + way * t - place).norm()
    }
}

/// The cylinder of `range` on which `limb` begins.
fn nearest(cylinders: &[Cylinder], range: std::ops::Range<usize>, limb: &Limb) -> Option<usize> {
    let base = limb.samples.first()?.at;
    range
        .map(|k| (cylinders[k].distance_to(&base), k))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, k)| k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::NodeId;
    use crate::shape::SkinWeights;

    /// A limb that runs straight and tapers evenly, turns, and tapers otherwise after its next sample.
    #[test]
    fn a_straight_limb_that_tapers_evenly_is_one_cylinder() {
        let sample = |x: f64, y: f64, radius: f64| CenterlineSample {
            at: Point3::new(x, y, 0.0),
            radius,
            skin: SkinWeights::between(NodeId(0), NodeId(1), 1.0),
        };
        let samples = [
            sample(0.0, 0.0, 4.0),
            sample(0.0, 1.0, 3.5),
            sample(0.0, 2.0, 3.0),
            sample(1.0, 3.0, 2.5),
            sample(2.0, 4.0, 1.0),
        ];
        let ends = ends_of_even_pieces(&samples);
        let heights: Vec<f64> = ends.iter().map(|end| end.at.y).collect();
        assert_eq!(heights, [0.0, 2.0, 3.0, 4.0]);
        assert!(ends_of_even_pieces(&[]).is_empty());
        assert_eq!(ends_of_even_pieces(&samples[..1]).len(), 1);
        // In one place, or without one, nothing is straight.
        let nowhere = [
            sample(0.0, 0.0, 1.0),
            sample(f64::NAN, 0.0, 1.0),
            sample(0.0, 0.0, 1.0),
        ];
        assert_eq!(ends_of_even_pieces(&nowhere).len(), 3);
        let radius = radius_by_volume(4.0, 2.0);
        assert!((radius * radius - 28.0 / 3.0).abs() < 1e-12);
        assert_eq!(radius_by_volume(3.0, 3.0), 3.0);
    }

    /// A thick trunk, and a branch that begins in its middle.
    #[test]
    fn a_branch_is_no_thicker_within_its_carrier_than_where_it_comes_out() {
        let piece = |parent, branch, from: [f64; 3], to: [f64; 3], radius| Cylinder {
            parent,
            start: from.into(),
            end: to.into(),
            radius,
            branch,
            order: branch as u32,
            limb: branch,
            made_up: false,
        };
        let mut table = [
            piece(None, 0, [0.0, 0.0, 0.0], [0.0, 50.0, 0.0], 10.0),
            piece(Some(0), 1, [0.0, 40.0, 0.0], [4.0, 44.0, 0.0], 9.0),
            piece(Some(1), 1, [4.0, 44.0, 0.0], [12.0, 52.0, 0.0], 7.0),
            piece(Some(2), 1, [12.0, 52.0, 0.0], [30.0, 70.0, 0.0], 4.0),
        ];
        thin_within_carriers(&mut table);
        assert_eq!(table.map(|c| c.radius), [10.0, 7.0, 7.0, 4.0]);
    }
}
