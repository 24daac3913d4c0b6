//! The screen against made-up but realistic states.

mod keys;
pub mod made_up;
mod moving;
mod photo;
mod screens;
