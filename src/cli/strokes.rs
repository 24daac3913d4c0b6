//! Options for branches that the user draws.

use super::command_error::CommandError;
use super::line::Line;
use crate::config::Config;
use crate::model::Size;
use clap::Args;

/// Stroke options of `capture` and `replay`.
#[derive(Clone, Debug, Default, Args)]
pub struct StrokeArgs {
    /// A line along a branch or the trunk, where wood cannot be distinguished by its colour (JSON
    /// as for --trunk), drawn on a frame in which the tree is at rest. May be given several times.
    #[arg(long = "branch-stroke", value_name = "FILE", value_parser = Line::read)]
    strokes: Vec<Line>,
}

impl StrokeArgs {
    /// Applies the options of the command line.
    pub fn set(&self, config: &mut Config) {
        if !self.strokes.is_empty() {
            let lines = self.strokes.iter().map(|line| line.polyline_px.clone());
            config.skeleton.strokes_px = lines.collect();
        }
    }

    /// Checks that the strokes were drawn in a picture of this size.
    ///
    /// # Errors
    /// One was drawn in a picture of another size.
    pub fn check_size(&self, size: Size) -> Result<(), CommandError> {
        let mut strokes = self.strokes.iter();
        strokes.try_for_each(|line| line.check_size("--branch-stroke", size))
    }
}
