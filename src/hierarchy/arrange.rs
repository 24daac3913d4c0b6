//! From a tree in two to the hierarchy: splits that the data support, as many at once as cannot be
//! told apart.

use super::MIN_SIDE;
use super::binary::Binary;
use crate::config::Hierarchy;

/// A node of the hierarchy to be.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    pub parent: Option<usize>,
    pub level: u8,
    /// Index into [`Binary::parts`].
    pub part: usize,
    /// How sure it is that the children part here; 0 without children.
    pub certainty: f32,
}

/// The nodes, level by level, each before its children, of which the largest comes first.
///
/// - A few points that come off alone are no branch: they stay with the node and are in none of its
///   children. So do
///   those of its stem, `stems`.
/// - A split that is not sure (`min_certainty`) and has no sure one under it is not made.
/// - One that is not sure but leads to sure ones says only that it is not known which branch leaves
///   first: they leave
///   together, up to `max_children`.
pub fn arranged(tree: &Binary, certain: &[f32], stems: &[bool], settings: &Hierarchy) -> Vec<Node> {
    if tree.parts.is_empty() {
        return Vec::new();
    }
    let arranging = Arranging {
        tree,
        certain,
        stems,
        settings,
        surest: surest_below(tree, certain, stems),
    };
    let mut nodes = vec![Node {
        parent: None,
        level: 0,
        part: 0,
        certainty: 0.0,
    }];
    let mut next = 0;
    while next < nodes.len() {
        let Node { level, part, .. } = nodes[next];
        if u32::from(level) + 1 < settings.levels {
            let (children, certainty) = arranging.children(part);
            nodes[next].certainty = certainty;
            nodes.extend(children.into_iter().map(|part| Node {
                parent: Some(next),
                level: level + 1,
                part,
                certainty: 0.0,
            }));
        }
        next += 1;
    }
    nodes
}

struct Arranging<'a> {
    tree: &'a Binary,
    certain: &'a [f32],
    stems: &'a [bool],
    settings: &'a Hierarchy,
    surest: Vec<f32>,
}

impl Arranging<'_> {
    fn children(&self, part: usize) -> (Vec<usize>, f32) {
        let Some((split, halves)) = self.split(part) else {
            return (Vec::new(), 0.0);
        };
        let (mut children, mut last, mut certainty) = (halves.to_vec(), split, self.certain[split]);
        while !self.sure(last) && children.len() < self.settings.max_children as usize {
            let size = |p: usize| self.tree.parts[p].len();
            let open = children
                .iter()
                .enumerate()
                .filter_map(|(k, &c)| Some((k, self.split(c)?)));
            let Some((k, (next, halves))) = open.max_by_key(|(k, _)| size(children[*k])) else {
                break;
            };
            children.splice(k..=k, halves);
            certainty = certainty.max(self.certain[next]);
            last = next;
        }
        children.sort_by_key(|&c| std::cmp::Reverse(self.tree.parts[c].len()));
        (children, certainty)
    }

    fn sure(&self, part: usize) -> bool {
        f64::from(self.certain[part]) >= self.settings.min_certainty
    }

    /// The first split at or below `part` that has a branch on both sides, if it or one under it is
    /// sure.
    fn split(&self, mut part: usize) -> Option<(usize, [usize; 2])> {
        let size = |p: usize| self.tree.parts[p].len();
        loop {
            let halves = self.tree.parts[part].halves?;
            let [a, b] = halves;
            if size(part) < self.settings.min_points as usize || size(a).max(size(b)) < MIN_SIDE {
                return None;
            }
            if size(a).min(size(b)) >= MIN_SIDE && !self.stems[a] && !self.stems[b] {
                return (f64::from(self.surest[part]) >= self.settings.min_certainty)
                    .then_some((part, halves));
            }
            part = if self.stems[b] || (size(a) > size(b) && !self.stems[a]) {
                a
            } else {
                b
            };
        }
    }
}

/// For every part the certainty of the surest split in it that can be made.
fn surest_below(tree: &Binary, certain: &[f32], stems: &[bool]) -> Vec<f32> {
    let mut surest = vec![0.0f32; tree.parts.len()];
    for (k, part) in tree.parts.iter().enumerate().rev() {
        let Some(halves) = part.halves else { continue };
        if halves
            .iter()
            .all(|h| !stems[*h] && tree.parts[*h].len() >= MIN_SIDE)
        {
            surest[k] = certain[k];
        }
        for half in halves.into_iter().filter(|h| !stems[*h]) {
            surest[k] = surest[k].max(surest[half]);
        }
    }
    surest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points 0 and 1, 2 and 3, … come apart pair by pair, one after the other, as branches leave a
    /// trunk.
    fn trunk(pairs: usize) -> Binary {
        let points: Vec<usize> = (0..2 * pairs).collect();
        Binary::divided(points, |p, _| {
            (p.len() > 2).then(|| (0..p.len()).map(|k| k < 2).collect())
        })
    }

    fn arranged_all(tree: &Binary, certain: &[f32], settings: &Hierarchy) -> Vec<Node> {
        arranged(tree, certain, &vec![false; tree.parts.len()], settings)
    }

    fn sizes(nodes: &[Node], tree: &Binary) -> Vec<(u8, usize)> {
        nodes
            .iter()
            .map(|n| (n.level, tree.parts[n.part].len()))
            .collect()
    }

    #[test]
    fn sure_splits_are_made_one_after_the_other() {
        let tree = trunk(4);
        let settings = Hierarchy {
            levels: 10,
            min_points: 2,
            ..Hierarchy::default()
        };
        let nodes = arranged_all(&tree, &vec![0.9; tree.parts.len()], &settings);
        assert_eq!(
            sizes(&nodes, &tree),
            [(0, 8), (1, 6), (1, 2), (2, 4), (2, 2), (3, 2), (3, 2)]
        );
        let few = arranged_all(
            &tree,
            &vec![0.9; tree.parts.len()],
            &Hierarchy {
                levels: 2,
                ..settings
            },
        );
        assert_eq!(few.len(), 3, "no deeper than the levels");
    }

    #[test]
    fn splits_that_nothing_supports_are_not_made() {
        let tree = trunk(4);
        let settings = Hierarchy {
            levels: 10,
            min_points: 2,
            ..Hierarchy::default()
        };
        assert_eq!(
            arranged_all(&tree, &vec![0.2; tree.parts.len()], &settings).len(),
            1
        );
        let all = arranged_all(
            &tree,
            &vec![0.2; tree.parts.len()],
            &Hierarchy {
                min_certainty: 0.0,
                ..settings
            },
        );
        assert_eq!(all.len(), 7, "unless nothing is asked of them");
    }

    #[test]
    fn branches_whose_order_is_not_sure_leave_together() {
        let tree = trunk(4);
        let mut certain = vec![0.2; tree.parts.len()];
        // Only the split farthest from the foot is sure.
        let last = tree
            .parts
            .iter()
            .rposition(|p| p.halves.is_some())
            .expect("a split");
        certain[last] = 0.9;
        let of = |max_children| {
            let settings = Hierarchy {
                levels: 10,
                min_points: 2,
                max_children,
                ..Hierarchy::default()
            };
            sizes(&arranged_all(&tree, &certain, &settings), &tree)
        };
        assert_eq!(of(4), [(0, 8), (1, 2), (1, 2), (1, 2), (1, 2)]);
        assert_eq!(of(3), [(0, 8), (1, 4), (1, 2), (1, 2), (2, 2), (2, 2)]);
        assert_eq!(of(2).len(), 7, "in two as in the papers");
    }

    #[test]
    fn points_of_the_stem_stay_with_the_node() {
        let tree = trunk(4);
        let settings = Hierarchy {
            levels: 10,
            min_points: 2,
            ..Hierarchy::default()
        };
        let mut stems = vec![false; tree.parts.len()];
        let [first, _] = tree.parts[0].halves.expect("halves");
        stems[first] = true;
        let nodes = arranged(&tree, &vec![0.9; tree.parts.len()], &stems, &settings);
        assert_eq!(
            sizes(&nodes, &tree),
            [(0, 8), (1, 4), (1, 2), (2, 2), (2, 2)]
        );
    }
}
