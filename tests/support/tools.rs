//! Programs that only tests need.

use std::path::PathBuf;
use std::process::Command;

/// A program, if it is there. Else the test says why it skips; with `ARBORCAM_REQUIRE_TOOLS` it
/// fails.
pub fn program(name: &str, ask: &str) -> Option<PathBuf> {
    let found = Command::new(name)
        .arg(ask)
        .output()
        .is_ok_and(|o| o.status.success());
    found
        .then(|| PathBuf::from(name))
        .or_else(|| absent(&format!("{name} is not installed")))
}

/// Modules of `scripts/test-modules.sh` with `name` among them.
pub fn modules(name: &str) -> Option<PathBuf> {
    let target =
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| PathBuf::from("target"), PathBuf::from);
    let modules = std::path::absolute(target.join("test-npm/node_modules")).expect("path");
    if modules.join(name).is_dir() {
        Some(modules)
    } else {
        absent(&format!("npm's {name} is not there"))
    }
}

/// The Khronos validator of glTF.
pub struct Validator {
    node: PathBuf,
    modules: PathBuf,
}

impl Validator {
    /// As of [`program`].
    pub fn find() -> Option<Self> {
        Some(Self {
            node: program("node", "--version")?,
            modules: modules("gltf-validator")?,
        })
    }

    /// Fails where it finds an error in one of some files, or a warning.
    pub fn finds_nothing_in(&self, files: &[PathBuf]) {
        let mut validate = Command::new(&self.node);
        validate
            .arg("scripts/validate-glb.mjs")
            .args(files)
            .env("NODE_PATH", &self.modules);
        let output = validate.output().expect("node");
        let told = String::from_utf8_lossy(&output.stdout);
        println!("{told}");
        assert!(
            output.status.success(),
            "{told}{}",
            String::from_utf8_lossy(&output.stderr)
        );
        assert_eq!(told.matches("0 errors, 0 warnings").count(), files.len());
    }
}

fn absent<T>(what: &str) -> Option<T> {
    let line = format!("{what}; run scripts/setup.sh --tests");
    assert!(
        std::env::var_os("ARBORCAM_REQUIRE_TOOLS").is_none(),
        "{line}"
    );
    eprintln!("SKIPPED: {line}");
    None
}
