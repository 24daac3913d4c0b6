//! `arborcam finish DIR`: completes a capture whose run did not end in order.

use super::command_error::CommandError;
use super::output::eprint_line;
use super::stop::Stop;
use crate::cancel::CancelToken;
use crate::runtime;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct FinishArgs {
    /// The folder that was given as --out. The data of its run is in DIR.unfinished.
    dir: PathBuf,
}

pub fn run(args: &FinishArgs) -> Result<(), CommandError> {
    // DIR.unfinished is removed only when the capture is complete: a signal may end this any time.
    let _stop = Stop::on_signals()?;
    let written = runtime::finish_unfinished(&args.dir, &CancelToken::new())?;
    eprint_line(&written.verdict.labelled_line());
    let dir = written.dir.display();
    match &written.tree {
        Some(model) => eprint_line(&format!(
            "tree: {} nodes\ncapture: {dir}\nmodel:   {dir}/tree.glb",
            model.skeleton.measured()
        )),
        None => eprint_line(&format!("capture: {dir} (tracks only)")),
    }
    Ok(())
}
