//! `arborcam render DIR`: pictures and videos of a capture without a browser.

mod options;

pub use options::{Kind, RenderArgs, ViewName, WHITE, background, rate, size};

use super::ended::{self, Ended};
use super::stop::Stop;
use super::tree::{Tail, warn};
use crate::files::{OutputFile, WriteError, refuse_taken};
use crate::views::{PrepareError, PreparedTree, Shot, Studio, VIDEO_S};
use anyhow::anyhow;
use std::path::Path;

/// Length of any video, s.
const LONGEST_S: f64 = 600.0;

pub fn run(args: &RenderArgs) -> Result<(), Ended> {
    let kind = args.check().map_err(|why| Ended::BadUsage(anyhow!(why)))?;
    if args.seconds.is_some_and(|s| s > LONGEST_S) {
        return Err(Ended::BadUsage(anyhow!(
            "--seconds is more than {LONGEST_S}; give less"
        )));
    }
    refuse_taken(&args.out).map_err(unwritten)?;
    let stop = Stop::on_signals()?;
    let tree = args.tree.prepare(&args.dir, tail(args, kind))?;
    if args.film.is_some() && tree.document.picture.is_none() {
        return Err(Ended::Failed(anyhow!(
            "the capture holds no frame of the film; leave --film out"
        )));
    }
    draw(&tree, &args.shot(), kind, &args.out, &stop)?;
    // Told last, so that the error, if there is one, is the only line.
    warn(&tree);
    Ok(())
}

/// Draws a tree in its poses to the file `out`.
pub fn draw(
    tree: &PreparedTree,
    shot: &Shot,
    kind: Kind,
    out: &Path,
    stop: &Stop,
) -> Result<(), Ended> {
    let studio = Studio::new(tree, shot)?;
    match kind {
        Kind::Picture => {
            let png = studio.picture()?;
            write_picture(out, &png, stop).map_err(unwritten)
        }
        Kind::Video => studio.video(out, stop.while_writing()).map_err(failed),
    }
}

fn write_picture(out: &Path, png: &[u8], stop: &Stop) -> Result<(), WriteError> {
    let stop = stop.while_writing();
    let file = OutputFile::create(out)?;
    file.write(png, stop)?;
    file.publish()
}

/// How much of the end of the film is to be read: hours of poses would fill the memory.
fn tail(args: &RenderArgs, kind: Kind) -> Tail {
    match (args.at, kind) {
        (Some(at_s), _) => Tail::From(at_s),
        (None, Kind::Video) => Tail::Seconds(args.seconds.unwrap_or(VIDEO_S) + 1.0),
        (None, Kind::Picture) => Tail::Seconds(0.0),
    }
}

fn failed(e: PrepareError) -> Ended {
    match e {
        PrepareError::Export(crate::export::ExportError::Write(e)) => unwritten(e),
        e => e.into(),
    }
}

/// How a command ends whose one file could not be written.
pub fn unwritten(e: WriteError) -> Ended {
    match e {
        WriteError::Exists { path } => Ended::Failed(anyhow!(
            "{} exists already; choose another file, or remove it first",
            path.display()
        )),
        e => ended::unwritten(e),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Status 130, by which a script tells Ctrl-C from a failure.
    #[test]
    fn who_was_stopped_has_not_failed() {
        assert!(matches!(unwritten(WriteError::Stopped), Ended::Stopped));
        let taken = WriteError::Exists {
            path: "a.png".into(),
        };
        assert!(
            matches!(unwritten(taken), Ended::Failed(e) if e.to_string().contains("another file"))
        );
    }
}
