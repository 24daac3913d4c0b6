//! The parts of the service that should be on this system, against those that this program brings.

use std::fs;
use std::path::Path;

/// Places in which systemd looks, the one that goes before the others first.
const UNIT_FOLDERS: [&str; 4] = [
    "/etc/systemd/system",
    "/usr/local/lib/systemd/system",
    "/usr/lib/systemd/system",
    "/lib/systemd/system",
];
const RULE_FOLDERS: [&str; 3] = [
    "/etc/udev/rules.d",
    "/usr/lib/udev/rules.d",
    "/lib/udev/rules.d",
];
const UNIT: &str = include_str!("../../systemd/arborcam@.service");
const HELPER: &str = include_str!("../../systemd/arborcam-service");
const RULE: &str = include_str!("../../systemd/70-arborcam.rules");

/// State of one installed file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    Missing,
    /// Not what this version of the program brings.
    Differs,
    Same,
}

/// What is installed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Installed {
    pub unit: Part,
    pub helper: Part,
    pub rule: Part,
    /// Enabled instances, e.g. `arborcam@video0.service`.
    pub enabled: Vec<String>,
}

/// Looks below `root`, which is `/` but for tests.
pub fn installed(root: &Path) -> Installed {
    let read = |path: &str| fs::read_to_string(root.join(path.trim_start_matches('/'))).ok();
    let unit = UNIT_FOLDERS
        .iter()
        .find_map(|folder| read(&format!("{folder}/arborcam@.service")));
    // The unit itself says where the rest is.
    let prefix = unit
        .as_deref()
        .and_then(prefix)
        .unwrap_or("/usr/local")
        .to_owned();
    let compare = |found: Option<String>, ours: &str| match found {
        None => Part::Missing,
        Some(text) if text == ours.replace("@PREFIX@", &prefix) => Part::Same,
        Some(_) => Part::Differs,
    };
    Installed {
        helper: compare(
            read(&format!("{prefix}/lib/arborcam/arborcam-service")),
            HELPER,
        ),
        rule: compare(
            RULE_FOLDERS
                .iter()
                .find_map(|folder| read(&format!("{folder}/70-arborcam.rules"))),
            RULE,
        ),
        enabled: enabled(&root.join("etc/systemd/system")),
        unit: compare(unit, UNIT),
    }
}

fn prefix(unit: &str) -> Option<&str> {
    let line = unit
        .lines()
        .find_map(|line| line.strip_prefix("ExecStart="))?;
    line.split_once("/lib/arborcam/").map(|(prefix, _)| prefix)
}

fn enabled(folder: &Path) -> Vec<String> {
    let list = |folder: &Path| {
        fs::read_dir(folder)
            .into_iter()
            .flatten()
            .flatten()
            .map(|e| e.path())
    };
    let wants = list(folder).filter(|p| p.extension().is_some_and(|e| e == "wants"));
    let names = wants.flat_map(|w| list(&w).collect::<Vec<_>>());
    let mut names: Vec<String> = names
        .filter_map(|p| p.file_name()?.to_str().map(str::to_owned))
        .collect();
    names.retain(|name| name.starts_with("arborcam@"));
    names.sort();
    names.dedup();
    names
}
