//! `arborcam export DIR --format F --out PATH`: a capture's tree as a file for other programs.

use super::shaping::{Made, Shaping};
use super::stop::Stop;
use super::{Ended, idle, say};
use crate::export::csv::{MotionCsv, nodes};
use crate::export::cylinders::cylinders;
use crate::export::gltf::{KEY_TOLERANCE_PX, Model, NamedBytes, glb, gltf_files};
use crate::export::still::{obj_files, ply};
use crate::export::{ExportError, OutputFolder, html, refuse_taken, tracks_of, write_files};
use crate::model::NodeName;
use crate::shape::cylinders as cylinders_of;
use anyhow::anyhow;
use clap::{Args, ValueEnum};
use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

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
    shaping: Shaping,
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
    target.refuse_taken().map_err(failed)?;
    if args.format == Format::Html {
        html::built_in().map_err(failed)?;
    }
    let stop = Stop::on_signals()?;
    let made = args.shaping.made(&args.dir)?;
    for warning in &made.captured.warnings {
        say(&format!("arborcam: warning: {warning}"));
    }
    args.tell_idle();
    let model = Model {
        tolerance_px: args.tolerance_px,
        all_levels: args.lods && args.format != Format::Html,
        ..made.model()
    };
    let metres_per_px = made.config.export.metres_per_px;
    let stem = target.stem();
    let files = match args.format {
        Format::Csv => return tables(args, &made, &stop),
        Format::Html => page(&made, &model, &stem).map(|bytes| vec![(target.name(), bytes)]),
        Format::Glb => glb(&model).map(|(bytes, _)| vec![(target.name(), bytes)]),
        Format::Gltf => gltf_files(&model, &stem).map(|(files, _)| files),
        Format::Obj => obj_files(&made.dressed, &stem, metres_per_px),
        Format::Ply => ply(&made.dressed, metres_per_px).map(|bytes| vec![(target.name(), bytes)]),
    };
    target.write(files.map_err(failed)?, &stop)
}

/// The model as a page that shows it.
pub fn page(made: &Made, model: &Model, title: &str) -> Result<Vec<u8>, ExportError> {
    let (model, _) = glb(model)?;
    let captured = &made.captured;
    let metres_per_px = made.config.export.metres_per_px;
    let data = html::Data::of(
        &captured.note,
        &made.skeleton,
        &made.poses,
        &made.sway,
        metres_per_px,
    );
    let picture = captured.picture.as_ref().map(|p| &*p.rgb);
    html::page(&html::Page {
        title,
        glb: &model,
        data: &data,
        picture,
    })
    .map(String::into_bytes)
}

/// How a command ends whose files could not be written.
pub fn failed(e: ExportError) -> Ended {
    match e {
        ExportError::Stopped => Ended::Stopped,
        e => Ended::Failed(e.into()),
    }
}

/// The file that was asked for; others may come beside it.
enum Target<'a> {
    Stdout,
    Beside(&'a Path),
}

impl<'a> Target<'a> {
    fn of(args: &'a ExportArgs) -> Result<Self, Ended> {
        let unfit = |why: String| Err(Ended::BadUsage(anyhow!(why)));
        let shown = args.out.display();
        if args.out.as_os_str() == STDOUT {
            return match args.format {
                Format::Glb | Format::Html | Format::Ply => Ok(Self::Stdout),
                _ => unfit("--out -: this format is more than one file; give a path".into()),
            };
        }
        if args.out.file_name().is_none() {
            return unfit(format!(
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
            return unfit(format!(
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
    fn refuse_taken(&self) -> Result<(), ExportError> {
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
                write_files(folder, &files, stop.while_writing()).map_err(failed)?;
                say(&format!("{}: {:.1} MB", path.display(), size as f64 / 1e6));
                Ok(())
            }
        }
    }
}

/// The tables of the capture, as they are or of the changed tree, and the wood as cylinders.
fn tables(args: &ExportArgs, made: &Made, stop: &Stop) -> Result<(), Ended> {
    let rows = cylinders_of(&made.dressed.limbs);
    let stop = stop.while_writing();
    let folder = OutputFolder::create(&args.out).map_err(failed)?;
    let metres_per_px = made.config.export.metres_per_px;
    let names: BTreeSet<NodeName> = made.skeleton.nodes.iter().map(|n| n.name).collect();
    // Nothing was measured on copies.
    if made
        .captured
        .skeleton
        .nodes
        .iter()
        .all(|n| n.copy_of.is_some() || names.contains(&n.name))
    {
        folder.copy("tracks.csv", &args.dir, stop).map_err(failed)?;
    } else {
        tracks_of(&folder, &args.dir, &names, stop).map_err(failed)?;
    }
    if !made.reshaped && metres_per_px == made.captured.note.config.export.metres_per_px {
        folder.copy("nodes.csv", &args.dir, stop).map_err(failed)?;
        folder.copy("motion.csv", &args.dir, stop).map_err(failed)?;
    } else {
        let file = |name| folder.file(name).map_err(failed);
        nodes(
            file("nodes.csv")?,
            &made.skeleton,
            &made.sway,
            metres_per_px,
        )
        .map_err(failed)?;
        let mut motion =
            MotionCsv::new(file("motion.csv")?, &made.skeleton, metres_per_px).map_err(failed)?;
        // Not only the poses of the animation: `tracks.csv` beside it is of the whole film.
        for pose in made.film()? {
            if stop.load(Ordering::SeqCst) {
                return Err(Ended::Stopped);
            }
            motion.pose(&pose?).map_err(failed)?;
        }
        motion.finish().map_err(failed)?;
    }
    let write_rows = || cylinders(folder.file("cylinders.csv")?, &rows, metres_per_px).map(drop);
    write_rows()
        .and_then(|()| folder.publish())
        .map_err(failed)
        .map(|dir| {
            say(&format!(
                "{}: nodes, motion and tracks, {} cylinders",
                dir.display(),
                rows.len()
            ));
        })
}
