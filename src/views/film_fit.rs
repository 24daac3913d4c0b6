//! How surely a film lies on a scan, and how a tree leans in the film.
//!
//! A registration that was found is made finer: each line is brought to the line nearest to it, along
//! the normal alone (Chen and Medioni 1992), with weights that leave out what has no partner (Geman and
//! McClure 1987). Its covariance is that of clustered errors (Liang and Zeger 1986), a filmed branch a
//! cluster: all places of a branch are off together.
//!
//! In steady wind a tree leans as a whole. In the picture that is a roll of the camera about the foot:
//! lines alone cannot part the two. What is known of the upright does.

use super::film_lines::{FilmPiece, Lines, moved};
use crate::cloud::{Registration, WoodPiece};
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

/// How a film lies on a scan, and how surely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmFit {
    pub registration: Registration,
    /// By how much places of the scan are off in the picture at most in 95 of 100 cases, root mean
    /// square over the tree, as a share of its height; `None` by pairs of places alone.
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
            off_hi: Some(off_hi),
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
