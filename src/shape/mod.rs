//! The tree's shape in 3D, beyond its skeleton.

pub mod mesh;
pub mod radius;
mod tube;
