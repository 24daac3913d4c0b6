//! What `arborcam analyze` is asked for.

use super::super::ended::Ended;
use super::super::scale::ScaleArgs;
use crate::config::{Config, Excited};
use anyhow::anyhow;
use clap::{Args, ValueEnum};
use std::collections::BTreeSet;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct AnalyzeArgs {
    /// Captures: folders that --out of `capture` or `replay` has made. Several are compared with
    /// the first.
    #[arg(required = true, value_name = "DIR")]
    pub dirs: Vec<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Also write a page with plots (HTML, one file); it must not exist.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Put the answers into the captures: into nodes.csv, and into the model that shows them
    /// (tree.glb). Without it nothing is written into a capture.
    #[arg(long)]
    pub update: bool,
    /// What made the tree sway; `auto` looks at the motion.
    #[arg(long, value_name = "WHAT")]
    excitation: Option<Cause>,
    /// First moment of the film to look at, s; without --from and --to it is the end of it,
    /// `dynamics.window_s` long.
    #[arg(long, value_name = "SECONDS", value_parser = moment, allow_negative_numbers = true)]
    pub from: Option<f64>,
    /// Last moment of the film to look at, s.
    #[arg(long, value_name = "SECONDS", value_parser = moment, allow_negative_numbers = true)]
    pub to: Option<f64>,
    /// Whether several captures are of the same tree; `auto` looks how many branches stand in the
    /// same place, and compares nothing where that is no evidence.
    #[arg(long, value_name = "WHICH", default_value = "auto")]
    pub trees: Trees,
    #[command(flatten)]
    pub scale: ScaleArgs,
    /// Settings that differ from those of the capture (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Cause {
    Auto,
    Release,
    Wind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Trees {
    Auto,
    Same,
    Different,
}

impl Trees {
    /// What the user says; `None` for nothing.
    pub fn same(self) -> Option<bool> {
        match self {
            Self::Auto => None,
            Self::Same => Some(true),
            Self::Different => Some(false),
        }
    }
}

impl AnalyzeArgs {
    /// What clap does not look at.
    ///
    /// # Errors
    /// A folder is given twice; the film would end before it begins; the report has no name.
    pub fn check(&self) -> Result<(), Ended> {
        let mut seen = BTreeSet::new();
        for dir in &self.dirs {
            if !seen.insert(dir.canonicalize().unwrap_or_else(|_| dir.clone())) {
                return unfit(format!(
                    "{} is given twice; give every capture once",
                    dir.display()
                ));
            }
        }
        let [from, to] = self.within_s();
        if from >= to {
            return unfit(format!(
                "--from {from} is not before --to {to}; --from comes first"
            ));
        }
        match &self.report {
            Some(path) if path.file_name().is_none() => unfit(format!(
                "--report {} is no name for a file; choose another",
                path.display()
            )),
            _ => Ok(()),
        }
    }

    /// The part of the film that is looked at, s.
    pub fn within_s(&self) -> [f64; 2] {
        [
            self.from.unwrap_or(f64::NEG_INFINITY),
            self.to.unwrap_or(f64::INFINITY),
        ]
    }

    /// A capture's own settings with what is to be changed of them.
    ///
    /// # Errors
    /// The file of settings cannot be read, or a setting is out of range.
    pub fn config(&self, own: &Config) -> Result<Config, Ended> {
        let overlaid = self
            .config
            .as_ref()
            .map_or_else(|| Ok(own.clone()), |path| own.overlaid(path));
        let mut config = overlaid.map_err(|e| Ended::BadUsage(e.into()))?;
        if let Some(cause) = self.excitation {
            config.dynamics.excitation = match cause {
                Cause::Auto => Excited::Auto,
                Cause::Release => Excited::Release,
                Cause::Wind => Excited::Wind,
            };
        }
        self.scale.set(&mut config);
        config.check().map_err(|e| Ended::BadUsage(e.into()))?;
        Ok(config)
    }
}

fn unfit(what: String) -> Result<(), Ended> {
    Err(Ended::BadUsage(anyhow!(what)))
}

fn moment(text: &str) -> Result<f64, String> {
    let seconds = text
        .parse()
        .ok()
        .filter(|s: &f64| s.is_finite() && *s >= 0.0);
    seconds.ok_or_else(|| "give a number of seconds, 0 or more".to_owned())
}
