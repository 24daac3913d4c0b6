//! How deep a tree is that only its front was seen of.

use crate::model::Skeleton;
use nalgebra::Point3;

/// Lower branches than this share of the tree's height are its trunk.
const CROWN_SHARE: f64 = 0.3;
/// Depths become so many times as large at most, and as small.
const MOST_STRETCHED: f64 = 3.0;

/// Stretches all depths by one factor, so that the deviation of the crown's wood from front to back, by its
/// lengths as they were, is `share` of the geometric mean of that from side to side and the tree's height.
/// Places in the picture stay; a flat tree stays flat.
///
/// By the width alone a crown of which two limbs happen to lie in the picture's plane becomes deep too, and one
/// whose limbs lie behind each other becomes shallow.
pub fn set_depth_share(tree: &mut Skeleton, share: f64) {
    let Spread {
        height,
        across,
        deep,
    } = Spread::of(tree);
    if deep <= 0.0 || across <= 0.0 {
        return;
    }
    let factor = share * (across * height).sqrt() / deep;
    let factor = factor.clamp(1.0 / MOST_STRETCHED, MOST_STRETCHED);
    for node in &mut tree.nodes {
        node.position.z *= factor;
    }
}

/// Height of a tree, and deviation of its crown's wood to the side and to the front by its length, px.
struct Spread {
    height: f64,
    across: f64,
    deep: f64,
}

impl Spread {
    fn of(tree: &Skeleton) -> Self {
        let heights = tree.nodes.iter().map(|node| node.position.y);
        let height = heights.fold(0.0, f64::max);
        let low_px = CROWN_SHARE * height;
        let mut pieces: Vec<Piece> = Vec::with_capacity(tree.nodes.len());
        for node in &tree.nodes {
            let Some(parent) = node.parent.map(|p| tree.nodes[p.index()].position) else {
                continue;
            };
            let middle = nalgebra::center(&parent, &node.position);
            if middle.y >= low_px {
                pieces.push(Piece {
                    middle,
                    length_px: (node.position - parent).norm(),
                });
            }
        }
        Self {
            height,
            across: deviation(&pieces, 0),
            deep: deviation(&pieces, 2),
        }
    }
}

/// A piece of a branch.
struct Piece {
    middle: Point3<f64>,
    length_px: f64,
}

/// Deviation of the places of pieces along an axis, by their length, px.
fn deviation(pieces: &[Piece], axis: usize) -> f64 {
    let all_px: f64 = pieces.iter().map(|piece| piece.length_px).sum();
    if all_px <= 0.0 {
        return 0.0;
    }
    let moments = pieces.iter().map(|p| p.length_px * p.middle[axis]);
    let mean = moments.sum::<f64>() / all_px;
    let squares = pieces
        .iter()
        .map(|p| p.length_px * (p.middle[axis] - mean).powi(2));
    (squares.sum::<f64>() / all_px).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_crown_becomes_as_deep_as_asked_and_stays_in_the_picture() {
        let mut tree = Skeleton::forked();
        for (k, node) in tree.nodes.iter_mut().enumerate().skip(2) {
            node.position.z = 20.0 * (k as f64 - 3.0);
        }
        let before = tree.clone();
        let Spread {
            height,
            across,
            deep,
        } = Spread::of(&before);
        let factor = 0.3 * (across * height).sqrt() / deep;
        assert!((1.0..MOST_STRETCHED).contains(&factor), "{factor}");
        set_depth_share(&mut tree, 0.3);
        for (node, own) in tree.nodes.iter().zip(&before.nodes) {
            assert_eq!(node.position.xy(), own.position.xy());
            assert!((node.position.z - factor * own.position.z).abs() < 1e-9);
        }
        for node in &mut tree.nodes {
            node.position.z = 0.0;
        }
        let flat = tree.clone();
        set_depth_share(&mut tree, 0.3);
        assert_eq!(tree, flat);
    }
}
