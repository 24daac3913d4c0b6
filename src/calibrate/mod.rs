//! A lens by pictures of a chessboard (Zhang 2000, "A Flexible New Technique for Camera Calibration").
//!
//! [`find_board`] finds the inner corners of the board in a picture; [`calibrate`] finds the lens by
//! several such views: homographies give the focal lengths, and all is then fitted together.

mod board;
mod error;
mod fit;
mod homographies;
mod saddles;

pub use board::{Board, BoardView, find_board};
pub use error::CalibrateError;

use crate::model::{Lens, Size};
use fit::Fit;

/// Views that a lens takes at least. Two suffice in theory; with five the errors are small (Zhang 2000
/// fig. 3).
const LEAST_VIEWS: usize = 5;
/// Views are alike if corners move on average by less than this share of the picture's width.
const ALIKE_SHARE: f64 = 0.04;
/// More views add little.
const MOST_VIEWS: usize = 40;
/// A view is left out that is off by so many times the median of all: it was blurred by motion.
const OUTLIER_VIEWS: f64 = 3.0;
/// Views say too little where the standard deviation of the focal length, or of the middle, is more than
/// this share of the focal length.
const UNSURE_SHARE: f64 = 0.02;

/// A lens, and how sure it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    pub lens: Lens,
    /// Standard deviations of focal lengths and middle, px, and of k1, k2, p1 and p2.
    pub deviations: [f64; 8],
    /// Root of the mean square by which corners are off, px (both axes together).
    pub rms_px: f64,
    /// Views that it rests on.
    pub views: usize,
}

/// Views of a board that differ from each other.
#[derive(Clone, Debug, Default)]
pub struct BoardViews {
    views: Vec<BoardView>,
    /// Pictures in which the board was found.
    pub found: usize,
}

impl BoardViews {
    /// Takes a view, if no other is like it and there is room.
    pub fn push(&mut self, view: BoardView, size: Size) {
        self.found += 1;
        let least_px = ALIKE_SHARE * f64::from(size.width);
        let is_new = self
            .views
            .iter()
            .all(|own| own.distance_px(&view) > least_px);
        if is_new && self.views.len() < MOST_VIEWS {
            self.views.push(view);
        }
    }

    /// Views that differ.
    pub fn len(&self) -> usize {
        self.views.len()
    }

    pub fn is_empty(&self) -> bool {
        self.views.is_empty()
    }

    /// Refuses so many of them.
    fn refuse_few(&self, views: usize) -> Result<(), CalibrateError> {
        if views >= LEAST_VIEWS {
            return Ok(());
        }
        Err(CalibrateError::TooFewViews {
            views,
            found: self.found,
            least: LEAST_VIEWS,
        })
    }
}

/// The lens by views of a board in pictures of one size: focal lengths, middle, k1, k2, p1 and p2.
///
/// # Errors
/// There are too few views, or they do not say it.
pub fn calibrate(
    board: Board,
    views: &BoardViews,
    size: Size,
) -> Result<Calibration, CalibrateError> {
    views.refuse_few(views.len())?;
    let all = Fit::of(board, &views.views, size).ok_or(CalibrateError::Alike)?;
    let sharp = all.sharp_views(OUTLIER_VIEWS);
    views.refuse_few(sharp.len())?;
    let fit = Fit::of(board, &sharp, size).ok_or(CalibrateError::Alike)?;
    let lens = fit.lens();
    let deviations = fit.deviations().ok_or(CalibrateError::Alike)?;
    let most = UNSURE_SHARE * lens.focal_px.min();
    if !deviations[..4].iter().all(|sd| *sd <= most) {
        return Err(CalibrateError::Alike);
    }
    Ok(Calibration {
        lens,
        deviations,
        rms_px: fit.rms_px(),
        views: sharp.len(),
    })
}
