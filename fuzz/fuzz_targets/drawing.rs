//! Any bytes as a drawing.
#![no_main]

use arborcam::import::{joined, read_sketch};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = read_sketch(bytes).and_then(|sketch| joined(&sketch));
});
