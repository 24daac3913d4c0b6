//! Any bytes as a file of a scanner, LAS or E57. Crates read them whose panics are caught, as in the program; a panic
//! anywhere else ends the fuzzer.
#![no_main]

use arborcam::caught::print_only_uncaught;
use arborcam::import::{CloudFormat, read_cloud};
use std::io::Cursor;

fn ignore_caught_panics() {
    // The fuzzer's own hook ends at every panic, the caught ones too.
    std::panic::set_hook(Box::new(|panic| eprintln!("{panic}")));
    print_only_uncaught();
}

libfuzzer_sys::fuzz_target!(init: ignore_caught_panics(), |bytes: &[u8]| {
    let format = match bytes.first() {
        Some(b'L') => CloudFormat::Las,
        _ => CloudFormat::E57,
    };
    if let Err(what) = read_cloud(Cursor::new(bytes.to_vec()), format, None) {
        assert!(!what.to_string().contains('\n'), "one line");
    }
});
