//! The stages of the library on recorded and made-up trees. One test program, as for the commands.

#[path = "../support/bag.rs"]
mod bag;
#[path = "../bent/mod.rs"]
mod bent;
#[path = "../support/branches.rs"]
mod branches;
#[path = "../support/chance.rs"]
mod chance;
#[path = "../made_trees/mod.rs"]
mod made_trees;
#[path = "../support/ros.rs"]
mod ros;
#[path = "../support/small_disk.rs"]
mod small_disk;
#[path = "../support/still.rs"]
mod still;
#[path = "../support/mod.rs"]
mod support;
#[path = "../synthetic/mod.rs"]
mod synthetic;
#[path = "../support/trees.rs"]
mod trees;

mod accuracy_tree;
mod along_wood;
mod animate;
mod bag_files;
mod corpus;
mod depth_tree;
mod draw;
mod export_files;
mod glb;
mod kinect;
mod leaf_files;
mod leaf_looks;
mod leaves;
mod mesh;
mod moves_with;
mod occlusion;
mod pose;
mod pose_noise;
mod recording_depth;
mod refinement;
mod shape_keep;
mod shape_push;
mod source;
mod stages_hierarchy;
mod stages_model;
mod stages_track;
mod topiary;
mod wood;
