//! arborcam films a swaying tree with an ordinary camera and turns it, while it films, into a 3D
//! tree that moves as the real one does, after Li, Deussen, Song, Willis and Hall, "Modeling and
//! Generating Moving Trees from Video" (2011), and Zeng's variant of it (2015).
//!
//! # The way of the data
//!
//! ```text
//! source ──RawFrame──▶ decode ──Frame──▶ outline ─▶ track ──TrackSet──▶ hierarchy ──MotionHierarchy──┐
//!                                                     │    once enough motion has accumulated         ▼
//!                                                     │                          skeleton (2D) ─▶ shape (3D)
//!                                                     │                                               │ Skeleton
//!                                                     └──────TrackSet, every frame──────▶ motion ◀────┘
//!                                                                                           │ Pose
//!                                                     terminal UI, --stream, capture folder ◀
//! ```
//!
//! [`pipeline`] is that picture as code: a front end (frame to tracks) and a back end (tracks to
//! tree and pose). [`runtime`] runs the two on threads between a source and the screen.
//!
//! # The modules in reading order
//!
//! [`model`] the nouns · [`source`] where frames come from · [`outline`] which pixels are tree ·
//! [`track`] points followed · [`hierarchy`] who moves with whom · [`skeleton`] in the picture ·
//! [`shape`] in space · [`motion`] the pose of every frame · [`dynamics`] what the motion says ·
//! [`animate`] motion that nobody filmed · [`signal`] small common mathematics · [`random`] seeded
//! random numbers · [`caught`] other people's panics · [`draw`] pictures of it · [`pipeline`] all
//! of it · [`runtime`] on threads ·
//! [`recording`] kept on disk · [`export`] files for others · [`capture`] those files read back ·
//! [`report`] what the sway of one or several of them says · [`tui`] the screen · [`doctor`]
//! whether this machine can · [`cli`] the commands · [`config`] what can be set.

pub mod animate;
pub mod cancel;
pub mod capture;
pub mod caught;
pub mod cli;
pub mod config;
pub mod doctor;
pub mod draw;
pub mod dynamics;
pub mod export;
pub mod hierarchy;
pub mod model;
pub mod motion;
pub mod outline;
pub mod pipeline;
pub mod random;
pub mod recording;
pub mod report;
pub mod runtime;
pub mod shape;
pub mod signal;
pub mod skeleton;
pub mod source;
pub mod track;
pub mod tui;
