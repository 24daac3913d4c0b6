//! Options of `arborcam analyze`.

use super::super::command_error::CommandError;
use super::super::common::{moment, parse_within};
use super::super::markers::MarkerFile;
use super::super::scale::ScaleArgs;
use crate::bounds::Bounds;
use crate::config::{Config, ConfigError, Excited, MarkerWindow, check_marker_names};
use crate::files::{LARGEST_NOTE, read_bounded};
use crate::import::read_lens_profile;
use crate::model::Lens;
use anyhow::anyhow;
use clap::{Args, ValueEnum};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::str::FromStr;

#[derive(Debug, Args)]
pub struct AnalyzeArgs {
    /// Captures: folders written by `capture` or `replay --out`. Several captures are compared with
    /// the first one.
    #[arg(required = true, value_name = "DIR")]
    pub dirs: Vec<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Print one CSV table of all captures: a row for each capture and branch, the same tree_branch
    /// for the same branch.
    #[arg(long, conflicts_with = "json")]
    pub csv: bool,
    /// Also write a page with plots (HTML, in one file); the file must not exist.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Also write the angles of all branches over time (CSV); the file must not exist.
    #[arg(long, value_name = "FILE")]
    angles: Option<PathBuf>,
    /// Also write the spectra of these angles (CSV); the file must not exist.
    #[arg(long, value_name = "FILE")]
    spectra: Option<PathBuf>,
    /// Write the results to the captures, to nodes.csv and tree.glb, and judge them anew in
    /// capture.json. Without it nothing is written to a capture.
    #[arg(long)]
    pub update: bool,
    /// Excitation of the tree; `auto` decides by the motion.
    #[arg(long, value_name = "WHAT")]
    excitation: Option<ExcitationArg>,
    /// Begin of the analysed part of the film, s. Without --from and --to its end is analysed, of
    /// the length `dynamics.window_s`.
    #[arg(long, value_name = "SECONDS", value_parser = moment)]
    pub from: Option<f64>,
    /// End of the analysed part of the film, s.
    #[arg(long, value_name = "SECONDS", value_parser = moment)]
    pub to: Option<f64>,
    /// Whether several captures are of the same tree. `auto` decides by the number of branches in
    /// the same place, and compares nothing if that is ambiguous.
    #[arg(long, value_name = "WHICH", default_value = "auto")]
    pub trees: Trees,
    /// Analyse the coloured markers (`capture --markers`) in place of the branches of the tree: each is
    /// the end of a branch that begins at its parent. A file as for `--markers` names the parents;
    /// without it those of the capture count, or the motion. Write --markers=FILE.
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true, conflicts_with = "update")]
    markers: Option<Option<MarkerParents>>,
    /// Profile of the camera's lens (JSON of Gyroflow's lens_profiles, or from config/lenses): points are
    /// put where a camera without distortion would show them, and at the time at which their row is read.
    #[arg(long, value_name = "FILE", value_parser = lens, conflicts_with = "update")]
    pub lens: Option<LensProfile>,
    /// Time in which a rolling shutter reads a frame from its first to its last row, ms; over that of the
    /// lens profile.
    #[arg(long, value_name = "MS", value_parser = readout, conflicts_with = "update")]
    pub readout_ms: Option<f64>,
    #[command(flatten)]
    pub scale: ScaleArgs,
    /// Settings that differ from those of the capture (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ExcitationArg {
    Auto,
    Release,
    Wind,
}

/// A lens by its profile.
#[derive(Clone, Debug)]
pub struct LensProfile {
    pub file: String,
    pub lens: Lens,
}

/// Reads a lens profile.
fn lens(path: &str) -> Result<LensProfile, String> {
    let bytes =
        read_bounded(Path::new(path), LARGEST_NOTE).map_err(|e| format!("{e}; give a file"))?;
    Ok(LensProfile {
        file: path.to_owned(),
        lens: read_lens_profile(&bytes)?,
    })
}

/// Parses the time in which a frame is read, ms.
fn readout(text: &str) -> Result<f64, String> {
    parse_within(
        text,
        0.0..=1000.0,
        "give a number of milliseconds, 0 to 1000",
    )
}

/// What is written to a file of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    Report,
    Angles,
    Spectra,
}

impl Content {
    /// Its option, and what is said of it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Report => "report",
            Self::Angles => "angles",
            Self::Spectra => "spectra",
        }
    }
}

/// A file that is asked for.
#[derive(Clone, Copy, Debug)]
pub struct FileAsked<'a> {
    pub content: Content,
    pub path: &'a Path,
}

/// Markers with their parents, from a file.
#[derive(Clone, Debug)]
struct MarkerParents(MarkerFile);

impl FromStr for MarkerParents {
    type Err = String;

    fn from_str(path: &str) -> Result<Self, String> {
        let file = MarkerFile::read(path)?;
        check_marker_names(&file.markers).map_err(|e| e.to_string())?;
        Ok(Self(file))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Trees {
    Auto,
    Same,
    Different,
}

impl Trees {
    /// What the user states; `None` for `auto`.
    pub fn same(self) -> Option<bool> {
        match self {
            Self::Auto => None,
            Self::Same => Some(true),
            Self::Different => Some(false),
        }
    }
}

impl AnalyzeArgs {
    /// Checks combinations of options, which clap cannot.
    ///
    /// # Errors
    /// A folder is given twice, unless its rows are wanted twice; the film would end before it
    /// begins; a file that is to be written has no name.
    pub fn check(&self) -> Result<(), CommandError> {
        let mut seen = BTreeSet::new();
        for dir in &self.dirs {
            if !self.csv && !seen.insert(dir.canonicalize().unwrap_or_else(|_| dir.clone())) {
                return bad_usage(format!(
                    "{} is given twice; give every capture once",
                    dir.display()
                ));
            }
        }
        let within_s = self.within_s();
        if within_s.is_empty() {
            return bad_usage(format!(
                "--from {} is not before --to {}; --from comes first",
                within_s.lo, within_s.hi
            ));
        }
        let mut paths = BTreeSet::new();
        for file in self.files() {
            if !paths.insert(file.path) {
                return bad_usage(format!(
                    "{} is given for two files; choose another name for one",
                    file.path.display()
                ));
            }
            if file.path.file_name().is_none() {
                return bad_usage(format!(
                    "--{} {} is no name for a file; choose another",
                    file.content.word(),
                    file.path.display()
                ));
            }
        }
        Ok(())
    }

    /// The files that are to be written beside the table.
    pub fn files(&self) -> impl Iterator<Item = FileAsked<'_>> {
        let asked = [
            (Content::Report, &self.report),
            (Content::Angles, &self.angles),
            (Content::Spectra, &self.spectra),
        ];
        asked.into_iter().filter_map(|(content, path)| {
            Some(FileAsked {
                content,
                path: path.as_deref()?,
            })
        })
    }

    /// Whether the page with plots is to be written.
    pub fn wants_report(&self) -> bool {
        self.report.is_some()
    }

    /// Whether markers are analysed in place of branches.
    pub fn by_markers(&self) -> bool {
        self.markers.is_some()
    }

    /// The parents of markers that a file names.
    pub fn marker_parents(&self) -> Option<&[MarkerWindow]> {
        Some(&self.marker_file()?.markers)
    }

    /// The file that names them.
    pub fn marker_file(&self) -> Option<&MarkerFile> {
        let parents = self.markers.as_ref()?.as_ref()?;
        Some(&parents.0)
    }

    /// Begin and end of the analysed part of the film, s.
    pub fn within_s(&self) -> Bounds {
        Bounds::new(
            self.from.unwrap_or(f64::NEG_INFINITY),
            self.to.unwrap_or(f64::INFINITY),
        )
    }

    /// The settings for a capture: command line over configuration file over the capture's `own`.
    ///
    /// # Errors
    /// The configuration file cannot be read, or a setting is out of range.
    pub fn config(&self, own: &Config) -> Result<Config, ConfigError> {
        own.layered(self.config.as_deref(), |config| self.set(config))
    }

    /// Applies the options of the command line.
    fn set(&self, config: &mut Config) {
        if let Some(excitation) = self.excitation {
            config.dynamics.excitation = match excitation {
                ExcitationArg::Auto => Excited::Auto,
                ExcitationArg::Release => Excited::Release,
                ExcitationArg::Wind => Excited::Wind,
            };
        }
        self.scale.set(config);
    }
}

fn bad_usage(what: String) -> Result<(), CommandError> {
    Err(CommandError::BadUsage(anyhow!(what)))
}
