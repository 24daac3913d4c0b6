//! The wood as cylinders, for those who reckon with volumes.

use super::limb::Limb;
use nalgebra::Point3;

/// A straight piece of a limb.
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
    /// 0 for the trunk, one more for every branch that leaves.
    pub order: u32,
    /// The limb that it is a piece of.
    pub limb: usize,
}

/// The limbs as cylinders, parents first. Pieces without length are left out.
pub fn cylinders(limbs: &[Limb]) -> Vec<Cylinder> {
    let mut out: Vec<Cylinder> = Vec::new();
    // The last cylinder of every limb, its branch and its order.
    let mut ends: Vec<(Option<usize>, usize, u32)> = Vec::with_capacity(limbs.len());
    let (mut goes_on, mut branches) = (vec![false; limbs.len()], 0);
    for (i, limb) in limbs.iter().enumerate() {
        let parent = limb.parent.filter(|&p| p < i);
        let (mut before, branch, order) = match parent {
            // The first limb that grows from another goes on in it.
            Some(p) if !std::mem::replace(&mut goes_on[p], true) => ends[p],
            Some(p) => (ends[p].0, branches, ends[p].2 + 1),
            None => (None, branches, 0),
        };
        branches = branches.max(branch + 1);
        for pair in limb.stations.windows(2) {
            let (start, end, radius) = (pair[0].at, pair[1].at, 0.5 * (pair[0].radius + pair[1].radius));
            let length = (end - start).norm();
            if length > 1e-9 && length.is_finite() && radius.is_finite() {
                out.push(Cylinder { parent: before, start, end, radius, branch, order, limb: i });
                before = Some(out.len() - 1);
            }
        }
        ends.push((before, branch, order));
    }
    out
}
