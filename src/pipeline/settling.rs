//! The trunk of a tree that is drawn, or found and bare, made sure of in a smaller picture.
//!
//! The line that a trunk is found by may lie on the dark side of its bark, and ends below the crown; one that
//! is drawn runs beside its middle, and ends where the hand stopped. By its colours alone wood is found with
//! holes, and too thin. Colours are learned anew along the middle of what was taken for wood until that stays
//! (in turns, as Rother et al. 2004 sect. 3). Where the trunk and its limbs run is seen in a small picture as
//! well, in a quarter of the time.

use super::photograph::PhotoOptions;
use super::unaided::Attempt;
use crate::cancel::CancelToken;
use crate::model::Rgb;
use crate::outline::Reduced;
use crate::signal::distance_to_segment;
use crate::wood::{self, LeavesSeen, NotSeen, SeenInPhotograph, Stroke, length_px};
use nalgebra::Point2;

/// Width to which photographs are reduced for this, px.
const WIDTH: u32 = 750;
/// How often a tree is looked at again at most.
const ROUNDS: usize = 5;
/// A drawn stroke along the middle of its trunk is as good as what would settle, if it is this share of it long.
const LONG: f64 = 0.5;
/// Colours are not learned anew along a line that stays within this of the one before, px: it is drawn so wide.
const STAYS_PX: f64 = 2.0;

/// A photograph in which trunks settle.
pub struct Settling<'a> {
    reduced: Reduced,
    options: PhotoOptions,
    cancel: &'a CancelToken,
}

impl<'a> Settling<'a> {
    /// # Errors
    /// OpenCV fails.
    pub fn of(
        picture: &Rgb,
        options: PhotoOptions,
        cancel: &'a CancelToken,
    ) -> Result<Self, NotSeen> {
        Ok(Self {
            reduced: Reduced::to_width(picture, WIDTH)?,
            options,
            cancel,
        })
    }

    /// What is seen of a tree along drawn strokes.
    ///
    /// # Errors
    /// Nothing is seen.
    pub fn look_at_drawn(&self, drawn: &Attempt) -> Result<SmallLook, NotSeen> {
        let attempt = self.small(drawn)?.ok_or(NotSeen::Crown)?;
        let leaves = LeavesSeen::of(self.photo(&attempt), self.cancel)?;
        let mut look = self.beside(leaves, attempt)?;
        let trunk = look.attempt.strokes.first();
        look.drawn_to = trunk.and_then(|trunk| trunk.last()).copied();
        Ok(look)
    }

    /// What is seen of a bare tree along the strokes of an attempt; `None` of one in leaf.
    ///
    /// # Errors
    /// Nothing is seen.
    pub fn first_look(&self, attempt: &Attempt) -> Result<Option<SmallLook>, NotSeen> {
        let Some(attempt) = self.small(attempt)? else {
            return Ok(None);
        };
        let leaves = LeavesSeen::of(self.photo(&attempt), self.cancel)?;
        match leaves.in_leaf() {
            true => Ok(None),
            false => self.beside(leaves, attempt).map(Some),
        }
    }

    /// The look at the wood beside leaves.
    fn beside(&self, leaves: LeavesSeen, attempt: Attempt) -> Result<SmallLook, NotSeen> {
        let seen = wood::beside_leaves(self.photo(&attempt), &leaves, self.cancel)?;
        Ok(SmallLook {
            attempt,
            leaves,
            seen,
            drawn_to: None,
        })
    }

    /// The line at which the trunk settles, px of the whole picture, after a first look.
    ///
    /// # Errors
    /// The work is ended.
    pub fn trunk(&self, first: SmallLook) -> Result<Stroke, NotSeen> {
        let SmallLook {
            attempt: mut small,
            leaves,
            mut seen,
            drawn_to,
        } = first;
        let size = self.reduced.picture.size;
        for _ in 0..ROUNDS {
            let branches = &seen.wood.branches;
            let by = drawn_to.and_then(|end| branches.piece_at(end, size));
            let way_px = branches.longest_way_px(by.unwrap_or(0));
            let is_drawn_well = by.is_some()
                && small.strokes.first().is_some_and(|drawn| {
                    lies_on(drawn, &way_px, STAYS_PX)
                        && length_px(drawn) >= LONG * length_px(&way_px)
                });
            if is_drawn_well {
                break;
            }
            let stays = small
                .strokes
                .first()
                .is_none_or(|line| lies_on(&way_px, line, STAYS_PX));
            small = small.along(way_px);
            if stays {
                break;
            }
            seen = match wood::beside_leaves(self.photo(&small), &leaves, self.cancel) {
                Ok(next) => next,
                Err(NotSeen::Cancelled) => return Err(NotSeen::Cancelled),
                Err(_) => break,
            };
        }
        let way_px = small.strokes.first().into_iter().flatten();
        Ok(way_px.map(|at| self.reduced.to_whole(*at)).collect())
    }

    /// An attempt in the small picture; `None` where nothing is left of its crown.
    fn small(&self, attempt: &Attempt) -> Result<Option<Attempt>, NotSeen> {
        let crown = self.reduced.outline_in_reduced(&attempt.crown)?;
        let mut strokes = Vec::with_capacity(attempt.strokes.len());
        for stroke in &attempt.strokes {
            strokes.push(
                stroke
                    .iter()
                    .map(|at| self.reduced.to_reduced(*at))
                    .collect(),
            );
        }
        Ok(crown.map(|crown| Attempt {
            crown,
            strokes,
            along: attempt.along,
        }))
    }

    fn photo<'b>(&'b self, small: &'b Attempt) -> wood::Photograph<'b> {
        wood::Photograph {
            picture: &self.reduced.picture,
            crown: &small.crown,
            strokes: &small.strokes,
            along: small.along,
            leaves: self.options.leaves,
            trace_by: self.options.trace_by,
        }
    }
}

/// What was seen of an attempt in the small picture.
pub struct SmallLook {
    /// In px of that picture.
    attempt: Attempt,
    leaves: LeavesSeen,
    pub seen: SeenInPhotograph,
    /// Where the trunk's stroke ends if it was drawn: the trunk leads there.
    drawn_to: Option<Point2<f64>>,
}

/// Whether all corners of a line are within so much of another one, px.
pub fn lies_on(line: &Stroke, other: &Stroke, within_px: f64) -> bool {
    line.iter().all(|at| {
        let mut pieces = other.windows(2);
        pieces.any(|ends| distance_to_segment(*at, ends[0], ends[1]) <= within_px)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(line: &[[f64; 2]]) -> Stroke {
        line.iter().map(|at| (*at).into()).collect()
    }

    #[test]
    fn a_line_stays_if_all_its_corners_do() {
        let line = points(&[[10.0, 90.0], [10.0, 10.0]]);
        let near = points(&[[11.0, 80.0], [9.0, 40.0]]);
        assert!(lies_on(&near, &line, STAYS_PX));
        let far = points(&[[11.0, 80.0], [20.0, 10.0]]);
        assert!(!lies_on(&far, &line, STAYS_PX));
    }
}
