//! Any bytes as the depth image of a film of two pictures.
#![no_main]

use arborcam::config::Config;
use std::fs;

const CAMERA: &str = r#"{"fx": 600, "fy": 600, "cx": 8, "cy": 6, "depth_unit_m": 0.001}"#;
const COLOUR: &[u8] = include_bytes!("../corpus/depth/colour.png");

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("folder");
    let files: [(&str, &[u8]); 5] = [
        ("camera.json", CAMERA.as_bytes()),
        ("rgb.txt", b"1.0 colour.png\n1.1 colour.png\n"),
        ("depth.txt", b"1.0 depth.png\n1.1 depth.png\n"),
        ("colour.png", COLOUR),
        ("depth.png", bytes),
    ];
    for (name, content) in files {
        fs::write(folder.path().join(name), content).expect("file");
    }
    let Ok(mut film) = arborcam::source::open(folder.path(), &Config::default(), None) else {
        return;
    };
    let _ = film.next_frame();
    assert!(film.warnings().iter().all(|w| !w.contains('\n')), "one line");
});
