//! Any text as an outline file.
#![no_main]

use arborcam::model::Size;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let _ = arborcam::outline::parse(text, "fuzz.json".into(), Size::new(64, 36));
});
