//! The tree of a point cloud as a skeleton.

use crate::cloud::{CloudFigures, CloudNode, CloudTree};
use crate::import::ModelTree;
use crate::model::{NOT_FILMED_PX, Node, NodeId, NodeKind, NodeName, Skeleton};
use nalgebra::Point3;

/// A skeleton and its scale.
#[derive(Clone, Debug)]
pub struct ScaledTree {
    pub skeleton: Skeleton,
    pub metres_per_px: f64,
}

/// The tree of a cloud, seen from where its y axis is near: x to the right, z up. Its branches run
/// from fork to fork, with bends.
pub fn stand_scanned(tree: &CloudTree) -> ScaledTree {
    let foot = tree.nodes.first().map_or(Point3::origin(), |n| n.position);
    let px_per_metre = NOT_FILMED_PX / tree.figures.height_m;
    let mut children = vec![0_usize; tree.nodes.len()];
    for parent in tree.nodes.iter().filter_map(|n| n.parent) {
        children[parent] += 1;
    }
    let movers = movers(tree, &children);
    let mut nodes: Vec<Node> = Vec::with_capacity(tree.nodes.len());
    for (i, own) in tree.nodes.iter().enumerate() {
        let way = (own.position - foot) * px_per_metre;
        let is_fork = children[i] > 1 && i > 0;
        // A branch is one level above what carries it, and so are its bends.
        let level = own
            .parent
            .map_or(0, |p| nodes[p].level + u8::from(p == 0 || movers[p] == p));
        nodes.push(Node {
            name: NodeName(i as u32),
            parent: own.parent.map(|p| NodeId(p as u32)),
            level,
            position: Point3::new(way.x, way.z, -way.y),
            radius: own.radius * px_per_metre,
            n_tracks: 0,
            kind: NodeKind::Traced,
            certainty: if is_fork { 1.0 } else { 0.0 },
            copy_of: None,
            plane_angle: 0.0,
            moves_with: (movers[i] != i).then_some(NodeId(movers[i] as u32)),
        });
    }
    ScaledTree {
        skeleton: Skeleton::not_filmed(nodes),
        metres_per_px: 1.0 / px_per_metre,
    }
}

/// A modelled tree as one of a scan, node by node; a unit of its file is so many metres. `None` where a
/// radius is not known, or it has no height.
pub fn as_scanned(model: &ModelTree, metres_per_unit: f64) -> Option<CloudTree> {
    let mut nodes = Vec::with_capacity(model.nodes.len());
    for node in &model.nodes {
        let at = node.position * metres_per_unit;
        nodes.push(CloudNode {
            parent: node.parent,
            position: Point3::new(at.x, -at.z, at.y),
            radius: node.wood.radius * metres_per_unit,
            is_measured: false,
        });
    }
    let foot_m = nodes.first()?.position.z;
    let top_m = nodes.iter().map(|n| n.position.z).fold(foot_m, f64::max);
    let is_thick = nodes.iter().skip(1).all(|n| n.radius > 0.0);
    // The foot is as thick as what stands on it.
    nodes[0].radius = nodes.get(1).map_or(0.0, |n| n.radius.max(nodes[0].radius));
    let figures = CloudFigures {
        height_m: top_m - foot_m,
        ..CloudFigures::default()
    };
    (is_thick && figures.height_m > 0.0).then_some(CloudTree { nodes, figures })
}

/// For each node the one in which its branch ends: the next fork or tip. The foot is its own.
fn movers(tree: &CloudTree, children: &[usize]) -> Vec<usize> {
    let mut movers: Vec<usize> = (0..tree.nodes.len()).collect();
    for i in (1..tree.nodes.len()).rev() {
        if let Some(parent) = tree.nodes[i].parent.filter(|p| *p > 0 && children[*p] == 1) {
            movers[parent] = movers[i];
        }
    }
    movers
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stem with a bend that forks; one of the two has a bend.
    #[test]
    fn branches_run_from_fork_to_fork() {
        let places = [
            (None, [5.0, 5.0, 1.0]),
            (Some(0), [5.0, 5.0, 2.0]),
            (Some(1), [5.0, 6.0, 3.0]),
            (Some(2), [4.0, 6.0, 5.0]),
            (Some(2), [6.0, 6.0, 4.0]),
            (Some(4), [7.0, 6.0, 4.5]),
        ];
        let node = |(parent, at): (Option<usize>, [f64; 3])| CloudNode {
            parent,
            position: at.into(),
            radius: 0.1,
            is_measured: true,
        };
        let tree = CloudTree {
            nodes: places.map(node).to_vec(),
            figures: CloudFigures {
                height_m: 4.0,
                ..CloudFigures::default()
            },
        };
        let scaled = stand_scanned(&tree);
        let nodes = &scaled.skeleton.nodes;
        assert_eq!(scaled.metres_per_px * NOT_FILMED_PX, 4.0);
        assert_eq!(nodes[2].position, Point3::new(0.0, 360.0, -180.0));
        assert_eq!(nodes[2].radius, 18.0);
        let levels: Vec<u8> = nodes.iter().map(|n| n.level).collect();
        assert_eq!(levels, [0, 1, 1, 2, 2, 2]);
        let movers: Vec<Option<u32>> = nodes.iter().map(|n| n.moves_with.map(|m| m.0)).collect();
        assert_eq!(movers, [None, Some(2), None, None, Some(5), None]);
        let ends: Vec<u32> = scaled.skeleton.measured_branches().map(|n| n.0).collect();
        assert_eq!(ends, [2, 3, 5]);
    }
}
