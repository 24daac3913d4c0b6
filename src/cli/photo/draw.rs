//! `arborcam photo --draw`: strokes by mouse and keys on the screen.

use super::drawn::DrawnTree;
use super::nothing_drawn;
use super::picture::ShownPicture;
use crate::cancel::CancelToken;
use crate::cli::command_error::CommandError;
use crate::cli::hangup::SighupAction;
use crate::cli::session::stop_on_signals;
use crate::model::{Rgb, TreeStrokes};
use crate::pipeline::{PhotoOptions, TreeInPhoto, see_tree};
use crate::tui::{self, FoundTree, PhotoSession};
use anyhow::anyhow;
use std::io::IsTerminal;
use std::sync::Arc;

/// The photograph behind the screen.
struct OnScreen<'a> {
    shown: &'a ShownPicture,
    options: PhotoOptions,
}

impl PhotoSession for OnScreen<'_> {
    fn name(&self) -> &str {
        &self.shown.name
    }

    fn picture(&self) -> Arc<Rgb> {
        self.shown.picture.rgb.clone()
    }

    fn look(&mut self, strokes: &TreeStrokes) -> Result<FoundTree, String> {
        let picture = &self.shown.picture.rgb;
        let tree = see_tree(picture, strokes, self.options, &CancelToken::new());
        tree.map(found).map_err(|e| e.to_string())
    }
}

fn found(tree: TreeInPhoto) -> FoundTree {
    FoundTree {
        wood: tree.seen.wood,
        in_leaf: tree.seen.in_leaf,
        agreement: tree.agreement,
    }
}

/// Shows the picture with what is `drawn` on the terminal until the user accepts what is found, and
/// gives the strokes of every tree.
///
/// # Errors
/// There is no terminal, or the user leaves without accepting.
pub fn on_screen(
    shown: &ShownPicture,
    drawn: Vec<DrawnTree>,
    options: PhotoOptions,
) -> Result<Vec<DrawnTree>, CommandError> {
    if !std::io::stdout().is_terminal() {
        let why = "there is no terminal to draw on; give --crown and --branch, or --tree, instead of --draw";
        return Err(CommandError::BadUsage(anyhow!(why)));
    }
    let stop = stop_on_signals(SighupAction::ends_this_process())?;
    let mut session = OnScreen { shown, options };
    let begun = drawn.into_iter().map(|tree| tree.strokes).collect();
    let accepted = tui::draw_on_photo(&mut session, begun, tui::Options::from_env(), &stop);
    let accepted = accepted.map_err(CommandError::bad_usage)?;
    let trees = accepted.ok_or(CommandError::Stopped)?;
    let drawn = trees.into_iter().map(|strokes| DrawnTree {
        strokes,
        ..nothing_drawn()
    });
    Ok(drawn.collect())
}
