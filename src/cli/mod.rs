//! The commands: one file each. Here, what they have in common: arguments, exit status, messages.

mod analyze;
mod animate;
mod camera;
mod capture;
mod devices;
mod doctor;
mod export;
mod finish;
mod hangup;
mod idle;
mod play;
mod record;
mod recording;
mod render;
mod replay;
mod scale;
mod service;
mod session;
mod shape;
mod stop;
mod supervisor;
mod tree;

use crate::config::{Config, ConfigError};
use crate::outline::OutlineSpec;
use crate::runtime::Failure;
use camera::CameraArgs;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::io::{ErrorKind, Write};
use std::path::PathBuf;
use std::process::ExitCode;

/// Exit status of the contract.
const FAILED: u8 = 1;
const BAD_USAGE: u8 = 2;
const NO_INPUT: u8 = 3;
const STOPPED: u8 = 130;

/// Films a swaying tree and turns it, while it films, into a moving 3D tree.
#[derive(Debug, Parser)]
#[command(name = "arborcam", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Film with a camera, live.
    Capture(capture::CaptureArgs),
    /// The same from a recording, a video file or a folder of pictures.
    Replay(replay::ReplayArgs),
    /// Film into a recording (.mcap), frames only.
    Record(record::RecordArgs),
    /// Feed a v4l2loopback device from a recording or a video file; other programs see it as a
    /// camera.
    Play(play::PlayArgs),
    /// Draw a capture's tree: a picture (.png) or a video (.mp4).
    Render(render::RenderArgs),
    /// Write the tree of a capture as a file for other programs.
    Export(export::ExportArgs),
    /// Tell at what frequency every branch of a capture sways and how it is damped; compare
    /// captures.
    Analyze(analyze::AnalyzeArgs),
    /// Make a capture's tree move in a wind that nobody filmed, pull and release it, or magnify its
    /// motion.
    Animate(animate::AnimateArgs),
    /// Complete a capture whose run was cut, by a crash or a full disk.
    Finish(finish::FinishArgs),
    /// List the cameras that are plugged in.
    Devices(devices::DevicesArgs),
    /// Find out what is wrong with this machine, and what to do about it.
    Doctor(doctor::DoctorArgs),
}

/// What `capture` and `replay` share.
#[derive(Debug, Args)]
struct Common {
    /// Where the tree is: a JSON polygon, a mask image (white = tree), a scribble image (white =
    /// tree, black = background, rest grey or transparent), or `auto` to find it by its motion.
    #[arg(long, value_name = "FILE|auto", default_value = "auto")]
    outline: OutlineSpec,
    /// Folder for the result; it must not exist, and appears when it is complete.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Run without the terminal UI.
    #[arg(long)]
    headless: bool,
    /// Print each pose on standard output, as a line of JSON; implies --headless.
    #[arg(long, value_name = "FORMAT")]
    stream: Option<Stream>,
    /// Settings that differ from the defaults (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// End by itself after so many seconds of film.
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    for_s: Option<f64>,
    #[command(flatten)]
    scale: scale::ScaleArgs,
    #[command(flatten)]
    shape: shape::ShapeArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Stream {
    Ndjson,
}

impl Common {
    /// The file over the defaults, and over both what the command line says; `camera` are the
    /// arguments of a command that films.
    fn config(&self, camera: Option<&CameraArgs>) -> Result<Config, ConfigError> {
        Config::default().layered(self.config.as_deref(), |config| {
            self.scale.set(config);
            self.shape.set(config);
            if let Some(camera) = camera {
                camera.set(&mut config.camera);
            }
        })
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text
        .parse()
        .ok()
        .filter(|s: &f64| s.is_finite() && *s > 0.0);
    seconds.ok_or_else(|| "give a number of seconds above 0".to_owned())
}

/// Why a command did not end well; decides the exit status.
enum Ended {
    Failed(anyhow::Error),
    BadUsage(anyhow::Error),
    NoInput(anyhow::Error),
    Stopped,
}

impl From<ConfigError> for Ended {
    fn from(e: ConfigError) -> Self {
        Ended::BadUsage(e.into())
    }
}

impl From<Failure> for Ended {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::NothingDecoded(_) => Ended::NoInput(failure.into()),
            Failure::Recording(e) => recording::refused(e),
            other => Ended::Failed(other.into()),
        }
    }
}

/// Runs the command line.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(e) => return refused(&e),
    };
    match run(&cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(ended) => status(&ended),
    }
}

fn run(command: &Command) -> Result<(), Ended> {
    match command {
        Command::Capture(args) => capture::run(args),
        Command::Replay(args) => replay::run(args),
        Command::Record(args) => record::run(args),
        Command::Play(args) => play::run(args),
        Command::Render(args) => render::run(args),
        Command::Export(args) => export::run(args),
        Command::Analyze(args) => analyze::run(args),
        Command::Animate(args) => animate::run(args),
        Command::Finish(args) => finish::run(args),
        Command::Devices(args) => devices::run(args),
        Command::Doctor(args) => doctor::run(args),
    }
}

/// Says why a command did not end well, and gives the exit status of the contract.
fn status(ended: &Ended) -> ExitCode {
    let (status, error) = match ended {
        Ended::Failed(e) => (FAILED, e),
        Ended::BadUsage(e) => (BAD_USAGE, e),
        Ended::NoInput(e) => (NO_INPUT, e),
        Ended::Stopped => return ExitCode::from(STOPPED),
    };
    say(&format!("arborcam: {}", one_line(error)));
    ExitCode::from(status)
}

/// Arguments that clap does not take, in the form that all our errors have; or help and version,
/// which were asked for.
fn refused(e: &clap::Error) -> ExitCode {
    let text = e.render().to_string();
    match text.strip_prefix("error: ") {
        Some(what) => say(&format!("arborcam: {}", what.trim_end())),
        None => drop(e.print()),
    }
    if e.use_stderr() {
        ExitCode::from(BAD_USAGE)
    } else {
        ExitCode::SUCCESS
    }
}

/// The error with those of its causes that it does not quote already.
fn one_line(error: &anyhow::Error) -> String {
    let mut line = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !line.contains(&cause) {
            line = format!("{line}: {cause}");
        }
    }
    line.replace('\n', " ")
}

/// Writes `text` to standard output. A reader that closed it early has seen what it needed.
fn print(text: &str) -> Result<(), Ended> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Ended::Failed(e.into())),
        _ => Ok(()),
    }
}

/// A line on standard error; if nobody reads it any more, that is no reason to fail.
fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    /// Help texts that come from the settings are empty if the key is misspelt.
    #[test]
    fn every_option_has_a_help_text() {
        let cli = Cli::command();
        for command in cli.get_subcommands() {
            for option in command.get_arguments() {
                let text = option.get_help().map(ToString::to_string);
                assert!(
                    text.is_some_and(|text| !text.is_empty()),
                    "{} {}",
                    command.get_name(),
                    option.get_id()
                );
            }
        }
    }
}
