//! The colours on what is drawn on a photograph and those of all else, and whether what is drawn is on
//! anything.

use super::Stroke;
use super::colours::Colours;
use super::contrast::{self, Along};
use super::drawing::{self, LOW, lower_part};
use super::mixture::{LogRatio, Mixture};
use super::photograph::{NotSeen, PARTS, Photograph, StrokesAlong};
use nalgebra::Vector3;

/// Fewer colours than this on the strokes show no bark.
const LEAST_BARK: f64 = 64.0;
/// The colours on the strokes are bark if their odds against all else are this at least in their mean, as
/// a logarithm; elsewhere there is nothing to see.
const LEAST_TOLD: f64 = 0.5;
/// The trunk's stroke is on something if the odds of its own colours are above those at either side by so
/// many of the difference's standard errors. As the colours are learned from the stroke itself, this is up
/// to 5.2 on nothing; along trunks of made photographs it is 9.4 or more (seeds 36001 to 36004). It is
/// doubtful with less, and not refused: the trunk of the shipped clip, 640 px wide and before bushes, has
/// 3.2.
const LEAST_TRUNK_DEVIATIONS: f64 = 5.0;
/// With less than this a trunk is refused. For other strokes the colours are the trunk's, and with less than
/// this they are doubtful: on nothing it is 0 in the median and 1.6 at most, along twigs that are drawn 2 px
/// off 2.1 at least (the same seeds), but one of some hundred of fresh seeds had -0.3: they are not refused.
const LEAST_DEVIATIONS: f64 = 1.0;
/// How far a hand is off a twig, as a share of the picture's width (4 px of 1500).
const UNSTEADY: f64 = 4.0 / 1500.0;
/// A stroke of which less is in sight than this share leads through leaves.
const IN_SIGHT: f64 = 0.5;

/// What is on the strokes: their pixels, their colours against all others.
pub struct StrokeColours {
    pub is_stroke: Vec<bool>,
    odds: LogRatio,
    /// By how many standard errors the trunk's stroke differs from what is beside it, where that is in
    /// sight.
    pub trunk_deviations: Option<f64>,
    /// The other strokes that do not differ from what is beside them.
    pub doubtful: Vec<usize>,
}

impl StrokeColours {
    /// # Errors
    /// The strokes show too little bark, or the trunk's is on nothing.
    pub fn of(
        photo: Photograph,
        is_stroke: Vec<bool>,
        region: &[u8],
        is_leaf: &[bool],
    ) -> Result<Self, NotSeen> {
        let on_strokes = bark_of(photo, &is_stroke, is_leaf)?;
        let others = Colours::of(photo.picture, |i| region[i] == 0 || is_leaf[i]);
        let mut own = Self {
            is_stroke,
            odds: LogRatio {
                first: Mixture::learned(&on_strokes, PARTS),
                second: Mixture::learned(&others, PARTS),
            },
            trunk_deviations: None,
            doubtful: Vec::new(),
        };
        own.look_along(photo, is_leaf)?;
        match own.odds.mean(&on_strokes) < LEAST_TOLD {
            true => Err(NotSeen::Wood),
            false => Ok(own),
        }
    }

    /// The odds that a colour is of bark, as a logarithm within the bounds in which it is believed.
    pub fn odds(&self, colour: &Vector3<f64>) -> f64 {
        self.odds.believed(colour)
    }

    /// Holds what is along the strokes against what is beside them.
    ///
    /// # Errors
    /// The trunk's does not differ.
    fn look_along(&mut self, photo: Photograph, hides: &[bool]) -> Result<(), NotSeen> {
        for number in 0..photo.strokes.len() {
            let seen = self.along(photo, number, hides);
            let is_doubtful = match number {
                0 => is_below(seen, LEAST_TRUNK_DEVIATIONS),
                // One that leaves hide is drawn where it must be.
                _ => seen.in_sight >= IN_SIGHT && is_below(seen, LEAST_DEVIATIONS),
            };
            if number == 0 {
                if is_below(seen, LEAST_DEVIATIONS) {
                    return Err(NotSeen::Trunk);
                }
                self.trunk_deviations = seen.deviations;
            }
            self.doubtful.extend(is_doubtful.then_some(number));
        }
        Ok(())
    }

    fn along(&self, photo: Photograph, number: usize, hides: &[bool]) -> Along {
        let size = photo.picture.size;
        // A trunk is wider than a hand is unsteady.
        let off_px = match number {
            0 => 0.0,
            _ => UNSTEADY * f64::from(size.width),
        };
        contrast::along(&photo.strokes[number], size, hides, off_px, |at| {
            Some(self.odds(&photo.picture.interpolated(at)?))
        })
    }
}

/// The colours on the strokes that are of bark: those of the lower part of drawn ones, as far as it shows enough. What
/// is beside the wood high in the crown would be taken for bark, too.
///
/// # Errors
/// The strokes show too little bark, or OpenCV fails.
fn bark_of(photo: Photograph, is_stroke: &[bool], is_leaf: &[bool]) -> Result<Colours, NotSeen> {
    if photo.along == StrokesAlong::Drawn {
        let strokes = photo.strokes.iter();
        let low: Vec<Stroke> = strokes.map(|stroke| lower_part(stroke, LOW)).collect();
        let is_low = drawing::on_lines(&low, photo.picture.size, drawing::STROKE_PX)?;
        let colours = Colours::of(photo.picture, |i| is_low[i] && !is_leaf[i]);
        if colours.count() >= LEAST_BARK {
            return Ok(colours);
        }
    }
    let colours = Colours::of(photo.picture, |i| is_stroke[i] && !is_leaf[i]);
    match colours.count() < LEAST_BARK {
        true => Err(NotSeen::Wood),
        false => Ok(colours),
    }
}

/// Whether a line differs from its sides by less than so many standard errors.
fn is_below(along: Along, least: f64) -> bool {
    along.deviations.is_some_and(|found| found < least)
}
