//! arborcam
pub mod config;
pub mod dynamics;
pub mod export;
pub mod hierarchy;
pub mod model;
pub mod motion;
pub mod outline;
pub mod pipeline;
pub mod recording;
pub mod runtime;
pub mod shape;
pub mod skeleton;
pub mod source;
pub mod track;
