//! Any text as the lists of a folder with colour and depth images.
#![no_main]

use arborcam::config::Config;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let folder = tempfile::tempdir().expect("folder");
    for name in ["rgb.txt", "depth.txt"] {
        std::fs::write(folder.path().join(name), text).expect("list");
    }
    if let Err(e) = arborcam::source::open(folder.path(), &Config::default(), None) {
        assert!(!e.to_string().contains('\n'), "one line");
    }
});
