//! A tree in a photograph on which its crown, its trunk or both were not drawn: several attempts to find them.

use super::photograph::{PhotoError, failed};
use crate::model::{Outline, Rgb};
use crate::outline::{self, Margin, Reduced};
use crate::wood::{self, LeafColour, LeafHint, Stroke, StrokesAlong};

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
    pub along: StrokesAlong,
}

impl Attempt {
    /// Of a crown and of strokes that were drawn.
    pub fn drawn(crown: Outline, strokes: Vec<Stroke>) -> Self {
        Self {
            crown,
            strokes,
            along: StrokesAlong::Drawn,
        }
    }

    /// The same with a trunk along wood that was found.
    pub fn along(mut self, trunk: Stroke) -> Self {
        match self.strokes.first_mut() {
            Some(drawn) => *drawn = trunk,
            None => self.strokes.push(trunk),
        }
        self.along = StrokesAlong::Wood;
        self
    }
}

/// Where a crown is looked for that was not drawn, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// What has the colour of leaves.
    InLeaf,
    /// What stands in the picture's middle, between margins.
    InMiddle(Margin),
}

impl Place {
    pub const ALL: [Self; 3] = [
        Self::InLeaf,
        Self::InMiddle(Margin::Wide),
        Self::InMiddle(Margin::Narrow),
    ];
}

/// What was drawn of a tree: its crown or its strokes, not both.
#[derive(Clone, Debug)]
pub struct Half {
    pub crown: Option<Outline>,
    pub strokes: Vec<Stroke>,
}

impl Half {
    /// Where the rest may be; `None` where it is not.
    ///
    /// # Errors
    /// OpenCV fails.
    pub fn attempt(
        &self,
        reduced: &Reduced,
        place: Place,
        leaves: LeafHint,
    ) -> Result<Option<Attempt>, PhotoError> {
        match self.crown(reduced, place, leaves)? {
            Some(crown) => self.with_trunk(reduced, &crown),
            None => Ok(None),
        }
    }

    /// In the reduced picture.
    fn crown(
        &self,
        reduced: &Reduced,
        place: Place,
        leaves: LeafHint,
    ) -> Result<Option<Outline>, PhotoError> {
        match (&self.crown, place) {
            (Some(crown), Place::InLeaf) => reduced.outline_in_reduced(crown).map_err(failed),
            (Some(_), Place::InMiddle(_)) => Ok(None),
            (None, Place::InLeaf) => {
                let colour = leaves.sought();
                Ok(colour.and_then(|colour| in_leaf(&reduced.picture, colour)))
            }
            (None, Place::InMiddle(margin)) => {
                outline::in_middle(&reduced.picture, margin).map_err(failed)
            }
        }
    }

    /// A crown with its trunk; `None` where it stands on none.
    fn with_trunk(
        &self,
        reduced: &Reduced,
        crown: &Outline,
    ) -> Result<Option<Attempt>, PhotoError> {
        let drawn = Attempt::drawn(crown.clone(), self.strokes.clone());
        let attempt = match self.strokes.is_empty() {
            true => {
                let Some(trunk) = outline::stem(&reduced.picture, crown) else {
                    return Ok(None);
                };
                drawn.along(trunk.into_iter().map(|at| reduced.to_whole(at)).collect())
            }
            false => drawn,
        };
        let whole = match &self.crown {
            Some(drawn) => Some(drawn.clone()),
            None => reduced.outline_in_whole(crown).map_err(failed)?,
        };
        Ok(whole.map(|crown| Attempt { crown, ..attempt }))
    }
}

/// The largest piece that has the colour of leaves above the ground.
fn in_leaf(picture: &Rgb, colour: LeafColour) -> Option<Outline> {
    let mask = wood::greenery(picture, colour);
    let crown = outline::closed(picture.size, &mask, CLOSE_PX).ok()?;
    (crown.coverage() >= LEAST_COVERAGE).then_some(crown)
}
