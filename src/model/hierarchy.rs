//! Which points move together: the tree as the motion shows it.

use super::TrackId;

/// Index into [`MotionHierarchy::clusters`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ClusterId(pub u32);

/// A set of points that one recursive cut has put together.
#[derive(Clone, Debug, PartialEq)]
pub struct Cluster {
    pub parent: Option<ClusterId>,
    /// 0 for the whole tree, one more with every cut.
    pub level: u8,
    /// Every point of the cluster, those of its children included, ordered by id.
    pub members: Vec<TrackId>,
    /// Mean rest position of the members, px.
    pub centroid_px: [f64; 2],
}

/// The clusters, parents before children; the first is the whole tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionHierarchy {
    pub clusters: Vec<Cluster>,
}
