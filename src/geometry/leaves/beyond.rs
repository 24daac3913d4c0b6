//! Wood that is invented must not stand out of the crown that the film shows in leaf.

use super::carry::Carried;
use super::target::Target;
use super::view::{LeafView, tree_height};
use crate::model::{Pose, Skeleton};
use crate::shape::{CenterlineSample, Limb};
use nalgebra::Point3;

/// Less of the smoothed density than this is beyond the leaves: it is a half at their edge.
const EDGE: f32 = 0.4;

/// `limbs` without the copies and twigs that end where the picture shows no leaves, and carry
/// nothing that does not: the envelope is round and does not know it, and a tree in leaf has no
/// bare boughs beside its crown. What is left of them for the sake of what they carry ends with it,
/// or where the leaves do. Measured branches stay. Without a picture, or where a drawing says
/// where the leaves are to be, all stay.
pub fn within_leaves(limbs: Vec<Limb>, skeleton: &Skeleton, view: &LeafView) -> Vec<Limb> {
    if view.density.is_some() {
        return limbs;
    }
    let Some(target) = Target::new(skeleton, view, tree_height(skeleton)) else {
        return limbs;
    };
    let crown = Crown {
        skeleton,
        pose: view.pose,
        target: &target,
    };
    let whole: Vec<bool> = limbs
        .iter()
        .map(|limb| !is_invented(limb, skeleton) || crown.holds_end(limb))
        .collect();
    let mut stays = whole.clone();
    // What carries a limb comes before it.
    for k in (0..limbs.len()).rev() {
        if let Some(parent) = limbs[k].parent.filter(|_| stays[k]) {
            stays[parent] = true;
        }
    }
    let mut needed = vec![0; limbs.len()];
    for (_, limb) in limbs.iter().enumerate().filter(|(k, _)| stays[*k]) {
        if let (Some(parent), Some(base)) = (limb.parent, limb.samples.first()) {
            needed[parent] = needed[parent].max(nearest_sample(&limbs[parent], &base.at));
        }
    }
    let mut now = vec![None; limbs.len()];
    let mut kept: Vec<Limb> = Vec::with_capacity(limbs.len());
    for (k, mut limb) in limbs.into_iter().enumerate().filter(|(k, _)| stays[*k]) {
        limb.parent = limb.parent.and_then(|p| now[p]);
        if !whole[k] {
            let last = needed[k].max(crown.last_held(&limb));
            end_at(&mut limb, last);
        }
        now[k] = Some(kept.len());
        kept.push(limb);
    }
    kept
}

fn is_invented(limb: &Limb, skeleton: &Skeleton) -> bool {
    let node = skeleton.nodes.get(limb.node.index());
    limb.twig || node.is_some_and(|n| n.copy_of.is_some())
}

/// The leaves that the picture shows.
struct Crown<'a> {
    skeleton: &'a Skeleton,
    pose: Option<&'a Pose>,
    target: &'a Target,
}

impl Crown<'_> {
    /// Whether a point of a limb is seen among leaves.
    fn holds(&self, sample: &CenterlineSample) -> bool {
        let seen = Carried::by(&sample.skin, self.skeleton, self.pose).posed(&sample.at);
        let cell = self.target.grid.index(self.target.grid.cell_of(&seen));
        cell.is_some_and(|i| self.target.density[i] >= EDGE)
    }

    fn holds_end(&self, limb: &Limb) -> bool {
        limb.samples.last().is_none_or(|tip| self.holds(tip))
    }

    /// The last sample of a limb that is seen among leaves; 0 where none is.
    fn last_held(&self, limb: &Limb) -> usize {
        let held = limb.samples.iter().rposition(|sample| self.holds(sample));
        held.unwrap_or(0)
    }
}

/// The sample of a limb that is next to a place.
fn nearest_sample(limb: &Limb, at: &Point3<f64>) -> usize {
    let mut nearest = (f64::INFINITY, 0);
    for (k, sample) in limb.samples.iter().enumerate() {
        let off = (sample.at - at).norm();
        if off < nearest.0 {
            nearest = (off, k);
        }
    }
    nearest.1
}

/// Cuts a limb off behind sample `last`; it thins over its new length as it did over the old one.
fn end_at(limb: &mut Limb, last: usize) {
    let last = last.max(1);
    if last + 1 >= limb.samples.len() {
        return;
    }
    let mut radii = Vec::with_capacity(last + 1);
    for k in 0..=last {
        radii.push(limb.radius_at(k as f64 / last as f64));
    }
    limb.samples.truncate(last + 1);
    for (sample, radius) in limb.samples.iter_mut().zip(radii) {
        sample.radius = radius;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Node, NodeId, Outline, Rgb, Size};
    use crate::shape::SkinWeights;

    fn node(i: u32, parent: Option<u32>, at: [f64; 3], copied: bool) -> Node {
        Node {
            level: parent.map_or(0, |p| if p == 0 { 1 } else { 2 }),
            copy_of: copied.then_some(NodeId(1)),
            ..Node::made_up(i, parent, at)
        }
    }

    /// The branch that ends in node `k` as a straight limb.
    fn limb(nodes: &[Node], k: usize, parent: Option<usize>) -> Limb {
        let from = nodes[k].parent.map_or(0, |p| p.index());
        let samples = [from, k].map(|i| CenterlineSample {
            at: nodes[i].position,
            radius: 1.0,
            skin: SkinWeights::between(NodeId(from as u32), NodeId(k as u32), 1.0),
        });
        Limb {
            node: NodeId(k as u32),
            parent,
            twig: false,
            made_up: false,
            samples: samples.into(),
        }
    }

    /// A trunk with two branches to the sides of a green square; `copied` of them are invented.
    fn tree(copied: [bool; 2]) -> (Skeleton, Vec<Limb>) {
        let nodes = vec![
            node(0, None, [0.0; 3], false),
            node(1, Some(0), [0.0, 40.0, 0.0], false),
            node(2, Some(1), [0.0, 80.0, 10.0], copied[0]),
            node(3, Some(1), [45.0, 60.0, 10.0], copied[1]),
        ];
        let limbs = vec![
            limb(&nodes, 1, None),
            limb(&nodes, 3, Some(0)),
            limb(&nodes, 2, Some(0)),
        ];
        (
            Skeleton {
                nodes,
                foot_px: [50.0, 100.0].into(),
                image_size: Size::new(100, 101),
            },
            limbs,
        )
    }

    fn left(copied: [bool; 2]) -> Vec<(u32, Option<usize>)> {
        let (skeleton, limbs) = tree(copied);
        left_of(limbs, &skeleton)
            .iter()
            .map(|l| (l.node.0, l.parent))
            .collect()
    }

    fn left_of(limbs: Vec<Limb>, skeleton: &Skeleton) -> Vec<Limb> {
        // Leaves from the crown's top down to its middle, and not out at the side; sky elsewhere.
        let size = Size::new(100, 101);
        let (mut pixels, mut mask) = (Vec::new(), Vec::new());
        for i in 0..size.area() {
            let (u, v) = (i % 100, i / 100);
            let leaf = (30..70).contains(&u) && v < 60;
            let inside = (5..97).contains(&u) && (2..70).contains(&v);
            pixels.extend(if leaf { [60, 110, 40] } else { [150, 180, 230] });
            mask.push(if inside { 255 } else { 0 });
        }
        let picture = Rgb { size, pixels };
        let outline = Outline {
            size,
            mask,
            polygon_px: Vec::new(),
            matte: None,
            other_foot_px: None,
        };
        let view = LeafView {
            picture: Some(&picture),
            outline: Some(&outline),
            ..LeafView::default()
        };
        within_leaves(limbs, skeleton, &view)
    }

    #[test]
    fn no_invented_bough_stands_bare_beside_the_leaves() {
        assert_eq!(left([true, true]), [(1, None), (2, Some(0))]);
    }

    #[test]
    fn what_was_measured_stays_wherever_it_is() {
        assert_eq!(left([true, false]), [(1, None), (3, Some(0)), (2, Some(0))]);
    }

    /// A copied bough that goes out of the leaves and stays for a twig that does not.
    #[test]
    fn a_bough_that_is_kept_for_its_twig_does_not_stand_out_of_the_leaves() {
        let (skeleton, mut limbs) = tree([true, true]);
        let bough = &mut limbs[1];
        let [base, tip] = [bough.samples[0], bough.samples[1]];
        bough.samples.clear();
        for k in 0..=10 {
            let share = f64::from(k) / 10.0;
            bough.samples.push(CenterlineSample {
                at: base.at + (tip.at - base.at) * share,
                radius: 1.0 - share,
                skin: base.skin,
            });
        }
        let mut twig = limb(&skeleton.nodes, 2, Some(1));
        twig.twig = true;
        twig.samples[0].at = limbs[1].samples[3].at;
        limbs.push(twig);
        let left = left_of(limbs, &skeleton);
        let bough = left.iter().find(|l| l.node == NodeId(3)).unwrap();
        let tip = bough.samples.last().unwrap();
        assert!((4..9).contains(&bough.samples.len()), "{bough:?}");
        assert!(tip.at.x < 25.0 && tip.radius == 0.0, "{tip:?}");
    }
}
