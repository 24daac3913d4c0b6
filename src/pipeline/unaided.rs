//! A tree in a photograph on which its crown, its trunk or both were not drawn: several attempts to find them.

use super::photograph::{PhotoError, failed};
use crate::model::{Outline, Rgb};
use crate::outline::{self, Reduced};
use crate::wood::{self, LeafColour, Stroke};

/// Gaps between leaves up to this are closed, px of the reduced picture, and a crown of leaves covers so
/// great a share of it at least.
const CLOSE_PX: u32 = 6;
const LEAST_COVERAGE: f64 = 0.01;

/// Where crown and trunk may be.
#[derive(Clone, Debug)]
pub struct Attempt {
    pub crown: Outline,
    /// The trunk's first, from its foot up.
    pub strokes: Vec<Stroke>,
}

/// Where a crown is looked for that was not drawn, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// What has the colour of leaves.
    InLeaf,
    /// What stands in the picture's middle.
    InMiddle,
}

impl Place {
    pub const ALL: [Self; 2] = [Self::InLeaf, Self::InMiddle];
}

/// What was drawn of a tree: its crown or its strokes, not both.
#[derive(Clone, Debug)]
pub struct Half {
    pub crown: Option<Outline>,
    pub strokes: Vec<Stroke>,
}

impl Half {
    /// Where the rest may be.
    ///
    /// # Errors
    /// OpenCV fails.
    pub fn attempts(
        &self,
        reduced: &Reduced,
        place: Place,
        colour: LeafColour,
    ) -> Result<Vec<Attempt>, PhotoError> {
        let mut attempts = Vec::new();
        for crown in self.crowns(reduced, place, colour)? {
            attempts.extend(self.attempt(reduced, &crown)?);
        }
        Ok(attempts)
    }

    /// In the reduced picture.
    fn crowns(
        &self,
        reduced: &Reduced,
        place: Place,
        colour: LeafColour,
    ) -> Result<Vec<Outline>, PhotoError> {
        let crown = match (&self.crown, place) {
            (Some(crown), Place::InLeaf) => reduced.outline_in_reduced(crown).map_err(failed)?,
            (Some(_), Place::InMiddle) => None,
            (None, Place::InLeaf) => in_leaf(&reduced.picture, colour),
            (None, Place::InMiddle) => {
                return outline::in_middle(&reduced.picture).map_err(failed);
            }
        };
        Ok(crown.into_iter().collect())
    }

    /// `None` where the crown stands on no trunk.
    fn attempt(&self, reduced: &Reduced, crown: &Outline) -> Result<Option<Attempt>, PhotoError> {
        let mut strokes = self.strokes.clone();
        if strokes.is_empty() {
            let Some(trunk) = outline::stem(&reduced.picture, crown) else {
                return Ok(None);
            };
            strokes.push(trunk.into_iter().map(|at| reduced.to_whole(at)).collect());
        }
        let whole = match &self.crown {
            Some(drawn) => Some(drawn.clone()),
            None => reduced.outline_in_whole(crown).map_err(failed)?,
        };
        Ok(whole.map(|crown| Attempt { crown, strokes }))
    }
}

/// The largest piece that has the colour of leaves above the ground.
fn in_leaf(picture: &Rgb, colour: LeafColour) -> Option<Outline> {
    let mask = wood::greenery(picture, colour);
    let crown = outline::closed(picture.size, &mask, CLOSE_PX).ok()?;
    (crown.coverage() >= LEAST_COVERAGE).then_some(crown)
}
