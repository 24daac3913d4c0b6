//! The nouns that flow through arborcam: plain data, no I/O, no threads.
//!
//! `RawFrame -> Frame -> TrackSet -> MotionHierarchy -> Skeleton -> Pose`. Each carries the frame
//! number and the sensor time of the picture that it comes from. Trees are flat arrays in which a
//! parent stands before its children.

mod botany;
mod branch_graph;
mod camera_motion;
mod capture_facts;
mod control;
mod depth;
mod depth_rig;
mod foot;
mod forest;
mod frame;
mod hierarchy;
mod leaf_swing;
mod lens;
mod local_time;
mod main_branch;
mod mode_summary;
mod moving_branch;
mod origin;
mod outline;
mod participation;
mod point_cloud;
mod pose;
mod rounded;
mod skeleton;
mod snapshot;
mod sway;
mod sway_columns;
mod sway_now;
mod tag_scale;
mod timing;
mod track;
mod track_log;
mod track_table;
mod tree_mode;
mod tree_strokes;
mod user_notes;
mod verdict;
mod wood;

pub use botany::{BotanicalBranch, BotanicalBranches, TREE, TRUNK};
pub use branch_graph::{BranchGraph, BranchLength, RADIUS_SHARE, WoodNode};
pub use camera_motion::{Agreement, Background, CameraMotion};
pub use capture_facts::{CaptureFacts, FilmCut, KnownMode, PointFacts, Shake, SwayFacts};
pub use control::Control;
pub use depth::{
    DEPTH_APART_S, DepthFormat, DepthImage, DepthSeen, LONGEST_LAG_S, METRES_UNIT_M, NodeDepth,
    Pinhole, RestDepths, depth_in_model_px,
};
pub use depth_rig::{CameraModel, DepthRig};
pub use foot::{Foot, FootBasis, TrunkRow};
pub use forest::{Forest, ForestTree, Ground};
pub use frame::{
    Frame, Luma, Picture, PixelFormat, RawFrame, Rgb, Size, TimedFrame, brightness, nanoseconds,
    seconds,
};
pub use hierarchy::{Cluster, ClusterId, MotionHierarchy};
pub use leaf_swing::LeafSwing;
pub use lens::{Distortion, Lens};
pub use local_time::{LocalTime, NoLocalTime};
pub use main_branch::MAIN_BRANCH_RGB;
pub use mode_summary::ModeSummary;
pub use moving_branch::MovingBranch;
pub use origin::Origin;
pub use outline::{Outline, bounds_px};
pub use participation::{Participation, moves_with, participation, reason};
pub use point_cloud::{MOST_CLOUD_POINTS, PointCloud};
pub use pose::{JointMotion, JointPose, Pose};
pub use skeleton::{FARTHEST_PX, NOT_FILMED_PX, Node, NodeId, NodeKind, NodeName, Skeleton};
pub use snapshot::{
    BranchRow, CameraState, DepthCameraState, FormatNote, Phase, Snapshot, StillNeeded,
};
pub use sway::{Excitation, Interval, Sway, Swaying, Unidentified};
pub use sway_columns::SwayColumns;
pub use sway_now::{AngleSpectrum, Angles, BranchSway, SwayNow};
pub use tag_scale::{TagScale, TagState};
pub use timing::{DepthCounts, Gap, GapCause, MAX_GAPS, Timing};
pub use track::{LONGEST_TRIAL_S, Observation, TrackId, TrackSet};
pub use track_log::{LogWindow, Tentative, TrackLog};
pub use track_table::TrackTable;
pub use tree_mode::{LimbEnergy, TreeMode};
pub use tree_strokes::{TreeStrokes, scaled};
pub use user_notes::{NoteError, UserNote, UserNotes};
pub use verdict::{Finding, Grade, Judgement, Verdict};
pub use wood::{AtRest, Masks, Wood, WoodSeen, WoodSight, shows_leaves};
