//! `arborcam analyze DIR...`: how every branch of a capture sways, and what captures have in
//! common.

mod options;
mod written;

use super::ended::{Ended, unwritten};
use super::output::say;
use super::stop::Stop;
use crate::cancel::CancelToken;
use crate::config::{Config, Excited};
use crate::document::{Document, DocumentError};
use crate::dynamics::{Depth, Film, analyse};
use crate::export::picture::data_address;
use crate::files::refuse_taken;
use crate::model::{Excitation, Pose, Skeleton, Swaying};
use crate::report::{Comparison, Given, Study, compare, hints, json, page, text};
use crate::tui::columns;
use crate::views::update;
use anyhow::anyhow;
pub use options::AnalyzeArgs;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use written::{answers, put_beside};

/// Film that is analysed at most, s, where a part is chosen: the end of a longer one. Points of
/// hours would fill the memory.
const LONGEST_S: f64 = 600.0;

/// One capture, and the answers for its tables by node index.
struct Analysed {
    study: Study,
    sway: Vec<Swaying>,
}

pub fn run(args: &AnalyzeArgs) -> Result<(), Ended> {
    args.check()?;
    if let Some(path) = &args.report {
        refuse_taken(path).map_err(|e| Ended::Failed(e.into()))?;
    }
    let stop = Stop::on_signals()?;
    let names = names(&args.dirs);
    // Before the first is worked on: a mistyped name is reported at once.
    let mut documents = Vec::with_capacity(args.dirs.len());
    for dir in &args.dirs {
        let document = Document::tree(dir)?;
        args.scale.fits(document.skeleton.image_size)?;
        documents.push(document);
    }
    let (mut studies, mut answers) = (Vec::new(), Vec::new());
    for (document, name) in documents.iter().zip(&names) {
        let analysed = analysed(args, document, name)?;
        studies.push(analysed.study);
        answers.push(analysed.sway);
    }
    let comparison = compare(&studies, args.trees.same());
    if comparison.as_ref().is_some_and(|c| c.same_tree.is_none()) {
        say(
            "arborcam: warning: nothing is compared: it cannot be told whether these are films of \
             one tree; say --trees same or different",
        );
    }
    print(&table(args, &studies, comparison.as_ref()))?;
    let stop = stop.while_writing();
    let mut failures = Vec::new();
    if args.update {
        for (dir, sway) in args.dirs.iter().zip(&answers) {
            failures.extend(update(dir, sway, stop).err().map(Ended::from));
        }
    }
    if let Some(path) = &args.report {
        let html = page(&studies, comparison.as_ref());
        failures.extend(report(path, html, stop).err());
    }
    ended(failures)
}

/// What is printed.
fn table(args: &AnalyzeArgs, studies: &[Study], comparison: Option<&Comparison>) -> String {
    if args.json {
        format!("{}\n", json(studies, comparison))
    } else {
        text(studies, comparison, columns().map(usize::from))
    }
}

fn report(path: &Path, html: String, stop: &AtomicBool) -> Result<(), Ended> {
    put_beside(path, html, stop).map_err(unwritten)?;
    say(&format!("report:  {}", path.display()));
    Ok(())
}

/// The last failure ends the command; those before it are told here.
fn ended(mut failures: Vec<Ended>) -> Result<(), Ended> {
    if failures.iter().any(|e| matches!(e, Ended::Stopped)) {
        return Err(Ended::Stopped);
    }
    let Some(last) = failures.pop() else {
        return Ok(());
    };
    for failure in &failures {
        if let Ended::Failed(e) | Ended::BadUsage(e) | Ended::NoInput(e) = failure {
            say(&format!("arborcam: {e}"));
        }
    }
    Err(last)
}

/// What is said of a capture, at once and in its report.
struct Notes<'a> {
    name: &'a str,
    all: Vec<String>,
}

impl Notes<'_> {
    fn tell(&mut self, kind: &str, what: String) {
        say(&format!("arborcam: {kind}: {}: {what}", self.name));
        self.all.push(what);
    }
}

fn analysed(args: &AnalyzeArgs, document: &Document, name: &str) -> Result<Analysed, Ended> {
    let mut own = document.note.config.clone();
    // What its tables are in.
    own.export.metres_per_px = document.metres_per_px();
    let config = args.config(&own)?;
    let mut notes = Notes {
        name,
        all: document.note.warnings.clone(),
    };
    for warning in &document.warnings {
        notes.tell("warning", warning.clone());
    }
    let film = film(args, document, &config, &mut notes)?;
    // Nothing was measured on copies.
    let skeleton = Skeleton {
        nodes: document.skeleton.nodes[..document.skeleton.measured()].to_vec(),
        ..(*document.skeleton).clone()
    };
    let progress = Progress::begin(name, skeleton.nodes.len().saturating_sub(1));
    let analysis = analyse(
        &skeleton,
        &film,
        &config.dynamics,
        Depth::Full,
        &CancelToken::new(),
    );
    drop(progress);
    let given = config.dynamics.excitation != Excited::Auto;
    for hint in hints(&film, &analysis, given) {
        notes.tell("note", hint);
    }
    let poses = poses_of(document, &film, skeleton.nodes.len()).unwrap_or_else(|e| {
        notes.tell(
            "warning",
            format!("there are no plots of angles and spectra: {e}"),
        );
        Vec::new()
    });
    let picture = document.picture.as_ref().filter(|_| args.report.is_some());
    let picture = picture.and_then(|p| data_address(&p.rgb).ok());
    let outline = document.note.outline.as_ref();
    let study = Study::of(&Given {
        name,
        source: &document.note.source.name,
        skeleton: &skeleton,
        film: &film,
        poses: &poses,
        analysis: &analysis,
        excitation: excitation(config.dynamics.excitation),
        metres_per_px: config.export.metres_per_px,
        highest_hz: config.dynamics.highest_hz,
        outline_px: outline.map_or(&[][..], |o| &o.polygon_px),
        picture: picture.as_deref(),
        notes: &notes.all,
    });
    Ok(Analysed {
        sway: answers(&skeleton, analysis.sway, &study),
        study,
    })
}

fn excitation(setting: Excited) -> Option<Excitation> {
    match setting {
        Excited::Auto => None,
        Excited::Release => Some(Excitation::Release),
        Excited::Wind => Some(Excitation::Wind),
    }
}

/// The points that are analysed. As at the end of a capture these are of the last seconds: points
/// do not live for ever, and of those that are gone nothing is said.
fn film(
    args: &AnalyzeArgs,
    document: &Document,
    config: &Config,
    notes: &mut Notes,
) -> Result<Film, Ended> {
    let chosen = args.from.is_some() || args.to.is_some();
    let window_s = config.dynamics.window_s;
    let longest_s = if chosen { LONGEST_S } else { window_s };
    let film = document.tracked_within(longest_s, args.within_s())?;
    let duration_s = document.note.timing.duration_s;
    if let Some(from) = args.from
        && film.times_s.is_empty()
        && from > duration_s
    {
        return Err(Ended::BadUsage(anyhow!(
            "--from {from} is after the end of {}, which is {duration_s:.1} s long; choose an earlier part",
            notes.name
        )));
    }
    let to_s = args.to.map_or(duration_s, |to| to.min(duration_s));
    if to_s - args.from.unwrap_or(0.0) <= longest_s + 1.0 {
        return Ok(film);
    }
    if chosen {
        notes.tell(
            "warning",
            format!(
                "the film is longer than {LONGEST_S:.0} s; its end is analysed; choose another \
                 part with --from and --to"
            ),
        );
    } else {
        notes.tell(
            "note",
            format!(
                "of {duration_s:.0} s of film the last {longest_s:.0} (dynamics.window_s) are \
                 analysed; choose others with --from and --to"
            ),
        );
    }
    Ok(film)
}

/// The poses of the first `nodes` nodes in the time of `film`.
fn poses_of(document: &Document, film: &Film, nodes: usize) -> Result<Vec<Pose>, DocumentError> {
    let from_s = film.times_s.first().copied().unwrap_or(0.0);
    let to_s = film.times_s.last().copied().unwrap_or(0.0);
    let mut poses = Vec::new();
    for pose in document.film()? {
        let mut pose = pose?;
        if from_s <= pose.time_s && pose.time_s <= to_s {
            pose.joints.truncate(nodes);
            poses.push(pose);
        }
    }
    Ok(poses)
}

/// A line on the terminal while a capture is analysed, gone when this is dropped.
struct Progress {
    shown: bool,
}

impl Progress {
    fn begin(name: &str, branches: usize) -> Self {
        let shown = std::io::stderr().is_terminal();
        if shown {
            let _ = write!(std::io::stderr(), "{name}: analysing {branches} branches");
        }
        Self { shown }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.shown {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
    }
}

/// What the captures are called: the names of their folders, with as much of the way to them as
/// tells them apart.
fn names(dirs: &[PathBuf]) -> Vec<String> {
    let all: Vec<Vec<String>> = dirs.iter().map(|dir| parts(dir)).collect();
    let longest = all.iter().map(Vec::len).max().unwrap_or(1);
    let mut names = Vec::with_capacity(all.len());
    for own in &all {
        let mut length = 1;
        while length < longest && is_shared(&all, own, length) {
            length += 1;
        }
        names.push(end(own, length));
    }
    names
}

/// The folders that lead to `dir`, and its name.
fn parts(dir: &Path) -> Vec<String> {
    let dir = std::path::absolute(dir).unwrap_or_else(|_| dir.to_owned());
    let dir = dir.canonicalize().unwrap_or(dir);
    dir.components()
        .map(|c| c.as_os_str().to_string_lossy().into_owned())
        .collect()
}

/// The last `length` parts of a path.
fn end(parts: &[String], length: usize) -> String {
    parts[parts.len().saturating_sub(length)..].join("/")
}

/// Whether the last `length` parts are those of several paths.
fn is_shared(all: &[Vec<String>], own: &[String], length: usize) -> bool {
    let same = all
        .iter()
        .filter(|other| end(other, length) == end(own, length));
    same.count() > 1
}

fn print(text: &str) -> Result<(), Ended> {
    let mut out = std::io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    match written {
        // A reader that closed it early has seen what it wanted.
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Ended::Failed(anyhow!(
            "cannot write to standard output: {e}"
        ))),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captures_of_one_name_are_told_apart_by_where_they_lie() {
        let named = |dirs: &[&str]| names(&dirs.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!(
            named(&["/x/calm/oak", "/x/storm/oak/", "/x/elm"]),
            ["calm/oak", "storm/oak", "elm"]
        );
        assert_eq!(named(&["/x/oak"]), ["oak"]);
    }
}
