//! The lines of a filmed tree beside those of its scan: what their pairs say of how the one lies on the
//! other, and how surely. See [`FilmFit`](super::film_fit::FilmFit).

use crate::cloud::{LinePlace, PlacePair, Registration, WoodPiece, places_seen, thickest};
use crate::signal::median;
use nalgebra::{Point2, Point3, SMatrix, SVector, Similarity2, UnitComplex, Vector2};

/// Lines are sampled at so many places in the height of the tree.
const SAMPLES_IN_HEIGHT: f64 = 150.0;
/// Of the scan the thickest wood counts, so long as this many times the wood of the film.
const SCAN_LENGTHS: f64 = 1.6;
/// A line at a right angle counts as so far away, as a share of the height.
const ACROSS_SHARE: f64 = 0.04;
/// Lines are known to this share of the height at best: less than a pixel.
const LEAST_SCALE_SHARE: f64 = 0.002;
/// A normal distribution is so many times as wide as its median distance.
const SD_PER_MEDIAN: f64 = 1.4826;
/// Fewer branches say nothing of how branches are off.
const LEAST_BRANCHES: usize = 3;

/// A straight piece of filmed wood in the picture's plane, px, y up, the foot at the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmPiece {
    pub wood: WoodPiece<Point2<f64>>,
    /// The number of its branch.
    pub branch: usize,
}

/// Turn, roll, logarithm of the scale, and shift, px.
pub(super) const UNKNOWNS: usize = 5;
pub(super) type Step = SVector<f64, UNKNOWNS>;
pub(super) type Square = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

pub(super) fn moved(registration: &mut Registration, step: &Step) {
    registration.turn += step[0];
    let old = registration.to_picture;
    let rotation = UnitComplex::new(step[1]) * old.isometry.rotation;
    let shift = old.isometry.translation.vector + Vector2::new(step[3], step[4]);
    let scale = old.scaling() * step[2].exp();
    registration.to_picture = Similarity2::from_parts(shift.into(), rotation, scale);
}

/// How a place of the scan moves in the picture with each part of a step.
fn moves(registration: &Registration, at: &Point3<f64>) -> SMatrix<f64, 2, UNKNOWNS> {
    let linear = registration.to_picture;
    let origin = linear * Point2::origin();
    let off = registration.project(at) - origin;
    let (sin, cos) = registration.turn.sin_cos();
    let sideways = linear * Vector2::new(cos * at.y - sin * at.x, 0.0);
    SMatrix::from_columns(&[
        sideways,
        Vector2::new(-off.y, off.x),
        off,
        Vector2::x(),
        Vector2::y(),
    ])
}

/// The lines of both, in short parts.
pub(super) struct Lines {
    film: Vec<LinePlace>,
    /// Of each the number of its branch.
    branches: Vec<usize>,
    scan: Vec<WoodPiece<Point3<f64>>>,
    height_px: f64,
}

/// What pairs of lines say of a step.
pub(super) struct Equations {
    normal: Square,
    right: Step,
    /// The right side by the film's branches.
    by_branch: Vec<Step>,
    /// What the film's lines miss those of the scan by, as a share of the height, median.
    pub miss: f64,
}

impl Equations {
    /// The step that they ask for.
    pub fn step(&self) -> Option<Step> {
        Some(self.normal.try_inverse()? * self.right)
    }

    /// That of clustered errors.
    pub fn covariance(&self) -> Option<Square> {
        let branches: Vec<&Step> = self.by_branch.iter().filter(|b| b.norm() > 0.0).collect();
        if branches.len() < LEAST_BRANCHES {
            return None;
        }
        let count = branches.len() as f64;
        let between: Square = branches.iter().map(|b| *b * b.transpose()).sum();
        let inverse = self.normal.try_inverse()?;
        Some(count / (count - 1.0) * inverse * between * inverse)
    }
}

/// A place of the film beside one of the scan.
struct Beside {
    film: usize,
    scan: usize,
    /// In place and direction, px.
    off: f64,
    /// Of the line on which the partner was looked for.
    normal: Vector2<f64>,
}

impl Lines {
    /// `None` where one of both has no lines.
    pub fn of(film: &[FilmPiece], scan: &[WoodPiece<Point3<f64>>], px_per_m: f64) -> Option<Self> {
        let tops = film.iter().map(|p| p.wood.to.y.max(p.wood.from.y));
        let height_px = tops.fold(0.0, f64::max);
        let step_px = height_px / SAMPLES_IN_HEIGHT;
        if !(step_px > 0.0 && px_per_m > 0.0) {
            return None;
        }
        let length_px: f64 = film.iter().map(|p| p.wood.length()).sum();
        let thickest = thickest(scan, SCAN_LENGTHS * length_px / px_per_m);
        let mut lines = Self {
            film: Vec::new(),
            branches: Vec::new(),
            scan: thickest
                .iter()
                .flat_map(|p| p.cut(step_px / px_per_m))
                .collect(),
            height_px,
        };
        for piece in film {
            lines
                .film
                .extend(piece.wood.cut(step_px).map(|p| p.place()));
            lines.branches.resize(lines.film.len(), piece.branch);
        }
        let is_enough = !lines.film.is_empty() && !lines.scan.is_empty();
        is_enough.then_some(lines)
    }

    fn middle(&self, k: usize) -> Point3<f64> {
        nalgebra::center(&self.scan[k].from, &self.scan[k].to)
    }

    /// What pairs of lines say of the next step; `None` where there are none.
    pub fn equations(&self, registration: &Registration) -> Option<Equations> {
        let scan = places_seen(&self.scan, |at| registration.project(at));
        let across = ACROSS_SHARE * self.height_px;
        let mut of_film = Vec::with_capacity(self.film.len());
        for (film, own) in self.film.iter().enumerate() {
            let other = own.nearest_of(&scan, across)?;
            of_film.push(Beside {
                film,
                scan: other.place,
                off: other.off,
                normal: scan[other.place].normal(),
            });
        }
        let mut of_scan = Vec::with_capacity(scan.len());
        for (own, line) in scan.iter().enumerate() {
            let other = line.nearest_of(&self.film, across)?;
            of_scan.push(Beside {
                film: other.place,
                scan: own,
                off: other.off,
                normal: self.film[other.place].normal(),
            });
        }
        let branches = self.branches.iter().max()? + 1;
        let mut equations = Equations {
            normal: Square::zeros(),
            right: Step::zeros(),
            by_branch: vec![Step::zeros(); branches],
            miss: median_off(&of_film) / self.height_px,
        };
        for pairs in [&of_film, &of_scan] {
            let least_px = LEAST_SCALE_SHARE * self.height_px;
            let scale_px = (SD_PER_MEDIAN * median_off(pairs)).max(least_px);
            for pair in pairs {
                let off = pair.off / scale_px;
                let robust = (1.0 + off * off).powi(-2);
                let weight = robust / (pairs.len() as f64 * scale_px * scale_px);
                let film = self.film[pair.film].at;
                let miss_px = (film - scan[pair.scan].at).dot(&pair.normal);
                let row = moves(registration, &self.middle(pair.scan)).transpose() * pair.normal;
                equations.normal += weight * row * row.transpose();
                equations.right += weight * miss_px * row;
                equations.by_branch[self.branches[pair.film]] += weight * miss_px * row;
            }
        }
        Some(equations)
    }

    /// Whether a scan so high, m, is about as high in the picture as the film.
    pub fn fits_height(&self, registration: &Registration, height_m: f64) -> bool {
        registration.fits_height(height_m, self.height_px)
    }

    /// The covariance of the step that pairs of places ask for, whose standard deviation along either axis is this
    /// share of the height; `None` where they do not say all of it.
    pub fn pairs_covariance(
        &self,
        registration: &Registration,
        pairs: &[PlacePair],
        sd_share: f64,
    ) -> Option<Square> {
        let sd_px = sd_share * self.height_px;
        let mut normal = Square::zeros();
        for pair in pairs {
            let moves = moves(registration, &pair.scan);
            normal += moves.transpose() * moves / sd_px.powi(2);
        }
        normal.try_inverse()
    }

    /// How far a step moves the tree, root mean square, as a share of its height.
    pub fn off_by(&self, registration: &Registration, step: &Step) -> f64 {
        self.spread(registration, &(step * step.transpose()))
    }

    /// How far places are off by this covariance, root mean square, as a share of the height.
    pub fn spread(&self, registration: &Registration, covariance: &Square) -> f64 {
        let mut squares = 0.0;
        for k in 0..self.scan.len() {
            let moves = moves(registration, &self.middle(k));
            squares += (moves * covariance * moves.transpose()).trace();
        }
        (squares / self.scan.len() as f64).sqrt() / self.height_px
    }

    /// The same by a roll of one radian about the foot.
    pub fn swing_share(&self, registration: &Registration) -> f64 {
        self.off_by(registration, &Step::new(0.0, 1.0, 0.0, 0.0, 0.0))
    }
}

fn median_off(pairs: &[Beside]) -> f64 {
    let offs = pairs.iter().map(|p| p.off).collect();
    median(offs, f64::total_cmp).unwrap_or(0.0)
}
