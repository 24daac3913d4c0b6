//! `arborcam devices`: the cameras that are plugged in.

use super::Ended;
use crate::source;
use clap::Args;
use std::io::Write;

#[derive(Debug, Args)]
pub struct DevicesArgs {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: &DevicesArgs) -> Result<(), Ended> {
    let devices = source::list();
    let mut text = String::new();
    if args.json {
        let list: Vec<_> = devices
            .iter()
            .map(|d| serde_json::json!({ "path": d.path, "name": d.name, "description": d.description }))
            .collect();
        text = format!("{}\n", serde_json::Value::from(list));
    } else {
        for d in &devices {
            text.push_str(&format!("{:<14} {}  ({})\n", d.path.display().to_string(), d.name, d.description));
        }
    }
    let written = std::io::stdout().lock().write_all(text.as_bytes());
    if devices.is_empty() {
        return Err(Ended::NoInput(anyhow::anyhow!(
            "no camera found; plug one in, and look whether /dev/video0 appears"
        )));
    }
    // Whoever closed standard output early has seen what they wanted.
    written
        .or_else(|e| if e.kind() == std::io::ErrorKind::BrokenPipe { Ok(()) } else { Err(e) })
        .map_err(|e| Ended::Failed(e.into()))
}
