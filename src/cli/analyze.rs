//! `arborcam analyze DIR...`: natural frequency and damping of every branch of a capture, and the
//! comparison of captures.

mod options;
mod written;

use super::command_error::CommandError;
use super::markers::MarkerFile;
use super::output::{eprint_line, print};
use super::stop::Stop;
use super::unused;
use crate::cancel::CancelToken;
use crate::config::{Config, ConfigError, Excited};
use crate::document::{Document, DocumentError, MarkedTree};
use crate::dynamics::{Depth, Film, Take, analyse};
use crate::export::picture::data_address;
use crate::files::check_place;
use crate::model::{Excitation, FilmCut, Lens, NodeName, Pose, Skeleton, Swaying, TreeMode};
use crate::report::{
    Comparison, Given, Study, angles_csv, compare, csv, hints, json, page, spectra_csv, text,
};
use crate::runtime::scales_differ;
use crate::tui::columns;
use crate::views::{SwayFound, update};
use anyhow::anyhow;
use nalgebra::Point2;
pub use options::AnalyzeArgs;
use options::{Content, FileAsked, LensProfile};
use std::collections::BTreeMap;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use written::{with_amplitudes, write_file};

/// Longest part of a film that is analysed if one is chosen, s; of a longer part the end is used.
/// Points of hours would fill the memory.
const MAX_PART_S: f64 = 600.0;
/// Points that end so long before the film were cut off, s.
const LEAST_CUT_S: f64 = 1.0;
/// A marker that was seen in less than this share of the frames is named.
const SELDOM_SEEN: f64 = 0.5;
/// And one that moves by less than this share of what markers do.
const STANDS_STILL: f64 = 0.02;
/// A frame is read within this share of the time to the next: times of frames jitter.
const LONGEST_READOUT: f64 = 1.1;

/// The analysis of one capture.
struct CaptureAnalysis {
    study: Study,
    found: Found,
}

/// The results for the tables of a capture.
struct Found {
    /// By node index.
    sway: Vec<Swaying>,
    /// Those of the whole tree.
    modes: Vec<TreeMode>,
    cut: Option<FilmCut>,
}

pub fn run(args: &AnalyzeArgs) -> Result<(), CommandError> {
    args.check()?;
    for file in args.files() {
        check_place(file.path)?;
    }
    let stop = Stop::on_signals()?;
    let names = names(&args.dirs);
    let documents = read_documents(args)?;
    let (mut studies, mut results) = (Vec::new(), Vec::new());
    for (document, name) in documents.iter().zip(&names) {
        let analysis = analyse_capture(args, document, name)?;
        studies.push(analysis.study);
        results.push(analysis.found);
    }
    let comparison = compare(&studies, args.trees.same());
    if let Some(warning) = comparison.as_ref().and_then(|c| warning(args, c)) {
        eprint_line(&format!("arborcam: warning: {warning}"));
    }
    print(&table(args, &studies, comparison.as_ref())?)?;
    let stop = stop.while_writing();
    let mut failures = Vec::new();
    if args.update {
        for (dir, found) in args.dirs.iter().zip(&results) {
            let found = SwayFound {
                sway: &found.sway,
                modes: &found.modes,
                cut: found.cut,
            };
            failures.extend(update(dir, found, stop).err().map(CommandError::from));
        }
    }
    for file in args.files() {
        let written = write_asked(file, &studies, comparison.as_ref(), stop);
        failures.extend(written.err());
    }
    combined(failures)
}

/// What the user should know of a comparison that is less than it could be. The CSV table does not
/// say by itself what was taken for one tree.
fn warning(args: &AnalyzeArgs, comparison: &Comparison) -> Option<&'static str> {
    match comparison.same_tree {
        None if args.csv => Some(
            "only the trunks are matched: it cannot be told whether these are films of one tree; \
             say --trees same or different",
        ),
        None => Some(
            "nothing is compared: it cannot be told whether these are films of one tree; say \
             --trees same or different",
        ),
        Some(false) if args.csv && !comparison.said => Some(
            "only the trunks are matched: by the places of their branches these are films of \
             different trees; if they are of one, say --trees same",
        ),
        Some(_) => None,
    }
}

/// Reads the trees of all captures before the first one is analysed: a mistyped name is reported at
/// once.
fn read_documents(args: &AnalyzeArgs) -> Result<Vec<Document>, CommandError> {
    let mut documents = Vec::with_capacity(args.dirs.len());
    if args.marker_file().is_some_and(MarkerFile::has_corrections) {
        unused::note(
            "corrections in the file of --markers",
            "they set places while a film is read; give the file to `replay`",
        );
    }
    for dir in &args.dirs {
        let document = match args.by_markers() {
            true => Document::for_markers(dir)?,
            false => Document::tree(dir)?,
        };
        let size = document.skeleton.image_size;
        args.scale.check_size(size)?;
        if args.marker_file().is_some_and(|file| file.size() != size) {
            unused::note(
                "the picture's size in the file of --markers, which is not that of the film,",
                "the file says which markers count and their parents; see that it is of this film",
            );
        }
        documents.push(document);
    }
    Ok(documents)
}

/// The text for standard output.
fn table(
    args: &AnalyzeArgs,
    studies: &[Study],
    comparison: Option<&Comparison>,
) -> Result<String, CommandError> {
    if args.csv {
        let bytes = csv(studies, comparison)?;
        return Ok(String::from_utf8_lossy(&bytes).into_owned());
    }
    if args.json {
        return Ok(format!("{}\n", json(studies, comparison)));
    }
    Ok(text(studies, comparison, columns().map(usize::from)))
}

/// Writes a file that is asked for, and prints where.
fn write_asked(
    file: FileAsked,
    studies: &[Study],
    comparison: Option<&Comparison>,
    stop: &AtomicBool,
) -> Result<(), CommandError> {
    let bytes = match file.content {
        Content::Report => page(studies, comparison).into_bytes(),
        Content::Angles => angles_csv(studies)?,
        Content::Spectra => spectra_csv(studies)?,
    };
    write_file(file.path, bytes, stop)?;
    let what = format!("{}:", file.content.word());
    eprint_line(&format!("{what:<9}{}", file.path.display()));
    Ok(())
}

/// The last failure becomes the error of the command; those before it are printed.
fn combined(mut failures: Vec<CommandError>) -> Result<(), CommandError> {
    if failures.iter().any(|e| matches!(e, CommandError::Stopped)) {
        return Err(CommandError::Stopped);
    }
    let Some(last) = failures.pop() else {
        return Ok(());
    };
    for failure in &failures {
        if let CommandError::Failed(e) | CommandError::BadUsage(e) | CommandError::NoInput(e) =
            failure
        {
            eprint_line(&format!("arborcam: {e}"));
        }
    }
    Err(last)
}

/// Warnings and notes on a capture; they are printed at once and go into its report.
struct Notes<'a> {
    name: &'a str,
    all: Vec<String>,
}

impl Notes<'_> {
    fn add(&mut self, kind: &str, what: String) {
        eprint_line(&format!("arborcam: {kind}: {}: {what}", self.name));
        // A capture may have said so before.
        if !self.all.contains(&what) {
            self.all.push(what);
        }
    }
}

/// Analyses one capture. Warnings and notes are printed, and go into its report.
fn analyse_capture(
    args: &AnalyzeArgs,
    document: &Document,
    name: &str,
) -> Result<CaptureAnalysis, CommandError> {
    let config = config_for(args, document)?;
    let mut notes = Notes {
        name,
        all: document.note.warnings.clone(),
    };
    for warning in &document.warnings {
        notes.add("warning", warning.clone());
    }
    if let Some(other) = other_scale(args, document) {
        notes.add("warning", other);
    }
    let marked = marked_tree(args, document, &config)?;
    if let Some(unsure) = marked.as_ref().and_then(unsure_parents) {
        notes.add("note", unsure);
    }
    if let Some(lost) = marked.as_ref().and_then(often_lost) {
        notes.add("warning", lost);
    }
    if let Some(still) = marked.as_ref().and_then(standing_still) {
        notes.add("note", still);
    }
    if args
        .marker_parents()
        .is_some_and(|given| given.iter().all(|m| m.parent.is_none()))
    {
        notes.add(
            "note",
            "no marker of the file has a parent, and all begin at the foot; with --markers alone parents follow \
             from the motion"
                .to_owned(),
        );
    }
    let camera = Optics::of(args, document)?;
    if let Some(undone) = camera.note(args) {
        notes.add("note", undone);
    }
    let filmed = film(args, document, marked.as_ref(), &config, &mut notes)?;
    if let Some(cut) = cut_off(&filmed, document).filter(|_| args.to.is_none()) {
        notes.add("warning", cut);
    }
    camera.refuse_long_readout(&filmed)?;
    let take = Take::of(camera.film(&filmed));
    if let Some(warning) = take.warning() {
        notes.add("warning", warning);
    }
    let film = &take.film;
    let skeleton = match &marked {
        Some(marked) => marked.skeleton.clone(),
        // Copies have no measured points.
        None => Skeleton {
            nodes: document.skeleton.nodes[..document.skeleton.measured()].to_vec(),
            ..(*document.skeleton).clone()
        },
    };
    let filmed_skeleton = skeleton;
    let skeleton = camera.skeleton(&filmed_skeleton);
    let progress = Progress::begin(name, skeleton.nodes.len().saturating_sub(1));
    let analysis = analyse(
        &skeleton,
        film,
        &config.dynamics,
        Depth::Full,
        &CancelToken::new(),
    );
    drop(progress);
    let is_excitation_given = config.dynamics.excitation != Excited::Auto;
    for hint in hints(film, &analysis, is_excitation_given) {
        notes.add("note", hint);
    }
    let poses = match &marked {
        Some(marked) => marked.poses(film, &skeleton),
        None => {
            let mut poses = poses_for_plots(document, film, skeleton.nodes.len(), &mut notes);
            camera.straighten(&mut poses, &filmed_skeleton);
            poses
        }
    };
    let picture = document.picture.as_ref().filter(|_| args.wants_report());
    let picture = picture.and_then(|p| data_address(&p.rgb).ok());
    let outline = document.note.outline.iter();
    let outline_px: Vec<Point2<i32>> = outline
        .flat_map(|o| &o.polygon_px)
        .map(|p| Point2::from(*p))
        .collect();
    let cut = take.cut();
    let note = &document.note;
    let renewed = note.judgement_with(&skeleton, &analysis.sway, &analysis.modes, cut);
    let renewed = renewed.filter(|_| args.update).map(|j| j.verdict);
    let mut study = Study::of(&Given {
        name,
        source: &document.note.source.name,
        origin: &document.note.origin(),
        verdict: renewed.as_ref().or(document.note.verdict.as_ref()),
        skeleton: &skeleton,
        film,
        poses: &poses,
        analysis: &analysis,
        excitation: excitation(config.dynamics.excitation),
        metres_per_px: config.export.metres_per_px,
        highest_hz: config.dynamics.highest_hz,
        outline_px: &outline_px,
        picture: picture.as_deref(),
        notes: &notes.all,
    });
    if let Some(marked) = &marked {
        name_by_markers(&mut study, marked, !document.note.config.markers.find);
    }
    Ok(CaptureAnalysis {
        found: Found {
            modes: analysis.modes,
            sway: with_amplitudes(&skeleton, analysis.sway, &study),
            cut,
        },
        study,
    })
}

/// What a camera does to the points that it films, and is undone here.
struct Optics {
    lens: Option<Lens>,
    readout_s: f64,
    height_px: f64,
}

impl Optics {
    /// As the options say, for the pictures of a capture.
    ///
    /// # Errors
    /// The lens is for pictures of other proportions.
    fn of(args: &AnalyzeArgs, document: &Document) -> Result<Self, CommandError> {
        let size = document.skeleton.image_size;
        let lens = match &args.lens {
            None => None,
            Some(LensProfile { lens, .. }) => Some(lens.for_size(size).ok_or_else(|| {
                let profile = lens.size;
                CommandError::BadUsage(anyhow!(
                    "--lens is for pictures of the proportions {profile}, this film is {size}; give \
                     the profile of its own mode"
                ))
            })?),
        };
        let profile_s = lens.map_or(0.0, |lens| lens.readout_s);
        Ok(Self {
            lens,
            readout_s: args.readout_ms.map_or(profile_s, |ms| ms / 1000.0),
            height_px: f64::from(size.height),
        })
    }

    /// A frame is read before the next one begins.
    ///
    /// # Errors
    /// The rows are said to take longer.
    fn refuse_long_readout(&self, film: &Film) -> Result<(), CommandError> {
        let step_s = film.step_s();
        if step_s == 0.0 || self.readout_s <= LONGEST_READOUT * step_s {
            return Ok(());
        }
        Err(CommandError::BadUsage(anyhow!(
            "a frame cannot be read in {:.1} ms, for the next comes after {:.1} ms; give --readout-ms of this mode of \
             the camera",
            1000.0 * self.readout_s,
            1000.0 * step_s
        )))
    }

    /// What is said of it; `None` where nothing is undone.
    fn note(&self, args: &AnalyzeArgs) -> Option<String> {
        let mut undone = Vec::new();
        if let Some(LensProfile { file, .. }) = &args.lens {
            undone.push(format!("points are put where no lens distorts ({file})"));
        }
        if self.readout_s > 0.0 {
            let readout_ms = 1000.0 * self.readout_s;
            undone.push(format!(
                "rows count as read one after the other within {readout_ms:.1} ms"
            ));
        }
        (!undone.is_empty()).then(|| undone.join("; "))
    }

    fn film(&self, film: &Film) -> Film {
        let timed = match self.readout_s > 0.0 {
            true => film.at_middle_rows(self.readout_s, self.height_px),
            false => film.clone(),
        };
        match &self.lens {
            Some(lens) => timed.moved(|at_px| lens.undistorted(at_px)),
            None => timed,
        }
    }

    fn skeleton(&self, skeleton: &Skeleton) -> Skeleton {
        match &self.lens {
            Some(lens) => lens.straighten(skeleton),
            None => skeleton.clone(),
        }
    }

    fn straighten(&self, poses: &mut [Pose], skeleton: &Skeleton) {
        if let Some(lens) = &self.lens {
            for pose in poses {
                lens.straighten_pose(pose, skeleton);
            }
        }
    }
}

/// The tree of the markers, where they are analysed.
fn marked_tree(
    args: &AnalyzeArgs,
    document: &Document,
    config: &Config,
) -> Result<Option<MarkedTree>, DocumentError> {
    if !args.by_markers() {
        return Ok(None);
    }
    let longest_s = longest_s(args, config);
    let marked = document.marked_tree(args.marker_parents(), longest_s, args.within_s())?;
    Ok(Some(marked))
}

/// What is to be said of markers that were not seen for much of the film.
fn often_lost(marked: &MarkedTree) -> Option<String> {
    let seldom = marked.seldom_seen(SELDOM_SEEN);
    let each: Vec<String> = seldom
        .iter()
        .map(|marker| format!("{} in {}", marker.name, marker.seen))
        .collect();
    (!each.is_empty()).then(|| {
        format!(
            "of {} frames markers were seen in few ({}), and what they and those on them say is of those frames \
             alone; correct their places in markers.json and replay the film",
            marked.film.times_s.len(),
            each.join(", ")
        )
    })
}

/// The warning where the user gives a scale that is not that of the capture.
fn other_scale(args: &AnalyzeArgs, document: &Document) -> Option<String> {
    let (own, given) = (document.metres_per_px(), args.scale.metres_per_px()?);
    let is_other = own > 0.0 && scales_differ(given, own);
    is_other.then(|| {
        format!(
            "a pixel is {given:.5} m long by the given scale, and {own:.5} m by the capture; the given one counts: see \
             that it is right"
        )
    })
}

/// What is to be said of markers that hardly move: one may be no marker, and not on the tree.
fn standing_still(marked: &MarkedTree) -> Option<String> {
    let still = marked.standing(STANDS_STILL);
    let first = still.first()?;
    let names: Vec<&str> = still.iter().map(|marker| marker.name.as_str()).collect();
    Some(format!(
        "markers that hardly move, {} by {:.1} px where markers move by {:.1} px: {}; if one is not on the tree, leave \
         it out with a file of the others, --markers=FILE",
        first.name,
        first.moves_px,
        first.usual_px,
        names.join(", ")
    ))
}

/// What is to be said of markers whose parents follow from the motion, but not for certain.
fn unsure_parents(marked: &MarkedTree) -> Option<String> {
    let (whose, them) = match marked.unsure.len() {
        0 => return None,
        1 => ("the parent of marker", "it"),
        _ => ("the parents of markers", "them"),
    };
    let which = marked.unsure.join(", ");
    Some(format!(
        "{whose} {which} cannot be told for certain from place and motion; see what carries {them}, and give parents \
         with --markers=FILE"
    ))
}

/// Calls the branches as the markers are called in which they end, and so in the modes; a limb of several as the first
/// of them. Markers that were found without the user have names by chance, which are no evidence across captures.
fn name_by_markers(study: &mut Study, marked: &MarkedTree, are_given: bool) {
    study.by_markers = true;
    let mut marker_of: BTreeMap<String, &String> = BTreeMap::new();
    for branch in &mut study.branches {
        if let Some(name) = marked.names.get(&NodeName(branch.name)) {
            branch.marker = are_given.then(|| name.clone());
            let piece = std::mem::replace(&mut branch.piece, name.clone());
            marker_of.insert(piece, name);
        }
    }
    for mode in &mut study.modes {
        mode.branch = mode.node.and_then(|node| marked.names.get(&node).cloned());
        for part in &mut mode.energy {
            call_as_marker(&mut part.limb, &marker_of);
        }
    }
    for branch in &mut study.branches {
        for part in &mut branch.participation {
            if let Some(name) = &mut part.branch {
                call_as_marker(name, &marker_of);
            }
        }
    }
}

/// Calls a limb as the marker that it has, if any.
fn call_as_marker(limb: &mut String, marker_of: &BTreeMap<String, &String>) {
    if let Some(name) = marker_of.get(limb.as_str()) {
        limb.clone_from(name);
    }
}

/// Length of film that is analysed at most, s.
fn longest_s(args: &AnalyzeArgs, config: &Config) -> f64 {
    match args.from.is_some() || args.to.is_some() {
        true => MAX_PART_S,
        false => config.dynamics.window_s,
    }
}

/// The settings for a capture: command line over configuration file over those of the capture.
fn config_for(args: &AnalyzeArgs, document: &Document) -> Result<Config, ConfigError> {
    let mut own = document.note.config.clone();
    // The unit of its tables.
    own.export.metres_per_px = document.metres_per_px();
    args.config(&own)
}

fn excitation(setting: Excited) -> Option<Excitation> {
    match setting {
        Excited::Auto => None,
        Excited::Release => Some(Excitation::Release),
        Excited::Wind => Some(Excitation::Wind),
    }
}

/// What is said of points that end before the film does, though not all of them were lost.
fn cut_off(film: &Film, document: &Document) -> Option<String> {
    let note = &document.note;
    let (last_s, duration_s) = (*film.times_s.last()?, note.timing.duration_s);
    let is_cut = duration_s - last_s > LEAST_CUT_S && note.quality.tracks_alive_end > 0;
    is_cut.then(|| {
        format!(
            "its points end at {last_s:.1} s, and the film at {duration_s:.1} s: tracks.csv was cut off; what follows \
             is of a part of the film"
        )
    })
}

/// The tracked points to analyse. As at the end of a capture these are the points of the last
/// seconds, because points are lost and replaced in the course of a film.
fn film(
    args: &AnalyzeArgs,
    document: &Document,
    marked: Option<&MarkedTree>,
    config: &Config,
    notes: &mut Notes,
) -> Result<Film, CommandError> {
    let chosen = args.from.is_some() || args.to.is_some();
    let longest_s = longest_s(args, config);
    let film = match marked {
        Some(marked) => marked.film.clone(),
        None => document.tracked_within(longest_s, args.within_s())?,
    };
    let duration_s = document.note.timing.duration_s;
    if let Some(from) = args.from
        && film.times_s.is_empty()
        && from > duration_s
    {
        return Err(CommandError::BadUsage(anyhow!(
            "--from {from} is after the end of {}, which is {duration_s:.1} s long; choose an \
             earlier part",
            notes.name
        )));
    }
    let to_s = args.to.map_or(duration_s, |to| to.min(duration_s));
    if to_s - args.from.unwrap_or(0.0) <= longest_s + 1.0 {
        return Ok(film);
    }
    if chosen {
        notes.add(
            "warning",
            format!(
                "the film is longer than {MAX_PART_S:.0} s; its end is analysed; choose another \
                 part with --from and --to"
            ),
        );
    } else {
        notes.add(
            "note",
            format!(
                "of {duration_s:.0} s of film the last {longest_s:.0} (dynamics.window_s) are \
                 analysed; choose others with --from and --to"
            ),
        );
    }
    Ok(film)
}

/// The poses of the first `nodes` nodes in the time of `film`. Without them there are no plots, and
/// a warning is added.
fn poses_for_plots(document: &Document, film: &Film, nodes: usize, notes: &mut Notes) -> Vec<Pose> {
    match poses_of(document, film, nodes) {
        Ok(poses) => poses,
        Err(e) => {
            let why = format!("there are no plots of angles and spectra: {e}");
            notes.add("warning", why);
            Vec::new()
        }
    }
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

/// A line on the terminal while a capture is analysed; erased when this is dropped.
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

/// Names of the captures: the ends of their paths, as short as possible, but all different. A
/// folder that is given again has its turn after its name.
fn names(dirs: &[PathBuf]) -> Vec<String> {
    let all: Vec<Vec<String>> = dirs.iter().map(|dir| parts(dir)).collect();
    let longest = all.iter().map(Vec::len).max().unwrap_or(1);
    let mut names = Vec::with_capacity(all.len());
    for (k, own) in all.iter().enumerate() {
        let mut length = 1;
        while length < longest && is_shared(&all, own, length) {
            length += 1;
        }
        let before = all[..k].iter().filter(|other| *other == own).count();
        names.push(match before {
            0 => end(own, length),
            n => format!("{}#{}", end(own, length), n + 1),
        });
    }
    names
}

/// The components of the absolute path of `dir`.
fn parts(dir: &Path) -> Vec<String> {
    let dir = std::path::absolute(dir).unwrap_or_else(|_| dir.to_owned());
    let dir = dir.canonicalize().unwrap_or(dir);
    dir.components()
        .map(|c| c.as_os_str().to_string_lossy().into_owned())
        .collect()
}

/// The last `length` components of a path.
fn end(parts: &[String], length: usize) -> String {
    parts[parts.len().saturating_sub(length)..].join("/")
}

/// Whether another path has the same last `length` components as `own`.
fn is_shared(all: &[Vec<String>], own: &[String], length: usize) -> bool {
    all.iter()
        .any(|other| other != own && end(other, length) == end(own, length))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names_of(dirs: &[&str]) -> Vec<String> {
        let dirs: Vec<PathBuf> = dirs.iter().map(PathBuf::from).collect();
        names(&dirs)
    }

    #[test]
    fn captures_of_one_name_are_told_apart_by_where_they_lie() {
        assert_eq!(
            names_of(&["/x/calm/oak", "/x/storm/oak/", "/x/elm"]),
            ["calm/oak", "storm/oak", "elm"]
        );
        assert_eq!(names_of(&["/x/oak"]), ["oak"]);
        assert_eq!(
            names_of(&["/x/oak", "/y/elm", "/x/oak"]),
            ["oak", "elm", "oak#2"]
        );
    }
}
