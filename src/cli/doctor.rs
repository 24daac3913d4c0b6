//! `arborcam doctor`: what is wrong with this machine, and what to do about it.

use super::ended::Ended;
use super::output::print;
use crate::config::Config;
use crate::doctor::{self, Asked, Screen, Verdict};
use crate::tui::{self, Depth};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct DoctorArgs {
    /// The camera to try; without it the first that films.
    device: Option<PathBuf>,
    /// Settings that a capture will have.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Folder that captures will be written to; the present one if not given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: &DoctorArgs) -> Result<(), Ended> {
    let config = Config::default()
        .layered(args.config.as_deref(), |_| {})
        .map_err(|e| e.to_string());
    let wanted = args.out.clone().unwrap_or_else(|| PathBuf::from("."));
    // A capture makes its own folder; the one above it is what counts.
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
        serde_json::to_string(&checks).map_err(|e| Ended::Failed(e.into()))? + "\n"
    } else {
        checks.iter().map(|check| format!("{check}\n")).collect()
    };
    print(&text)?;
    match failed {
        0 => Ok(()),
        _ => Err(Ended::Failed(anyhow::anyhow!(
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

/// The name of the locale; of the variables that hold one, the first that is set counts.
fn locale() -> String {
    for name in ["LC_ALL", "LC_CTYPE", "LANG"] {
        match std::env::var(name) {
            Ok(locale) if !locale.is_empty() => return locale,
            _ => {}
        }
    }
    String::new()
}
