//! Triangles that move with a skeleton.

/// Triangles with skinning weights; all vectors but `indices` have one entry a vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Model axes at rest, px.
    pub positions: Vec<[f32; 3]>,
    /// Outward, of length 1.
    pub normals: Vec<[f32; 3]>,
    /// u runs once around the branch, v along it in units of its circumference.
    pub uvs: Vec<[f32; 2]>,
    /// Node indices of the branches that move the vertex; unused entries are 0.
    pub joints: Vec<[u16; 4]>,
    /// Their shares, which add up to 1; unused entries are 0.
    pub weights: Vec<[f32; 4]>,
    /// Three a triangle, counter-clockwise seen from outside.
    pub indices: Vec<u32>,
}
