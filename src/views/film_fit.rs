//! How surely a film lies on a scan, and how a tree leans in the film.
//!
//! A registration that was found is made finer: each line is brought to the line nearest to it, along
//! the normal alone (Chen and Medioni 1992), with weights that leave out what has no partner (Geman and
//! McClure 1987). Its covariance is that of clustered errors (Liang and Zeger 1986), a filmed branch a
//! cluster: all places of a branch are off together.
//!
//! In steady wind a tree leans as a whole. In the picture that is a roll of the camera about the foot:
//! lines alone cannot part the two. What is known of the upright does.

use crate::cloud::{Registration, WoodPiece};
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
/// Rounds of pairing; it stands still when nothing moves by more than this share of the height.
const ROUNDS: usize = 20;
const STANDS_STILL: f64 = 1e-5;
/// Fewer branches say nothing of how branches are off.
const LEAST_BRANCHES: usize = 3;
/// Standard deviations within which it is in 95 of 100 cases.
const SDS: f64 = 2.0;
/// A film that lies on the scan no better than this, as a share of the height, is not found.
const LARGEST_OFF: f64 = 0.02;
/// Standard deviation of the roll of a camera that was set up level, and of a tag that was hung
/// upright, degrees: guesses.
const CAMERA_ROLL_SD_DEG: f64 = 1.0;
const TAG_HANGS_SD_DEG: f64 = 0.5;

/// A straight piece of filmed wood in the picture's plane, px, y up, the foot at the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmPiece {
    pub wood: WoodPiece<Point2<f64>>,
    /// The number of its branch.
    pub branch: usize,
}

/// How a film lies on a scan, and how surely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmFit {
    pub registration: Registration,
    /// By how much places of the scan are off in the picture at most in 95 of 100 cases, root mean
    /// square over the tree, as a share of its height; `None` by pairs of places.
    pub off_hi: Option<f64>,
    /// Of a film in wind.
    pub lean: Option<Lean>,
}

/// How far a tree leans to the right in the picture of a film in wind, against the scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lean {
    /// Radians.
    pub angle: f64,
    /// As [`FilmFit::off_hi`], of the places at rest, when the lean is taken back.
    pub rest_off_hi: f64,
}

/// What is known of the upright in the picture of a film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Upright {
    /// The camera was set up level, more or less.
    Camera,
    /// From the upright of the picture to that of a tag, clockwise, and the standard deviation of that by
    /// the edges of the tag.
    Tag { roll_deg: f64, sd_deg: f64 },
}

impl FilmFit {
    /// Of a registration by pairs of places.
    pub fn by_pairs(registration: Registration) -> Self {
        Self {
            registration,
            off_hi: None,
            lean: None,
        }
    }

    /// Whether it may be used: the registration holds, and is sure enough.
    pub fn holds(&self) -> bool {
        self.registration.holds() && self.off_hi.is_none_or(|off| off <= LARGEST_OFF)
    }

    /// Whether places of the tree at rest are less sure than the registration should be.
    pub fn is_rest_unsure(&self) -> bool {
        self.lean.is_some_and(|lean| lean.rest_off_hi > LARGEST_OFF)
    }

    /// Makes a registration by lines finer. `upright` is given for films in wind. `None` where too few
    /// branches were filmed, or lines say nothing.
    pub fn by_lines(
        found: Registration,
        film: &[FilmPiece],
        scan: &[WoodPiece<Point3<f64>>],
        upright: Option<Upright>,
    ) -> Option<Self> {
        let lines = Lines::of(film, scan, found.to_picture.scaling())?;
        let mut registration = found;
        let mut equations = lines.equations(&registration)?;
        for _ in 0..ROUNDS {
            let step = equations.normal.try_inverse()? * equations.right;
            moved(&mut registration, &step);
            equations = lines.equations(&registration)?;
            if lines.off_by(&registration, &step) < STANDS_STILL {
                break;
            }
        }
        let covariance = equations.covariance()?;
        let spread = lines.spread(&registration, &covariance);
        // What lines miss each other by does not become less with more of them: branches hang otherwise
        // in the film than in the scan.
        let off_sd = spread.hypot(equations.miss);
        let lean = upright.map(|upright| {
            let roll = registration.to_picture.isometry.rotation.angle();
            let (angle, sd) = match upright {
                Upright::Camera => (-roll, CAMERA_ROLL_SD_DEG.to_radians()),
                Upright::Tag { roll_deg, sd_deg } => (
                    -roll - roll_deg.to_radians(),
                    TAG_HANGS_SD_DEG.hypot(sd_deg).to_radians(),
                ),
            };
            Lean {
                angle,
                rest_off_hi: SDS * off_sd.hypot(sd * lines.swing_share(&registration)),
            }
        });
        Some(Self {
            registration,
            off_hi: Some(SDS * off_sd),
            lean,
        })
    }

    /// How the scan lies in the picture while the tree is at rest.
    pub fn at_rest(&self) -> Registration {
        let mut registration = self.registration;
        if let Some(lean) = self.lean {
            let back = Similarity2::new(Vector2::zeros(), lean.angle, 1.0);
            registration.to_picture = back * registration.to_picture;
        }
        registration
    }
}

/// Turn, roll, logarithm of the scale, and shift, px.
type Step = SVector<f64, 5>;
type Square = SMatrix<f64, 5, 5>;

fn moved(registration: &mut Registration, step: &Step) {
    registration.turn += step[0];
    let old = registration.to_picture;
    let rotation = UnitComplex::new(step[1]) * old.isometry.rotation;
    let shift = old.isometry.translation.vector + Vector2::new(step[3], step[4]);
    let scale = old.scaling() * step[2].exp();
    registration.to_picture = Similarity2::from_parts(shift.into(), rotation, scale);
}

/// How a place of the scan moves in the picture with each part of a step.
fn moves(registration: &Registration, at: &Point3<f64>) -> SMatrix<f64, 2, 5> {
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

/// A place on a line in the picture, and its direction, of length 1.
#[derive(Clone, Copy)]
struct Sample {
    at: Point2<f64>,
    along: Vector2<f64>,
    /// Of the film's branches.
    branch: usize,
}

/// Samples of the lines of both.
struct Lines {
    film: Vec<Sample>,
    scan: Vec<WoodPiece<Point3<f64>>>,
    height_px: f64,
}

/// What pairs of lines say of a step.
struct Equations {
    normal: Square,
    right: Step,
    /// The right side by the film's branches.
    by_branch: Vec<Step>,
    /// What the film's lines miss those of the scan by, as a share of the height, median.
    miss: f64,
}

impl Equations {
    /// That of clustered errors.
    fn covariance(&self) -> Option<Square> {
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

/// A sample of the film beside one of the scan.
struct Beside {
    film: usize,
    scan: usize,
    /// In place and direction, px.
    off: f64,
    /// Of the line on which the partner was looked for.
    normal: Vector2<f64>,
}

impl Lines {
    fn of(film: &[FilmPiece], scan: &[WoodPiece<Point3<f64>>], px_per_m: f64) -> Option<Self> {
        let tops = film.iter().map(|p| p.wood.to.y.max(p.wood.from.y));
        let height_px = tops.fold(0.0, f64::max);
        let step_px = height_px / SAMPLES_IN_HEIGHT;
        if !(step_px > 0.0 && px_per_m > 0.0) {
            return None;
        }
        let mut samples = Vec::new();
        for piece in film {
            let way = piece.wood.to - piece.wood.from;
            let count = (way.norm() / step_px).ceil() as usize;
            let along = way.try_normalize(1e-9).unwrap_or_else(Vector2::y);
            samples.extend((0..count).map(|k| Sample {
                at: piece.wood.from + way * ((k as f64 + 0.5) / count as f64),
                along,
                branch: piece.branch,
            }));
        }
        let length_px: f64 = film.iter().map(|p| (p.wood.to - p.wood.from).norm()).sum();
        let mut thickest = scan.to_vec();
        thickest.sort_by(|a, b| b.radius.total_cmp(&a.radius));
        let mut left = SCAN_LENGTHS * length_px / px_per_m;
        let mut pieces = Vec::new();
        for piece in thickest {
            let way = piece.to - piece.from;
            left -= way.norm();
            if left <= 0.0 {
                break;
            }
            let count = (px_per_m * way.norm() / step_px).ceil().max(1.0) as usize;
            pieces.extend((0..count).map(|k| {
                let [from, to] = [k, k + 1].map(|k| piece.from + way * (k as f64 / count as f64));
                WoodPiece { from, to, ..piece }
            }));
        }
        let is_enough = !samples.is_empty() && !pieces.is_empty();
        is_enough.then_some(Self {
            film: samples,
            scan: pieces,
            height_px,
        })
    }

    fn middle(&self, k: usize) -> Point3<f64> {
        nalgebra::center(&self.scan[k].from, &self.scan[k].to)
    }

    /// The lines of the scan in the picture.
    fn projected(&self, registration: &Registration) -> Vec<Sample> {
        let mut samples = Vec::with_capacity(self.scan.len());
        for (k, piece) in self.scan.iter().enumerate() {
            let way = registration.project(&piece.to) - registration.project(&piece.from);
            samples.push(Sample {
                at: registration.project(&self.middle(k)),
                along: way.try_normalize(1e-9).unwrap_or_else(Vector2::y),
                branch: 0,
            });
        }
        samples
    }

    fn equations(&self, registration: &Registration) -> Option<Equations> {
        let scan = self.projected(registration);
        let across = ACROSS_SHARE * self.height_px;
        let mut of_film = Vec::with_capacity(self.film.len());
        for (k, own) in self.film.iter().enumerate() {
            let (other, off) = nearest(own, &scan, across)?;
            of_film.push(Beside {
                film: k,
                scan: other,
                off,
                normal: normal(&scan[other]),
            });
        }
        let mut of_scan = Vec::with_capacity(scan.len());
        for (k, own) in scan.iter().enumerate() {
            let (other, off) = nearest(own, &self.film, across)?;
            of_scan.push(Beside {
                film: other,
                scan: k,
                off,
                normal: normal(&self.film[other]),
            });
        }
        let branches = self.film.iter().map(|s| s.branch + 1).max()?;
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
                let film = self.film[pair.film];
                let miss_px = (film.at - scan[pair.scan].at).dot(&pair.normal);
                let row = moves(registration, &self.middle(pair.scan)).transpose() * pair.normal;
                equations.normal += weight * row * row.transpose();
                equations.right += weight * miss_px * row;
                equations.by_branch[film.branch] += weight * miss_px * row;
            }
        }
        Some(equations)
    }

    /// How far a step moves the tree, root mean square, as a share of its height.
    fn off_by(&self, registration: &Registration, step: &Step) -> f64 {
        self.spread(registration, &(step * step.transpose()))
    }

    /// How far places are off by this covariance, root mean square, as a share of the height.
    fn spread(&self, registration: &Registration, covariance: &Square) -> f64 {
        let mut squares = 0.0;
        for k in 0..self.scan.len() {
            let moves = moves(registration, &self.middle(k));
            squares += (moves * covariance * moves.transpose()).trace();
        }
        (squares / self.scan.len() as f64).sqrt() / self.height_px
    }

    /// The same by a roll of one radian about the foot.
    fn swing_share(&self, registration: &Registration) -> f64 {
        self.off_by(registration, &Step::new(0.0, 1.0, 0.0, 0.0, 0.0))
    }
}

fn normal(line: &Sample) -> Vector2<f64> {
    Vector2::new(-line.along.y, line.along.x)
}

/// Which of some samples is nearest in place and direction, and how far that is, px.
fn nearest(own: &Sample, others: &[Sample], across: f64) -> Option<(usize, f64)> {
    let squares = others.iter().map(|other| {
        let turn = own.along.perp(&other.along);
        (other.at - own.at).norm_squared() + across * across * turn * turn
    });
    let (k, square) = squares.enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((k, square.sqrt()))
}

fn median_off(pairs: &[Beside]) -> f64 {
    let offs = pairs.iter().map(|p| p.off).collect();
    median(offs, f64::total_cmp).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan() -> Vec<WoodPiece<Point3<f64>>> {
        let stem = Point3::new(0.3, 0.1, 5.0);
        let limbs = [
            (1.5, 0.3, 2.0),
            (2.2, 2.9, 1.4),
            (2.9, 4.4, 1.8),
            (3.5, 1.6, 1.1),
        ];
        let mut pieces = vec![WoodPiece {
            from: Point3::origin(),
            to: stem,
            radius: 0.1,
        }];
        for (height, azimuth, length) in limbs {
            let from = Point3::from(stem.coords * (height / 5.0));
            let (sin, cos) = f64::sin_cos(azimuth);
            let to = from + nalgebra::Vector3::new(cos, sin, 0.5) * length;
            pieces.push(WoodPiece {
                from,
                to,
                radius: 0.05,
            });
        }
        pieces
    }

    fn filmed(truth: &Registration) -> Vec<FilmPiece> {
        let piece = |(branch, p): (usize, WoodPiece<Point3<f64>>)| FilmPiece {
            wood: WoodPiece {
                from: truth.project(&p.from),
                to: truth.project(&p.to),
                radius: 0.0,
            },
            branch,
        };
        scan().into_iter().enumerate().map(piece).collect()
    }

    fn registration(turn: f64, roll: f64, scale: f64) -> Registration {
        Registration {
            turn,
            to_picture: Similarity2::new(Vector2::zeros(), roll, scale),
            miss: 0.005,
            other_side_miss: Some(0.02),
        }
    }

    fn off_share(a: &Registration, b: &Registration) -> f64 {
        let off = |p: &WoodPiece<Point3<f64>>| (a.project(&p.to) - b.project(&p.to)).norm();
        scan().iter().map(off).fold(0.0, f64::max) / 300.0
    }

    #[test]
    fn a_registration_is_made_finer_and_says_how_sure_it_is() {
        let truth = registration(2.2, 0.01, 60.0);
        let mut near = registration(2.26, -0.01, 60.5);
        near.to_picture
            .append_translation_mut(&Vector2::new(2.0, -1.5).into());
        let fit = FilmFit::by_lines(near, &filmed(&truth), &scan(), None).expect("a fit");
        let off = off_share(&fit.registration, &truth);
        assert!(off < 0.002 && off < off_share(&near, &truth), "{off}");
        assert!(fit.holds() && fit.lean.is_none(), "{fit:?}");
        // Branches that hang otherwise make it less sure.
        let mut bent = filmed(&truth);
        for (k, piece) in (1..).zip(&mut bent[1..]) {
            let off = Vector2::new(if k % 2 == 0 { 16.0 } else { -14.0 }, 12.0);
            piece.wood.to += off;
        }
        let unsure = FilmFit::by_lines(near, &bent, &scan(), None).expect("a fit");
        assert!(unsure.off_hi > fit.off_hi, "{unsure:?} {fit:?}");
        assert!(FilmFit::by_lines(near, &bent[..2], &scan(), None).is_none());
    }

    #[test]
    fn a_tree_that_leans_in_wind_is_set_upright_again() {
        let at_rest = registration(2.2, 0.0, 60.0);
        let leaning = registration(2.2, -0.04, 60.0);
        let film = filmed(&leaning);
        let near = registration(2.25, -0.03, 60.5);
        let level = FilmFit::by_lines(near, &film, &scan(), Some(Upright::Camera)).expect("a fit");
        let lean = level.lean.expect("a lean");
        assert!((lean.angle - 0.04).abs() < 0.003, "{lean:?}");
        assert!(off_share(&level.at_rest(), &at_rest) < 0.003);
        assert!(
            level.is_rest_unsure(),
            "nobody knows how level the camera was"
        );
        // A tag that hangs upright says that it is the camera that is rolled.
        let tag = Upright::Tag {
            roll_deg: 0.04_f64.to_degrees(),
            sd_deg: 0.2,
        };
        let rolled = FilmFit::by_lines(near, &film, &scan(), Some(tag)).expect("a fit");
        assert!(off_share(&rolled.at_rest(), &leaning) < 0.003);
        assert!(!rolled.is_rest_unsure(), "{rolled:?}");
    }
}
