//! Any bytes as a modelled tree, of the kind that the first one says.
#![no_main]

use arborcam::import::{StandingModel, read_model};
use std::path::Path;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let name = match bytes.first() {
        Some(b'g' | b'{') => "fuzz.glb",
        Some(b'p') => "fuzz.ply",
        Some(b'I' | b'c') => "fuzz.csv",
        Some(b'#' | b'h' | b'x') => "fuzz.txt",
        _ => "fuzz.obj",
    };
    let _ = read_model(bytes, Path::new(name)).map(|model| StandingModel::of(&model.tree));
});
