//! The wood as cylinders, as tools for tree models from laser scans tell it (TreeQSM, Raumonen et
//! al. 2013; SimpleTree).

use super::limb::Limb;
use nalgebra::Point3;

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
    /// 0 for the trunk, one more for every branch that leaves.
    pub order: u32,
    /// The limb that it is a piece of.
    pub limb: usize,
}

/// The limbs as cylinders, parents first; each as thick as its limb is at the middle of the
/// cylinder. Pieces without length are left out.
pub fn cylinders(limbs: &[Limb]) -> Vec<Cylinder> {
    let mut out: Vec<Cylinder> = Vec::new();
    // The cylinders of every limb, and its branch with its order.
    let mut of_limb: Vec<std::ops::Range<usize>> = Vec::with_capacity(limbs.len());
    let mut branch_of: Vec<(usize, u32)> = Vec::with_capacity(limbs.len());
    let goes_on = super::chain::continuations(limbs);
    let mut branches = 0;
    for (i, limb) in limbs.iter().enumerate() {
        let parent = limb.parent.filter(|&p| p < i);
        let (branch, order) = match parent {
            Some(p) if goes_on[p] == Some(i) => branch_of[p],
            _ => {
                branches += 1;
                (branches - 1, parent.map_or(0, |p| branch_of[p].1 + 1))
            }
        };
        branch_of.push((branch, order));
        let first = out.len();
        let mut before = parent.and_then(|p| nearest(&out, of_limb[p].clone(), limb));
        for pair in limb.stations.windows(2) {
            let (start, end, radius) = (
                pair[0].at,
                pair[1].at,
                0.5 * (pair[0].radius + pair[1].radius),
            );
            let length = (end - start).norm();
            if !(length > 1e-9 && length.is_finite() && radius.is_finite()) {
                continue;
            }
            out.push(Cylinder {
                parent: before,
                start,
                end,
                radius,
                branch,
                order,
                limb: i,
            });
            before = Some(out.len() - 1);
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

/// The cylinder of `range` on which `limb` begins.
fn nearest(cylinders: &[Cylinder], range: std::ops::Range<usize>, limb: &Limb) -> Option<usize> {
    let base = limb.stations.first()?.at;
    let off = |k: &usize| {
        let c = &cylinders[*k];
        let way = c.end - c.start;
        let t = ((base - c.start).dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
        (c.start + way * t - base).norm()
    };
    range.min_by(|a, b| off(a).total_cmp(&off(b)))
}
