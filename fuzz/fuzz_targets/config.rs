//! Any text as a configuration.
#![no_main]

use arborcam::config::Config;

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Err(e) = Config::parse(text, "fuzz.toml") {
        assert!(!e.to_string().contains('\n'), "one line");
    }
});
