//! Any bytes as a recording or a bag of ROS 1: pictures or words, never a panic, and an end.
#![no_main]

use arborcam::model::Size;
use arborcam::recording::Reader;
use std::io::Cursor;
use std::path::Path;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(mut reader) = Reader::new(Path::new("fuzz.mcap"), Cursor::new(bytes)) {
        while reader.next_picture().is_some() {}
        let _ = (reader.warnings(), reader.topics(), reader.pictures_total());
        let _ = (reader.depth_rig(), reader.depth_camera(Size::new(640, 480)), reader.depth_unit_m(), reader.depth_misfit());
    }
});
