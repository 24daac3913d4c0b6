//! How thick the branches are: the pipe model.

use crate::model::Skeleton;

/// Exponent e of `r_parent^e = sum r_child^e`. Shinozaki's pipes and Leonardo's rule give 2, measured trees 2 to 3.
pub const PIPE_EXPONENT: f64 = 2.5;

/// Gives every node its radius (px): `trunk_radius_px` at levels 0 and 1, thinner with every fork, never below
/// `tip_radius_px`, and no branch thicker than the one that it grows from.
///
/// Only measured nodes count as pipes. Copies stand for branches that the camera cannot tell from the measured ones
/// in depth; they take the radius of their original, so the branches stay as thick as they were filmed and the trunk
/// as well, however many planes there are.
pub fn pipe_model(skeleton: &mut Skeleton, trunk_radius_px: f64, tip_radius_px: f64) {
    let trunk = if trunk_radius_px.is_finite() { trunk_radius_px.max(0.0) } else { 0.0 };
    let tip = tip_radius_px.max(0.0).min(trunk);
    let pipes = pipes(skeleton);
    // The whole tree's pipes: those of every measured branch that leaves the foot.
    let total = pipes.first().copied().unwrap_or(1.0).max(1.0);
    for (i, &own_pipes) in pipes.iter().enumerate() {
        let node = &skeleton.nodes[i];
        let own = match node.copy_of {
            _ if node.level <= 1 => trunk,
            Some(original) if original.index() < i => skeleton.nodes[original.index()].radius,
            Some(_) => tip,
            None => (trunk * (own_pipes / total).powf(1.0 / PIPE_EXPONENT)).max(tip),
        };
        let parent = node.parent.and_then(|p| skeleton.nodes.get(p.index())).map_or(trunk, |p| p.radius);
        skeleton.nodes[i].radius = own.min(parent);
    }
}

/// Number of measured tips above every node; summing them is the same as summing `r^e` from the tips down.
fn pipes(skeleton: &Skeleton) -> Vec<f64> {
    let mut pipes = vec![0.0_f64; skeleton.nodes.len()];
    for (i, node) in skeleton.nodes.iter().enumerate().rev() {
        if node.copy_of.is_some() {
            continue;
        }
        pipes[i] = pipes[i].max(1.0);
        if let Some(p) = node.parent.filter(|p| p.index() < i) {
            pipes[p.index()] += pipes[i];
        }
    }
    pipes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Node, NodeId, NodeName, Size};
    use nalgebra::Point3;

    fn node(parent: Option<u32>, level: u8, copy_of: Option<u32>) -> Node {
        Node {
            name: NodeName(0),
            parent: parent.map(NodeId),
            level,
            position: Point3::origin(),
            radius: 0.0,
            n_tracks: 0,
            certainty: 0.0,
            copy_of: copy_of.map(NodeId),
            plane_angle: 0.0,
        }
    }

    fn skeleton(nodes: Vec<Node>) -> Skeleton {
        Skeleton { nodes, foot_px: [0.0, 0.0], image_size: Size::new(640, 480) }
    }

    /// Foot, trunk, a fork into 2 and 3, a fork of 2 into 4 and 5.
    fn measured() -> Vec<Node> {
        [(None, 0), (Some(0), 1), (Some(1), 2), (Some(1), 2), (Some(2), 3), (Some(2), 3)]
            .map(|(p, l)| node(p, l, None))
            .to_vec()
    }

    #[test]
    fn pipes_add_up_at_every_fork_and_the_trunk_is_as_thick_as_it_was_measured() {
        let mut s = skeleton(measured());
        pipe_model(&mut s, 12.0, 0.1);
        let r: Vec<f64> = s.nodes.iter().map(|n| n.radius).collect();
        assert_eq!((r[0], r[1]), (12.0, 12.0));
        for (parent, children) in [(1, [2, 3]), (2, [4, 5])] {
            let sum: f64 = children.iter().map(|&c: &usize| r[c].powf(PIPE_EXPONENT)).sum();
            assert!((sum / r[parent].powf(PIPE_EXPONENT) - 1.0).abs() < 1e-9, "{r:?}");
        }
    }

    #[test]
    fn more_planes_do_not_make_the_measured_branches_thinner() {
        let mut alone = skeleton(measured());
        let mut copied = alone.clone();
        for (parent, original) in [(1, 2), (1, 3), (6, 4), (6, 5)] {
            copied.nodes.push(node(Some(parent), copied.nodes[original].level, Some(original as u32)));
        }
        pipe_model(&mut alone, 12.0, 0.5);
        pipe_model(&mut copied, 12.0, 0.5);
        assert_eq!(alone.nodes[..], copied.nodes[..6]);
        for n in &copied.nodes[6..] {
            assert_eq!(n.radius, copied.nodes[n.copy_of.unwrap().index()].radius);
        }
    }

    #[test]
    fn odd_radii_give_no_child_thicker_than_its_parent_and_no_nan() {
        for (trunk, tip) in [(12.0, 100.0), (0.0, 1.0), (f64::NAN, 1.0), (5.0, f64::NAN), (-1.0, -1.0)] {
            let mut s = skeleton(measured());
            pipe_model(&mut s, trunk, tip);
            for n in &s.nodes {
                assert!(n.radius.is_finite() && n.radius >= 0.0);
                assert!(n.parent.is_none_or(|p| n.radius <= s.nodes[p.index()].radius), "{trunk} {tip}");
            }
        }
        pipe_model(&mut skeleton(Vec::new()), 3.0, 1.0);
    }
}
