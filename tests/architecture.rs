//! The walls of the house: who may know whom, held by reading the sources.

use std::fs;
use std::path::{Path, PathBuf};

/// Who may use what of the crate, in the order in which the data flows: `model <- stages <-
/// pipeline <- runtime <- cli`. Stages know `model` and `config`, and of each other only the nouns
/// named here.
const MAY_USE: &[(&str, &[&str])] = &[
    ("bounds", &[]),
    ("cancel", &[]),
    ("model", &["signal"]),
    ("config", &[]),
    // The crates that read cameras panic; the hook that gives the terminal back must know what is
    // caught.
    ("caught", &[]),
    // A recording is a source, read where its format is known.
    (
        "source",
        &[
            "model",
            "config",
            "recording",
            "caught",
            "ffmpeg",
            // The colour camera that the user gives.
            "depth",
        ],
    ),
    ("depth", &["model", "config", "signal"]),
    ("outline", &["model", "config", "signal"]),
    ("track", &["model", "config", "signal"]),
    ("markers", &["model", "config"]),
    ("tag", &["model", "signal"]),
    // Pictures are carried to the rest pose.
    (
        "wood",
        &["model", "config", "signal", "motion::Spread", "random"],
    ),
    ("hierarchy", &["model", "config", "signal"]),
    ("skeleton", &["model", "config"]),
    // The flat node that is stood up in space.
    (
        "shape",
        &["model", "config", "signal", "skeleton::Node2d", "random"],
    ),
    // Limbs become meshes, and leaves stand on them.
    ("geometry", &["model", "config", "shape", "random"]),
    ("motion", &["model", "config", "signal"]),
    ("dynamics", &["model", "config", "signal"]),
    ("files", &[]),
    ("ffmpeg", &[]),
    ("signal", &[]),
    ("random", &[]),
    ("animate", &["model", "config", "signal", "random"]),
    // New trees are flat before they are stood up in space.
    (
        "grow",
        &["model", "config", "signal", "skeleton::Node2d", "random"],
    ),
    // Sketches and modelled trees become flat trees. Readers of scans panic on damaged files.
    ("import", &["model", "signal", "files", "caught"]),
    ("cloud", &["model", "signal"]),
    ("calibrate", &["model", "signal", "bounds"]),
    // Sub-branches, which only their own frequency tells, and modes.
    (
        "solve",
        &[
            "model",
            "config",
            "depth",
            "hierarchy",
            "skeleton",
            "shape",
            "motion",
            "signal",
            "dynamics",
        ],
    ),
    (
        "pipeline",
        &[
            "model",
            "config",
            // The first of its stages makes pictures of bytes, the last analyses the sway.
            "source::Decoder",
            "source::DecodeError",
            "depth",
            "dynamics",
            "outline",
            "track",
            "markers",
            "tag",
            "hierarchy",
            "skeleton",
            "shape",
            "geometry",
            "motion",
            "signal",
            "solve",
            "wood",
            "random",
            // The branches that a photograph shows become a flat tree as drawn ones do.
            "import",
            // A scanned tree becomes a skeleton.
            "cloud",
        ],
    ),
    ("recording", &["model"]),
    // What is drawn.
    (
        "draw",
        &[
            "model",
            "geometry::Mesh",
            "geometry::Foliage",
            "geometry::FoliageGroup",
        ],
    ),
    // `capture.json` holds the whole configuration and what the push has achieved. Poses are read
    // by the rule by which they were made, the outline as a file of its own would be, the points as
    // the sway is told from them.
    (
        "document",
        &[
            "model",
            "config",
            "signal",
            "files",
            "motion::PoseEstimator",
            "outline",
            "shape::PushFigures",
            "dynamics::Film",
        ],
    ),
    // The model's file holds all that is drawn; the HTML page plots the angles; a user's leaf is
    // read where glTF is known.
    (
        "export",
        &[
            "model",
            "config",
            "files",
            "ffmpeg",
            "document",
            // A lens as a profile.
            "calibrate::Calibration",
            "geometry",
            // Cylinders are pieces of limbs.
            "shape::Limb",
            "dynamics::angle_to_parent_deg",
        ],
    ),
    // The tree of a document as it is wanted, and all that is written or drawn of it.
    (
        "views",
        &[
            "model", "config", "files", "document", "export", "pipeline", "shape", "geometry",
            "draw", "signal", "grow", "animate", "random", "import", "cloud",
        ],
    ),
    // Told from what the sway was told from, and drawn beside it; its table for statistics is
    // written as those of a document.
    (
        "report",
        &[
            "model",
            "dynamics",
            "signal",
            "files",
            "document::TableWriter",
        ],
    ),
    // The screen draws outlines, and refuses the crossing ones as a file would be. It draws the
    // tree's wood too, a coarse mesh that only it needs.
    (
        "tui",
        &[
            "model",
            "outline::crossing",
            "caught",
            "draw",
            "geometry::Mesh",
            "geometry::bare_wood",
        ],
    ),
    (
        "runtime",
        &[
            "model",
            "config",
            // What the run knows of the film's depth.
            "depth",
            "caught",
            "source",
            "outline",
            "markers",
            "dynamics",
            "signal",
            "pipeline",
            "solve",
            "recording",
            "files",
            "document",
            "views",
        ],
    ),
    // It tries what a capture would use: a camera, the decoder, the front end; the rest of the
    // machine it reads itself.
    (
        "doctor",
        &[
            "model",
            "config",
            "source",
            "outline::whole",
            "pipeline::FrontEnd",
        ],
    ),
    (
        "cli",
        &[
            "model",
            "config",
            "source",
            "outline",
            "pipeline",
            "recording",
            "runtime",
            "files",
            "document",
            "export",
            "views",
            "animate",
            "calibrate",
            "cloud",
            "draw",
            "grow",
            "import",
            "report",
            "solve::Model",
            "solve::LEAST_MOVING",
            // What one photograph shows, along strokes.
            "wood",
            // What `analyze` asks of a capture's film.
            "dynamics::analyse",
            "dynamics::Depth",
            "dynamics::Film",
            "dynamics::Take",
            // A drawn shape is read, and what it cut is told.
            "shape::Cut",
            "shape::Drawn",
            "tui",
            "doctor",
            // What is caught is said by a command in one line.
            "caught::print_only_uncaught",
            // Markers off the picture are refused before anything is filmed.
            "markers::check_places",
        ],
    ),
    ("main.rs", &["cli"]),
];

/// Crates and calls that only some folders may know.
const ONLY_IN: &[(&str, &[&str])] = &[
    ("v4l::", &["source"]),
    ("nokhwa::", &["source"]),
    ("ratatui::", &["tui"]),
    ("gltf::", &["export", "import"]),
    ("gltf_json::", &["export"]),
    ("roxmltree::", &["import"]),
    ("svgtypes::", &["import"]),
    ("kurbo::", &["import"]),
    ("las::", &["import"]),
    ("e57::", &["import"]),
    ("crs_definitions::", &["import"]),
    ("flate2::", &["export"]),
    ("base64::", &["export"]),
    ("opencv::", &["track", "outline", "wood", "markers"]),
    ("turbojpeg::", &["source"]),
    ("mcap::", &["recording"]),
    ("crc32fast::", &["recording"]),
    ("bzip2::", &["recording"]),
    ("lz4::", &["recording"]),
    ("hound::", &["animate"]),
    // All draw from the one generator.
    ("rand_chacha::", &["random"]),
    ("clap::", &["cli"]),
    ("anyhow::", &["cli"]),
    ("sd_notify::", &["cli"]),
    ("crossbeam_channel::", &["runtime"]),
    ("thread::Builder", &["runtime"]),
    ("thread::spawn", &["runtime"]),
    ("thread::scope", &["runtime"]),
    ("mpsc::", &["runtime"]),
    // The doctor writes a nameless file to see how fast the disk is.
    // What ffmpeg says goes into one too. A file that is replaced begins as one.
    ("tempfile::", &["ffmpeg", "recording", "doctor", "files"]),
    ("fs::write", &["files"]),
    ("File::create", &["files"]),
    // Stages know no clock; the pipeline passes one on that it does not look at.
    // The line to the service manager keeps its beat; the doctor measures.
    (
        "Instant::now",
        &["runtime", "tui", "source", "cli", "doctor", "cancel"],
    ),
    // When a recording began, for those who look for it in a calendar.
    ("SystemTime", &["runtime"]),
    ("ZonedDateTime::now", &["runtime"]),
    ("jiff::", &["model", "runtime"]),
];

/// A source file without its tests and its comments.
struct Source {
    path: PathBuf,
    /// `track` for `src/track/flow.rs` and for `src/track.rs`.
    module: String,
    code: Vec<(usize, String)>,
}

fn files(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .flatten()
    {
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        if path.is_dir() && !["target", ".git", "out"].contains(&name.as_str()) {
            files(&path, into);
        } else if path.is_file() {
            into.push(path);
        }
    }
}

fn sources() -> Vec<Source> {
    let mut paths = Vec::new();
    files(Path::new("src"), &mut paths);
    // Files of unit tests, `mod tests;`.
    paths.retain(|p| {
        p.extension().is_some_and(|e| e == "rs") && !p.components().any(|c| is_tests(c.as_os_str()))
    });
    assert!(paths.len() > 60, "only {} source files", paths.len());
    paths.into_iter().map(read).collect()
}

fn is_tests(name: &std::ffi::OsStr) -> bool {
    name == "tests.rs" || name == "tests"
}

fn read(path: PathBuf) -> Source {
    let text = fs::read_to_string(&path).expect("source");
    let first = path
        .components()
        .nth(1)
        .expect("src/...")
        .as_os_str()
        .to_string_lossy()
        .into_owned();
    let module = if first == "main.rs" || first == "lib.rs" {
        first
    } else {
        first.trim_end_matches(".rs").to_owned()
    };
    let mut code = Vec::new();
    let mut lines = text.lines().enumerate();
    while let Some((i, line)) = lines.next() {
        if line.trim() == "#[cfg(test)]" {
            let (_, item) = lines.next().expect("an item after #[cfg(test)]");
            if item.ends_with('{') {
                // rustfmt puts the closing brace under the item's first letter.
                let close = format!("{}}}", " ".repeat(item.len() - item.trim_start().len()));
                let _ = lines.find(|(_, l)| *l == close);
            }
            continue;
        }
        let is_comment = line.trim_start().starts_with("//");
        code.push((
            i + 1,
            if is_comment {
                String::new()
            } else {
                line.to_owned()
            },
        ));
    }
    Source { path, module, code }
}

/// `track::TrackTable` for every mention of `crate::model::TrackTable` or of what stands in
/// `crate::track::{…}`.
fn uses(code: &str) -> Vec<String> {
    let mut found = Vec::new();
    for root in ["crate::", "arborcam::"] {
        for (at, _) in code.match_indices(root) {
            let rest = &code[at + root.len()..];
            let rest = &rest[..rest.find(';').unwrap_or(rest.len())];
            expand("", rest, &mut found);
        }
    }
    found
}

/// The paths of a use tree: `{shape, track::{A, B}}` is `shape`, `track::A` and `track::B`.
fn expand(prefix: &str, tree: &str, into: &mut Vec<String>) {
    let tree = tree.trim();
    if let Some(inner) = tree.strip_prefix('{') {
        let (mut depth, mut from) = (0, 0);
        for (i, c) in inner.char_indices() {
            match c {
                '{' => depth += 1,
                ',' | '}' if depth == 0 => {
                    expand(prefix, &inner[from..i], into);
                    from = i + 1;
                    if c == '}' {
                        return;
                    }
                }
                '}' => depth -= 1,
                _ => {}
            }
        }
        return;
    }
    let end = tree
        .find(|c: char| !(c.is_alphanumeric() || c == '_'))
        .unwrap_or(tree.len());
    let (name, rest) = tree.split_at(end);
    let path = if prefix.is_empty() {
        name.to_owned()
    } else {
        format!("{prefix}::{name}")
    };
    match rest.strip_prefix("::") {
        Some(rest) if prefix.is_empty() => expand(&path, rest, into),
        _ if name.is_empty() => {}
        _ => into.push(path.trim_end_matches("::self").to_owned()),
    }
}

#[test]
fn imports_go_one_way() {
    let mut wrong = Vec::new();
    for source in sources().iter().filter(|s| s.module != "lib.rs") {
        let Some((_, allowed)) = MAY_USE.iter().find(|(module, _)| *module == source.module) else {
            panic!("{} is not in the list of modules", source.path.display());
        };
        let code: String = source
            .code
            .iter()
            .flat_map(|(_, line)| [line.as_str(), "\n"])
            .collect();
        for used in uses(&code) {
            let module = used.split("::").next().expect("a name");
            if module != source.module
                && !["bounds", "cancel"].contains(&module)
                && !allowed.iter().any(|a| *a == module || *a == used)
            {
                wrong.push(format!("{} uses {used}", source.path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The check above reads code; this is the check that it reads it rightly.
#[test]
fn use_trees_are_read_rightly() {
    let code = "use crate::model::{Frame, Luma};\nuse crate::{shape, skeleton::Node2d};\nlet x = crate::track::distance(a);";
    assert_eq!(
        uses(code),
        [
            "model::Frame",
            "model::Luma",
            "shape",
            "skeleton::Node2d",
            "track::distance"
        ]
    );
    assert_eq!(
        uses("use crate::hierarchy::{self, Evidence};\nuse crate::config;"),
        ["hierarchy", "hierarchy::Evidence", "config"]
    );
}

#[test]
fn crates_stay_in_their_rooms() {
    let mut wrong = Vec::new();
    for source in sources() {
        for (word, rooms) in ONLY_IN
            .iter()
            .filter(|(_, rooms)| !rooms.contains(&source.module.as_str()))
        {
            for (line, text) in &source.code {
                let starts = |at: usize| {
                    !text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':')
                };
                if text
                    .match_indices(word)
                    .any(|(at, _)| starts(at) || word.contains("thread"))
                {
                    wrong.push(format!(
                        "{}:{line}: {word} belongs in {rooms:?}",
                        source.path.display()
                    ));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn nothing_in_the_program_gives_up_by_panicking() {
    let mut wrong = Vec::new();
    for source in sources() {
        for (line, text) in &source.code {
            if [
                ".unwrap()",
                ".expect(",
                "panic!(",
                "todo!(",
                "unimplemented!(",
            ]
            .iter()
            .any(|w| text.contains(w))
            {
                wrong.push(format!("{}:{line}: {}", source.path.display(), text.trim()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// A path of the machine that something was written on leads nowhere on the user's.
#[test]
fn nothing_points_to_places_that_only_this_machine_has() {
    let here = std::env::current_dir()
        .expect("folder")
        .display()
        .to_string();
    // Put together, lest this file finds itself.
    let home: Vec<String> = ["home", "root", "Users"]
        .iter()
        .map(|h| format!("/{h}/"))
        .collect();
    let places = [
        vec![here, format!("/{}/", "work"), format!("..{}", "/shared")],
        home,
    ]
    .concat();
    let mut paths = Vec::new();
    files(Path::new("."), &mut paths);
    let mut wrong = Vec::new();
    // Written by the set-up script on every machine anew, and not in the repository.
    for path in paths
        .iter()
        .filter(|p| !p.starts_with("./.cargo") && **p != Path::new("./.git"))
    {
        let Ok(text) = fs::read_to_string(path) else {
            continue;
        };
        wrong.extend(
            places
                .iter()
                .filter(|place| text.contains(*place))
                .map(|p| format!("{}: {p}", path.display())),
        );
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
