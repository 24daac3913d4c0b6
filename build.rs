//! Puts the page of `export --format html` into the program, where `scripts/build-viewer.sh` has
//! made it. Without it the program is complete but for that format, and says so when it is asked
//! for it.

use std::path::PathBuf;
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    let folder = env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| PathBuf::from("target"), PathBuf::from)
        .join("viewer");
    let page =
        env::var_os("ARBORCAM_VIEWER").map_or_else(|| folder.join("viewer.html"), PathBuf::from);
    println!("cargo::rerun-if-env-changed=CARGO_TARGET_DIR");
    println!("cargo::rerun-if-env-changed=ARBORCAM_VIEWER");
    println!("cargo::rerun-if-changed=build.rs");
    // Cargo takes a file that is not there for one that always changes, and would build everything
    // each time; while there is none it watches the folder, whose time changes when the page
    // appears in it.
    let absent = !page.exists() && page.starts_with(&folder) && fs::create_dir_all(&folder).is_ok();
    println!(
        "cargo::rerun-if-changed={}",
        if absent { &folder } else { &page }.display()
    );
    let html = match fs::read(&page) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => Vec::new(),
        read => read?,
    };
    fs::write(out.join("viewer.html"), html)
}
