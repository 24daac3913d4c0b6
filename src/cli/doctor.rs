//! `arborcam doctor`: checks this machine, and says how to fix what is wrong.

use super::command_error::CommandError;
use super::output::print;
use crate::config::Config;
use crate::doctor::{self, Asked, Screen, Verdict};
use crate::tui::{self, Depth};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct DoctorArgs {
    /// The camera to test; without it the first that can film.
    device: Option<PathBuf>,
    /// Settings for the captures (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Folder that captures will be written to; default: the current one.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: &DoctorArgs) -> Result<(), CommandError> {
    let config = Config::default()
        .layered(args.config.as_deref(), |_| {})
        .map_err(|e| e.to_string());
    let wanted = args.out.clone().unwrap_or_else(|| PathBuf::from("."));
    // A capture creates its own folder: check the nearest folder above that exists.
    let there = std::path::absolute(&wanted)
        .ok()
        .and_then(|p| p.ancestors().find(|a| a.is_dir()).map(PathBuf::from));
    let asked = Asked {
        device: args.device.clone(),
        config,
        folder: there.unwrap_or(wanted),
        screen: screen(),
    };
    let checks = doctor::judge(&doctor::gather(asked));
    let failed = checks.iter().filter(|c| c.verdict == Verdict::Fail).count();
    let text = if args.json {
        serde_json::to_string(&checks).map_err(CommandError::failed)? + "\n"
    } else {
        checks.iter().map(|check| format!("{check}\n")).collect()
    };
    print(&text)?;
    match failed {
        0 => Ok(()),
        _ => Err(CommandError::Failed(anyhow::anyhow!(
            "{failed} of {} checks failed; each says what to do",
            checks.len()
        ))),
    }
}

fn screen() -> Screen {
    let Some(found) = tui::abilities() else {
        return Screen::default();
    };
    let locale = locale().to_lowercase();
    Screen {
        cells: Some(found.cells),
        utf8: locale.contains("utf-8") || locale.contains("utf8"),
        colours: match found.depth {
            Depth::None => "none",
            Depth::Indexed => "256",
            Depth::True => "all",
        },
        pictures: found.pictures,
    }
}

/// The name of the locale: the first of its environment variables that is set.
fn locale() -> String {
    for name in ["LC_ALL", "LC_CTYPE", "LANG"] {
        match std::env::var(name) {
            Ok(locale) if !locale.is_empty() => return locale,
            _ => {}
        }
    }
    String::new()
}
