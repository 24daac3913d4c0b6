//! `arborcam export DIR --format F --out PATH`: writes the tree of a capture for other programs.

use super::command_error::CommandError;
use super::common::parse_within;
use super::output::{eprint_line, print_bytes};
use super::scale::HeightArgs;
use super::stop::Stop;
use super::tree::{Tail, TreeArgs, print_warnings};
use super::unused;
use crate::document::ForestDocument;
use crate::export::gltf::{KEY_TOLERANCE_PX, LEVELS_OF_DETAIL, Model, NamedBytes, glb, gltf_files};
use crate::export::still::{obj_files, ply};
use crate::export::{ExportError, html};
use crate::files::{WriteError, check_place, write_files};
use crate::views::{PreparedForest, PreparedTree};
use anyhow::anyhow;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Value of `--out` for standard output.
const STDOUT: &str = "-";

#[derive(Debug, Args)]
pub struct ExportArgs {
    /// A capture: the folder written by `capture` or `replay --out`; or a forest made by `grow`
    /// (html).
    dir: PathBuf,
    /// Format. glb: mesh and motion in one file; gltf: the same as .gltf and .bin; csv: a folder
    /// with the tables and the wood as cylinders; obj and ply: the tree at rest; html: a page for a
    /// browser, in one file; qsm: the wood as cylinders for SimpleForest, aRchi and rTwig, with
    /// frequency and damping; treefile: the same for RayCloudTools.
    #[arg(long, value_name = "FORMAT")]
    format: Format,
    /// File to write, for csv a folder. It must not exist, and appears when it is complete. `-`:
    /// standard output (glb, html, ply, qsm, treefile).
    #[arg(long, value_name = "PATH")]
    out: PathBuf,
    /// Largest deviation of a node when keys of the animation are left out, px in the front view;
    /// twice that in depth.
    #[arg(long, value_name = "PX", default_value_t = KEY_TOLERANCE_PX, value_parser = tolerance)]
    tolerance_px: f64,
    /// Write all levels of detail of wood and leaves: the finest to PATH, the others beside it as
    /// NAME_lod1, NAME_lod2 with the same bones and motion (glb, gltf).
    #[arg(long)]
    lods: bool,
    #[command(flatten)]
    height: HeightArgs,
    #[command(flatten)]
    tree: TreeArgs,
}

impl ExportArgs {
    /// # Errors
    /// Something is asked for that a forest does not have.
    fn check_forest(&self) -> Result<(), CommandError> {
        if self.format != Format::Html {
            return bad_usage(
                "of a forest only --format html is made; its GLB files lie in its folder, and its \
                 trees are folders of their own"
                    .into(),
            );
        }
        if self.tree.is_given() || self.height.is_given() {
            return bad_usage("the options of the tree do not go with a forest".into());
        }
        Ok(())
    }

    /// Prints which options have no effect on this format.
    fn note_unused(&self) {
        if self.lods && !matches!(self.format, Format::Glb | Format::Gltf) {
            unused::note("--lods", "only glb and gltf hold levels of detail");
        }
        if self.tolerance_px != KEY_TOLERANCE_PX
            && matches!(
                self.format,
                Format::Csv | Format::Obj | Format::Ply | Format::Qsm | Format::Treefile
            )
        {
            unused::note("--tolerance-px", "this format holds no keys");
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
    Qsm,
    Treefile,
}

impl Format {
    /// What its main file ends in; `None` for a folder.
    fn suffix(&self) -> Option<&'static str> {
        Some(match self {
            Self::Glb => "glb",
            Self::Html => "html",
            Self::Gltf => "gltf",
            Self::Obj => "obj",
            Self::Ply => "ply",
            Self::Qsm => "csv",
            Self::Treefile => "txt",
            Self::Csv => return None,
        })
    }
}

/// Parses `--tolerance-px`, px.
fn tolerance(text: &str) -> Result<f64, String> {
    parse_within(
        text,
        0.001..=100.0,
        "give a number of pixels from 0.001 to 100",
    )
}

pub fn run(args: &ExportArgs) -> Result<(), CommandError> {
    let target = Target::of(args)?;
    target.check_place()?;
    if args.format == Format::Html {
        html::built_in()?;
    }
    let stop = Stop::on_signals()?;
    if ForestDocument::is_in(&args.dir) {
        args.check_forest()?;
        let page = PreparedForest::read(&args.dir)?.page(&target.stem())?;
        return target.write(vec![(target.name(), page)], &stop);
    }
    let mut tree = args.tree.prepare(&args.dir, Tail::Animation, |_| {})?;
    print_warnings(&tree);
    args.note_unused();
    args.height.set(&mut tree);
    if args.format == Format::Csv {
        return write_tables(args, &tree, &stop);
    }
    if matches!(args.format, Format::Qsm | Format::Treefile) {
        return write_qsm(args.format, &tree, &target, &stop);
    }
    let model = Model {
        tolerance_px: args.tolerance_px,
        ..tree.model()
    };
    let mut files = files(args.format, &tree, &model, &target)?;
    if args.lods && matches!(target, Target::Stdout) && args.format == Format::Glb {
        eprint_line(
            "arborcam: warning: standard output takes the finest level alone; give --out a path \
             for the others",
        );
    } else if args.lods && matches!(args.format, Format::Glb | Format::Gltf) {
        for level in 1..LEVELS_OF_DETAIL {
            let model = Model { level, ..model };
            let stem = format!("{}_lod{level}", target.stem());
            files.extend(match args.format {
                Format::Gltf => gltf_files(&model, &stem)?.0,
                _ => vec![(format!("{stem}.glb"), glb(&model)?.0)],
            });
        }
    }
    target.write(files, &stop)
}

/// The files of all formats except csv.
fn files(
    format: Format,
    tree: &PreparedTree,
    model: &Model,
    target: &Target,
) -> Result<Vec<NamedBytes>, ExportError> {
    let (stem, metres_per_px) = (target.stem(), model.metres_per_px);
    let about = tree.document.note.origin().lines();
    let bytes = match format {
        Format::Gltf => return gltf_files(model, &stem).map(|(files, _)| files),
        Format::Obj => return obj_files(&tree.dressed, &stem, metres_per_px, &about),
        Format::Html => tree.page(model, &stem)?,
        Format::Ply => ply(&tree.dressed, metres_per_px, &about)?,
        _ => glb(model)?.0,
    };
    Ok(vec![(target.name(), bytes)])
}

/// Writes the tables, copied or of the changed tree, and the wood as cylinders.
fn write_tables(args: &ExportArgs, tree: &PreparedTree, stop: &Stop) -> Result<(), CommandError> {
    let written = tree.write_tables(&args.out, stop.while_writing())?;
    let film = if written.film {
        "nodes, motion and tracks"
    } else {
        "nodes (there is no film)"
    };
    eprint_line(&format!(
        "{}: {film}, {} cylinders",
        written.dir.display(),
        written.cylinders
    ));
    Ok(())
}

/// Writes the wood as cylinders, and prints what each order of branches sums up to.
fn write_qsm(
    format: Format,
    tree: &PreparedTree,
    target: &Target,
    stop: &Stop,
) -> Result<(), CommandError> {
    let qsm = tree.qsm();
    let bytes = match format {
        Format::Treefile => qsm.treefile().into_bytes(),
        _ => qsm.table(Vec::new())?,
    };
    target.write(vec![(target.name(), bytes)], stop)?;
    let unit = if tree.config.export.metres_per_px > 0.0 {
        "m"
    } else {
        "px"
    };
    for (order, sum) in qsm.by_order().iter().enumerate() {
        let (branches, length, volume) = (sum.branches, sum.length, sum.volume);
        eprint_line(&format!(
            "order {order}: {branches} branches, length {length:.2} {unit}, volume {volume:.5} {unit}3"
        ));
    }
    Ok(())
}

fn bad_usage<T>(why: String) -> Result<T, CommandError> {
    Err(CommandError::BadUsage(anyhow!(why)))
}

/// Where the main file of an export goes; other files may be written beside it.
enum Target<'a> {
    Stdout,
    File(&'a Path),
}

impl<'a> Target<'a> {
    /// # Errors
    /// The path has no file name or another suffix than the format, or the format is more than one
    /// file and cannot go to standard output.
    fn of(args: &'a ExportArgs) -> Result<Self, CommandError> {
        let shown = args.out.display();
        if args.out.as_os_str() == STDOUT {
            return match args.format {
                Format::Glb | Format::Html | Format::Ply | Format::Qsm | Format::Treefile => {
                    Ok(Self::Stdout)
                }
                _ => bad_usage("--out -: this format is more than one file; give a path".into()),
            };
        }
        if args.out.file_name().is_none() {
            return bad_usage(format!(
                "--out {shown} is no name for a file; choose another"
            ));
        }
        let Some(own) = args.format.suffix() else {
            return Ok(Self::File(&args.out));
        };
        let ending = args.out.extension().unwrap_or_default();
        if ending.eq_ignore_ascii_case(own) {
            return Ok(Self::File(&args.out));
        }
        // The other files of these are named after it.
        if matches!(args.format, Format::Gltf | Format::Obj) {
            return bad_usage(format!(
                "--out {shown} does not end in .{own}, as this format must"
            ));
        }
        let mut suffixes = Format::value_variants().iter().filter_map(Format::suffix);
        if suffixes.any(|known| ending.eq_ignore_ascii_case(known)) {
            return bad_usage(format!(
                "--out {shown} ends as another format does; end it in .{own}"
            ));
        }
        Ok(Self::File(&args.out))
    }

    /// Name of the main file.
    fn name(&self) -> String {
        match self {
            Self::Stdout => "tree".into(),
            Self::File(path) => path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
        }
    }

    /// Name of the main file without its suffix.
    fn stem(&self) -> String {
        match self {
            Self::Stdout => "tree".into(),
            Self::File(path) => path
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
        }
    }

    /// Checks, before anything is computed, that the file does not exist.
    fn check_place(&self) -> Result<(), WriteError> {
        match self {
            Self::Stdout => Ok(()),
            Self::File(path) => check_place(path),
        }
    }

    /// Writes all files, or the only one to standard output.
    fn write(&self, files: Vec<NamedBytes>, stop: &Stop) -> Result<(), CommandError> {
        match self {
            Self::Stdout => {
                let bytes: Vec<&[u8]> = files.iter().map(|(_, bytes)| &bytes[..]).collect();
                print_bytes(&bytes)
            }
            Self::File(path) => {
                let size: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
                let folder = path.parent().unwrap_or(Path::new(""));
                write_files(folder, &files, stop.while_writing())?;
                eprint_line(&format!("{}: {:.1} MB", path.display(), size as f64 / 1e6));
                Ok(())
            }
        }
    }
}
