//! Wood that is invented must not stand out of the crown that the film shows in leaf.

use super::carry::Carried;
use super::target::Target;
use super::view::{LeafView, tree_height};
use crate::model::Skeleton;
use crate::shape::Limb;

/// Less of the smoothed density than this is beyond the leaves: it is a half at their edge.
const EDGE: f32 = 0.4;

/// `limbs` without the copies and twigs that end where the picture shows no leaves, and carry
/// nothing that does not: the envelope is round and does not know it, and a tree in leaf has no
/// bare boughs beside its crown. Measured branches stay. Without a picture, or where a drawing says
/// where the leaves are to be, all stay.
pub fn within_leaves(limbs: Vec<Limb>, skeleton: &Skeleton, view: &LeafView) -> Vec<Limb> {
    if view.density.is_some() {
        return limbs;
    }
    let Some(target) = Target::new(skeleton, view, tree_height(skeleton)) else {
        return limbs;
    };
    let mut stays: Vec<bool> = limbs
        .iter()
        .map(|limb| !is_invented(limb, skeleton) || ends_in_leaves(limb, skeleton, view, &target))
        .collect();
    // What carries a limb comes before it.
    for k in (0..limbs.len()).rev() {
        if let Some(parent) = limbs[k].parent.filter(|_| stays[k]) {
            stays[parent] = true;
        }
    }
    let mut now = vec![None; limbs.len()];
    let mut kept: Vec<Limb> = Vec::with_capacity(limbs.len());
    for (k, mut limb) in limbs.into_iter().enumerate().filter(|(k, _)| stays[*k]) {
        limb.parent = limb.parent.and_then(|p| now[p]);
        now[k] = Some(kept.len());
        kept.push(limb);
    }
    kept
}

fn is_invented(limb: &Limb, skeleton: &Skeleton) -> bool {
    let node = skeleton.nodes.get(limb.node.index());
    limb.twig || node.is_some_and(|n| n.copy_of.is_some())
}

fn ends_in_leaves(limb: &Limb, skeleton: &Skeleton, view: &LeafView, target: &Target) -> bool {
    let Some(tip) = limb.samples.last() else {
        return true;
    };
    let seen = Carried::by(&tip.skin, skeleton, view.pose).posed(&tip.at);
    let cell = target.grid.index(target.grid.cell_of(&seen));
    cell.is_some_and(|i| target.density[i] >= EDGE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Node, NodeId, NodeName, Outline, Rgb, Size};
    use crate::shape::{CenterlineSample, SkinWeights};
    use nalgebra::Point3;

    fn node(i: u32, parent: Option<u32>, at: [f64; 3], copied: bool) -> Node {
        Node {
            name: NodeName(i),
            parent: parent.map(NodeId),
            level: parent.map_or(0, |p| if p == 0 { 1 } else { 2 }),
            position: Point3::from(at),
            radius: 1.0,
            n_tracks: 1,
            certainty: 1.0,
            copy_of: copied.then_some(NodeId(1)),
            plane_angle: 0.0,
            moves_with: None,
            kind: Default::default(),
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
        };
        let view = LeafView {
            picture: Some(&picture),
            outline: Some(&outline),
            ..LeafView::default()
        };
        within_leaves(limbs, &skeleton, &view)
            .iter()
            .map(|l| (l.node.0, l.parent))
            .collect()
    }

    #[test]
    fn no_invented_bough_stands_bare_beside_the_leaves() {
        assert_eq!(left([true, true]), [(1, None), (2, Some(0))]);
    }

    #[test]
    fn what_was_measured_stays_wherever_it_is() {
        assert_eq!(left([true, false]), [(1, None), (3, Some(0)), (2, Some(0))]);
    }
}
