//! arborcam films a swaying tree with an ordinary camera and turns it, while it films, into a 3D tree that moves.

pub mod config;
pub mod export;
pub mod model;
pub mod shape;
