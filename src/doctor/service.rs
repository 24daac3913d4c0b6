//! The parts of the service that should be on this system, against those that this program brings.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

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
    let unit = first_file(root, &UNIT_FOLDERS, "arborcam@.service");
    let rule = first_file(root, &RULE_FOLDERS, "70-arborcam.rules");
    // The unit itself says where the rest is.
    let prefix = unit.as_deref().and_then(prefix).unwrap_or("/usr/local");
    let helper_folder = format!("{prefix}/lib/arborcam");
    let helper = first_file(root, &[&helper_folder], "arborcam-service");
    Installed {
        unit: compare(unit.as_deref(), UNIT, prefix),
        helper: compare(helper.as_deref(), HELPER, prefix),
        rule: compare(rule.as_deref(), RULE, prefix),
        enabled: enabled(&root.join("etc/systemd/system")),
    }
}

/// The file of this name in the first of the folders below `root` that has it.
fn first_file(root: &Path, folders: &[&str], name: &str) -> Option<String> {
    folders.iter().find_map(|folder| {
        let folder = root.join(folder.trim_start_matches('/'));
        fs::read_to_string(folder.join(name)).ok()
    })
}

/// An installed file against ours, in which `@PREFIX@` stands for the folder of installation.
fn compare(found: Option<&str>, ours: &str, prefix: &str) -> Part {
    match found {
        None => Part::Missing,
        Some(text) if text == ours.replace("@PREFIX@", prefix) => Part::Same,
        Some(_) => Part::Differs,
    }
}

fn prefix(unit: &str) -> Option<&str> {
    let line = unit
        .lines()
        .find_map(|line| line.strip_prefix("ExecStart="))?;
    line.split_once("/lib/arborcam/").map(|(prefix, _)| prefix)
}

fn enabled(folder: &Path) -> Vec<String> {
    let mut names = BTreeSet::new();
    for target in entries(folder) {
        if target.extension().is_none_or(|e| e != "wants") {
            continue;
        }
        for instance in entries(&target) {
            let name = instance.file_name().and_then(|name| name.to_str());
            names.extend(
                name.filter(|n| n.starts_with("arborcam@"))
                    .map(str::to_owned),
            );
        }
    }
    names.into_iter().collect()
}

/// What a folder holds; nothing if it cannot be read.
fn entries(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    entries.flatten().map(|entry| entry.path()).collect()
}
