//! One run of `capture` or `replay`: opens the source, runs the capture, shows it, reports the end.

use super::camera::{CameraArgs, check_depth};
use super::command_error::CommandError;
use super::common::Common;
use super::hangup::{Reload, SighupAction};
use super::markers;
use super::output::eprint_line;
use super::recording::{self, RecordOption};
use super::service::Service;
use super::signals::stop_on_signals;
use super::supervisor::CaptureSupervisor;
use crate::config::Config;
use crate::files::OutputFolder;
use crate::outline::{self, OutlineSpec};
use crate::runtime::{self, Failure, Job, Pace, Running, Summary};
use crate::source::{Source, SourceInfo};
use crate::tui;
use anyhow::anyhow;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Interval of preview pictures with and without a screen.
const PREVIEW_SCREEN: Duration = Duration::from_millis(80);

/// What `capture` and `replay` run with, apart from their common arguments.
pub struct Plan<'a> {
    pub input: &'a Path,
    /// Rate of a folder of pictures, frames per second.
    pub fps: Option<f64>,
    /// `None`: live for a live source, else the source's own pace.
    pub pace: Option<Pace>,
    pub record: &'a RecordOption,
    /// The camera options, for a command that films.
    pub camera: Option<&'a CameraArgs>,
}

impl Plan<'_> {
    /// A live source is always processed live: it cannot be slowed down or sped up.
    fn pace(&self, live: bool) -> Pace {
        if live {
            return Pace::Live;
        }
        self.pace.unwrap_or(Pace::Recorded)
    }
}

/// Runs a capture from the first frame to the last message.
pub fn run(common: &Common, plan: Plan) -> Result<(), CommandError> {
    let config = common.config(plan.camera)?;
    let headless = common.headless || common.stream.is_some();
    check_arguments(common, &plan)?;
    let source = runtime::open(plan.input, &config, plan.fps).map_err(CommandError::no_input)?;
    check_terminal(headless)?;
    let job = job(common, &plan, config, &*source, headless)?;
    let action = SighupAction::of_this_process();
    let unfinished = common.out.as_deref().map(runtime::unfinished_dir);
    let stop = stop_on_signals(action == SighupAction::Stop, unfinished)?;
    if headless {
        warn_of_other_format(&source.describe());
    }
    warn_of_no_output(common, headless);
    init_log(headless);
    let reload =
        Reload::new(common, plan.camera, &job.config, action).map_err(CommandError::failed)?;
    let service = Service::from_env(job.config.camera.timeout_s);
    let running = runtime::start(source, job)?;
    let mut supervisor = CaptureSupervisor {
        running: &running,
        reload,
        service,
    };
    let watched = if headless {
        supervisor.watch(&stop);
        Ok(())
    } else {
        supervisor.show(&stop)
    };
    let messages = last_messages(&running, headless);
    let (summary, failure) = running.join();
    watched?;
    // Markers that cannot be followed end a run in its first frame: there is nothing else to say of it.
    if let Some(Failure::Markers(_)) = failure {
        return report(None, failure, stop.load(Ordering::SeqCst));
    }
    for line in messages {
        eprint_line(&format!("arborcam: {line}"));
    }
    report(summary.as_ref(), failure, stop.load(Ordering::SeqCst))
}

/// A screen needs a terminal.
fn check_terminal(headless: bool) -> Result<(), CommandError> {
    if headless || std::io::stdout().is_terminal() {
        return Ok(());
    }
    let why = tui::TuiError::NoTerminal(None);
    Err(CommandError::BadUsage(why.into()))
}

/// Checks, before anything is filmed, what would otherwise only fail at the end.
fn check_arguments(common: &Common, plan: &Plan) -> Result<(), CommandError> {
    common.shape.reject_image_envelope()?;
    common.notes.check()?;
    if let Some(dir) = &common.out {
        // Created only as a test; dropping it removes it.
        OutputFolder::create(dir).map_err(CommandError::failed)?;
        let unfinished = runtime::unfinished_dir(dir);
        if unfinished.exists() {
            return Err(Failure::UnfinishedIsThere { dir: unfinished }.into());
        }
    }
    plan.record.check()
}

/// The job of the runtime for this source.
///
/// # Errors
/// A file in the arguments cannot be read, or is for another picture size.
fn job(
    common: &Common,
    plan: &Plan,
    config: Config,
    source: &dyn Source,
    headless: bool,
) -> Result<Job, CommandError> {
    let info = source.describe();
    if let Some(camera) = plan.camera {
        check_depth(camera, &info)?;
    }
    common.shape.check_size(info.size)?;
    common.scale.check_size(info.size)?;
    common.strokes.check_size(info.size)?;
    common.markers.check_size(info.size)?;
    markers::check_in_picture(&config.markers, info.size)?;
    common.depth.check_size(info.size)?;
    common.depth.note_unused(&info);
    let outline = match &common.outline {
        OutlineSpec::Auto => None,
        OutlineSpec::File(path) => {
            Some(outline::load(path, info.size).map_err(CommandError::bad_usage)?)
        }
    };
    let notes = common.notes.over(source)?;
    Ok(Job {
        config,
        outline,
        pace: plan.pace(info.live),
        length_s: common.for_s,
        stream: common.stream.map(|_| Box::new(std::io::stdout()) as _),
        out: common.out.clone(),
        record: plan.record.target(source, &notes),
        notes,
        preview_every: (!headless).then_some(PREVIEW_SCREEN),
    })
}

/// Reports a camera format other than the requested one.
pub fn warn_of_other_format(info: &SourceInfo) {
    if info.live && info.format.asked != info.format.given {
        eprint_line(&format!(
            "arborcam: asked for {}, the camera gives {}",
            info.format.asked, info.format.given
        ));
    }
}

fn warn_of_no_output(common: &Common, headless: bool) {
    if common.out.is_some() || common.stream.is_some() {
        return;
    }
    let but = if headless {
        ""
    } else {
        " but what key e exports"
    };
    eprint_line(&format!(
        "arborcam: warning: without --out nothing is written{but}"
    ));
}

/// Messages still to be printed. After a screen these are all warnings again, because those on the
/// screen disappear with it.
fn last_messages(running: &Running, headless: bool) -> Vec<String> {
    if headless {
        return running.news();
    }
    let warnings = running.warnings();
    warnings.iter().map(|w| format!("warning: {w}")).collect()
}

/// Sends log messages to standard error, unless they would overwrite a screen on the terminal.
pub fn init_log(headless: bool) {
    if headless || !std::io::stderr().is_terminal() {
        let filter = tracing_subscriber::EnvFilter::try_from_env("ARBORCAM_LOG")
            .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("warn"));
        let _ = tracing_subscriber::fmt()
            .with_env_filter(filter)
            .with_writer(std::io::stderr)
            .with_ansi(std::io::stderr().is_terminal())
            .without_time()
            .try_init();
    }
}

/// Prints the closing lines, and returns the error that decides the exit status.
fn report(
    summary: Option<&Summary>,
    failure: Option<Failure>,
    stopped: bool,
) -> Result<(), CommandError> {
    if let Some(s) = summary {
        for line in closing_lines(s) {
            eprint_line(&line);
        }
        if let Some(recorded) = &s.recorded {
            eprint_line(&recording::closing_line(recorded, s.not_recorded));
        }
    }
    match failure {
        // No frame at all: the camera is not usable, although it could be opened.
        Some(Failure::Source(e)) if summary.is_none_or(|s| s.frames == 0) => {
            Err(CommandError::no_input(e))
        }
        Some(failure) => Err(failure.into()),
        None if stopped => Err(CommandError::Stopped),
        // Without a tree there is no tree.glb: scripts must see that in the exit status.
        None => match summary.filter(|s| s.tree.is_none()) {
            Some(s) => Err(CommandError::Failed(no_tree(s))),
            None => Ok(()),
        },
    }
}

fn no_tree(s: &Summary) -> anyhow::Error {
    if s.moving >= crate::solve::LEAST_MOVING {
        return anyhow!(
            "no tree: {} points moved, but not enough to tell branches apart (accumulation \
             {:.2}); film for longer, at least ten seconds, or in more wind",
            s.moving,
            s.accumulation
        );
    }
    anyhow!(
        "no tree: {} points moved by themselves, and at least {} must; wait for wind, come nearer, keep the \
         camera still, or draw the outline closer (--outline)",
        s.moving,
        crate::solve::LEAST_MOVING
    )
}

fn closing_lines(s: &Summary) -> Vec<String> {
    let mut lines = vec![format!(
        "{} frames, {} points followed",
        s.frames, s.tracks_total
    )];
    if let Some(tree) = &s.tree {
        lines.push(tree_line(tree));
    }
    if let Some(verdict) = &s.verdict {
        lines.push(verdict.labelled_line());
    }
    if let Some(written) = &s.written {
        let dir = written.dir.display();
        lines.push(match written.tree.is_some() {
            true => format!("capture: {dir}\nmodel:   {dir}/tree.glb"),
            false => format!("capture: {dir} (tracks only)"),
        });
    }
    lines
}

fn tree_line(tree: &crate::solve::Model) -> String {
    let (nodes, points) = (tree.skeleton.measured(), tree.skeleton.nodes[0].n_tracks);
    let copies = tree.skeleton.nodes.len() - nodes;
    let first = &tree.first;
    let when = if first.forced {
        "built early,"
    } else {
        "built"
    };
    let refined = match tree.refinements {
        0 => String::new(),
        1 => format!(", refined at {:.1} s", tree.time_s),
        n => format!(", refined {n} times until {:.1} s", tree.time_s),
    };
    format!(
        "tree: {nodes} nodes (from {points} moving points) and {copies} copies, {when} at {:.1} s \
         (accumulation {:.2}){refined}",
        first.time_s, first.measure
    )
}
