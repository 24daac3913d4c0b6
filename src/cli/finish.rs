//! `arborcam finish DIR`: completes a capture whose run was cut.

use super::ended::Ended;
use super::output::say;
use super::stop::Stop;
use crate::cancel::CancelToken;
use crate::runtime;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct FinishArgs {
    /// The folder that was given as --out; what its run has left is in DIR.unfinished.
    dir: PathBuf,
}

pub fn run(args: &FinishArgs) -> Result<(), Ended> {
    // Nothing is taken away before the capture is there, so a signal may end it at any time.
    let _stop = Stop::on_signals()?;
    let written = runtime::finish_unfinished(&args.dir, &CancelToken::new())?;
    let dir = written.dir.display();
    match &written.tree {
        Some(model) => say(&format!(
            "tree: {} nodes\ncapture: {dir}\nmodel:   {dir}/tree.glb",
            model.skeleton.measured()
        )),
        None => say(&format!("capture: {dir} (tracks only)")),
    }
    Ok(())
}
