//! `arborcam note DIR [KEY=VALUE]...`: what the user notes on a capture, afterwards.

use super::command_error::CommandError;
use super::output::print;
use super::stop::Stop;
use crate::document::Document;
use crate::model::{UserNote, UserNotes};
use crate::views::put_notes;
use anyhow::anyhow;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct NoteCommandArgs {
    /// The folder of a capture.
    dir: PathBuf,
    /// Notes to add or to change, e.g. species=Quercus; without any the notes are printed.
    #[arg(value_name = "KEY=VALUE")]
    notes: Vec<UserNote>,
    /// Take the note with this key out; may be given several times.
    #[arg(long, value_name = "KEY")]
    remove: Vec<String>,
}

pub fn run(args: &NoteCommandArgs) -> Result<(), CommandError> {
    let given = UserNotes::of(&args.notes).map_err(CommandError::bad_usage)?;
    let stop = Stop::on_signals()?;
    let old = Document::note(&args.dir)?.notes;
    let mut notes = old.clone();
    for key in &args.remove {
        if !notes.remove(key) {
            return Err(CommandError::BadUsage(anyhow!(
                "--remove {key}: there is no such note on {}",
                args.dir.display()
            )));
        }
    }
    let notes = notes.with(given).map_err(CommandError::bad_usage)?;
    if notes != old {
        put_notes(&args.dir, &notes, stop.while_writing())?;
    }
    let lines = notes.iter().map(|(key, value)| format!("{key}={value}\n"));
    print(&lines.collect::<String>())
}
