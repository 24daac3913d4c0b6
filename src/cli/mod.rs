//! The commands: one file each. Here, the command line as a whole, and the exit status.

mod analyze;
mod animate;
mod camera;
mod capture;
mod common;
mod devices;
mod doctor;
mod ended;
mod export;
mod finish;
mod hangup;
mod idle;
mod output;
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

use clap::{Parser, Subcommand};
use ended::{BAD_USAGE, Ended, FAILED, NO_INPUT, STOPPED};
use output::say;
use std::process::ExitCode;

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
