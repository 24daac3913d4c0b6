//! Which points move together: the tree as the motion shows it.

use super::TrackId;
use nalgebra::Point2;
use std::collections::BTreeSet;

/// Index into [`MotionHierarchy::clusters`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ClusterId(pub u32);

/// A set of points that move together, apart from the rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Cluster {
    pub parent: Option<ClusterId>,
    /// 0 for the whole tree, one more with every split.
    pub level: u8,
    /// Every point of the cluster, those of its children included, ordered by id. Points may be in
    /// no child: those that sit on the branch itself, below all of its forks.
    pub members: Vec<TrackId>,
    /// Mean rest position of the members, px.
    pub centroid_px: Point2<f64>,
    /// Where the cluster's branch ends at rest, px: where its children part, or at its tip. `None`
    /// where all that is known is the centroid.
    pub end_px: Option<Point2<f64>>,
    /// How sure it is that the children part here, 0 (not at all) to 1; 0 for a cluster without
    /// children.
    pub certainty: f32,
}

/// The clusters, parents before children; the first is the whole tree. A cluster has none or at
/// least two children, which stand together, the one with the most points first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionHierarchy {
    pub clusters: Vec<Cluster>,
}

impl MotionHierarchy {
    /// All tracks that the tree is made of.
    pub fn members(&self) -> BTreeSet<TrackId> {
        match self.clusters.first() {
            Some(all) => all.members.iter().copied().collect(),
            None => BTreeSet::new(),
        }
    }

    /// How sure the splits are, 0 to 1: the median over the clusters that have children.
    pub fn median_certainty(&self) -> Option<f64> {
        let mut parted: Vec<u32> = self
            .clusters
            .iter()
            .filter_map(|c| c.parent)
            .map(|p| p.0)
            .collect();
        parted.dedup();
        let mut certain: Vec<f32> = parted
            .iter()
            .map(|&p| self.clusters[p as usize].certainty)
            .collect();
        certain.sort_unstable_by(f32::total_cmp);
        certain.get(certain.len() / 2).copied().map(f64::from)
    }
}
