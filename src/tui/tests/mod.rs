//! The screen against made-up but realistic states.

mod keys;
mod made_up;
mod moving;
mod screens;
