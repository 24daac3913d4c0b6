//! What is said when a tree comes into effect.

use super::shared::Shared;
use crate::solve::Model;
use std::sync::Arc;

/// The tree that was last told of.
#[derive(Default)]
pub struct Announced {
    tree: Option<Arc<Model>>,
    /// The warning that the first one was worth little.
    warned: Option<String>,
}

impl Announced {
    /// Tells of `tree` if it is a new one. One built early is worth less than `threshold`
    /// (accumulation measure), and the capture is to say so until a refinement has made up for it.
    pub fn tell(&mut self, tree: &Arc<Model>, threshold: f64, shared: &Shared) {
        if self
            .tree
            .as_ref()
            .is_some_and(|known| Arc::ptr_eq(known, tree))
        {
            return;
        }
        let first = self.tree.replace(tree.clone()).is_none();
        let nodes = tree.skeleton.measured();
        if tree.refinements > 0 {
            let kept = tree.kept;
            shared.tell(format!(
                "the tree was refined from {:.0} s on: {kept} of {nodes} nodes are those of before",
                tree.time_s
            ));
            tracing::info!(
                "tree refined at {:.1} s: {kept} of {nodes} nodes go on",
                tree.time_s
            );
            if tree.evidence.measure >= threshold {
                self.warned
                    .take()
                    .into_iter()
                    .for_each(|warning| shared.withdraw(&warning));
            }
        } else if first {
            self.warned = little_motion(tree, threshold);
            self.warned
                .iter()
                .for_each(|warning| shared.warn(warning.clone()));
            let (points, time_s) = (tree.evidence.moving.len(), tree.time_s);
            tracing::info!(
                "tree built at {time_s:.1} s: {nodes} nodes from {points} moving points"
            );
        }
    }
}

/// The warning that goes with a tree that was asked for before the measure had reached `threshold`.
pub fn little_motion(tree: &Model, threshold: f64) -> Option<String> {
    let measure = tree.evidence.measure;
    (tree.forced && measure < threshold).then(|| {
        format!(
            "the tree was built from little motion (accumulation {measure:.2} of {threshold}); \
             branches may be wrong: film longer, or in more wind"
        )
    })
}
