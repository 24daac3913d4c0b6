//! Where the trunk meets the ground: it is led down by its places some way above.

use super::paths::{Path, Place};
use crate::signal::median;
use nalgebra::{Point3, Vector2, Vector3};

/// Between these heights above the ground, in radii of the trunk, its middle is believed. Below, points of
/// the ground, of roots and of grass pull it aside, where they are seen from one side only by as much as
/// its radius.
const CLEAR_RADII: [f64; 2] = [2.5, 8.0];
/// Fewer places in a half of that say nothing.
const LEAST_PLACES: usize = 3;
/// Its radius is that of the places below this share of the tree's height.
const LOW_SHARE: f64 = 0.15;
/// A path that is at least this share of the tree's height long is another stem: above where it leaves the
/// trunk the middle is not that of one.
const STEM_SHARE: f64 = 0.3;
/// It is not believed nearer than so many radii below where such a stem leaves: the trunk widens there.
const FORK_RADII: f64 = 1.5;
/// No trunk leans more, as a slope.
const STEEPEST_LEAN: f64 = 1.0;

/// Lets the trunk begin on the ground; `base` is about where, `ground_at` says how high the ground is at a
/// place, where any was scanned.
pub(super) fn stand(
    paths: &mut [Path],
    base: Point3<f64>,
    ground_at: impl Fn(&Point3<f64>) -> Option<f64>,
) {
    let axis = Axis::of(paths, base.z);
    let Some(trunk) = paths.first_mut() else {
        return;
    };
    let Some(axis) = axis else {
        let first = &mut trunk.places[0];
        first.at.z = first.at.z.min(base.z);
        return;
    };
    let foot = axis.at(base.z);
    let foot = axis.at(ground_at(&foot).unwrap_or(base.z));
    let is_clear = |place: &Place| place.at.z >= axis.clear_from;
    let clear = trunk.places.iter().position(is_clear).unwrap_or(0).max(1);
    let top = trunk.places[clear].at;
    // The axis is that of all clear places together: it goes over into the lowest of them without a kink.
    let aside = top - axis.at(top.z);
    for (k, place) in trunk.places[..clear].iter_mut().enumerate() {
        let share = k as f64 / clear as f64;
        place.at = axis.at(foot.z + (top.z - foot.z) * share) + aside * share;
        place.measured = None;
    }
}

/// The middle of the lowest part of a trunk.
struct Axis {
    middle: Point3<f64>,
    /// Sideways for each metre up.
    lean: Vector2<f64>,
    clear_from: f64,
}

impl Axis {
    /// `None` where the trunk does not say it: it has no circles there, forks at once, or leans too much.
    fn of(paths: &[Path], ground: f64) -> Option<Self> {
        let trunk = paths.first()?;
        let top = trunk.places.iter().map(|p| p.at.z).fold(ground, f64::max);
        let height = top - ground;
        let low = trunk
            .places
            .iter()
            .filter(|p| p.at.z < ground + LOW_SHARE * height);
        let circles = low.filter_map(|p| p.measured.filter(|m| m.is_circle));
        let radius = median(circles.map(|m| m.radius).collect(), f64::total_cmp)?;
        let fork = lowest_stem(paths, STEM_SHARE * height).unwrap_or(f64::INFINITY);
        let [from, to] = CLEAR_RADII.map(|radii| ground + radii * radius);
        let to = to.min(fork - FORK_RADII * radius);
        let half = 0.5 * (from + to);
        let [lower, upper] = [middle(trunk, from, half)?, middle(trunk, half, to)?];
        let way: Vector3<f64> = upper - lower;
        let lean = way.xy() / way.z;
        (way.z > 0.0 && lean.norm() <= STEEPEST_LEAN).then_some(Self {
            middle: lower,
            lean,
            clear_from: from,
        })
    }

    fn at(&self, z: f64) -> Point3<f64> {
        let aside = self.lean * (z - self.middle.z);
        Point3::new(self.middle.x + aside.x, self.middle.y + aside.y, z)
    }
}

/// How high the lowest path of such a length leaves the trunk.
fn lowest_stem(paths: &[Path], least: f64) -> Option<f64> {
    let mut lowest: Option<f64> = None;
    for path in &paths[1..] {
        let Some(on) = path.on.filter(|on| on.path == 0) else {
            continue;
        };
        let at = paths[0].places[on.place].at.z;
        if path.length_from(0) >= least && lowest.is_none_or(|z| at < z) {
            lowest = Some(at);
        }
    }
    lowest
}

/// The mean of the places of a path between two heights.
fn middle(path: &Path, from: f64, to: f64) -> Option<Point3<f64>> {
    let mut sum = Vector3::zeros();
    let mut count = 0;
    for place in path.places.iter().filter(|p| (from..to).contains(&p.at.z)) {
        sum += place.at.coords;
        count += 1;
    }
    (count >= LEAST_PLACES).then(|| Point3::from(sum / f64::from(count as u32)))
}

#[cfg(test)]
mod tests {
    use super::super::paths::Measured;
    use super::*;

    /// A trunk of 0.2 m radius that leans by a tenth; near the ground its middle is pulled aside.
    fn leaning() -> Path {
        let mut trunk = Path::default();
        for k in 0..200 {
            let z = 0.03 * f64::from(k);
            let aside = if z < 0.4 { 0.3 - z } else { 0.0 };
            let mut place = Place::new(Point3::new(1.0 + 0.1 * z, 2.0 + aside, z));
            place.measured = Some(Measured {
                radius: 0.2,
                spread: 0.002,
                points: 60,
                is_circle: true,
            });
            trunk.places.push(place);
        }
        trunk
    }

    #[test]
    fn a_trunk_is_led_down_past_what_lies_about_its_foot() {
        let mut paths = [leaning()];
        stand(&mut paths, Point3::new(1.0, 2.3, 0.0), |_| Some(-0.1));
        let foot = paths[0].places[0].at;
        assert!(
            (foot - Point3::new(0.99, 2.0, -0.1)).norm() < 1e-6,
            "{foot}"
        );
        let heights = paths[0].places.windows(2).map(|w| w[1].at.z - w[0].at.z);
        assert!(heights.into_iter().all(|step| step > 0.0));
        assert!(paths[0].places.iter().all(|p| (p.at.y - 2.0).abs() < 1e-6));
    }

    #[test]
    fn a_trunk_that_says_nothing_begins_straight_below_its_first_place() {
        let mut paths = [leaning()];
        for place in &mut paths[0].places {
            place.measured = None;
        }
        stand(&mut paths, Point3::new(1.0, 2.3, -0.2), |_| None);
        assert_eq!(paths[0].places[0].at, Point3::new(1.0, 2.3, -0.2));
        assert_eq!(paths[0].places[1], {
            let mut place = leaning().places[1].clone();
            place.measured = None;
            place
        });
    }
}
