//! How far leaves swing in one frame.

/// Weights of the two displacements of a group of leaves, radians.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LeafSwing {
    /// `A(t) sin(omega t)`.
    pub sine: f32,
    /// `A(t) cos(omega t)`.
    pub cosine: f32,
}
