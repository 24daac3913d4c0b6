//! Any bytes as a point cloud, of the kind that the first one says, and its tree.
#![no_main]

use arborcam::cloud::{CloudOptions, tree_of_cloud};
use arborcam::import::{CloudFormat, read_cloud};
use std::io::Cursor;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let format = match bytes.first() {
        // LAS and E57 have a target of their own.
        Some(b'p') => CloudFormat::Ply,
        Some(b'V' | b'#') => CloudFormat::Pcd,
        _ => CloudFormat::Text,
    };
    let _ = read_cloud(Cursor::new(bytes.to_vec()), format, None).map(|read| tree_of_cloud(&read.cloud, CloudOptions::default()));
});
