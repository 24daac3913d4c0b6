//! The commands of the program, and what they do with files of all kinds. One test program: each takes its
//! time to link, and reads the shipped film once.

#[path = "../support/chance.rs"]
mod chance;
#[path = "../support/small_disk.rs"]
mod small_disk;
#[path = "../support/still.rs"]
mod still;
#[path = "../support/mod.rs"]
mod support;
#[path = "../synthetic/mod.rs"]
mod synthetic;
#[path = "../support/tools.rs"]
mod tools;

mod analyze;
mod animate;
mod bad_input;
mod calibrate;
mod capture_folder;
mod capture_read;
mod cloud;
mod depth;
mod doctor;
mod export;
mod forest;
mod glb_tools;
mod grow;
mod grow_examples;
mod markers;
mod notes;
mod photo;
mod recording;
mod render;
mod sketch;
mod to_folder;
