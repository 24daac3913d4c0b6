//! How far leaves swing in one frame.

/// Weights of the two displacements of a group of leaves, radians: `A(t) sin(omega t)` and `A(t)
/// cos(omega t)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LeafSwing {
    pub sine: f32,
    pub cosine: f32,
}
