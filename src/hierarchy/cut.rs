//! From the dendrogram to the hierarchy: only splits that the data support are kept, and splits
//! whose order is uncertain become one fork with several branches.

use super::dendrogram::Dendrogram;
use crate::config::Hierarchy;

/// Fewest points on either side of a cut: one alone is more likely a bad track than a branch.
pub const MIN_SIDE: usize = 2;

/// A node of the hierarchy to be.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    pub parent: Option<usize>,
    pub level: u8,
    /// Index into [`Dendrogram::parts`].
    pub part: usize,
    /// Certainty that the children part here, 0 to 1; 0 without children.
    pub certainty: f32,
}

/// The nodes, level by level, each before its children, of which the largest comes first.
///
/// - Fewer points than [`MIN_SIDE`] are no branch: they stay with the node and are in none of its
///   children. So do the points of its own axis, `axis`.
/// - A split below `min_certainty` is dropped unless a split below it is certain.
/// - An uncertain split above a certain one means that only the order is unknown in which the
///   branches leave: they leave together, up to `max_children`.
///
/// `certain` and `axis` hold a value for each part of `tree`.
pub fn cut_dendrogram(
    tree: &Dendrogram,
    certain: &[f32],
    axis: &[bool],
    settings: &Hierarchy,
) -> Vec<Node> {
    if tree.parts.is_empty() {
        return Vec::new();
    }
    let cutter = Cutter {
        tree,
        certain,
        axis,
        settings,
        surest: surest_below(tree, certain, axis),
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
            let (children, certainty) = cutter.children(part);
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

struct Cutter<'a> {
    tree: &'a Dendrogram,
    certain: &'a [f32],
    axis: &'a [bool],
    settings: &'a Hierarchy,
    /// See [`surest_below`].
    surest: Vec<f32>,
}

/// A split with a branch on both sides.
struct Split {
    part: usize,
    halves: [usize; 2],
}

impl Cutter<'_> {
    /// The parts that `part` forks into, largest first, and how certain the fork is.
    fn children(&self, part: usize) -> (Vec<usize>, f32) {
        let Some(mut split) = self.split(part) else {
            return (Vec::new(), 0.0);
        };
        let mut children = split.halves.to_vec();
        let mut certainty = self.certain[split.part];
        while !self.is_certain(split.part) && children.len() < self.settings.max_children as usize {
            let Some((k, next)) = self.largest_split(&children) else {
                break;
            };
            children.splice(k..=k, next.halves);
            certainty = certainty.max(self.certain[next.part]);
            split = next;
        }
        children.sort_by_key(|&c| std::cmp::Reverse(self.size(c)));
        (children, certainty)
    }

    /// Of those of `parts` that split further the largest (the last of equals): its index, and its
    /// split.
    fn largest_split(&self, parts: &[usize]) -> Option<(usize, Split)> {
        let mut largest: Option<(usize, Split)> = None;
        for (k, &part) in parts.iter().enumerate() {
            let Some(split) = self.split(part) else {
                continue;
            };
            if largest
                .as_ref()
                .is_none_or(|(best, _)| self.size(part) >= self.size(parts[*best]))
            {
                largest = Some((k, split));
            }
        }
        largest
    }

    fn size(&self, part: usize) -> usize {
        self.tree.parts[part].len()
    }

    fn is_certain(&self, part: usize) -> bool {
        f64::from(self.certain[part]) >= self.settings.min_certainty
    }

    /// The first split at or below `part` that has a branch on both sides, if it or one below it is
    /// certain.
    fn split(&self, mut part: usize) -> Option<Split> {
        loop {
            let halves = self.tree.parts[part].halves?;
            let [a, b] = halves;
            let (size_a, size_b) = (self.size(a), self.size(b));
            if self.size(part) < self.settings.min_points as usize || size_a.max(size_b) < MIN_SIDE
            {
                return None;
            }
            if size_a.min(size_b) >= MIN_SIDE && !self.axis[a] && !self.axis[b] {
                return (f64::from(self.surest[part]) >= self.settings.min_certainty)
                    .then_some(Split { part, halves });
            }
            part = if self.axis[b] || (size_a > size_b && !self.axis[a]) {
                a
            } else {
                b
            };
        }
    }
}

/// For every part the certainty of the most certain split in it that can be made.
fn surest_below(tree: &Dendrogram, certain: &[f32], axis: &[bool]) -> Vec<f32> {
    let mut surest = vec![0.0f32; tree.parts.len()];
    for (k, part) in tree.parts.iter().enumerate().rev() {
        let Some(halves) = part.halves else { continue };
        if halves
            .iter()
            .all(|h| !axis[*h] && tree.parts[*h].len() >= MIN_SIDE)
        {
            surest[k] = certain[k];
        }
        for half in halves.into_iter().filter(|h| !axis[*h]) {
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
    fn trunk(pairs: usize) -> Dendrogram {
        let points: Vec<usize> = (0..2 * pairs).collect();
        Dendrogram::divided(points, |p, _| {
            (p.len() > 2).then(|| (0..p.len()).map(|k| k < 2).collect())
        })
    }

    /// Without parts that are an axis.
    fn cut_all(tree: &Dendrogram, certain: &[f32], settings: &Hierarchy) -> Vec<Node> {
        cut_dendrogram(tree, certain, &vec![false; tree.parts.len()], settings)
    }

    fn splitting_into(max_children: u32) -> Hierarchy {
        Hierarchy {
            levels: 10,
            min_points: 2,
            max_children,
            ..Hierarchy::default()
        }
    }

    fn sizes(nodes: &[Node], tree: &Dendrogram) -> Vec<(u8, usize)> {
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
        let nodes = cut_all(&tree, &vec![0.9; tree.parts.len()], &settings);
        assert_eq!(
            sizes(&nodes, &tree),
            [(0, 8), (1, 6), (1, 2), (2, 4), (2, 2), (3, 2), (3, 2)]
        );
        let few = cut_all(
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
            cut_all(&tree, &vec![0.2; tree.parts.len()], &settings).len(),
            1
        );
        let all = cut_all(
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
        let cases = [
            (4, vec![(0, 8), (1, 2), (1, 2), (1, 2), (1, 2)]),
            (3, vec![(0, 8), (1, 4), (1, 2), (1, 2), (2, 2), (2, 2)]),
        ];
        for (max_children, expected) in cases {
            let nodes = cut_all(&tree, &certain, &splitting_into(max_children));
            assert_eq!(sizes(&nodes, &tree), expected, "at most {max_children}");
        }
        let nodes = cut_all(&tree, &certain, &splitting_into(2));
        assert_eq!(nodes.len(), 7, "in two as in the papers");
    }

    #[test]
    fn points_of_the_axis_stay_with_the_node() {
        let tree = trunk(4);
        let settings = Hierarchy {
            levels: 10,
            min_points: 2,
            ..Hierarchy::default()
        };
        let mut axis = vec![false; tree.parts.len()];
        let [first, _] = tree.parts[0].halves.expect("halves");
        axis[first] = true;
        let nodes = cut_dendrogram(&tree, &vec![0.9; tree.parts.len()], &axis, &settings);
        assert_eq!(
            sizes(&nodes, &tree),
            [(0, 8), (1, 4), (1, 2), (2, 2), (2, 2)]
        );
    }
}
