//! `arborcam render DIR`: draws pictures and videos of a capture or a forest.

mod options;

pub use options::{Kind, RenderArgs, ViewName, WHITE, background, rate, size};

use super::command_error::CommandError;
use super::output::eprint_line;
use super::stop::Stop;
use super::tree::{Tail, print_warnings};
use crate::document::ForestDocument;
use crate::files::{OutputFile, WriteError, check_place};
use crate::views::{
    ForestStudio, PrepareError, PreparedForest, PreparedTree, Shot, Studio, VIDEO_S,
};
use anyhow::anyhow;
use std::path::Path;

/// Longest video, s.
const MAX_VIDEO_S: f64 = 600.0;

pub fn run(args: &RenderArgs) -> Result<(), CommandError> {
    let kind = args
        .check()
        .map_err(|why| CommandError::BadUsage(anyhow!(why)))?;
    if args.seconds.is_some_and(|s| s > MAX_VIDEO_S) {
        return Err(CommandError::BadUsage(anyhow!(
            "--seconds is more than {MAX_VIDEO_S}; give less"
        )));
    }
    check_place(&args.out).map_err(write_error)?;
    let stop = Stop::on_signals()?;
    if ForestDocument::is_in(&args.dir) {
        args.check_forest()
            .map_err(|why| CommandError::BadUsage(anyhow!(why)))?;
        let forest = PreparedForest::read(&args.dir)?;
        if kind == Kind::Video && !forest.sways() {
            return Err(CommandError::BadUsage(anyhow!(
                "the trees of this forest are at rest; `arborcam animate` lets them sway in a video"
            )));
        }
        return draw_forest(&forest, &args.shot(), kind, &args.out, &stop);
    }
    let tree = args.tree.prepare(&args.dir, tail(args, kind), |_| {})?;
    if args.film.is_some() && tree.document.picture.is_none() {
        return Err(CommandError::Failed(anyhow!(
            "the capture holds no frame of the film; leave --film out"
        )));
    }
    draw(&tree, &args.shot(), kind, &args.out, &stop)?;
    // Printed last: if there is an error, it is the only line.
    print_warnings(&tree);
    if kind == Kind::Video && !args.shot().turntable && !tree.document.has_motion() {
        eprint_line(
            "arborcam: warning: nothing moves in the video, as no motion of the tree was filmed; `arborcam animate` \
             lets it sway, and --view turntable goes round it",
        );
    }
    Ok(())
}

/// Draws a picture or video of `tree` to the file `out`.
pub fn draw(
    tree: &PreparedTree,
    shot: &Shot,
    kind: Kind,
    out: &Path,
    stop: &Stop,
) -> Result<(), CommandError> {
    let studio = Studio::new(tree, shot)?;
    match kind {
        Kind::Picture => write_picture(out, &studio.picture()?, stop),
        Kind::Video => video_written(studio.video(out, stop.while_writing()), out),
    }
}

/// Draws a picture or video of a forest to the file `out`.
pub fn draw_forest(
    forest: &PreparedForest,
    shot: &Shot,
    kind: Kind,
    out: &Path,
    stop: &Stop,
) -> Result<(), CommandError> {
    let studio = ForestStudio::new(forest, shot)?;
    match kind {
        Kind::Picture => write_picture(out, &studio.picture()?, stop),
        Kind::Video => video_written(studio.video(out, stop.while_writing()), out),
    }
}

fn write_picture(out: &Path, png: &[u8], stop: &Stop) -> Result<(), CommandError> {
    let stop = stop.while_writing();
    let file = OutputFile::create(out).map_err(write_error)?;
    file.write(png, stop).map_err(write_error)?;
    file.publish().map_err(write_error)?;
    print_written(out);
    Ok(())
}

/// What became of a video.
fn video_written(written: Result<(), PrepareError>, out: &Path) -> Result<(), CommandError> {
    written.map_err(video_error)?;
    print_written(out);
    Ok(())
}

/// The line of a file that is there now.
fn print_written(out: &Path) {
    let size = std::fs::metadata(out).map_or(0, |file| file.len());
    eprint_line(&format!("{}: {:.1} MB", out.display(), size as f64 / 1e6));
}

/// The part of the film to read: poses of hours would fill the memory.
fn tail(args: &RenderArgs, kind: Kind) -> Tail {
    match (args.at, kind) {
        (Some(at_s), _) => Tail::From(at_s),
        (None, Kind::Video) => Tail::Seconds(args.seconds.unwrap_or(VIDEO_S) + 1.0),
        (None, Kind::Picture) => Tail::Seconds(0.0),
    }
}

fn video_error(e: PrepareError) -> CommandError {
    match e {
        PrepareError::Export(crate::export::ExportError::Write(e)) => write_error(e),
        e => e.into(),
    }
}

/// The error of a command that writes one file; a file that exists gets a message of its own.
pub fn write_error(e: WriteError) -> CommandError {
    match e {
        WriteError::Exists { path } => CommandError::Failed(anyhow!(
            "{} exists already; choose another file, or remove it first",
            path.display()
        )),
        e => e.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By status 130 a script distinguishes Ctrl-C from a failure.
    #[test]
    fn a_stopped_command_has_not_failed() {
        assert!(matches!(
            write_error(WriteError::Stopped),
            CommandError::Stopped
        ));
        let taken = WriteError::Exists {
            path: "a.png".into(),
        };
        assert!(
            matches!(write_error(taken), CommandError::Failed(e) if e.to_string().contains("another file"))
        );
    }
}
