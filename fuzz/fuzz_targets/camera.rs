//! Any text as a file with cameras: as `camera.json`, as the calibration of an Azure Kinect, and as the profile of a lens.
#![no_main]

use arborcam::import::read_lens_profile;
use arborcam::model::Size;
use arborcam::source::{CameraFile, kinect_rig};

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Err(what) = CameraFile::parse(text) {
        assert!(!what.contains('\n'), "one line");
    }
    if let Err(what) = kinect_rig(text, Size::new(640, 576), Size::new(1280, 720)) {
        assert!(!what.contains('\n'), "one line");
    }
    if let Err(what) = read_lens_profile(text.as_bytes()) {
        assert!(!what.contains('\n'), "one line");
    }
});
