//! Leaves as meshes, ready for a file (Li 2011 app. B).

use super::mesh::Mesh;
use crate::model::NodeId;

/// The leaves that oscillate together: those of one main branch.
///
/// A cluster of leaves turns about its main axis by `A(t) sin(omega t + beta)` (app. B.2). For
/// small angles that is
/// `A(t) sin(omega t)` times one displacement of its vertices plus `A(t) cos(omega t)` times
/// another, which every vertex carries with the phase `beta` of its cluster in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FoliageGroup {
    /// The branch whose speed decides how far the leaves swing.
    pub node: NodeId,
    pub mesh: Mesh,
    /// Colour of each vertex (sRGB).
    pub colours: Vec<[u8; 3]>,
    /// Displacement of each vertex at A = 1 rad for the two parts, model axes at rest, px.
    pub sine: Vec<[f32; 3]>,
    pub cosine: Vec<[f32; 3]>,
}

/// All leaves of a tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Foliage {
    pub groups: Vec<FoliageGroup>,
    /// PNG or JPEG bytes of the leaves' texture with its media type; `None` for plain colour.
    pub texture: Option<(&'static str, Vec<u8>)>,
    /// omega / 2 pi, Hz.
    pub frequency_hz: f64,
}
