//! `arborcam cloud FILE --out DIR`: a tree from a point cloud, or all of a plot.

mod pairs;
mod plot;
mod table;

use super::command_error::CommandError;
use super::common::parse_within;
use super::output::eprint_line;
use super::stop::Stop;
use super::unused;
use crate::cloud::{
    CloudMethod, CloudOptions, CloudTree, CloudTrees, Colonisation, trees_of_cloud, verdict,
};
use crate::config::{self, Config};
use crate::document::Document;
use crate::files::check_place;
use crate::import::{
    CloudFormat, CloudRead, ImportError, TALL_M, TooFewSaid, Units, cover_px, read_cloud,
};
use crate::model::{PointCloud, Verdict};
use crate::outline;
use crate::pipeline::stand_scanned;
use crate::views::{
    DrawnTree, FilmFit, FilmOnScan, Grounds, ScanSway, filmed_points, odd_pair_of, register_film,
    scan_defaults, sway_on_scan,
};
use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use nalgebra::{Point3, Vector3};
use pairs::{Pairs, read_pairs};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// A place on a tree is no farther off its wood than this, as a share of the tree's size.
const BESIDE_TREE: f64 = 0.2;
/// Radii of twigs that may be given, mm.
const TWIG_RADII_MM: std::ops::RangeInclusive<f64> = 0.1..=100.0;

#[derive(Debug, Args)]
pub struct CloudArgs {
    /// The points of a tree, or of several, z up (.las, .laz, .e57, .ply, .pcd, .xyz, .txt, .asc, .csv, .pts); or a
    /// tree as a table of cylinders or a treefile, which are known by their first line.
    file: PathBuf,
    /// Folder for the tree, or for several trees and their scene. It must not exist, and appears
    /// when it is complete.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// How the middle lines are found; `paths` if not given.
    #[arg(long, value_name = "HOW")]
    method: Option<Method>,
    /// Unit of the file, if it is not the metre and the file does not say it.
    #[arg(long, value_name = "UNIT")]
    unit: Option<Unit>,
    /// Radius of the last twigs, mm, where it was measured.
    #[arg(long, value_name = "MM", value_parser = twig_radius)]
    twig_radius_mm: Option<f64>,
    /// The tree was scanned in leaf: take the leaves off first.
    #[arg(long)]
    in_leaf: bool,
    /// Of several trees only this one, by its number from 1 on: the largest is the first.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    tree: Option<u64>,
    /// Of several trees, write all points with the numbers of their trees (points.ply).
    #[arg(long)]
    points: bool,
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
    /// By space colonisation along the wood.
    Colonisation,
    /// By space colonisation of the bare points, as Runions et al. 2007 have it.
    Runions,
}

impl Method {
    /// The method with its lengths by the settings.
    ///
    /// # Errors
    /// Points would draw from no farther than they are reached.
    fn with(self, settings: &config::Cloud) -> Result<CloudMethod, CommandError> {
        Ok(match self {
            Self::Paths => CloudMethod::Paths,
            Self::Colonisation => {
                CloudMethod::Colonisation(lengths(settings, Colonisation::ALONG_WOOD)?)
            }
            Self::Runions => CloudMethod::Runions(lengths(settings, Colonisation::BARE)?),
        })
    }
}

/// The lengths of space colonisation by the settings; 0 there is that of the method, or farther than points are
/// reached.
///
/// # Errors
/// Points would draw from no farther than they are reached.
fn lengths(settings: &config::Cloud, usual: Colonisation) -> Result<Colonisation, CommandError> {
    let kill_steps = given(settings.kill_steps).unwrap_or(usual.kill_steps);
    let farther = usual.influence_steps.max(2.0 * kill_steps);
    let influence_steps = given(settings.influence_steps).unwrap_or(farther);
    if influence_steps <= kill_steps {
        return Err(CommandError::BadUsage(anyhow!(
            "cloud.influence_steps is {influence_steps}, and points are reached from cloud.kill_steps, {kill_steps}: \
             give more"
        )));
    }
    Ok(Colonisation {
        step_cells: settings.step_cells,
        kill_steps,
        influence_steps,
    })
}

/// A setting that is 0 where it is not given.
fn given(setting: f64) -> Option<f64> {
    (setting > 0.0).then_some(setting)
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
    check_place(&args.out)?;
    let stop = Stop::on_signals()?;
    let config = scan_defaults().layered(args.config.as_deref(), |config| {
        config.wood.seed = args.seed;
    })?;
    let film = args.film.as_deref().map(Document::tree).transpose()?;
    if let Some(table) = table::read(&args.file)? {
        return table::write(args, &table, film.as_ref(), config, &stop);
    }
    let CloudRead {
        cloud,
        units_in_file,
        unknown_system,
        too_few_said,
    } = read(&args.file, args.unit.map(Unit::metres))?;
    print_units(units_in_file);
    let method = args.method.unwrap_or(Method::Paths);
    if method == Method::Paths && config.cloud != config::Cloud::default() {
        unused::note(
            "[cloud] of the settings",
            "it is of --method colonisation and runions",
        );
    }
    let options = CloudOptions {
        method: method.with(&config.cloud)?,
        twig_radius_m: args.twig_radius_mm.map(|mm| 1e-3 * mm),
        in_leaf: args.in_leaf,
    };
    let found = trees_of_cloud(&cloud, options).map_err(|e| args.failed(e))?;
    print_left_out(cloud.not_finite);
    print_too_few_said(too_few_said);
    let given = args.unit.map(|unit| Units::all(unit.metres()));
    let scan = Scan {
        name: args
            .file
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        units: given.or(units_in_file).unwrap_or(Units::METRES),
        unit_is_known: given.or(units_in_file).is_some(),
        unknown_system,
        cloud,
        config,
    };
    let count = found.trees.len() as u64;
    let number = args.tree.or((count == 1).then_some(1));
    let Some(number) = number else {
        args.refuse_film_of_several(count)?;
        return plot::write(args, &scan, found, stop.while_writing());
    };
    if args.points {
        unused::note("--points", "one tree is written");
    }
    let holds_ground = found.figures.ground > 0;
    let tree = args.chosen(found, number)?;
    let drawn = scan.drawn(&tree).map_err(|e| args.failed(e))?;
    let is_stopped = stop.while_writing();
    let branches = drawn.skeleton.botanical_branches().all.len();
    let mut judged = Some(verdict(&tree.figures));
    match &film {
        Some(capture) => {
            judged = args.write_with_film(capture, &tree, &scan, drawn, is_stopped)?;
        }
        None => drawn.write(&args.out, is_stopped)?,
    }
    if !holds_ground {
        eprint_line(
            "arborcam: note: the cloud holds no ground; the lowest wood counts as the foot",
        );
    }
    scan.say_unit("the tree", tree.figures.height_m);
    print_summary(&args.out, &tree, branches, &judged.unwrap_or_default());
    Ok(())
}

/// The points that were read, and what trees of them are made with.
struct Scan {
    name: String,
    cloud: PointCloud,
    /// Of the file.
    units: Units,
    unit_is_known: bool,
    /// The EPSG number of its coordinate system, where nothing says the unit of that.
    unknown_system: Option<u64>,
    config: Config,
}

impl Scan {
    /// A place in the units of the file, m.
    fn metres(&self, at: &Point3<f64>) -> Point3<f64> {
        let Units { along_m, up_m } = self.units;
        Point3::new(along_m * at.x, along_m * at.y, up_m * at.z)
    }

    /// Says which unit was taken where neither the file nor `--unit` does: so high a tree shows it. One that is
    /// too high is a warning. `which` is the tree.
    fn say_unit(&self, which: &str, height_m: f64) {
        if self.unit_is_known {
            return;
        }
        let (word, why) = match self.unknown_system {
            Some(code) => (
                "warning",
                format!("the unit of the file's coordinate system, EPSG:{code}, is not known"),
            ),
            None if height_m > TALL_M => ("warning", "no unit in the file".to_owned()),
            None => ("note", "no unit in the file".to_owned()),
        };
        eprint_line(&format!(
            "arborcam: {word}: {why}: taken as metres, {which} is {height_m:.1} m high; give --unit if that is wrong"
        ));
    }

    /// The tree as a document.
    fn drawn(&self, tree: &CloudTree) -> anyhow::Result<DrawnTree> {
        let scaled = stand_scanned(tree);
        let size = scaled.skeleton.image_size;
        let region = outline::covered(&cover_px(&scaled.skeleton), size)?;
        let (name, config) = (self.name.clone(), self.config.clone());
        Ok(DrawnTree::scanned(
            name,
            &self.cloud,
            tree,
            scaled,
            &region,
            config,
        ))
    }
}

impl CloudArgs {
    /// What failed with this file.
    fn failed(&self, e: impl Into<anyhow::Error>) -> CommandError {
        CommandError::Failed(e.into().context(self.file.display().to_string()))
    }

    /// The tree with this number, and a word on the others.
    ///
    /// # Errors
    /// There are not so many, or it could not be made.
    fn chosen(&self, mut found: CloudTrees, number: u64) -> Result<CloudTree, CommandError> {
        let count = found.trees.len();
        if number > count as u64 {
            let trees = if count == 1 {
                "tree stands"
            } else {
                "trees stand"
            };
            return Err(CommandError::BadUsage(anyhow!(
                "--tree {number}: {count} {trees} in {}; give a number up to {count}",
                self.file.display()
            )));
        }
        if count > 1 {
            eprint_line(&format!("arborcam: note: this is tree {number} of {count}"));
        }
        let tree = found.trees.swap_remove(number as usize - 1);
        tree.map_err(|e| self.failed(e))
    }

    /// A film is of one tree.
    fn refuse_film_of_several(&self, count: u64) -> Result<(), CommandError> {
        if self.film.is_none() {
            return Ok(());
        }
        Err(CommandError::BadUsage(anyhow!(
            "--film: {count} trees stand in {}; say with --tree which of them was filmed",
            self.file.display()
        )))
    }

    /// Writes the tree with the frequencies of a film, and says how well that lies on it. Returns the verdict with
    /// that.
    ///
    /// # Errors
    /// It does not lie on the scan, or the tree cannot be written.
    fn write_with_film(
        &self,
        capture: &Document,
        tree: &CloudTree,
        scan: &Scan,
        mut drawn: DrawnTree,
        is_stopped: &AtomicBool,
    ) -> Result<Option<Verdict>, CommandError> {
        let film = self.laid_on(capture, tree, scan, &drawn)?;
        let swaying = film.branches();
        let pieces = drawn.skeleton.measured_branches().count();
        for warning in film.warnings() {
            eprint_line(&format!("arborcam: warning: {warning}"));
            drawn.note.warnings.push(warning);
        }
        if let Some(finding) = film.finding() {
            drawn.note.verdict = drawn.note.verdict.map(|verdict| verdict.with(finding));
        }
        let verdict = drawn.note.verdict.clone();
        drawn.write_with_film(&self.out, &film, is_stopped)?;
        eprint_line(&format!(
            "{}; {swaying} of {pieces} pieces of branches carry its frequencies (a piece leads from fork to fork)",
            lies_on(&film.fit)
        ));
        for line in film.whereabouts() {
            eprint_line(&line);
        }
        Ok(verdict)
    }

    /// The film on the scan.
    ///
    /// # Errors
    /// It does not lie on the scan.
    fn laid_on(
        &self,
        film: &Document,
        tree: &CloudTree,
        scan: &Scan,
        document: &DrawnTree,
    ) -> Result<FilmOnScan, CommandError> {
        let foot = tree
            .nodes
            .first()
            .map_or(Vector3::zeros(), |n| n.position.coords)
            + scan.cloud.origin;
        let mut pairs = self.pairs.clone();
        let picture = film.skeleton.image_size;
        for pair in pairs.iter_mut().flat_map(|pairs| &mut pairs.0) {
            let at = pair.film_px;
            let [width, height] = [picture.width, picture.height].map(f64::from);
            if !((0.0..=width).contains(&at.x) && (0.0..=height).contains(&at.y)) {
                return Err(CommandError::Failed(anyhow!(
                    "--pairs: {}, {} lies off the picture of the film, {picture}; give places in px from the left and \
                     from the top",
                    at.x,
                    at.y
                )));
            }
            let given = pair.scan;
            pair.scan = scan.metres(&given) - foot;
            if !is_at(tree, &pair.scan) {
                return Err(CommandError::Failed(anyhow!(
                    "--pairs: {}, {}, {} lies off the tree of the scan; give places on it, in the unit of the scan",
                    given.x,
                    given.y,
                    given.z
                )));
            }
        }
        let pairs = pairs.as_ref().map(|pairs| pairs.0.as_slice());
        let found = register_film(tree, film, pairs);
        let fit = found.filter(FilmFit::holds).ok_or_else(|| {
            let what = match &self.pairs {
                Some(pairs) => {
                    let why = pairs_say_too_little(found.as_ref());
                    why + &odd_pair_said(pairs, film).unwrap_or_default()
                }
                None => "it is not found from where it was filmed; if it is of this tree, give three places in both \
                         with --pairs"
                    .to_owned(),
            };
            CommandError::Failed(anyhow!("--film {}: {what}", film.dir.display()))
        })?;
        let metres_per_px = document.note.config.export.metres_per_px;
        let ScanSway { sway, laid } = sway_on_scan(
            &document.skeleton,
            metres_per_px,
            film,
            &filmed_points(film)?,
            &fit.registration,
        );
        let has_tag = film.note.tag.is_some();
        Ok(FilmOnScan {
            fit,
            sway,
            laid,
            has_tag,
            film_metres_per_px: film.note.config.export.metres_per_px,
        })
    }
}

/// Whether a place, m from the foot, is not far off the tree: what was left out as leaves reaches farther than
/// the wood.
fn is_at(tree: &CloudTree, place: &Point3<f64>) -> bool {
    let Some(foot) = tree.nodes.first().map(|node| node.position) else {
        return false;
    };
    let ways = tree.nodes.iter().map(|node| node.position - foot);
    let (low, high) = ways.fold((Vector3::zeros(), Vector3::zeros()), |(low, high), way| {
        (low.inf(&way), high.sup(&way))
    });
    let margin = Vector3::repeat(BESIDE_TREE * (high - low).max());
    let nearest = place.coords.sup(&(low - margin)).inf(&(high + margin));
    nearest == place.coords
}

/// How well a film lies on a scan.
fn lies_on(fit: &FilmFit) -> String {
    format!(
        "the film lies on the scan within {:.1} % of its height",
        100.0 * fit.off_hi
    )
}

/// Why a film does not lie on its scan by the pairs of a user.
fn pairs_say_too_little(fit: Option<&FilmFit>) -> String {
    match fit.filter(|fit| fit.registration.holds()) {
        Some(fit) if fit.grounds == Grounds::LinesAgainstPairs => format!(
            "the lines of film and scan lie on each other within {:.1} % of the height, and not where --pairs has \
             them; check the pairs, or leave them out",
            100.0 * fit.off_hi
        ),
        Some(fit) => format!(
            "the lines of film and scan do not confirm the pairs of --pairs, and these alone leave places off by up to \
             {:.1} % of the height, where 2 % are allowed; give more, all over the tree",
            100.0 * fit.off_hi
        ),
        None => "the pairs of --pairs do not agree with each other, lie on one line, or show the tree in a size or a \
                 roll that no film has; check them, or give more"
            .to_owned(),
    }
}

/// Which of the pairs does not fit the others, where one alone does not.
fn odd_pair_said(pairs: &Pairs, film: &Document) -> Option<String> {
    let at = pairs.0[odd_pair_of(film, &pairs.0)?].film_px;
    Some(format!(
        "; without the one at {}, {} px they agree",
        at.x, at.y
    ))
}

/// Reads the points of a file.
///
/// # Errors
/// The file cannot be opened, or holds no points that can be read.
fn read(path: &Path, unit_m: Option<f64>) -> Result<CloudRead, CommandError> {
    if path.is_dir() {
        return Err(CommandError::NoInput(anyhow!(
            "cannot read {}: it is a folder; give a file of points",
            path.display()
        )));
    }
    let format = CloudFormat::of_name(path).with_context(|| path.display().to_string());
    let format = format.map_err(CommandError::BadUsage)?;
    let file = File::open(path).map_err(|e| {
        CommandError::NoInput(anyhow!("cannot read {}: {e}; give another", path.display()))
    })?;
    read_cloud(BufReader::new(file), format, unit_m).map_err(|e| match e {
        ImportError::Unreadable { .. } => CommandError::NoInput(anyhow!("{}: {e}", path.display())),
        e => CommandError::Failed(anyhow!("{}: {e}", path.display())),
    })
}

/// A word on units that the file names, where they are no metres.
fn print_units(units: Option<Units>) {
    let Some(units) = units.filter(|u| *u != Units::METRES) else {
        return;
    };
    let Units { along_m, up_m } = units;
    let heights = match along_m == up_m {
        true => String::new(),
        false => format!(", and of its heights {up_m:.4} m"),
    };
    eprint_line(&format!(
        "arborcam: note: the file's unit is {along_m:.4} m{heights}, as its coordinate system says"
    ));
}

/// A word on points that were left out as they are no places.
fn print_left_out(not_finite: usize) {
    if not_finite > 0 {
        let (points, their) = match not_finite {
            1 => ("point is", "its"),
            _ => ("points are", "their"),
        };
        eprint_line(&format!(
            "arborcam: note: {not_finite} {points} left out: not all of {their} coordinates are numbers"
        ));
    }
}

/// A warning of a header that does not say all points.
fn print_too_few_said(said: Option<TooFewSaid>) {
    if let Some(TooFewSaid { said, room }) = said {
        eprint_line(&format!(
            "arborcam: warning: the header says {said} points, and there is room for {room} in the file: those behind \
             are not read. Perhaps its writing was not finished: have a program for point clouds write it anew"
        ));
    }
}

/// How many branches a tree has, in words.
fn branches_said(branches: usize) -> String {
    match branches {
        1 => "1 branch".to_owned(),
        n => format!("{n} branches"),
    }
}

fn print_summary(out: &Path, tree: &CloudTree, branches: usize, verdict: &Verdict) {
    let figures = tree.figures;
    let leaves = match figures.leaves {
        0 => String::new(),
        leaves => format!(", {:.0} % leaves", figures.percent(leaves)),
    };
    eprint_line(&format!(
        "{}: a tree of {}, {:.2} m high; of {} points {:.0} % are ground{leaves} \
         and {:.1} % noise",
        out.display(),
        branches_said(branches),
        figures.height_m,
        figures.points,
        figures.percent(figures.ground),
        figures.percent(figures.noise),
    ));
    eprint_line(&verdict.labelled_line());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{CloudFigures, CloudNode};

    #[test]
    fn a_place_is_at_a_tree_or_off_it() {
        let node = |parent, z| CloudNode {
            parent,
            position: Point3::new(3.0, 4.0, z),
            radius: 0.1,
            is_measured: true,
            is_joint: false,
        };
        let tree = CloudTree {
            nodes: vec![node(None, 1.0), node(Some(0), 11.0)],
            figures: CloudFigures::default(),
        };
        for (place, expected) in [
            ([0.0, 0.0, 10.0], true),
            ([1.5, -1.5, 5.0], true),
            ([0.0, 0.0, 13.0], false),
            ([20.0, 0.0, 5.0], false),
        ] {
            assert_eq!(is_at(&tree, &Point3::from(place)), expected, "{place:?}");
        }
        assert!(!is_at(
            &CloudTree {
                nodes: Vec::new(),
                ..tree
            },
            &Point3::origin()
        ));
    }
}
