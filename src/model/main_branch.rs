//! Main branches: the parts of the crown that every screen and page gives one colour each.

use super::{MovingBranch, NodeId, Skeleton};

/// Colours of main branches (sRGB), taken again from the start after the last one; few, and of
/// middle brightness, so that they can be told apart on dark and on light.
pub const MAIN_BRANCH_RGB: [[u8; 3]; 8] = [
    [0x2f, 0x86, 0xff],
    [0xe8, 0x70, 0x00],
    [0x1f, 0xa2, 0x3e],
    [0xe0, 0x35, 0x70],
    [0xa0, 0x60, 0xf0],
    [0x00, 0xa0, 0xa8],
    [0xa8, 0x8e, 0x00],
    [0xc2, 0x6e, 0x50],
];

/// The trunk ends at a fork where the second largest branch has at least this share of the nodes of
/// the largest one; smaller ones leave the trunk's side.
const FORK_SHARE: f64 = 0.25;

impl Skeleton {
    /// Number of the main branch that each node belongs to, by node index; `None` for the trunk.
    ///
    /// The trunk runs from the foot to the first real fork, past small branches on its side. Every
    /// branch that leaves the trunk there or below is a main branch, with all that it carries. A
    /// copy belongs to the main branch of its original, and what moves with another node to that
    /// one's. Sizes are counted in measured nodes that move on their own, so that a tree has the
    /// same main branches with copies as without.
    ///
    /// Main branches are numbered in the order of the names of their first nodes. Names survive a
    /// refinement and new ones are larger, so a refined tree keeps the numbers of the main branches
    /// that it keeps, unless an older one has gone. Numbers begin anew after 255.
    pub fn main_branches(&self) -> Vec<Option<u8>> {
        let branches = self.moving_branches();
        let trunk = self.trunk(&branches);
        let mut first: Vec<NodeId> = Vec::new();
        for branch in branches.iter().filter(|b| self.is_measured(b)) {
            if !trunk[branch.node.index()] && trunk[branch.parent.index()] {
                first.push(branch.node);
            }
        }
        first.sort_by_key(|n| self.nodes[n.index()].name);
        let mut numbers = vec![None; self.nodes.len()];
        for (number, node) in first.into_iter().enumerate() {
            numbers[node.index()] = Some((number % 256) as u8);
        }
        for branch in &branches {
            let i = branch.node.index();
            if !trunk[i] && numbers[i].is_none() {
                let followed = self.nodes[i].copy_of.unwrap_or(branch.parent);
                numbers[i] = numbers.get(followed.index()).copied().flatten();
            }
            for rider in &branch.riders {
                numbers[rider.index()] = numbers[i];
            }
        }
        numbers
    }

    /// Which nodes the trunk's branches end in: the foot, and from each the largest measured branch
    /// until the first real fork.
    fn trunk(&self, branches: &[MovingBranch]) -> Vec<bool> {
        let mut sizes = vec![1usize; self.nodes.len()];
        let mut carried: Vec<Vec<usize>> = vec![Vec::new(); self.nodes.len()];
        for branch in branches.iter().rev().filter(|b| self.is_measured(b)) {
            let (i, parent) = (branch.node.index(), branch.parent.index());
            sizes[parent] += sizes[i];
            carried[parent].push(i);
        }
        let mut trunk = vec![false; self.nodes.len()];
        let mut top = 0;
        while top < trunk.len() {
            trunk[top] = true;
            carried[top].sort_by_key(|&i| std::cmp::Reverse(sizes[i]));
            let Some(&largest) = carried[top].first() else {
                break;
            };
            if let Some(&second) = carried[top].get(1)
                && sizes[second] as f64 >= FORK_SHARE * sizes[largest] as f64
            {
                break;
            }
            top = largest;
        }
        trunk
    }

    fn is_measured(&self, branch: &MovingBranch) -> bool {
        self.nodes[branch.node.index()].copy_of.is_none()
    }
}

#[cfg(test)]
mod tests {
    use crate::model::{Node, NodeId, NodeName, Size, Skeleton};
    use nalgebra::Point2;

    /// Nodes by parent; a name is the index unless given.
    fn tree(parents: &[Option<u32>]) -> Skeleton {
        let mut nodes = Vec::new();
        for (i, parent) in (0..).zip(parents) {
            nodes.push(Node::made_up(i, *parent, [0.0; 3]));
        }
        Skeleton {
            nodes,
            foot_px: Point2::origin(),
            image_size: Size::new(1, 1),
        }
    }

    /// Parents of a stem of `n` nodes from the foot up.
    fn stem(n: u32) -> Vec<Option<u32>> {
        (0..n).map(|i| i.checked_sub(1)).collect()
    }

    #[test]
    fn each_branch_of_the_first_fork_is_one_with_all_that_it_carries() {
        let tree = tree(&[
            None,
            Some(0),
            Some(1),
            Some(1),
            Some(2),
            Some(3),
            Some(3),
            Some(5),
        ]);
        let [a, b] = [Some(0), Some(1)];
        assert_eq!(tree.main_branches(), [None, None, a, b, a, b, b, b]);
    }

    #[test]
    fn a_small_branch_on_its_side_does_not_end_the_trunk() {
        // Seven nodes of a stem; a twig on node 1, and a fork of two at the end.
        let mut parents = stem(7);
        parents.extend([Some(1), Some(6), Some(6)]);
        let mut expected = vec![None; 7];
        expected.extend([Some(0), Some(1), Some(2)]);
        assert_eq!(tree(&parents).main_branches(), expected);
    }

    #[test]
    fn copies_belong_to_the_main_branch_of_their_original_and_change_nothing() {
        let mut tree = tree(&[None, Some(0), Some(1), Some(1), Some(3)]);
        let before = tree.main_branches();
        for (original, parent) in [(3, 1), (4, 5)] {
            let mut copy = tree.nodes[original].clone();
            copy.copy_of = Some(NodeId(original as u32));
            copy.parent = Some(NodeId(parent));
            copy.name = NodeName(tree.nodes.len() as u32);
            tree.nodes.push(copy);
        }
        let after = tree.main_branches();
        assert_eq!(after[..5], before);
        assert_eq!(after[5..], [Some(1), Some(1)]);
    }

    #[test]
    fn numbers_follow_names_and_not_places() {
        let mut refined = tree(&[None, Some(0), Some(1), Some(1), Some(1)]);
        refined.nodes[2].name = NodeName(9);
        assert_eq!(
            refined.main_branches(),
            [None, None, Some(2), Some(0), Some(1)]
        );
    }

    #[test]
    fn what_a_file_may_hold_has_numbers_too() {
        assert_eq!(tree(&[]).main_branches(), []);
        assert_eq!(tree(&stem(3)).main_branches(), [None; 3]);
        let odd = tree(&[None, Some(7), Some(1), None, Some(4)]);
        assert_eq!(odd.main_branches(), [None; 5]);
        let whorl: Vec<_> = [None].into_iter().chain([Some(0); 300]).collect();
        let numbers = tree(&whorl).main_branches();
        assert_eq!(
            (numbers[1], numbers[256], numbers[300]),
            (Some(0), Some(255), Some(43))
        );
    }
}
