//! Where the trees of a forest stand, and which template each of them is.

use super::poisson_disc::poisson_disc;
use crate::model::{Forest, ForestTree, Ground};
use crate::random::{Generator, generator};
use nalgebra::{Point2, Point3};
use rand::RngExt;
use rand::seq::SliceRandom;
use std::f64::consts::TAU;

/// Places in the square of a spacing that Poisson-disc sampling surely finds: on large plots it finds
/// 0.617 of them, on small ones more.
const DENSITY: f64 = 0.58;
/// Places that are sampled at most.
const MOST_PLACES: f64 = 2e6;
/// Trees are up to this share smaller or larger than their template.
const SCALE_SPREAD: f64 = 0.15;

/// How a forest is to be planted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planting {
    /// Trees; 1 or more.
    pub count: usize,
    /// Templates that they share; 1 or more.
    pub templates: usize,
    /// Least distance between two trunks, m; above 0.
    pub spacing_m: f64,
    pub seed: u64,
}

/// Why a forest cannot be planted.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PlantingError {
    #[error(
        "only {places} of {count} trees have room on {width_m:.1} m x {depth_m:.1} m at {spacing_m:.2} m from each \
         other; give a larger --size, less --spacing, or fewer trees"
    )]
    NoRoom {
        places: usize,
        count: usize,
        width_m: f64,
        depth_m: f64,
        spacing_m: f64,
    },
    #[error(
        "{width_m:.1} m x {depth_m:.1} m has room for more than two million trees at {spacing_m} m from each other; \
         give a smaller --size, or more --spacing"
    )]
    TooFine {
        width_m: f64,
        depth_m: f64,
        spacing_m: f64,
    },
}

impl Planting {
    /// Width of a plot on which the trees have just room, m; its depth is `depth_share` of it.
    pub fn width_m(&self, depth_share: f64) -> f64 {
        let area = self.count as f64 * self.spacing_m * self.spacing_m / DENSITY;
        // One tree needs no room: its plot is as wide as the spacing.
        (area / depth_share).sqrt().max(self.spacing_m)
    }

    /// The forest on this ground, of templates with this scale. Places are a Poisson-disc sample,
    /// evenly thinned where there are more than trees; templates come in equal numbers; turns are
    /// even over the circle.
    ///
    /// # Errors
    /// The trees have no room on the plot, or it is too large to be sampled at this spacing.
    pub fn on(&self, ground: Ground, metres_per_px: f64) -> Result<Forest, PlantingError> {
        let (width_m, depth_m, spacing_m) = (ground.width_m, ground.depth_m, self.spacing_m);
        if (width_m / spacing_m + 1.0) * (depth_m / spacing_m + 1.0) > MOST_PLACES {
            return Err(PlantingError::TooFine {
                width_m,
                depth_m,
                spacing_m,
            });
        }
        let mut random = generator(self.seed, 0);
        let mut places = poisson_disc(width_m, depth_m, spacing_m, &mut random);
        if places.len() < self.count {
            return Err(PlantingError::NoRoom {
                places: places.len(),
                count: self.count,
                width_m,
                depth_m,
                spacing_m,
            });
        }
        places.shuffle(&mut random);
        places.truncate(self.count);
        let mut templates: Vec<usize> = (0..self.count).map(|k| k % self.templates).collect();
        templates.shuffle(&mut random);
        let trees = places.iter().zip(templates);
        let trees = trees.map(|(place, template)| planted(*place, template, &ground, &mut random));
        Ok(Forest {
            trees: trees.collect(),
            ground,
            metres_per_px,
        })
    }
}

fn planted(
    place: Point2<f64>,
    template: usize,
    ground: &Ground,
    random: &mut Generator,
) -> ForestTree {
    ForestTree {
        template,
        foot: Point3::new(place.x, ground.height_m(place), place.y),
        turn_rad: TAU * random.random::<f64>(),
        scale: 1.0 + SCALE_SPREAD * (2.0 * random.random::<f64>() - 1.0),
        ahead: random.random_range(0..Forest::STEPS_AHEAD),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planting(count: usize) -> Planting {
        Planting {
            count,
            templates: 3,
            spacing_m: 4.0,
            seed: 7,
        }
    }

    #[test]
    fn every_number_of_trees_has_room_on_its_own_plot() {
        for count in [1, 2, 3, 10, 100, 1000, 5000] {
            for depth_share in [1.0, 0.3, 2.0] {
                let planting = planting(count);
                let width_m = planting.width_m(depth_share);
                let ground = Ground::flat(width_m, depth_share * width_m);
                let forest = planting.on(ground, 0.01).expect("room");
                assert_eq!(forest.trees.len(), count);
                for (i, a) in forest.trees.iter().enumerate().take(200) {
                    let mut others = forest.trees[..i].iter();
                    assert!(others.all(|b| (a.foot - b.foot).norm() >= 4.0));
                    assert!((0.85..=1.15).contains(&a.scale));
                }
            }
        }
    }

    #[test]
    fn large_forests_have_room_with_every_seed() {
        for seed in 0..4 {
            let planting = Planting {
                seed,
                ..planting(40_000)
            };
            let width_m = planting.width_m(1.0);
            let forest = planting.on(Ground::flat(width_m, width_m), 0.01);
            assert_eq!(forest.expect("room").trees.len(), 40_000);
        }
    }

    #[test]
    fn templates_come_in_equal_numbers_and_a_seed_gives_one_forest() {
        let ground = Ground::flat(80.0, 80.0);
        let forest = planting(90).on(ground.clone(), 0.01).expect("room");
        for template in 0..3 {
            let of = forest.trees.iter().filter(|t| t.template == template);
            assert_eq!(of.count(), 30);
        }
        assert_eq!(forest, planting(90).on(ground, 0.01).expect("room"));
    }

    #[test]
    fn what_has_no_room_is_refused() {
        let small = planting(90).on(Ground::flat(10.0, 10.0), 0.01);
        assert!(matches!(
            small,
            Err(PlantingError::NoRoom { count: 90, .. })
        ));
        let large = planting(90).on(Ground::flat(1e5, 1e5), 0.01);
        assert!(matches!(large, Err(PlantingError::TooFine { .. })));
    }
}
