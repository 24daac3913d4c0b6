//! arborcam films a swaying tree with one ordinary camera and builds, while it films, a 3D model of
//! it that moves as the real tree does, after Li, Deussen, Song, Willis and Hall, "Modeling and
//! Generating Moving Trees from Video" (2011), and Zeng's variant of it (2015).
//!
//! # The way of the data
//!
//! ```text
//! source ──RawFrame──▶ decode ──Frame──▶ outline ─▶ track ──TrackSet──▶ hierarchy
//! ──MotionHierarchy──┐                                                     │    once enough motion
//! has accumulated         ▼                                                     │
//! skeleton (2D) ─▶ shape (3D)                                                     │
//! │ Skeleton                                                     ├──────TrackSet, every
//! frame──────▶ motion ◀────┤                                                     │
//! │ Pose      │                                                     └──────TrackSet, now and
//! then────▶ dynamics ◀───┘
//! │ SwayNow                                                     terminal UI, --stream, capture
//! folder ◀
//! ```
//!
//! [`pipeline`] is that picture as code, in four stages: decode, a front end (frame to tracks), a
//! back end (tracks to tree and pose) and the sway. `runtime` runs them on threads between a source
//! and the screen.
//!
//! # The modules in reading order
//!
//! [`model`] shared data types · `source` where frames come from · `outline` which pixels are tree
//! · `track` points followed · `markers` coloured markers followed · [`tag`] a printed tag that
//! gives the scale · [`depth`] what a depth camera has seen of a point · [`hierarchy`] which points
//! move together · `wood` which pixels are wood · [`skeleton`] in the picture · [`shape`] in space
//! · [`geometry`] its wood and leaves as meshes · [`motion`] the pose in every frame ·
//! [`dynamics`] frequency and damping · [`animate`] motion that was not filmed · [`grow`] new trees
//! like an example · [`import`] sketches, modelled trees and point clouds · [`cloud`] trees in
//! point clouds · [`calibrate`] a lens by a chessboard · [`signal`] common mathematics · [`random`]
//! seeded random numbers · [`caught`] panics of other crates · [`draw`] pictures of the model ·
//! [`pipeline`] all of it, step by step · `runtime` on threads · `recording` frames and tracks on disk ·
//! [`document`] a tree as a folder, written and
//! read · [`files`] that appear when they are complete · [`export`] files for other programs ·
//! [`views`] what is made of a document · [`report`] tables and plots of the sway · `tui` the
//! screen · `doctor` checks of the machine · `cli` the commands · [`config`] the settings ·
//! [`cancel`] stops long work · [`bounds`] a stretch of the number line.
//!
//! # Features
//!
//! All are on by default. Without them only the core is built: everything from tracks to the model,
//! its motion, its frequencies and its files. `examples/tree_from_tracks.rs` uses it.
//!
//! | feature | adds | modules |
//! |---|---|---|
//! | `opencv` | pictures to tracks | `outline`, `track`, `markers`, `wood`, front end of [`pipeline`] |
//! | `camera` | cameras, recordings, videos | `source`, `recording`, decoding in [`pipeline`] |
//! | `nokhwa` | a second way to read cameras | inside of `source` |
//! | `terminal` | the program; needs `opencv` and `camera` | `runtime`, `tui`, `doctor`, `cli` |

pub mod animate;
pub mod bounds;
pub mod calibrate;
pub mod cancel;
pub mod caught;
#[cfg(feature = "terminal")]
pub mod cli;
pub mod cloud;
pub mod config;
pub mod depth;
#[cfg(feature = "terminal")]
pub mod doctor;
pub mod document;
pub mod draw;
pub mod dynamics;
pub mod export;
mod ffmpeg;
pub mod files;
pub mod geometry;
pub mod grow;
pub mod hierarchy;
pub mod import;
#[cfg(feature = "opencv")]
pub mod markers;
pub mod model;
pub mod motion;
#[cfg(feature = "opencv")]
pub mod outline;
pub mod pipeline;
pub mod random;
#[cfg(feature = "camera")]
pub mod recording;
pub mod report;
#[cfg(feature = "terminal")]
pub mod runtime;
pub mod shape;
pub mod signal;
pub mod skeleton;
pub mod solve;
#[cfg(feature = "camera")]
pub mod source;
pub mod tag;
#[cfg(feature = "opencv")]
pub mod track;
#[cfg(feature = "terminal")]
pub mod tui;
pub mod views;
#[cfg(feature = "opencv")]
pub mod wood;
