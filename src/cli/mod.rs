//! The commands, one file each. This file parses the command line and returns the exit status.

mod analyze;
mod animate;
mod calibrate;
mod camera;
mod capture;
mod cloud;
mod command_error;
mod common;
mod depth;
mod devices;
mod doctor;
mod example;
mod export;
mod finish;
mod forest;
mod grow;
mod hangup;
mod line;
mod markers;
mod note;
mod notes;
mod output;
mod photo;
mod plain;
mod play;
mod record;
mod recording;
mod render;
mod replay;
mod scale;
mod service;
mod session;
mod shape;
mod signals;
mod sketch;
mod stop;
mod strokes;
mod supervisor;
mod tree;
mod unused;

use crate::caught::print_only_uncaught;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use command_error::{BAD_USAGE, CommandError, FAILED, NO_INPUT, STOPPED};
use output::eprint_line;
use std::process::ExitCode;

/// Films a swaying tree and makes a moving 3D tree of it while it films.
#[derive(Debug, Parser)]
#[command(name = "arborcam", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Film a tree with a camera, live.
    Capture(capture::CaptureArgs),
    /// The same as `capture`, from a recording, a video file or a folder of pictures.
    Replay(replay::ReplayArgs),
    /// Record the frames of a camera to a file (.mcap), without making a tree.
    Record(record::RecordArgs),
    /// Play a recording or a video file to a v4l2loopback device, which other programs see as a
    /// camera.
    Play(play::PlayArgs),
    /// Draw the tree of a capture as a picture (.png) or a video (.mp4).
    Render(render::RenderArgs),
    /// Write the tree of a capture in a format of other programs.
    Export(export::ExportArgs),
    /// Estimate the natural frequency and damping of every branch of a capture; compare captures.
    Analyze(analyze::AnalyzeArgs),
    /// Animate the tree of a capture in simulated wind, pull and release it, or magnify its filmed
    /// motion.
    Animate(animate::AnimateArgs),
    /// Grow new trees that look and move like the tree of a capture.
    Grow(grow::GrowArgs),
    /// Make a tree of drawn strokes (.svg, .json).
    Sketch(sketch::SketchArgs),
    /// Make a tree from one photograph, along strokes that are drawn on it.
    Photo(photo::PhotoArgs),
    /// Make a tree from a point cloud (.las, .laz, .e57, .ply, .pcd, .xyz).
    Cloud(cloud::CloudArgs),
    /// Find the distortion of a lens by a film or pictures of a chessboard, as a profile for `--lens`.
    Calibrate(calibrate::CalibrateArgs),
    /// Note species, site, wind and the like on a capture, or print what is noted on it.
    Note(note::NoteCommandArgs),
    /// Complete a capture whose run was ended by a crash or a full disk.
    Finish(finish::FinishArgs),
    /// List the connected cameras.
    Devices(devices::DevicesArgs),
    /// Check this machine for problems, and say how to fix them.
    Doctor(doctor::DoctorArgs),
}

/// Runs the command that the arguments name.
pub fn main() -> ExitCode {
    print_only_uncaught();
    let cli = match parsed() {
        Ok(cli) => cli,
        Err(e) => return print_parse_error(&e),
    };
    match run(&cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => status(&e),
    }
}

/// The arguments. A negative number is the value of the option before it, so that the message names
/// the option and what it takes.
fn parsed() -> Result<Cli, clap::Error> {
    let command = Cli::command().mut_subcommands(|command| command.allow_negative_numbers(true));
    Cli::from_arg_matches(&command.try_get_matches()?)
}

fn run(command: &Command) -> Result<(), CommandError> {
    match command {
        Command::Capture(args) => capture::run(args),
        Command::Replay(args) => replay::run(args),
        Command::Record(args) => record::run(args),
        Command::Play(args) => play::run(args),
        Command::Render(args) => render::run(args),
        Command::Export(args) => export::run(args),
        Command::Analyze(args) => analyze::run(args),
        Command::Animate(args) => animate::run(args),
        Command::Grow(args) => grow::run(args),
        Command::Sketch(args) => sketch::run(args),
        Command::Photo(args) => photo::run(args),
        Command::Cloud(args) => cloud::run(args),
        Command::Calibrate(args) => calibrate::run(args),
        Command::Note(args) => note::run(args),
        Command::Finish(args) => finish::run(args),
        Command::Devices(args) => devices::run(args),
        Command::Doctor(args) => doctor::run(args),
    }
}

/// Prints why a command did not succeed, and returns its exit status.
fn status(error: &CommandError) -> ExitCode {
    let (status, cause) = match error {
        CommandError::Failed(e) => (FAILED, e),
        CommandError::BadUsage(e) => (BAD_USAGE, e),
        CommandError::NoInput(e) => (NO_INPUT, e),
        CommandError::Stopped => return ExitCode::from(STOPPED),
    };
    eprint_line(&format!("arborcam: {}", one_line(cause)));
    ExitCode::from(status)
}

/// Prints an error of the argument parser in the form of all other errors: of a value that an option
/// does not take, in one line. Help and version are such "errors" as well; they are printed as they are.
fn print_parse_error(e: &clap::Error) -> ExitCode {
    let text = e.render().to_string();
    let unknown = unknown_command(e);
    let text = match (e.kind(), text.split_once("\n\n")) {
        (ErrorKind::ValueValidation, Some((line, _))) => line,
        _ => &text,
    };
    match unknown.as_deref().or(text.strip_prefix("error: ")) {
        Some(what) => eprint_line(&format!("arborcam: {}", what.trim_end())),
        None => drop(e.print()),
    }
    if e.use_stderr() {
        ExitCode::from(BAD_USAGE)
    } else {
        ExitCode::SUCCESS
    }
}

/// Forests are made by an option of `grow`; who looks for a command of their own writes one of these.
const FOREST: [&str; 3] = ["forest", "forests", "forst"];

/// What is said of a command that there is not; `None` for another error.
fn unknown_command(e: &clap::Error) -> Option<String> {
    if e.kind() != ErrorKind::InvalidSubcommand {
        return None;
    }
    let Some(ContextValue::String(name)) = e.get(ContextKind::InvalidSubcommand) else {
        return None;
    };
    let hint = match e.get(ContextKind::SuggestedSubcommand) {
        _ if FOREST.contains(&name.as_str()) => {
            "; `arborcam grow EXAMPLE --count N --forest --out DIR` makes a forest;".to_owned()
        }
        // The last one is the nearest.
        Some(ContextValue::Strings(near)) => match near.last() {
            Some(nearest) => format!("; is `{nearest}` meant?"),
            None => ";".to_owned(),
        },
        _ => ";".to_owned(),
    };
    Some(format!(
        "there is no command `{name}`{hint} `arborcam --help` lists all commands"
    ))
}

/// The error in one line, followed by those of its causes that it does not quote already.
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

    /// Help texts taken from the settings are empty if the key is misspelt.
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
