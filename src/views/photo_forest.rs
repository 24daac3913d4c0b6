//! A forest of the trees in one photograph, each at its place and in its size.
//!
//! The camera is taken to stand level over level ground. Then a tree whose foot is `d` rows below the
//! horizon is farther away than one at `D` rows by `D / d`, and so many times as large as it looks
//! beside that one (Hoiem et al. 2006, "Putting Objects in Perspective").

use super::forest_plan::{ForestPlan, HEIGHT_M};
use super::photo::PhotoTree;
use crate::document::ForestOrigin;
use crate::model::{Forest, ForestTree, Ground, Size};
use nalgebra::{Point2, Point3};

/// The focal length by the longer side of the picture, where it is not known (as COLMAP takes it,
/// Schoenberger and Frahm 2016).
const FOCAL_SHARE: f64 = 1.2;
/// Where the horizon is not known it is the picture's middle row (the mean of Hoiem et al. 2006), or so
/// great a share of its height above the highest foot, if that is higher.
const HORIZON_SHARE: f64 = 0.5;
const ABOVE_FEET_SHARE: f64 = 0.1;
/// A foot less than this below the horizon has no place on the ground, px.
const LEAST_BELOW_PX: f64 = 1.0;
/// The ground reaches beyond the feet by this share of the highest tree.
const MARGIN_SHARE: f64 = 0.6;

/// Where trees stand that are seen in one picture.
#[derive(Clone, Debug, PartialEq)]
pub struct StandingPlaces {
    /// To the right and towards the viewer, from the middle of all; px at the nearest tree.
    pub places_px: Vec<Point2<f64>>,
    /// How many times as large each is as it looks beside the nearest one; 1 or more.
    pub scales: Vec<f64>,
}

impl StandingPlaces {
    /// Those of trees whose feet are at `feet_px` in a picture of this `size`; `horizon_px` is the row of
    /// the horizon where it is known. `None` where a foot is not below it, and where there are none.
    pub fn of(feet_px: &[Point2<f64>], size: Size, horizon_px: Option<f64>) -> Option<Self> {
        let rows = feet_px.iter().map(|foot| foot.y);
        let (highest, lowest) = (
            rows.clone().fold(f64::INFINITY, f64::min),
            rows.fold(f64::NEG_INFINITY, f64::max),
        );
        let height = f64::from(size.height);
        let horizon_px =
            horizon_px.unwrap_or((HORIZON_SHARE * height).min(highest - ABOVE_FEET_SHARE * height));
        if feet_px.is_empty() || highest - horizon_px < LEAST_BELOW_PX {
            return None;
        }
        let focal_px = FOCAL_SHARE * f64::from(size.width.max(size.height));
        let middle_px = 0.5 * (f64::from(size.width) - 1.0);
        let mut places_px = Vec::with_capacity(feet_px.len());
        let mut scales = Vec::with_capacity(feet_px.len());
        for foot in feet_px {
            let scale = (lowest - horizon_px) / (foot.y - horizon_px);
            let away_px = focal_px * (scale - 1.0);
            places_px.push(Point2::new(scale * (foot.x - middle_px), -away_px));
            scales.push(scale);
        }
        let middle = middle(&places_px);
        for place in &mut places_px {
            *place -= middle.coords;
        }
        Some(Self { places_px, scales })
    }

    /// Width and depth of what holds all places, px.
    fn extent_px(&self) -> [f64; 2] {
        [0, 1].map(|axis| {
            let [low, high] = range(&self.places_px, axis);
            high - low
        })
    }

    /// The least distance between two places; 0 where there is one, px.
    fn least_distance_px(&self) -> f64 {
        let mut least_px = f64::INFINITY;
        for (k, a) in self.places_px.iter().enumerate() {
            for b in &self.places_px[k + 1..] {
                least_px = least_px.min((a - b).norm());
            }
        }
        if least_px.is_finite() { least_px } else { 0.0 }
    }
}

/// The middle of what holds all places.
fn middle(places: &[Point2<f64>]) -> Point2<f64> {
    Point2::from([0, 1].map(|axis| {
        let [low, high] = range(places, axis);
        0.5 * (low + high)
    }))
}

fn range(places: &[Point2<f64>], axis: usize) -> [f64; 2] {
    let along = places.iter().map(|at| at[axis]);
    [
        along.clone().fold(f64::INFINITY, f64::min),
        along.fold(f64::NEG_INFINITY, f64::max),
    ]
}

/// The forest of `trees` at these places, in the same order; each is a template of its own, and
/// `template_name` gives its folder by its number, from 1 on. `name` says where the photograph is from.
pub fn photo_forest(
    name: &str,
    trees: &[PhotoTree],
    places: &StandingPlaces,
    template_name: impl Fn(u64) -> String,
) -> ForestPlan {
    let heights_px = trees.iter().zip(&places.scales);
    let heights_px = heights_px.map(|(tree, scale)| scale * tree.height_px());
    let highest_px = heights_px.fold(1.0, f64::max);
    let config = trees.first().map(|tree| &tree.tree.note.config);
    let measured = config.map_or(0.0, |config| config.export.metres_per_px);
    let metres_per_px = match measured > 0.0 {
        true => measured,
        false => HEIGHT_M / highest_px,
    };
    let mut stand = Vec::with_capacity(trees.len());
    for (template, (at, scale)) in places.places_px.iter().zip(&places.scales).enumerate() {
        stand.push(ForestTree {
            template,
            foot: Point3::new(metres_per_px * at.x, 0.0, metres_per_px * at.y),
            turn_rad: 0.0,
            scale: *scale,
            ahead: 0,
        });
    }
    let [width_m, depth_m] = places
        .extent_px()
        .map(|px| metres_per_px * (px + 2.0 * MARGIN_SHARE * highest_px));
    ForestPlan {
        forest: Forest {
            trees: stand,
            ground: Ground::flat(width_m, depth_m),
            metres_per_px,
        },
        origin: ForestOrigin {
            example: name.to_owned(),
            seed: config.map_or(0, |config| config.wood.seed.into()),
            templates: (1..=trees.len() as u64).map(template_name).collect(),
            spacing_m: metres_per_px * places.least_distance_px(),
            scale: if measured > 0.0 { "measured" } else { "height" },
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        width: 1001,
        height: 600,
    };

    fn places(feet_px: &[[f64; 2]], horizon_px: Option<f64>) -> Option<StandingPlaces> {
        let feet: Vec<Point2<f64>> = feet_px.iter().map(|at| Point2::from(*at)).collect();
        StandingPlaces::of(&feet, SIZE, horizon_px)
    }

    #[test]
    fn a_tree_half_as_far_below_the_horizon_is_twice_as_far_and_as_large() {
        let found = places(&[[300.0, 500.0], [600.0, 350.0]], Some(200.0)).expect("places");
        assert_eq!(found.scales, [1.0, 2.0]);
        let apart = found.places_px[1] - found.places_px[0];
        // The picture's middle is at 500 px, and the focal length is 1201.2 px.
        assert!((apart.x - (2.0 * 100.0 + 200.0)).abs() < 1e-9, "{apart}");
        assert!((apart.y + 1201.2).abs() < 1e-9, "{apart}");
        assert!(
            (found.places_px[0] + found.places_px[1].coords)
                .coords
                .norm()
                < 1e-9
        );
    }

    #[test]
    fn without_a_horizon_it_is_the_middle_row_or_above_all_feet() {
        let low = places(&[[300.0, 500.0], [600.0, 400.0]], None).expect("places");
        assert_eq!(low.scales, [1.0, 2.0]);
        let high = places(&[[300.0, 300.0], [600.0, 180.0]], None).expect("places");
        assert_eq!(high.scales, [1.0, 3.0]);
    }

    #[test]
    fn a_foot_at_or_above_the_horizon_stands_nowhere() {
        assert_eq!(places(&[[300.0, 500.0], [600.0, 300.0]], Some(300.0)), None);
        assert_eq!(places(&[], None), None);
    }
}
