//! The wood as cylinders, as tools for tree models from laser scans tell it (TreeQSM, Raumonen et
//! al. 2013; SimpleTree).

use super::chain::continuations;
use crate::model::Skeleton;
use crate::shape::{CenterlineSample, Limb};
use nalgebra::Point3;

/// A middle line is straight and tapers evenly where it is off that by less than this share of its length and its
/// radius.
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

/// The limbs as cylinders, parents first; each has the volume of what it stands for, and within what carries it is as
/// thick as where it comes out of that. What is straight and tapers evenly is one cylinder; pieces without length are
/// left out. Branches and orders are those of [`Skeleton::botanical_branches`]; a twig goes on in a branch that ends
/// where it begins, or leaves it.
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
    let mut cylinders = pieces(limbs, &goes_on, skeleton);
    thin_within_carriers(&mut cylinders);
    cylinders
}

/// A branch begins within what carries it, and is no thicker there than where it comes out.
fn thin_within_carriers(cylinders: &mut [Cylinder]) {
    // The first cylinder of the branch of each that lies within the carrier.
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
fn pieces(limbs: &[Limb], goes_on: &[Option<usize>], skeleton: &Skeleton) -> Vec<Cylinder> {
    let branches = skeleton.botanical_branches();
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
    for pair in samples.windows(2).skip(1) {
        let from = ends[ends.len() - 1];
        if !is_even(from, &pair[0], &pair[1]) {
            ends.push(&pair[0]);
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
