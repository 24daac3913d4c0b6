//! How surely a film lies on a scan, and how a tree leans in the film.
//!
//! A registration that was found is made finer: each line is brought to the line nearest to it, along
//! the normal alone (Chen and Medioni 1992), with weights that leave out what has no partner (Geman and
//! McClure 1987). Its covariance is that of clustered errors (Liang and Zeger 1986), a filmed branch a
//! cluster: all places of a branch are off together.
//!
//! In steady wind a tree leans as a whole. In the picture that is a roll of the camera about the foot:
//! lines alone cannot part the two. What is known of the upright does.

use super::film_lines::{FilmPiece, Lines, UNKNOWNS, moved};
use crate::cloud::{PlacePair, Registration, WoodPiece};
use nalgebra::{Point3, Similarity2, Vector2};

/// Rounds of pairing; it stands still when nothing moves by more than this share of the height.
const ROUNDS: usize = 20;
const STANDS_STILL: f64 = 1e-5;
/// Standard deviations within which it is in 95 of 100 cases.
const SDS: f64 = 2.0;
/// A film that lies on the scan no better than this, as a share of the height, is not found.
const LARGEST_OFF: f64 = 0.02;
/// In wind boughs lean together, which errors by branches do not show: registrations of seven made films in
/// wind were off by 0.9 % of the height, root mean square, from that which lies on the leaning tree best.
const WIND_OFF_SHARE: f64 = 0.009;
/// Standard deviation of the roll of a camera that was set up level, and of a tag that was hung
/// upright, degrees: guesses.
const CAMERA_ROLL_SD_DEG: f64 = 1.0;
const TAG_HANGS_SD_DEG: f64 = 0.5;

/// Standard deviation of a place that a user finds in a film and in its scan, as a share of the height: 2 px and 2 cm
/// of a tree 6 m and 500 px high. What pairs miss each other by counts where it is more.
const PAIR_SD_SHARE: f64 = 0.005;

/// How a film lies on a scan, and how surely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmFit {
    pub registration: Registration,
    /// By how much places of the scan are off in the picture at most in 95 of 100 cases, root mean
    /// square over the tree, as a share of its height.
    pub off_hi: f64,
    /// What says so.
    pub grounds: Grounds,
    /// Of a film in wind.
    pub lean: Option<Lean>,
}

/// What says how a film lies on a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grounds {
    /// The lines of both, and no pairs of places against them.
    Lines,
    /// Pairs of places alone: lines show nothing.
    Pairs,
    /// Lines, where the pairs have another place.
    LinesAgainstPairs,
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
    /// Of a registration by pairs of places alone, by the covariance of least squares. `is_wind` says whether the tree
    /// was filmed in wind. `None` where the places say too little, as on one line, or make the tree much larger or
    /// smaller than that of the film.
    pub fn by_pairs(
        registration: Registration,
        pairs: &[PlacePair],
        film: &[FilmPiece],
        scan: &[WoodPiece<Point3<f64>>],
        is_wind: bool,
    ) -> Option<Self> {
        let lines = Lines::of(film, scan, registration.to_picture.scaling())?;
        let tops = scan.iter().map(|piece| piece.to.z);
        if !lines.fits_height(&registration, tops.fold(0.0, f64::max)) {
            return None;
        }
        let numbers = 2 * pairs.len();
        let free = numbers.checked_sub(UNKNOWNS).filter(|free| *free > 0)?;
        let miss_sd = registration.miss * (pairs.len() as f64 / free as f64).sqrt();
        let covariance =
            lines.pairs_covariance(&registration, pairs, miss_sd.max(PAIR_SD_SHARE))?;
        let off_sd = lines.spread(&registration, &covariance);
        let wind_off = if is_wind { WIND_OFF_SHARE } else { 0.0 };
        let off_hi = (SDS * off_sd).hypot(wind_off);
        // Of places on one line the covariance may be no number.
        off_hi.is_finite().then_some(Self {
            registration,
            off_hi,
            grounds: Grounds::Pairs,
            lean: None,
        })
    }

    /// Whether it may be used: the registration holds, and is sure enough.
    pub fn holds(&self) -> bool {
        self.registration.holds()
            && self.off_hi <= LARGEST_OFF
            && self.grounds != Grounds::LinesAgainstPairs
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
            let step = equations.step()?;
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
        let wind_off = upright.map_or(0.0, |_| WIND_OFF_SHARE);
        let off_hi = (SDS * off_sd).hypot(wind_off);
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
                rest_off_hi: off_hi.hypot(SDS * sd * lines.swing_share(&registration)),
            }
        });
        Some(Self {
            registration,
            off_hi,
            grounds: Grounds::Lines,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::by_pairs;
    use crate::random::generator;
    use crate::views::film_lines::Step;
    use rand::RngExt;

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

    /// Places of the scan, and where they are in the picture.
    fn pairs(truth: &Registration, places: &[Point3<f64>]) -> Vec<PlacePair> {
        let pair = |at: &Point3<f64>| PlacePair {
            film_px: truth.project(at),
            scan: *at,
        };
        places.iter().map(pair).collect()
    }

    /// Of 100 draws of places that are off by what users are, those that are off by more than is said.
    #[test]
    fn places_are_off_by_what_pairs_say() {
        let truth = registration(2.2, 0.01, 60.0);
        let mut places: Vec<Point3<f64>> = scan().iter().map(|piece| piece.to).collect();
        places.push(Point3::origin());
        let film = filmed(&truth);
        let lines = Lines::of(&film, &scan(), 60.0).expect("lines");
        let exact = pairs(&truth, &places);
        let mut chance = generator(5, 0);
        // A uniform distribution of this standard deviation, of a tree 300 px high.
        let most_px = 3_f64.sqrt() * PAIR_SD_SHARE * 300.0;
        let mut beyond = 0;
        for _ in 0..100 {
            let mut clicked = exact.clone();
            for pair in &mut clicked {
                pair.film_px += Vector2::from_fn(|_, _| chance.random_range(-most_px..most_px));
            }
            let found = by_pairs(&clicked, 300.0).expect("a registration");
            let fit = FilmFit::by_pairs(found, &clicked, &film, &scan(), false).expect("a fit");
            let mut step = Step::zeros();
            step[0] = found.turn - truth.turn;
            step[0] -= std::f64::consts::TAU * (step[0] / std::f64::consts::TAU).round();
            let turn = found.to_picture.isometry.rotation.angle() - 0.01;
            step[1] = turn;
            step[2] = (found.to_picture.scaling() / 60.0).ln();
            let shift = found.to_picture.isometry.translation.vector;
            (step[3], step[4]) = (shift.x, shift.y);
            beyond += u32::from(lines.off_by(&truth, &step) > fit.off_hi);
        }
        assert!(beyond <= 10, "{beyond}");
    }

    #[test]
    fn pairs_all_over_the_tree_are_surer_than_three_beside_each_other() {
        let truth = registration(2.2, 0.01, 60.0);
        let fit = |places: &[Point3<f64>]| {
            let pairs = pairs(&truth, places);
            FilmFit::by_pairs(truth, &pairs, &filmed(&truth), &scan(), false)
        };
        let mut tips: Vec<Point3<f64>> = scan().iter().map(|piece| piece.to).collect();
        tips.push(Point3::origin());
        let all = fit(&tips).expect("a fit");
        assert!(
            all.off_hi < 0.02 && all.grounds == Grounds::Pairs,
            "{all:?}"
        );
        let near = [[0.0, 0.0, 1.0], [0.2, 0.1, 1.0], [0.1, 0.3, 1.4]].map(Point3::from);
        let near = fit(&near).expect("a fit");
        assert!(near.off_hi > 0.05, "{near:?}");
        assert!(fit(&[Point3::origin(); 4]).is_none());
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
