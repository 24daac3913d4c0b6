//! `arborcam photo --draw`: strokes by mouse and keys on the screen.

use super::drawn::DrawnTree;
use super::kept::KeptStrokes;
use super::picture::ShownPicture;
use crate::cli::command_error::CommandError;
use crate::cli::hangup::SighupAction;
use crate::cli::output::eprint_line;
use crate::cli::signals::stop_on_signals;
use crate::model::{Rgb, TreeStrokes};
use crate::pipeline::{PhotoError, PhotoOptions, TreeInPhoto, see_tree};
use crate::runtime::{Answer, Asked, AtOnce};
use crate::tui::{self, FoundTree, PhotoSession};
use anyhow::anyhow;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::Arc;

/// The photograph behind the screen.
struct OnScreen<'a> {
    shown: &'a ShownPicture,
    options: PhotoOptions,
    looking: Option<Looking>,
    kept: KeptStrokes,
}

/// What is looked at on a thread of its own.
type Looking = Asked<Result<TreeInPhoto, PhotoError>>;

impl PhotoSession for OnScreen<'_> {
    fn name(&self) -> &str {
        &self.shown.name
    }

    fn picture(&self) -> Arc<Rgb> {
        self.shown.picture.rgb.clone()
    }

    fn look(&mut self, strokes: &TreeStrokes) {
        let (picture, strokes) = (self.picture(), strokes.clone());
        let options = self.options;
        // What is looked at for older strokes is given up.
        self.looking = Asked::begin("photo", move |cancel| {
            see_tree(&picture, &strokes, options, &AtOnce, cancel)
        })
        .ok();
    }

    fn found(&mut self) -> Option<Result<FoundTree, String>> {
        let looking = self.looking.as_ref().map(Asked::answer);
        let answer = match looking.unwrap_or(Answer::Failed) {
            Answer::NotReady => return None,
            Answer::Ready(tree) => tree.map(found).map_err(|e| e.to_string()),
            Answer::Failed => Err("it cannot be looked at: too little memory, or a fault".into()),
        };
        self.looking = None;
        Some(answer)
    }

    fn keep(&mut self, trees: &[TreeStrokes]) -> Result<String, String> {
        let files = self.kept.keep(trees).map_err(|e| e.to_string())?;
        let names = files.iter().map(|file| file.display().to_string());
        let names: Vec<String> = names.collect();
        match names.is_empty() {
            true => Err("nothing is drawn yet".into()),
            false => Ok(names.join(", ")),
        }
    }
}

fn found(tree: TreeInPhoto) -> FoundTree {
    FoundTree {
        wood: tree.seen.wood,
        in_leaf: tree.seen.in_leaf,
        certainty: tree.found.map(|found| found.chance()),
        is_likely: tree.found.is_none_or(|found| found.is_likely()),
    }
}

/// Shows the picture with what is `drawn` on the terminal until the user accepts what is found, and
/// gives the strokes of every tree. They are kept as files beside `out`.
///
/// # Errors
/// There is no terminal, the user leaves without accepting, or a file cannot be written.
pub fn on_screen(
    shown: &ShownPicture,
    drawn: Vec<DrawnTree>,
    options: PhotoOptions,
    out: &Path,
) -> Result<Vec<DrawnTree>, CommandError> {
    if !std::io::stdout().is_terminal() {
        let why = "there is no terminal to draw on; give --crown and --branch, or --tree, instead of --draw";
        return Err(CommandError::BadUsage(anyhow!(why)));
    }
    let stop = stop_on_signals(SighupAction::ends_this_process(), None)?;
    let mut session = OnScreen {
        shown,
        options,
        looking: None,
        kept: KeptStrokes::beside(out, shown.picture.rgb.size),
    };
    let begun = drawn.into_iter().map(|tree| tree.strokes).collect();
    let accepted = tui::draw_on_photo(&mut session, begun, tui::Options::from_env(), &stop);
    let accepted = accepted.map_err(CommandError::bad_usage)?;
    let trees = accepted.ok_or(CommandError::Stopped)?;
    let files = session.kept.keep(&trees)?;
    for file in files {
        eprint_line(&format!("{}: the strokes that were drawn", file.display()));
    }
    let drawn = trees.into_iter().map(|strokes| DrawnTree {
        strokes,
        ..DrawnTree::default()
    });
    Ok(drawn.collect())
}
