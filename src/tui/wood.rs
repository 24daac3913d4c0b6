//! What is said of the wood that was found.

use crate::model::{Snapshot, WoodSight};

/// Which wood was found, or why none is shown, in one line.
pub fn told(snapshot: &Snapshot) -> String {
    if let Some(wood) = &snapshot.wood {
        return match wood.branches.tips() {
            0 | 1 => {
                "Light orange (w) is all wood that was found: one line, without a fork.".into()
            }
            tips => format!("Light orange (w) is the wood that was found, up to {tips} tips."),
        };
    }
    let why = match (snapshot.wood_sight, &snapshot.skeleton) {
        (WoodSight::NotSought, None) => "No wood is found yet: it is looked for with the tree.",
        (WoodSight::NotSought, Some(_)) => {
            "No wood is looked for, and no line is used: skeleton.along_wood is false."
        }
        (WoodSight::Sought | WoodSight::Seen, _) => "No wood is found yet: it is being looked for.",
        (WoodSight::NotSeen, _) => {
            "No wood was found in this film: begin lines at the foot of the trunk."
        }
    };
    why.into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{BranchGraph, Wood, WoodNode};
    use crate::tui::tests::made_up;
    use std::sync::Arc;

    /// A trunk with so many branches at its top.
    fn wood(branches: usize) -> Arc<Wood> {
        let mut nodes = vec![
            WoodNode::made_up(None, 100.0, 200.0),
            WoodNode::made_up(Some(0), 100.0, 100.0),
        ];
        nodes.extend((0..branches).map(|k| WoodNode::made_up(Some(1), 30.0 * k as f64, 50.0)));
        Arc::new(Wood {
            branches: BranchGraph { nodes },
            ..Wood::default()
        })
    }

    #[test]
    fn what_was_found_is_told_and_so_is_that_nothing_was() {
        let tree = Arc::new(made_up::skeleton());
        for (wood, sight, has_tree, expected) in [
            (Some(wood(3)), WoodSight::Seen, true, "up to 3 tips"),
            (Some(wood(1)), WoodSight::Seen, true, "without a fork"),
            (Some(wood(0)), WoodSight::Seen, true, "without a fork"),
            (None, WoodSight::NotSought, false, "with the tree"),
            (None, WoodSight::NotSought, true, "along_wood is false"),
            (None, WoodSight::Sought, true, "being looked for"),
            (
                None,
                WoodSight::NotSeen,
                true,
                "No wood was found in this film",
            ),
        ] {
            let snapshot = Snapshot {
                wood,
                wood_sight: sight,
                skeleton: has_tree.then(|| tree.clone()),
                ..Snapshot::default()
            };
            let told = told(&snapshot);
            assert!(told.contains(expected), "{told:?} for {expected:?}");
            assert!(told.len() <= 76, "{told} fits into a line of 80 columns");
        }
    }
}
