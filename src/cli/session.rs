//! One capture or replay from the command line: open, run, show, report.

use super::camera::CameraArgs;
use super::common::Common;
use super::ended::{Ended, FAILED};
use super::hangup::{Reload, SighupAction};
use super::output::say;
use super::recording::{self, RecordOption};
use super::service::Service;
use super::supervisor::CaptureSupervisor;
use crate::config::Config;
use crate::files::OutputFolder;
use crate::outline::{self, OutlineSpec};
use crate::runtime::{self, Failure, Job, Pace, Running, Summary};
use crate::source::{Source, SourceError, SourceInfo};
use crate::tui;
use anyhow::anyhow;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::io::IsTerminal;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Time between two pictures, with and without a screen.
const PREVIEW_SCREEN: Duration = Duration::from_millis(80);
const PREVIEW_HEADLESS: Duration = Duration::MAX;

/// What a command captures from, and how.
pub struct Plan<'a> {
    pub input: &'a Path,
    pub fps: Option<f64>,
    /// `None`: live if the source is, else at its own pace.
    pub pace: Option<Pace>,
    pub record: &'a RecordOption,
    /// The arguments on the camera, for a command that films.
    pub camera: Option<&'a CameraArgs>,
}

impl Plan<'_> {
    /// A camera cannot be slowed down or sped up, whatever the command.
    fn pace(&self, live: bool) -> Pace {
        if live {
            return Pace::Live;
        }
        self.pace.unwrap_or(Pace::Recorded)
    }
}

/// Runs a capture from the first frame to the last line.
pub fn run(common: &Common, plan: Plan) -> Result<(), Ended> {
    let config = common.config(plan.camera)?;
    let headless = common.headless || common.stream.is_some();
    refuse_unfit(common, &plan, headless)?;
    let source = runtime::open(plan.input, &config.camera, plan.fps).map_err(no_input)?;
    let job = job(common, &plan, config, &*source, headless)?;
    let action = SighupAction::of_this_process();
    let stop = stop_on_signals(action == SighupAction::Stop)?;
    if headless {
        warn_of_other_format(&source.describe());
    }
    warn_of_no_output(common, headless);
    init_log(headless);
    let reload = Reload::new(common, plan.camera, &job.config, action)
        .map_err(|e| Ended::Failed(e.into()))?;
    let service = Service::from_env(job.config.camera.timeout_s);
    let running = runtime::start(source, job)?;
    let mut supervisor = CaptureSupervisor {
        running: &running,
        reload,
        service,
        end_s: common.for_s.unwrap_or(f64::INFINITY),
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
    for line in messages {
        say(&format!("arborcam: {line}"));
    }
    report(summary.as_ref(), failure, stop.load(Ordering::SeqCst))
}

/// Refuses, before anything is filmed, arguments that could not be followed in the end.
fn refuse_unfit(common: &Common, plan: &Plan, headless: bool) -> Result<(), Ended> {
    if !headless && !std::io::stdout().is_terminal() {
        return Err(Ended::BadUsage(tui::TuiError::NoTerminal(None).into()));
    }
    common.shape.refuse_drawn()?;
    if let Some(dir) = &common.out {
        // Created and dropped: nothing of it is left.
        OutputFolder::create(dir).map_err(|e| Ended::Failed(e.into()))?;
        let unfinished = runtime::unfinished_dir(dir);
        if unfinished.exists() {
            return Err(Failure::UnfinishedIsThere { dir: unfinished }.into());
        }
    }
    plan.record.refuse_unfit()
}

/// What is to be done with this source.
///
/// # Errors
/// A file in the arguments is for a picture of another size, or cannot be read.
fn job(
    common: &Common,
    plan: &Plan,
    config: Config,
    source: &dyn Source,
    headless: bool,
) -> Result<Job, Ended> {
    let info = source.describe();
    common.shape.fits(info.size)?;
    common.scale.fits(info.size)?;
    let outline = match &common.outline {
        OutlineSpec::Auto => None,
        OutlineSpec::File(path) => {
            Some(outline::load(path, info.size).map_err(|e| Ended::BadUsage(e.into()))?)
        }
    };
    Ok(Job {
        config,
        outline,
        pace: plan.pace(info.live),
        stream: common.stream.map(|_| Box::new(std::io::stdout()) as _),
        out: common.out.clone(),
        record: plan.record.target(source),
        preview_every: if headless {
            PREVIEW_HEADLESS
        } else {
            PREVIEW_SCREEN
        },
    })
}

/// Says so if the camera does not give what it was asked for.
pub fn warn_of_other_format(info: &SourceInfo) {
    if info.live && info.format.asked != info.format.given {
        say(&format!(
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
    say(&format!(
        "arborcam: warning: without --out nothing is written{but}"
    ));
}

/// Messages that are still to be printed; all of them after a screen, which has shown them only as
/// long as it was there.
fn last_messages(running: &Running, headless: bool) -> Vec<String> {
    if headless {
        return running.news();
    }
    let warnings = running.warnings();
    warnings.iter().map(|w| format!("warning: {w}")).collect()
}

/// A flag that is set when the user or the system asks for the end; by SIGHUP as well if
/// `by_hangup`.
pub fn stop_on_signals(by_hangup: bool) -> Result<Arc<AtomicBool>, Ended> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM]
        .into_iter()
        .chain(by_hangup.then_some(SIGHUP))
    {
        // Twice the same signal ends at once, without a capture: a disk that hangs must not make
        // the program immortal.
        signal_hook::flag::register_conditional_shutdown(signal, i32::from(FAILED), stop.clone())
            .and_then(|_| signal_hook::flag::register(signal, stop.clone()))
            .map_err(|e| Ended::Failed(e.into()))?;
    }
    Ok(stop)
}

pub fn no_input(e: SourceError) -> Ended {
    Ended::NoInput(e.into())
}

/// Messages to standard error where there is no screen that they would spoil.
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

/// The closing lines, and the exit status.
fn report(summary: Option<&Summary>, failure: Option<Failure>, stopped: bool) -> Result<(), Ended> {
    if let Some(s) = summary {
        for line in closing_lines(s) {
            say(&line);
        }
        if let Some(recorded) = &s.recorded {
            say(&recording::closing_line(recorded, s.not_recorded));
        }
    }
    match failure {
        // Not one frame: there was no usable camera, whatever it said when it was opened.
        Some(Failure::Source(e)) if summary.is_none_or(|s| s.frames == 0) => Err(no_input(e)),
        Some(failure) => Err(failure.into()),
        None if stopped => Err(Ended::Stopped),
        // Tracks alone are not what was asked for; a script that looks for tree.glb is to
        // learn it from the status.
        None => match summary.filter(|s| s.tree.is_none()) {
            Some(s) => Err(Ended::Failed(no_tree(s))),
            None => Ok(()),
        },
    }
}

fn no_tree(s: &Summary) -> anyhow::Error {
    if s.moving >= crate::solve::LEAST_MOVING {
        return anyhow!(
            "no tree: {} points moved, but not enough to tell branches apart (accumulation {:.2}); film for longer, at \
             least ten seconds, or in more wind",
            s.moving,
            s.accumulation
        );
    }
    anyhow!(
        "no tree: {} points moved, and at least {} must; wait for wind, come nearer, keep the \
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
        "tree: {nodes} nodes (from {points} moving points) and {copies} copies, {when} at {:.1} s (accumulation \
         {:.2}){refined}",
        first.time_s, first.measure
    )
}
