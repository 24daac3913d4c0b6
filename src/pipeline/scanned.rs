//! The tree of a point cloud as a skeleton.

use crate::cloud::{CloudFigures, CloudNode, CloudTree};
use crate::import::{ImportError, ModelTree};
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

/// A modelled tree as one of a scan, node by node; a unit of its file is so many metres. The radius of a piece is
/// that of its middle, and that of a node a mean of what ends there and the thickest that goes on.
///
/// # Errors
/// A radius is not known, or as large as the tree, it has no height or is far wider than high, or too many forks on one
/// way.
pub fn as_scanned(model: &ModelTree, metres_per_unit: f64) -> Result<CloudTree, ImportError> {
    let figures = CloudFigures {
        height_m: metres_per_unit * model.height()?,
        ..CloudFigures::default()
    };
    let sway_changes = model.sway_changes();
    model.refuse_deep(&sway_changes)?;
    model.refuse_thick()?;
    if model.without_radius() > 0 {
        return Err(ImportError::NoRadius);
    }
    let radii = end_radii(model);
    let mut nodes = Vec::with_capacity(model.nodes.len());
    for (i, node) in model.nodes.iter().enumerate() {
        let at = node.position * metres_per_unit;
        nodes.push(CloudNode {
            parent: node.parent,
            position: Point3::new(at.x, -at.z, at.y),
            radius: radii[i] * metres_per_unit,
            is_measured: false,
            is_joint: sway_changes[i],
        });
    }
    Ok(CloudTree { nodes, figures })
}

/// Weight of its own radius where the first piece of a branch ends. That piece does not taper, or less: with a
/// half, branches lose volume. Where one tapers evenly 3/4 keeps the volume of a trunk, and 5/6 that of a branch.
const OWN_OF_FIRST: f64 = 0.75;

/// The radius where each piece ends: the mean of its own and that of the thickest that goes on there. The first
/// piece of a branch counts for more ([`OWN_OF_FIRST`]).
fn end_radii(model: &ModelTree) -> Vec<f64> {
    let radius = |i: usize| model.nodes[i].wood.radius;
    let mut heirs: Vec<Option<usize>> = vec![None; model.nodes.len()];
    for (i, node) in model.nodes.iter().enumerate() {
        if let Some(parent) = node.parent
            && heirs[parent].is_none_or(|heir| radius(i) > radius(heir))
        {
            heirs[parent] = Some(i);
        }
    }
    let mut radii = Vec::with_capacity(model.nodes.len());
    for (i, node) in model.nodes.iter().enumerate() {
        let above = heirs[i].map_or(0.0, radius);
        let begins_branch = node.parent.is_none_or(|p| p == 0 || heirs[p] != Some(i));
        radii.push(match (radius(i), above) {
            // Nothing ends in the foot of some files.
            (0.0, above) => above,
            (own, 0.0) => own,
            (own, above) if begins_branch => OWN_OF_FIRST * own + (1.0 - OWN_OF_FIRST) * above,
            (own, above) => 0.5 * (own + above),
        });
    }
    radii
}

/// For each node the one in which its branch ends: the next fork, joint or tip. The foot is its own.
fn movers(tree: &CloudTree, children: &[usize]) -> Vec<usize> {
    let mut movers: Vec<usize> = (0..tree.nodes.len()).collect();
    for i in (1..tree.nodes.len()).rev() {
        let goes_on = |p: &usize| *p > 0 && children[*p] == 1 && !tree.nodes[*p].is_joint;
        if let Some(parent) = tree.nodes[i].parent.filter(goes_on) {
            movers[parent] = movers[i];
        }
    }
    movers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{ModelNode, Wood};

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
            is_joint: false,
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

    fn piece(parent: Option<usize>, end: [f64; 3]) -> ModelNode {
        ModelNode {
            parent,
            position: end.into(),
            place: 0,
            wood: Wood {
                radius: 0.1,
                ..Wood::default()
            },
        }
    }

    /// A stem up along which one twig after the other leaves.
    fn comb(twigs: usize, rise: f64) -> ModelTree {
        let mut nodes = vec![piece(None, [0.0; 3])];
        let mut below = 0;
        for k in 1..=twigs {
            let height = rise * k as f64;
            nodes.push(piece(Some(below), [0.0, height, 0.0]));
            below = nodes.len() - 1;
            nodes.push(piece(Some(below), [1.0, height, 0.0]));
        }
        ModelTree {
            nodes,
            metres_per_unit: 0.0,
            unit_is_guessed: false,
        }
    }

    /// Long pieces, as RayCloudTools makes them: a stem of three, the last two thinner, with a branch of two.
    #[test]
    fn the_first_piece_of_a_branch_keeps_most_of_its_radius() {
        let rows = [
            (None, 0.0, 0.0),
            (Some(0), 2.0, 0.1),
            (Some(1), 3.0, 0.08),
            (Some(2), 4.0, 0.06),
            (Some(1), 2.5, 0.04),
            (Some(4), 3.0, 0.02),
        ];
        let mut tree = comb(0, 1.0);
        tree.nodes.clear();
        for (parent, height, radius) in rows {
            let mut own = piece(parent, [0.0, height, 0.0]);
            own.wood.radius = radius;
            tree.nodes.push(own);
        }
        let expected = [0.1, 0.095, 0.07, 0.06, 0.035, 0.02];
        for (radius, expected) in end_radii(&tree).iter().zip(expected) {
            assert!((radius - expected).abs() < 1e-12, "{radius}");
        }
    }

    #[test]
    fn a_table_that_no_picture_could_hold_is_refused() {
        let mut thick = comb(10, 0.1);
        thick.nodes[3].wood.radius *= 1e3;
        assert!(matches!(
            as_scanned(&thick, 1.0),
            Err(ImportError::TooThick { .. })
        ));
        let tree = as_scanned(&comb(200, 0.1), 0.5).expect("a tree");
        assert!((tree.figures.height_m - 10.0).abs() < 1e-9);
        assert_eq!(tree.nodes.len(), 401);
        // y up becomes z up.
        assert_eq!(
            tree.nodes[400].position,
            Point3::new(0.5, 0.0, tree.figures.height_m)
        );
        let levels = stand_scanned(&tree)
            .skeleton
            .nodes
            .iter()
            .map(|n| n.level)
            .max();
        assert_eq!(levels, Some(200));
        let deep = as_scanned(&comb(300, 0.1), 1.0);
        assert!(matches!(deep, Err(ImportError::TooMany { .. })), "{deep:?}");
        let flat = as_scanned(&comb(2, 1e-6), 1.0);
        assert!(matches!(flat, Err(ImportError::NoHeight)), "{flat:?}");
        let mut bare = comb(2, 1.0);
        bare.nodes[2].wood.radius = 0.0;
        assert!(matches!(as_scanned(&bare, 1.0), Err(ImportError::NoRadius)));
    }
}
