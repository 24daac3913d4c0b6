//! `arborcam cloud FILE --out DIR`: a tree from a point cloud.

use super::command_error::CommandError;
use super::common::parse_within;
use super::output::eprint_line;
use super::stop::Stop;
use crate::cloud::{CloudMethod, CloudOptions, CloudTree, PlacePair, Registration, tree_of_cloud};
use crate::document::Document;
use crate::files::{read_bounded, refuse_taken};
use crate::import::{CloudFormat, CloudRead, FlatTree, ImportError, read_cloud};
use crate::model::PointCloud;
use crate::outline;
use crate::pipeline::stand_scanned;
use crate::views::{DrawnTree, FilmOnScan, register_film, scan_defaults, sway_on_scan};
use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use nalgebra::{Point2, Point3, Vector3};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// The first line of `--pairs`, and the largest such table, bytes.
const PAIR_COLUMNS: &str = "u_px,v_px,x,y,z";
const LARGEST_PAIRS: u64 = 1_000_000;
/// Radii of twigs that may be given, mm.
const TWIG_RADII_MM: std::ops::RangeInclusive<f64> = 0.1..=100.0;

#[derive(Debug, Args)]
pub struct CloudArgs {
    /// The points of one tree, z up (.las, .laz, .e57, .ply, .pcd, .xyz, .txt, .asc).
    file: PathBuf,
    /// Folder for the tree. It must not exist, and appears when it is complete.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// How the middle lines are found.
    #[arg(long, value_name = "HOW", default_value = "paths")]
    method: Method,
    /// Unit of the file, if it is not the metre and the file does not say it.
    #[arg(long, value_name = "UNIT")]
    unit: Option<Unit>,
    /// Radius of the last twigs, mm, where it was measured.
    #[arg(long, value_name = "MM", value_parser = twig_radius)]
    twig_radius_mm: Option<f64>,
    /// The tree was scanned in leaf: take the leaves off first.
    #[arg(long)]
    in_leaf: bool,
    /// A capture of the same tree: its frequencies and damping are put on the scanned branches.
    /// From where it was filmed is found by itself, or by --pairs.
    #[arg(long, value_name = "DIR")]
    film: Option<PathBuf>,
    /// Places that are the same in film and scan, three at least: a table (.csv) with the columns
    /// u_px,v_px,x,y,z.
    #[arg(long, value_name = "FILE", requires = "film", value_parser = read_pairs)]
    pairs: Option<Pairs>,
    /// Seed of the random numbers in the looks of the wood; the same seed gives the same tree.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u32,
    /// Settings that differ from the defaults (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Method {
    /// By the shortest ways from the foot along the wood.
    Paths,
    /// By space colonisation (Runions et al. 2007).
    Colonisation,
}

impl From<Method> for CloudMethod {
    fn from(method: Method) -> Self {
        match method {
            Method::Paths => Self::Paths,
            Method::Colonisation => Self::Colonisation,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Unit {
    M,
    Cm,
    Mm,
    /// International foot.
    Ft,
    /// Foot of the surveys of the USA.
    UsFt,
    In,
}

impl Unit {
    fn metres(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Cm => 0.01,
            Self::Mm => 0.001,
            Self::Ft => 0.3048,
            Self::UsFt => 1200.0 / 3937.0,
            Self::In => 0.0254,
        }
    }
}

/// Parses `--twig-radius-mm`.
fn twig_radius(text: &str) -> Result<f64, String> {
    parse_within(
        text,
        TWIG_RADII_MM,
        "give a number of millimetres from 0.1 to 100",
    )
}

pub fn run(args: &CloudArgs) -> Result<(), CommandError> {
    refuse_taken(&args.out)?;
    let stop = Stop::on_signals()?;
    let config = scan_defaults().layered(args.config.as_deref(), |config| {
        config.wood.seed = args.seed;
    })?;
    let of_file =
        |e: anyhow::Error| CommandError::Failed(e.context(args.file.display().to_string()));
    let CloudRead {
        cloud,
        unit_in_file_m,
    } = read(&args.file, args.unit.map(Unit::metres))?;
    if let (Some(unit_m), None) = (unit_in_file_m, args.unit) {
        eprint_line(&format!(
            "arborcam: note: the file's unit is {unit_m:.4} m, as its coordinate system says"
        ));
    }
    let options = CloudOptions {
        method: args.method.into(),
        twig_radius_m: args.twig_radius_mm.map(|mm| 1e-3 * mm),
        in_leaf: args.in_leaf,
    };
    let tree = tree_of_cloud(&cloud, options).map_err(|e| of_file(e.into()))?;
    let scaled = stand_scanned(&tree);
    let flat = FlatTree {
        skeleton: scaled.skeleton.clone(),
        has_radii: true,
        trunk_px: Vec::new(),
        crown_px: Vec::new(),
    };
    let region = outline::covered(&flat.cover_px(), scaled.skeleton.image_size);
    let region = region.map_err(|e| of_file(e.into()))?;
    let name = args.file.file_name().unwrap_or_default().to_string_lossy();
    let document = DrawnTree::scanned(name.into_owned(), &cloud, &tree, scaled, &region, config);
    if stop.while_writing().load(Ordering::SeqCst) {
        return Err(CommandError::Stopped);
    }
    let branches = document.skeleton.measured_branches().count();
    let unit_m = args.unit.map(Unit::metres).or(unit_in_file_m);
    match args.film_on(&tree, &cloud, unit_m.unwrap_or(1.0), &document)? {
        Some(film) => {
            let (swaying, miss) = (film.branches(), 100.0 * film.registration.miss);
            document.write_with_film(&args.out, &film)?;
            eprint_line(&format!(
                "the film lies on the scan to {miss:.1} % of its height; {swaying} of {branches} \
                 branches carry its frequencies"
            ));
        }
        None => drop(document.write(&args.out)?),
    }
    print_summary(&args.out, &tree, branches);
    Ok(())
}

impl CloudArgs {
    /// The film on the scan, if there is one. `unit_m` is the unit of the scan, m.
    ///
    /// # Errors
    /// It cannot be read, or does not lie on the scan.
    fn film_on(
        &self,
        tree: &CloudTree,
        cloud: &PointCloud,
        unit_m: f64,
        document: &DrawnTree,
    ) -> Result<Option<FilmOnScan>, CommandError> {
        let Some(dir) = &self.film else {
            return Ok(None);
        };
        let film = Document::tree(dir)?;
        let foot = tree
            .nodes
            .first()
            .map_or(Vector3::zeros(), |n| n.position.coords)
            + cloud.origin;
        let pairs = self.pairs.as_ref().map(|pairs| {
            let against_foot = |p: &PlacePair| PlacePair {
                scan: p.scan * unit_m - foot,
                ..*p
            };
            pairs.0.iter().map(against_foot).collect::<Vec<_>>()
        });
        let registration = register_film(tree, &film, pairs.as_deref()).filter(Registration::holds);
        let registration = registration.ok_or_else(|| {
            let what = match self.pairs {
                Some(_) => "the pairs of --pairs do not agree with each other; check them, or give more",
                None => "it is not found from where it was filmed; give three places in both with --pairs",
            };
            CommandError::Failed(anyhow!("--film {}: {what}", dir.display()))
        })?;
        let metres_per_px = document.note.config.export.metres_per_px;
        let sway = sway_on_scan(&document.skeleton, metres_per_px, &film, &registration);
        Ok(Some(FilmOnScan { registration, sway }))
    }
}

/// The places of `--pairs`, in the unit of the scan.
#[derive(Clone, Debug)]
struct Pairs(Vec<PlacePair>);

/// Parses `--pairs`.
fn read_pairs(path: &str) -> Result<Pairs, String> {
    let bytes =
        read_bounded(Path::new(path), LARGEST_PAIRS).map_err(|e| format!("{e}; give a table"))?;
    let text = String::from_utf8_lossy(&bytes);
    let mut lines = (1..)
        .zip(text.lines().map(str::trim))
        .filter(|(_, line)| !line.is_empty());
    if lines
        .next()
        .is_none_or(|(_, line)| line.replace(' ', "") != PAIR_COLUMNS)
    {
        return Err(format!("its first line must be {PAIR_COLUMNS}"));
    }
    let mut pairs = Vec::new();
    for (number, line) in lines {
        let cells: Option<Vec<f64>> = line
            .split(',')
            .map(|cell| cell.trim().parse().ok())
            .collect();
        match cells.as_deref() {
            Some(&[u, v, x, y, z]) if [u, v, x, y, z].iter().all(|n| n.is_finite()) => {
                pairs.push(PlacePair {
                    film_px: Point2::new(u, v),
                    scan: Point3::new(x, y, z),
                })
            }
            _ => return Err(format!("line {number} does not hold five numbers")),
        }
    }
    match pairs.len() {
        0..3 => Err(format!(
            "it holds {} pairs, and three are needed",
            pairs.len()
        )),
        _ => Ok(Pairs(pairs)),
    }
}

/// Reads the points of a file.
///
/// # Errors
/// The file cannot be opened, or holds no points that can be read.
fn read(path: &Path, unit_m: Option<f64>) -> Result<CloudRead, CommandError> {
    let format = CloudFormat::of_name(path).with_context(|| path.display().to_string());
    let format = format.map_err(CommandError::BadUsage)?;
    let file = File::open(path).and_then(|file| match file.metadata()?.is_dir() {
        true => Err(std::io::ErrorKind::IsADirectory.into()),
        false => Ok(file),
    });
    let file = file.map_err(|e| {
        CommandError::NoInput(anyhow!("cannot read {}: {e}; give another", path.display()))
    })?;
    read_cloud(BufReader::new(file), format, unit_m).map_err(|e| match e {
        ImportError::Unreadable { .. } => CommandError::NoInput(anyhow!("{}: {e}", path.display())),
        e => CommandError::Failed(anyhow!("{}: {e}", path.display())),
    })
}

fn print_summary(out: &Path, tree: &CloudTree, branches: usize) {
    let figures = tree.figures;
    let share = |points: usize| 100.0 * points as f64 / figures.points.max(1) as f64;
    let leaves = match figures.leaves {
        0 => String::new(),
        leaves => format!(", {:.0} % leaves", share(leaves)),
    };
    eprint_line(&format!(
        "{}: a tree of {branches} branches, {:.2} m high; of {} points {:.0} % are ground{leaves} \
         and {:.1} % noise",
        out.display(),
        figures.height_m,
        figures.points,
        share(figures.ground),
        share(figures.noise),
    ));
}
