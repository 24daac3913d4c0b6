//! Pictures of the tree without a graphics card: pure, from a model, a pose and a camera to pixels.
//!
//! ```text
//! Model ──Pose──▶ Posed (skin, leaves) ──Camera──▶ Canvas (depth buffer, several samples a pixel) ──▶ Rgba
//! ```

mod camera;
mod canvas;
mod light;
mod model;
mod rgba;
mod skin;
mod texture;

pub use camera::{BoundingCylinder, Camera, View};
pub use light::{Look, picture, scene};
pub use model::{Model, Placed, Posed};
pub use rgba::Rgba;
pub use texture::Texture;
