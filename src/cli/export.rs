//! `arborcam export DIR --format F --out PATH`: a capture's tree as a file for other programs.

use super::ended::{Ended, failed, unwritten};
use super::idle;
use super::output::say;
use super::stop::Stop;
use super::tree::{Tail, TreeArgs, warn};
use crate::export::gltf::{KEY_TOLERANCE_PX, Model, NamedBytes, glb, gltf_files};
use crate::export::still::{obj_files, ply};
use crate::export::{ExportError, html};
use crate::files::{WriteError, refuse_taken, write_files};
use crate::views::PreparedTree;
use anyhow::anyhow;
use clap::{Args, ValueEnum};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Where the data goes instead of into a file.
const STDOUT: &str = "-";

#[derive(Debug, Args)]
pub struct ExportArgs {
    /// A capture: the folder that --out of `capture` or `replay` has made.
    dir: PathBuf,
    /// What to write. glb: one file, mesh and motion; gltf: the same as .gltf and .bin; csv: a
    /// folder with the tables and the wood as cylinders; obj and ply: the tree at rest; html: a
    /// page for a browser, all in one file.
    #[arg(long, value_name = "FORMAT")]
    format: Format,
    /// File to write, for csv a folder; it must not exist, and appears when it is complete. `-` is
    /// standard output (glb, html, ply).
    #[arg(long, value_name = "PATH")]
    out: PathBuf,
    /// How far a node may be from its pose when keys of the animation are left out, px on the
    /// screen of the front view; twice that in depth.
    #[arg(long, value_name = "PX", default_value_t = KEY_TOLERANCE_PX, value_parser = tolerance)]
    tolerance_px: f64,
    /// All levels of detail, as scenes lod0, lod1, ... on the same bones (glb, gltf).
    #[arg(long)]
    lods: bool,
    #[command(flatten)]
    tree: TreeArgs,
}

impl ExportArgs {
    /// Says which options the format has no use for.
    fn tell_idle(&self) {
        if self.lods && !matches!(self.format, Format::Glb | Format::Gltf) {
            idle::tell("--lods", "only glb and gltf hold levels of detail");
        }
        if self.tolerance_px != KEY_TOLERANCE_PX
            && matches!(self.format, Format::Csv | Format::Obj | Format::Ply)
        {
            idle::tell("--tolerance-px", "this format holds no keys");
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Glb,
    Html,
    Gltf,
    Csv,
    Obj,
    Ply,
}

fn tolerance(text: &str) -> Result<f64, String> {
    let px = text
        .parse()
        .ok()
        .filter(|px: &f64| (0.001..=100.0).contains(px));
    px.ok_or_else(|| "give a number of pixels from 0.001 to 100".to_owned())
}

pub fn run(args: &ExportArgs) -> Result<(), Ended> {
    let target = Target::of(args)?;
    target.refuse_taken().map_err(unwritten)?;
    if args.format == Format::Html {
        html::built_in().map_err(failed)?;
    }
    let stop = Stop::on_signals()?;
    let tree = args.tree.prepare(&args.dir, Tail::Animation)?;
    warn(&tree);
    args.tell_idle();
    if args.format == Format::Csv {
        return tables(args, &tree, &stop);
    }
    let model = Model {
        tolerance_px: args.tolerance_px,
        all_levels: args.lods && args.format != Format::Html,
        ..tree.model()
    };
    let files = files(args.format, &tree, &model, &target).map_err(failed)?;
    target.write(files, &stop)
}

/// The files of all formats but tables.
fn files(
    format: Format,
    tree: &PreparedTree,
    model: &Model,
    target: &Target,
) -> Result<Vec<NamedBytes>, ExportError> {
    let (stem, metres_per_px) = (target.stem(), model.metres_per_px);
    let bytes = match format {
        Format::Gltf => return gltf_files(model, &stem).map(|(files, _)| files),
        Format::Obj => return obj_files(&tree.dressed, &stem, metres_per_px),
        Format::Html => tree.page(model, &stem)?,
        Format::Ply => ply(&tree.dressed, metres_per_px)?,
        Format::Glb | Format::Csv => glb(model)?.0,
    };
    Ok(vec![(target.name(), bytes)])
}

/// The tables, as they are or of the changed tree, and the wood as cylinders.
fn tables(args: &ExportArgs, tree: &PreparedTree, stop: &Stop) -> Result<(), Ended> {
    let written = tree.write_tables(&args.out, stop.while_writing())?;
    let film = if written.film {
        "nodes, motion and tracks"
    } else {
        "nodes (there is no film)"
    };
    say(&format!(
        "{}: {film}, {} cylinders",
        written.dir.display(),
        written.cylinders
    ));
    Ok(())
}

fn bad_usage<T>(why: String) -> Result<T, Ended> {
    Err(Ended::BadUsage(anyhow!(why)))
}

/// The file that was asked for; others may come beside it.
enum Target<'a> {
    Stdout,
    Beside(&'a Path),
}

impl<'a> Target<'a> {
    fn of(args: &'a ExportArgs) -> Result<Self, Ended> {
        let shown = args.out.display();
        if args.out.as_os_str() == STDOUT {
            return match args.format {
                Format::Glb | Format::Html | Format::Ply => Ok(Self::Stdout),
                _ => bad_usage("--out -: this format is more than one file; give a path".into()),
            };
        }
        if args.out.file_name().is_none() {
            return bad_usage(format!(
                "--out {shown} is no name for a file; choose another"
            ));
        }
        let ending = match args.format {
            Format::Gltf => "gltf",
            Format::Obj => "obj",
            Format::Glb | Format::Html | Format::Csv | Format::Ply => {
                return Ok(Self::Beside(&args.out));
            }
        };
        // The names of the files beside it are made from it.
        if args
            .out
            .extension()
            .is_none_or(|e| !e.eq_ignore_ascii_case(ending))
        {
            return bad_usage(format!(
                "--out {shown} does not end in .{ending}, as this format must"
            ));
        }
        Ok(Self::Beside(&args.out))
    }

    fn name(&self) -> String {
        match self {
            Self::Stdout => "tree".into(),
            Self::Beside(path) => path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
        }
    }

    fn stem(&self) -> String {
        match self {
            Self::Stdout => "tree".into(),
            Self::Beside(path) => path
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
        }
    }

    /// Told before anything is worked out.
    fn refuse_taken(&self) -> Result<(), WriteError> {
        match self {
            Self::Stdout => Ok(()),
            Self::Beside(path) => refuse_taken(path),
        }
    }

    fn write(&self, files: Vec<NamedBytes>, stop: &Stop) -> Result<(), Ended> {
        match self {
            Self::Stdout => {
                let mut out = std::io::stdout().lock();
                let written = files
                    .iter()
                    .try_for_each(|(_, bytes)| out.write_all(bytes))
                    .and_then(|()| out.flush());
                written.map_err(|e| Ended::Failed(anyhow!("cannot write to standard output: {e}")))
            }
            Self::Beside(path) => {
                let size: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
                let folder = path.parent().unwrap_or(Path::new(""));
                write_files(folder, &files, stop.while_writing()).map_err(unwritten)?;
                say(&format!("{}: {:.1} MB", path.display(), size as f64 / 1e6));
                Ok(())
            }
        }
    }
}
