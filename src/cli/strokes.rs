//! Options for branches that the user draws.

use super::command_error::CommandError;
use super::line::Lines;
use crate::config::Config;
use crate::model::Size;
use clap::Args;

/// Stroke options of `capture` and `replay`.
#[derive(Clone, Debug, Default, Args)]
pub struct StrokeArgs {
    /// A line along a branch or the trunk, where wood cannot be distinguished by its colour (JSON
    /// as for --trunk), or several, in a drawing as for `sketch` of the size of the film (SVG, JSON);
    /// drawn on a frame in which the tree is at rest. May be given several times.
    #[arg(long = "branch-stroke", value_name = "FILE", value_parser = Lines::read)]
    strokes: Vec<Lines>,
}

impl StrokeArgs {
    /// Applies the options of the command line.
    pub fn set(&self, config: &mut Config) {
        if !self.strokes.is_empty() {
            let lines = self.strokes.iter().flat_map(|lines| &lines.0);
            config.skeleton.strokes_px = lines.map(|line| line.polyline_px.clone()).collect();
        }
    }

    /// Checks that the strokes were drawn in a picture of this size.
    ///
    /// # Errors
    /// One was drawn in a picture of another size.
    pub fn check_size(&self, size: Size) -> Result<(), CommandError> {
        let mut strokes = self.strokes.iter().flat_map(|lines| &lines.0);
        strokes.try_for_each(|line| line.check_size("--branch-stroke", size))
    }
}
