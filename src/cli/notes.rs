//! `--note`: what the user notes on a film.

use super::command_error::CommandError;
use crate::model::{UserNote, UserNotes};
use crate::source::Source;
use clap::Args;

/// The notes of a command line.
#[derive(Debug, Args)]
pub struct NoteArgs {
    /// Note on the film for all its files, e.g. species=Quercus, "site=north meadow" or wind=3bft;
    /// may be given several times. Those in a recording are kept, unless given anew.
    #[arg(long = "note", value_name = "KEY=VALUE")]
    notes: Vec<UserNote>,
}

impl NoteArgs {
    /// Checks the notes before anything is filmed.
    ///
    /// # Errors
    /// A key is given twice, or there are too many.
    pub fn check(&self) -> Result<(), CommandError> {
        UserNotes::of(&self.notes)
            .map(drop)
            .map_err(CommandError::bad_usage)
    }

    /// The notes on a film of `source`: those that it brings along, and these over them.
    ///
    /// # Errors
    /// As for [`check`](Self::check); or there are too many with those of the source.
    pub fn over(&self, source: &dyn Source) -> Result<UserNotes, CommandError> {
        let own = UserNotes::of(&self.notes).map_err(CommandError::bad_usage)?;
        let brought = source.origin().notes;
        brought.with(own).map_err(CommandError::bad_usage)
    }
}
