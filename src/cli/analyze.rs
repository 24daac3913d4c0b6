//! `arborcam analyze DIR...`: how every branch of a capture sways, and what captures have in
//! common.

mod options;
mod written;

use super::stop::Stop;
use super::{Ended, say};
use crate::cancel::CancelToken;
use crate::capture::Captured;
use crate::config::Excited;
use crate::dynamics::{Depth, analyse};
use crate::export::picture::data_address;
use crate::export::{ExportError, refuse_taken};
use crate::model::{Excitation, NodeName, Skeleton, Swaying};
use crate::report::{Given, Study, compare, hints, json, page, text};
use crate::tui::columns;
use anyhow::anyhow;
pub use options::AnalyzeArgs;
use std::collections::BTreeMap;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use written::{differs, put_beside, put_into, stale};

/// Film that is analysed at most, s, where a part is chosen: the end of a longer one. Points of
/// hours would fill the memory.
const LONGEST_S: f64 = 600.0;

/// One capture and what is to be written into it.
struct Analysed {
    study: Study,
    sway: BTreeMap<NodeName, Swaying>,
    /// Whether that is not what stood there.
    differs: bool,
}

pub fn run(args: &AnalyzeArgs) -> Result<(), Ended> {
    args.check()?;
    if let Some(path) = &args.report {
        refuse_taken(path).map_err(|e| Ended::Failed(e.into()))?;
    }
    let stop = Stop::on_signals()?;
    let names = names(&args.dirs);
    // Before the first is worked on: a mistyped name is told at once.
    let read: Vec<Captured> = args
        .dirs
        .iter()
        .map(|dir| Captured::tree(dir))
        .collect::<Result<_, _>>()?;
    read.iter()
        .try_for_each(|captured| args.scale.fits(captured.skeleton.image_size))?;
    let all: Vec<Analysed> = read
        .iter()
        .zip(&names)
        .map(|(captured, name)| analysed(args, captured, name))
        .collect::<Result<_, _>>()?;
    let (studies, answers): (Vec<Study>, Vec<_>) = all
        .into_iter()
        .map(|a| (a.study, (a.sway, a.differs)))
        .unzip();
    let comparison = compare(&studies, args.trees.same());
    if comparison.as_ref().is_some_and(|c| c.same_tree.is_none()) {
        say(
            "arborcam: warning: nothing is compared: it cannot be told whether these are films of one tree; say --trees same or different",
        );
    }
    let told = if args.json {
        format!("{}\n", json(&studies, comparison.as_ref()))
    } else {
        text(&studies, comparison.as_ref(), columns().map(usize::from))
    };
    print(&told)?;
    let stop = stop.while_writing();
    let mut failures: Vec<ExportError> = Vec::new();
    if !args.no_write {
        for (dir, (sway, differs)) in args.dirs.iter().zip(&answers) {
            match put_into(dir, sway, stop) {
                Ok(()) if *differs && dir.join("tree.glb").exists() => say(&stale(dir)),
                Ok(()) => {}
                Err(e) => failures.push(e),
            }
        }
    }
    if let Some(path) = &args.report {
        let html = page(&studies, comparison.as_ref());
        match put_beside(path, html, stop) {
            Ok(()) => say(&format!("report:  {}", path.display())),
            Err(e) => failures.push(e),
        }
    }
    if failures.iter().any(|e| matches!(e, ExportError::Stopped)) {
        return Err(Ended::Stopped);
    }
    match failures.pop() {
        None => Ok(()),
        Some(last) => {
            failures.iter().for_each(|e| say(&format!("arborcam: {e}")));
            Err(Ended::Failed(last.into()))
        }
    }
}

fn analysed(args: &AnalyzeArgs, captured: &Captured, name: &str) -> Result<Analysed, Ended> {
    let mut own = captured.note.config.clone();
    // What its tables are in.
    own.export.metres_per_px = captured.metres_per_px();
    let config = args.config(&own)?;
    let dynamics = &config.dynamics;
    // As at the end of a capture: points do not live for ever, and of those that are gone nothing
    // is said.
    let chosen = args.from.is_some() || args.to.is_some();
    let longest_s = if chosen { LONGEST_S } else { dynamics.window_s };
    let film = captured.tracked_within(longest_s, args.within_s())?;
    let mut notes: Vec<String> = captured.note.warnings.clone();
    let mut tell = |kind: &str, what: String| {
        say(&format!("arborcam: {kind}: {name}: {what}"));
        notes.push(what);
    };
    captured
        .warnings
        .iter()
        .for_each(|what| tell("warning", what.clone()));
    let ends = film
        .times_s
        .first()
        .copied()
        .zip(film.times_s.last().copied());
    let [from_s, to_s] = ends.map_or([0.0; 2], |(a, b)| [a, b]);
    let duration_s = captured.note.timing.duration_s;
    if let Some(from) = args
        .from
        .filter(|from| film.times_s.is_empty() && *from > duration_s)
    {
        let what = format!(
            "--from {from} is after the end of {name}, which is {duration_s:.1} s long; choose an earlier part"
        );
        return Err(Ended::BadUsage(anyhow!(what)));
    }
    let wanted_s = args.to.map_or(duration_s, |to| to.min(duration_s)) - args.from.unwrap_or(0.0);
    if wanted_s > longest_s + 1.0 {
        let (kind, what) = match chosen {
            true => (
                "warning",
                format!(
                    "the film is longer than {LONGEST_S:.0} s; its end is analysed; choose another part"
                ),
            ),
            false => (
                "note",
                format!(
                    "of {duration_s:.0} s of film the last {longest_s:.0} (dynamics.window_s) are analysed; choose others"
                ),
            ),
        };
        tell(kind, format!("{what} with --from and --to"));
    }
    // Nothing was measured on copies.
    let skeleton = Skeleton {
        nodes: captured.skeleton.nodes[..captured.skeleton.measured()].to_vec(),
        ..(*captured.skeleton).clone()
    };
    let progress = Progress::begin(name, skeleton.nodes.len().saturating_sub(1));
    let analysis = analyse(&skeleton, &film, dynamics, Depth::Full, &CancelToken::new());
    drop(progress);
    let given = dynamics.excitation != Excited::Auto;
    hints(&film, &analysis, given)
        .into_iter()
        .for_each(|what| tell("note", what));
    let mut poses = Vec::new();
    let all = captured.film().map(|film| {
        film.filter(|p| {
            p.as_ref()
                .map_or(true, |p| from_s <= p.time_s && p.time_s <= to_s)
        })
        .try_for_each(|pose| {
            let mut pose = pose?;
            pose.joints.truncate(skeleton.nodes.len());
            poses.push(pose);
            Ok(())
        })
    });
    if let Err(e) = all.and_then(|done| done) {
        tell(
            "warning",
            format!("there are no plots of angles and spectra: {e}"),
        );
        poses.clear();
    }
    let picture = captured.picture.as_ref().filter(|_| args.report.is_some());
    let picture = picture.and_then(|p| data_address(&p.rgb).ok());
    let outline_px = captured
        .note
        .outline
        .as_ref()
        .map_or(&[][..], |o| &o.polygon_px);
    let excitation = match dynamics.excitation {
        Excited::Auto => None,
        Excited::Release => Some(Excitation::Release),
        Excited::Wind => Some(Excitation::Wind),
    };
    let study = Study::of(&Given {
        name,
        source: &captured.note.source.name,
        skeleton: &skeleton,
        film: &film,
        poses: &poses,
        analysis: &analysis,
        excitation,
        metres_per_px: config.export.metres_per_px,
        highest_hz: dynamics.highest_hz,
        outline_px,
        picture: picture.as_deref(),
        notes: &notes,
    });
    let differs = captured
        .sway
        .iter()
        .zip(&analysis.sway)
        .any(|(old, new)| differs(old, new));
    let mut sway: BTreeMap<NodeName, Swaying> = skeleton
        .nodes
        .iter()
        .map(|n| n.name)
        .zip(analysis.sway)
        .collect();
    for branch in &study.branches {
        // The file says what the table says.
        if let Some(Ok(sway)) = sway.get_mut(&NodeName(branch.name)) {
            sway.amplitude_deg = branch.amplitude_deg;
        }
    }
    Ok(Analysed {
        study,
        sway,
        differs,
    })
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
    let parts = |dir: &PathBuf| -> Vec<String> {
        let dir = std::path::absolute(dir).unwrap_or_else(|_| dir.clone());
        let dir = dir.canonicalize().unwrap_or(dir);
        dir.components()
            .map(|c| c.as_os_str().to_string_lossy().into_owned())
            .collect()
    };
    let all: Vec<Vec<String>> = dirs.iter().map(parts).collect();
    let end = |parts: &[String], n: usize| parts[parts.len().saturating_sub(n)..].join("/");
    let longest = all.iter().map(Vec::len).max().unwrap_or(1);
    let name = |parts: &Vec<String>| {
        let alone = |n: &usize| {
            all.iter()
                .filter(|other| end(other, *n) == end(parts, *n))
                .count()
                == 1
        };
        end(parts, (1..=longest).find(alone).unwrap_or(longest))
    };
    all.iter().map(name).collect()
}

fn print(text: &str) -> Result<(), Ended> {
    let mut out = std::io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    // Whoever closed standard output early has seen what they wanted.
    written
        .or_else(|e| {
            if e.kind() == std::io::ErrorKind::BrokenPipe {
                Ok(())
            } else {
                Err(e)
            }
        })
        .map_err(|e| Ended::Failed(anyhow!("cannot write to standard output: {e}")))
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
