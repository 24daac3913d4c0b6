//! One capture or replay from the command line: open, run, show, report.

use super::hangup::{Hangup, Reload};
use super::recording::{self, RecordOption};
use super::service::Service;
use super::{Common, Ended, say};
use crate::config::Config;
use crate::files::OutputFolder;
use crate::model::{Control, Snapshot};
use crate::outline::{self, OutlineSpec};
use crate::runtime::{self, Failure, Job, Pace, Running, Summary};
use crate::source::{self, SourceError};
use crate::tui;
use anyhow::anyhow;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::io::IsTerminal;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Time between two looks at a capture without a screen.
const HEADLESS_TICK: Duration = Duration::from_millis(20);
/// Time between two pictures, with and without a screen.
const PREVIEW_SCREEN: Duration = Duration::from_millis(80);
const PREVIEW_HEADLESS: Duration = Duration::MAX;

/// What is worked off, and how.
pub struct Plan<'a> {
    pub input: &'a Path,
    pub fps: Option<f64>,
    /// `None`: live if the source is, else at its own pace.
    pub pace: Option<Pace>,
    pub record: &'a RecordOption,
    /// What the command's own arguments change of the settings.
    pub set: &'a dyn Fn(&mut Config),
}

/// Runs a capture from the first frame to the last line.
pub fn run(common: &Common, plan: Plan) -> Result<(), Ended> {
    let config = common
        .config(plan.set)
        .map_err(|e| Ended::BadUsage(e.into()))?;
    let headless = common.headless || common.stream.is_some();
    if !headless && !std::io::stdout().is_terminal() {
        return Err(Ended::BadUsage(tui::TuiError::NoTerminal(None).into()));
    }
    common.shape.refuse_drawn()?;
    refuse_unfit_out(common.out.as_deref())?;
    plan.record.refuse_unfit()?;
    let source = source::open(plan.input, &config.camera, plan.fps).map_err(no_input)?;
    let info = source.describe();
    common.shape.fits(info.size)?;
    common.scale.fits(info.size)?;
    let outline = match &common.outline {
        OutlineSpec::Auto => None,
        OutlineSpec::File(path) => {
            Some(outline::load(path, info.size).map_err(|e| Ended::BadUsage(e.into()))?)
        }
    };
    let own_pace = if info.live {
        Pace::Live
    } else {
        Pace::Recorded
    };
    let job = Job {
        config,
        outline,
        // A camera cannot be slowed down or hurried, whatever the command.
        pace: plan.pace.filter(|_| !info.live).unwrap_or(own_pace),
        stream: common.stream.map(|_| Box::new(std::io::stdout()) as _),
        out: common.out.clone(),
        record: plan.record.target(&*source),
        preview_every: if headless {
            PREVIEW_HEADLESS
        } else {
            PREVIEW_SCREEN
        },
    };
    let hangup = Hangup::of_this_process();
    let stop = stop_on_signals(hangup == Hangup::Stop)?;
    if headless && info.live && info.format.asked != info.format.given {
        say(&format!(
            "arborcam: asked for {}, the camera gives {}",
            info.format.asked, info.format.given
        ));
    }
    if common.out.is_none() && common.stream.is_none() {
        let but = if headless {
            ""
        } else {
            " but what key e exports"
        };
        say(&format!(
            "arborcam: warning: without --out nothing is written{but}"
        ));
    }
    init_log(headless);
    let reload = Reload::new((common, plan.set), &job.config, hangup)
        .map_err(|e| Ended::Failed(e.into()))?;
    let service = Service::from_env(job.config.camera.timeout_s);
    let running = runtime::start(source, job)?;
    let mut warden = Warden {
        running: &running,
        reload,
        service,
        end_s: common.for_s.unwrap_or(f64::INFINITY),
    };
    let watched = if headless {
        watch(&mut warden, &stop)
    } else {
        show(&mut warden, &stop)
    };
    // A screen has shown its messages only as long as it was there.
    let left = if headless {
        running.news()
    } else {
        running
            .warnings()
            .iter()
            .map(|w| format!("warning: {w}"))
            .collect()
    };
    let (summary, failure) = running.join();
    watched?;
    for line in left {
        say(&format!("arborcam: {line}"));
    }
    report(summary.as_ref(), failure, stop.load(Ordering::SeqCst))
}

/// Set when the user or the system asks us to end; by a hang-up as well, if so wanted.
pub fn stop_on_signals(by_hangup: bool) -> Result<Arc<AtomicBool>, Ended> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM]
        .into_iter()
        .chain(by_hangup.then_some(SIGHUP))
    {
        // Twice the same signal ends at once, without a capture: a disk that hangs must not make
        // the program immortal.
        signal_hook::flag::register_conditional_shutdown(
            signal,
            i32::from(super::FAILED),
            stop.clone(),
        )
        .and_then(|_| signal_hook::flag::register(signal, stop.clone()))
        .map_err(|e| Ended::Failed(e.into()))?;
    }
    Ok(stop)
}

pub fn no_input(e: SourceError) -> Ended {
    Ended::NoInput(e.into())
}

/// Told before anything is filmed, not after: that the folder exists, or may not be made.
fn refuse_unfit_out(out: Option<&Path>) -> Result<(), Ended> {
    // Made and dropped: nothing of it is left.
    out.map_or(Ok(()), |dir| OutputFolder::create(dir).map(drop))
        .map_err(|e| Ended::Failed(e.into()))
}

/// Looks after a capture from outside, with and without a screen: its length, its settings, its
/// service manager.
struct Warden<'a> {
    running: &'a Running,
    reload: Reload<'a>,
    service: Option<Service>,
    /// Sensor time of the capture at which it ends, s.
    end_s: f64,
}

impl Warden<'_> {
    /// Newest state, if there is a new one.
    fn look(&mut self) -> Option<Arc<Snapshot>> {
        let snapshot = self.running.latest();
        if snapshot.as_ref().is_some_and(|s| s.time_s >= self.end_s) {
            self.running.end();
        }
        if self.reload.is_wanted() {
            match &self.service {
                Some(service) => service.reloading(|| self.reload.fulfil(self.running)),
                None => self.reload.fulfil(self.running),
            }
            if let Some(service) = &self.service {
                service.warn_of_limit(self.reload.camera().timeout_s);
            }
        }
        if let Some(service) = &mut self.service {
            service.tick(self.running, snapshot.as_deref());
        }
        snapshot
    }
}

fn watch(warden: &mut Warden, stop: &AtomicBool) -> Result<(), Ended> {
    let progress = tui::Progress::new();
    while !warden.running.finished() {
        if stop.load(Ordering::SeqCst) {
            warden.running.stop();
        }
        for line in warden.running.news() {
            progress.tell(&format!("arborcam: {line}"));
        }
        if let Some(snapshot) = warden.look() {
            progress.update(&snapshot);
        }
        std::thread::sleep(HEADLESS_TICK);
    }
    progress.finish();
    Ok(())
}

fn show(warden: &mut Warden, stop: &AtomicBool) -> Result<(), Ended> {
    let shown = tui::run(warden, tui::Options::from_env(), stop);
    if shown.is_err() {
        warden.running.stop();
    }
    // The screen is gone; what is left is written without it.
    while !warden.running.finished() {
        warden.look();
        std::thread::sleep(HEADLESS_TICK);
    }
    shown.map_err(|e| Ended::BadUsage(e.into()))
}

impl tui::Session for Warden<'_> {
    fn latest(&mut self) -> Option<Arc<Snapshot>> {
        self.look()
    }

    fn send(&mut self, wish: Control) {
        self.running.send(wish);
    }

    fn finished(&self) -> bool {
        self.running.finished()
    }
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
        s.recorded
            .iter()
            .for_each(|recorded| say(&recording::closing_line(recorded, s.not_recorded)));
    }
    match failure {
        // Not one frame: there was no usable camera, whatever it said when it was opened.
        Some(Failure::Source(e)) if summary.is_none_or(|s| s.frames == 0) => Err(no_input(e)),
        Some(failure) => Err(failure.into()),
        None if stopped => Err(Ended::Stopped),
        // Tracks alone are not what was asked for; whoever looks for tree.glb is to learn it from
        // the status.
        None => match summary.filter(|s| s.tree.is_none()) {
            Some(s) => Err(Ended::Failed(no_tree(s))),
            None => Ok(()),
        },
    }
}

fn no_tree(s: &Summary) -> anyhow::Error {
    if s.moving >= crate::pipeline::LEAST_MOVING {
        return anyhow!(
            "no tree: {} points moved, but not enough to tell branches apart (accumulation {:.2}); film for longer, at \
             least ten seconds, or in more wind",
            s.moving,
            s.accumulation
        );
    }
    anyhow!(
        "no tree: {} points moved, and at least {} must; wait for wind, come nearer, keep the camera still, or draw the \
         outline closer (--outline)",
        s.moving,
        crate::pipeline::LEAST_MOVING
    )
}

fn closing_lines(s: &Summary) -> Vec<String> {
    let mut lines = vec![format!(
        "{} frames, {} points followed",
        s.frames, s.tracks_total
    )];
    if let Some(tree) = &s.tree {
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
        lines.push(format!(
            "tree: {nodes} nodes (from {points} moving points) and {copies} copies, {when} at {:.1} s (accumulation \
             {:.2}){refined}",
            first.time_s, first.measure
        ));
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
