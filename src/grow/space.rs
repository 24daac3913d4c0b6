//! The region in the picture that a flat tree is grown in, and how empty it is (Li 2011 sect. 5.3).

use crate::model::Outline;
use nalgebra::Point2;

/// Places in the region at which it is looked at how empty it is, about.
const PLACES: f64 = 240.0;
/// Sums that are added up side by side, which the compiler turns into vector instructions.
const LANES: usize = 8;
/// By how much two distances in single precision may differ though they are the same, px.
const ROUNDING_PX: f32 = 0.01;
/// Points along a branch that must lie in the region.
const LOOKED_AT: u32 = 6;

/// The region, and how far each of its places is from the nearest branch.
#[derive(Clone)]
pub(super) struct GrowthSpace<'a> {
    outline: &'a Outline,
    /// Left, top, right, bottom, px.
    bounds: [u32; 4],
    places: Vec<Point2<f32>>,
    nearest_px: Vec<f32>,
}

impl<'a> GrowthSpace<'a> {
    /// The space of a region; `None` where nothing is inside.
    ///
    /// The paper's attractors lie on the outline (eq. 5). Here they lie evenly all over the region:
    /// a twig within it fills space, too, and the outline's alone would leave it empty.
    pub fn of(outline: &'a Outline) -> Option<Self> {
        let bounds = outline.bounds_px()?;
        let area = outline.mask.iter().filter(|m| **m != 0).count() as f64;
        let mut step_px = (area / PLACES).sqrt().max(1.0);
        let mut places = even_places(outline, bounds, step_px);
        // A narrow region may lie between the places.
        while (places.len() as f64) < 0.5 * PLACES.min(area) && step_px > 1.0 {
            step_px = (0.7 * step_px).max(1.0);
            places = even_places(outline, bounds, step_px);
        }
        Some(Self {
            outline,
            bounds,
            nearest_px: vec![f32::INFINITY; places.len()],
            places,
        })
    }

    pub fn height_px(&self) -> f64 {
        f64::from(self.bounds[3] - self.bounds[1] + 1)
    }

    pub fn width_px(&self) -> f64 {
        f64::from(self.bounds[2] - self.bounds[0] + 1)
    }

    /// Whether the whole of a branch is inside.
    pub fn holds(&self, from: Point2<f64>, to: Point2<f64>) -> bool {
        // The end first: it is outside most often.
        (1..=LOOKED_AT).rev().all(|k| {
            let at = from + (to - from) * (f64::from(k) / f64::from(LOOKED_AT));
            self.outline.contains(at.x, at.y)
        })
    }

    /// The place of the region that is nearest to `at`.
    pub fn nearest_place(&self, at: Point2<f64>) -> Point2<f64> {
        let squared_px = |p: &&Point2<f32>| (p.cast() - at).norm_squared();
        let nearest = self
            .places
            .iter()
            .min_by(|a, b| squared_px(a).total_cmp(&squared_px(b)));
        nearest.map_or(at, |p| p.cast())
    }

    /// Takes in a branch of the tree, by its middle and its end.
    pub fn add(&mut self, from: Point2<f64>, to: Point2<f64>) {
        for node in [nalgebra::center(&from, &to), to] {
            let node: Point2<f32> = node.cast();
            for (place, nearest) in self.places.iter().zip(&mut self.nearest_px) {
                *nearest = nearest.min((place - node).norm());
            }
        }
    }

    /// D: how far the places are from the nearest branch, px in their mean.
    pub fn distance_px(&self) -> f64 {
        let sum: f32 = self.nearest_px.iter().sum();
        f64::from(sum) / self.places.len().max(1) as f64
    }

    /// What branches from `apex` of at most this length, px, may come nearer to than the tree is.
    pub fn around(&self, apex: Point2<f64>, longest_px: f64) -> Surroundings {
        let apex: Point2<f32> = apex.cast();
        let longest_px = longest_px as f32 + ROUNDING_PX;
        let mut surroundings = Surroundings {
            u: Vec::new(),
            v: Vec::new(),
            nearest_px: Vec::new(),
            all: self.places.len(),
        };
        for (place, nearest_px) in self.places.iter().zip(&self.nearest_px) {
            if (place - apex).norm() < nearest_px + longest_px {
                surroundings.u.push(place.x);
                surroundings.v.push(place.y);
                surroundings.nearest_px.push(*nearest_px);
            }
        }
        surroundings
    }
}

/// Some places of the region, by coordinate, and how far each is from the nearest branch, px.
pub(super) struct Surroundings {
    u: Vec<f32>,
    v: Vec<f32>,
    nearest_px: Vec<f32>,
    /// How many places the region has.
    all: usize,
}

impl Surroundings {
    /// E: by how much two more branches would bring the tree nearer to the places, px in the mean of
    /// all places of the region.
    pub fn gain(&self, apex: Point2<f64>, ends: [Point2<f64>; 2]) -> f64 {
        let middles = ends.map(|end| nalgebra::center(&apex, &end));
        let nodes: [Point2<f32>; 4] = [ends[0], ends[1], middles[0], middles[1]].map(|n| n.cast());
        let mut sums = [0.0_f32; LANES];
        let (us, vs) = (self.u.chunks(LANES), self.v.chunks(LANES));
        for ((us, vs), nearest) in us.zip(vs).zip(self.nearest_px.chunks(LANES)) {
            for (((sum, u), v), nearest) in sums.iter_mut().zip(us).zip(vs).zip(nearest) {
                let mut least = f32::INFINITY;
                for node in &nodes {
                    let (du, dv) = (u - node.x, v - node.y);
                    least = least.min(du * du + dv * dv);
                }
                *sum += (nearest - least.sqrt()).max(0.0);
            }
        }
        let sum: f32 = sums.iter().sum();
        f64::from(sum) / self.all.max(1) as f64
    }
}

/// The places of a grid that lie in the region.
fn even_places(outline: &Outline, bounds: [u32; 4], step_px: f64) -> Vec<Point2<f32>> {
    let [left, top, right, bottom] = bounds.map(f64::from);
    let [columns, rows] = [right - left, bottom - top].map(|side| (side / step_px) as u32);
    let mut places = Vec::new();
    for row in 0..=rows {
        for column in 0..=columns {
            let [u, v] = [
                left + f64::from(column) * step_px,
                top + f64::from(row) * step_px,
            ];
            if outline.contains(u, v) {
                places.push(Point2::new(u as f32, v as f32));
            }
        }
    }
    places
}
