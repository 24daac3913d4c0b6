//! How large a pixel is beside a tag, and which way is up.

use super::camera::TagCamera;
use super::decode::Tag;
use super::homography::Homography;
use super::pose::{Corners, Pose, SIZE, TURN};
use crate::model::TagScale;
use crate::signal::median;
use crate::signal::statistics::median_vector;
use nalgebra::{Point2, Vector2, distance};

/// Ink and blur make all edges of a square a little thicker or thinner: this much, px, is added to the
/// standard deviation of each corner, and does not shrink with the number of frames.
const EDGE_BIAS_PX: f64 = 0.1;
/// Standard deviation of the share of the upright along a camera's axis: a tree is filmed level or a little
/// from below, by some 15 degrees.
const AIM_SD: f64 = 0.25;
/// Standard deviations of one pose to either side that make up the interval, and steps in each of them.
const SPREAD_SD: i32 = 4;
const SPREAD_STEPS: i32 = 8;

/// One sight of a tag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TagSeen {
    pub tag: Tag,
    /// Its middle, px.
    pub middle_px: Point2<f64>,
}

impl TagSeen {
    /// What one sight says; `None` where the corners are no square seen from the front.
    pub fn of(tag: &Tag) -> Option<Self> {
        let homography = Homography::of_square(&tag.corners_px)?;
        let is_sound = homography.jacobian().determinant() > 0.0;
        is_sound.then(|| Self {
            tag: *tag,
            middle_px: homography.apply(Point2::origin()),
        })
    }
}

/// A way in which a tag may hang before its camera.
struct Way {
    /// Logarithm of how likely it is, and how likely against the likeliest.
    log_weight: f64,
    weight: f64,
    /// Pixels for its side where that is parallel to the picture, and the standard deviation of that.
    side_px: f64,
    side_sd_px: f64,
    roll_deg: f64,
    roll_sd_deg: f64,
    foreshortened: f64,
}

impl Way {
    /// Whether all of its numbers are such.
    fn is_sound(&self) -> bool {
        let numbers = [
            self.log_weight,
            self.side_sd_px,
            self.roll_sd_deg,
            self.side_px,
        ];
        numbers.iter().all(|x| x.is_finite()) && self.side_px > 0.0
    }
}

/// A roll within 90 degrees to either side: a tag that hangs upside down is upright, too. Printouts differ in
/// which side is up, and no camera films upside down.
fn upright_deg(roll_deg: f64) -> f64 {
    match roll_deg {
        roll if roll > 90.0 => roll - 180.0,
        roll if roll < -90.0 => roll + 180.0,
        roll => roll,
    }
}

/// What all sights of a tag with a side of `size_m` metres say together; `None` of no sight.
///
/// The size of a pixel at the tag's depth is that of a plane parallel to the picture, whatever way the tag
/// is turned. Off the middle of the picture that takes the direction in which the tag is seen, and so the
/// focal length: where that is not known, all are tried, and weighed by how well corners fit.
pub fn scale_of(seen: &[TagSeen], size_m: f64, camera: &TagCamera) -> Option<TagScale> {
    let first = seen.first()?;
    let ways = ways(seen, camera)?;
    let squares: f64 = {
        let all = seen.iter().map(|s| s.middle_px.coords);
        let mean = Point2::from(all.sum::<Vector2<f64>>() / seen.len() as f64);
        let off = seen.iter().map(|s| distance(&s.middle_px, &mean));
        off.map(|off_px| off_px * off_px).sum()
    };
    let [narrow_px, side_px, wide_px] = spread_px(&ways);
    let roll_deg = mean(&ways, |way| way.roll_deg);
    // That of each way, and that by which they differ.
    let roll_squares = mean(&ways, |way| way.roll_sd_deg.powi(2) + way.roll_deg.powi(2));
    let roll_sd_deg = (roll_squares - roll_deg.powi(2)).max(0.0).sqrt();
    Some(TagScale {
        id: first.tag.id,
        size_m,
        frames: seen.len(),
        metres_per_px: size_m / side_px,
        metres_per_px_lo: size_m / wide_px,
        metres_per_px_hi: size_m / narrow_px,
        roll_deg: upright_deg(roll_deg),
        roll_sd_deg,
        foreshortened: mean(&ways, |way| way.foreshortened),
        moves_px: (squares / seen.len() as f64).sqrt(),
    })
}

/// The mean of a value of all ways, each by its weight.
fn mean(ways: &[Way], value: fn(&Way) -> f64) -> f64 {
    let weights: f64 = ways.iter().map(|way| way.weight).sum();
    let sum: f64 = ways.iter().map(|way| way.weight * value(way)).sum();
    sum / weights
}

/// All ways in which a tag may hang that is seen like this.
fn ways(seen: &[TagSeen], camera: &TagCamera) -> Option<Vec<Way>> {
    let corners_px = common_corners_px(seen, camera)?;
    let homography = Homography::of_square(&corners_px)?;
    let middle = homography.apply(Point2::origin());
    let (mut flat, mut outwards) = (Corners::zeros(), Corners::zeros());
    for (k, corner) in corners_px.iter().enumerate() {
        // Both edges of a corner move outwards.
        let out = (corner - middle).normalize() * std::f64::consts::SQRT_2 * EDGE_BIAS_PX;
        for axis in 0..2 {
            (flat[2 * k + axis], outwards[2 * k + axis]) = (corner[axis], out[axis]);
        }
    }
    let scatter_px = median(
        seen.iter().map(|s| s.tag.corner_sd_px).collect(),
        f64::total_cmp,
    )?;
    // Noise is another one in each frame, and the rest is not.
    let noise_px = scatter_px / (seen.len() as f64).sqrt();
    let corner_sd_px = noise_px.hypot(EDGE_BIAS_PX);
    let mut ways: Vec<Way> = Vec::new();
    for focal in camera.focals() {
        for pose in Pose::both(&homography, focal.px).into_iter().flatten() {
            let Some(fitted) = pose.fitted(&flat) else {
                continue;
            };
            let side = fitted.answer.row(SIZE);
            let turn = fitted.pose.roll_gradient_deg() * fitted.answer.fixed_rows::<3>(TURN);
            let side_share = (noise_px * side.norm()).hypot((side * outwards)[0]);
            let misfit = fitted.left_px2 / corner_sd_px.powi(2);
            let aim = fitted.pose.down().z / AIM_SD;
            let mut roll_deg = fitted.pose.roll_deg();
            if let Some(first) = ways.first() {
                // As near as can be to that of the first: angles go round.
                roll_deg -= 360.0 * ((roll_deg - first.roll_deg) / 360.0).round();
            }
            ways.push(Way {
                log_weight: focal.weight.ln() - 0.5 * (misfit + aim * aim),
                weight: 0.0,
                side_px: fitted.pose.side_px,
                side_sd_px: fitted.pose.side_px * side_share,
                roll_deg,
                roll_sd_deg: corner_sd_px * turn.norm(),
                foreshortened: fitted.pose.foreshortened(),
            });
        }
    }
    ways.retain(Way::is_sound);
    // Against the likeliest: none of a large tag may fit well.
    let best = ways
        .iter()
        .map(|way| way.log_weight)
        .max_by(f64::total_cmp)?;
    for way in &mut ways {
        way.weight = (way.log_weight - best).exp();
    }
    Some(ways)
}

/// The corners that all sights have in common, from where the camera's axis meets the picture, px: the camera
/// may shift from one to the next.
fn common_corners_px(seen: &[TagSeen], camera: &TagCamera) -> Option<[Point2<f64>; 4]> {
    let middle_px = median_vector(seen.iter().map(|s| s.middle_px.coords));
    let mut corners_px = [Point2::origin(); 4];
    for (k, corner) in corners_px.iter_mut().enumerate() {
        let from_middle = seen.iter().map(|s| s.tag.corners_px[k] - s.middle_px);
        *corner = camera.from_axis_px((middle_px + median_vector(from_middle)).into())?;
    }
    Some(corners_px)
}

/// Side of a tag in pixels: lower end of its 95 % interval, median, and upper end.
fn spread_px(ways: &[Way]) -> [f64; 3] {
    let mut shares = Vec::with_capacity(ways.len() * (2 * SPREAD_SD * SPREAD_STEPS + 1) as usize);
    for way in ways {
        for k in -SPREAD_SD * SPREAD_STEPS..=SPREAD_SD * SPREAD_STEPS {
            let sd = f64::from(k) / f64::from(SPREAD_STEPS);
            let side_px = (way.side_px + sd * way.side_sd_px).max(f64::MIN_POSITIVE);
            shares.push((side_px, way.weight * (-0.5 * sd * sd).exp()));
        }
    }
    shares.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole: f64 = shares.iter().map(|share| share.1).sum();
    [0.025, 0.5, 0.975].map(|wanted| below_px(&shares, wanted * whole))
}

/// The size below which so much of the weight lies, px; between two sizes by the line between both.
fn below_px(shares: &[(f64, f64)], wanted: f64) -> f64 {
    let (mut sum, mut before): (f64, Option<(f64, f64)>) = (0.0, None);
    for (px, weight) in shares {
        let middle = sum + 0.5 * weight;
        if middle >= wanted {
            return before.map_or(*px, |(low_px, low)| {
                let share = (wanted - low) / (middle - low).max(f64::MIN_POSITIVE);
                low_px + share * (px - low_px)
            });
        }
        (sum, before) = (sum + weight, Some((*px, middle)));
    }
    before.map_or(f64::MIN_POSITIVE, |(px, _)| px)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Luma, Size};
    use crate::random::{Generator, generator};
    use crate::tag::codes::{BIT_CELLS, CODES};
    use crate::tag::find_tags;
    use nalgebra::{Matrix3, Vector3};
    use rand::Rng;

    const SIZE: Size = Size {
        width: 320,
        height: 240,
    };
    /// Places in a pixel that are averaged, along each axis.
    const FINE: usize = 5;

    /// A camera and where the tag is before it, m: the tag's middle, and how it is turned, rad.
    struct View {
        size: Size,
        focal_px: f64,
        middle_m: Vector3<f64>,
        turned: Vector3<f64>,
        size_m: f64,
    }

    impl View {
        fn to_tag(&self) -> Matrix3<f64> {
            let turn = self.turn();
            let right = turn * Vector3::x() * self.size_m;
            let down = turn * Vector3::y() * self.size_m;
            let camera = Matrix3::new(
                self.focal_px,
                0.0,
                f64::from(self.size.width - 1) / 2.0,
                0.0,
                self.focal_px,
                f64::from(self.size.height - 1) / 2.0,
                0.0,
                0.0,
                1.0,
            );
            let to_picture = camera * Matrix3::from_columns(&[right, down, self.middle_m]);
            to_picture.try_inverse().expect("a view")
        }

        fn turn(&self) -> nalgebra::Rotation3<f64> {
            nalgebra::Rotation3::from_scaled_axis(self.turned)
        }

        /// Angle from the picture's upright to the tag's, clockwise, degrees.
        fn roll_deg(&self) -> f64 {
            let down = self.turn() * Vector3::y();
            (-down.x).atan2(down.y).to_degrees()
        }

        /// The camera as it is.
        fn known(&self) -> TagCamera {
            let half = 0.5 * f64::from(self.size.width);
            TagCamera::of_view(self.size, 2.0 * (half / self.focal_px).atan().to_degrees())
        }

        /// Metres of a pixel at the distance of the tag.
        fn metres_per_px(&self) -> f64 {
            self.middle_m.z / self.focal_px
        }
    }

    /// White, black or wall at a place of the tag, whose black square is the unit square.
    fn reflectance(code: u64, at: Point2<f64>) -> f64 {
        let cell = at.coords.map(|x| ((x + 0.5) * 8.0).floor() as i32);
        let (column, row) = (cell.x, cell.y);
        if !(-1..=8).contains(&column) || !(-1..=8).contains(&row) {
            return 120.0;
        }
        let is_inside = (0..8).contains(&column) && (0..8).contains(&row);
        let bit = BIT_CELLS
            .iter()
            .position(|[c, r]| i32::from(*c) == column && i32::from(*r) == row);
        let white = bit.map_or(!is_inside, |k| code >> (35 - k) & 1 == 1);
        if white { 215.0 } else { 30.0 }
    }

    fn noise(rng: &mut Generator) -> f64 {
        (0..12)
            .map(|_| f64::from(rng.next_u32()) / f64::from(u32::MAX))
            .sum::<f64>()
            - 6.0
    }

    fn picture(view: &View, id: usize, seed: u64) -> Luma {
        let (to_tag, mut rng) = (view.to_tag(), generator(seed, 0));
        let mut pixels = Vec::with_capacity(view.size.area());
        for v in 0..view.size.height as usize {
            for u in 0..view.size.width as usize {
                let mut sum = 0.0;
                for k in 0..FINE * FINE {
                    let off = [k % FINE, k / FINE].map(|i| (i as f64 + 0.5) / FINE as f64 - 0.5);
                    let at = to_tag * Vector3::new(u as f64 + off[0], v as f64 + off[1], 1.0);
                    sum += reflectance(CODES[id], Point2::new(at.x / at.z, at.y / at.z));
                }
                let value = sum / (FINE * FINE) as f64 + 2.0 * noise(&mut rng);
                pixels.push(value.round().clamp(0.0, 255.0) as u8);
            }
        }
        Luma {
            size: view.size,
            pixels,
        }
    }

    fn scale(view: &View, id: usize, seed: u64, camera: &TagCamera) -> TagScale {
        let tags = find_tags(&picture(view, id, seed));
        assert_eq!(tags.len(), 1, "view {seed}");
        assert_eq!(usize::from(tags[0].id), id);
        let seen = TagSeen::of(&tags[0]).expect("a square");
        scale_of(&[seen], view.size_m, camera).expect("a scale")
    }

    /// 40 views from twenty widths away, aslant by up to 25 degrees: the scale is within 1 % of the true
    /// one, and inside of its interval in at least 90 % of them.
    #[test]
    fn the_scale_is_right_at_twenty_widths() {
        let (mut within, n) = (0, 40);
        for seed in 0..n {
            let mut rng = generator(1000, seed);
            let mut chance =
                |most: f64| most * (2.0 * f64::from(rng.next_u32()) / f64::from(u32::MAX) - 1.0);
            let size_m = 0.165;
            let distance_m = 20.0 * size_m;
            let view = View {
                size: SIZE,
                // The picture is a part of one of 1280 px with a field of view of 60 degrees.
                focal_px: 1108.0,
                middle_m: Vector3::new(chance(0.2), chance(0.15), distance_m),
                turned: Vector3::new(chance(0.25), chance(0.4), chance(0.3)),
                size_m,
            };
            let id = seed as usize * 13;
            let scale = scale(&view, id, seed, &view.known());
            let (truth, found) = (view.metres_per_px(), scale.metres_per_px);
            assert!(
                (found / truth - 1.0).abs() < 0.01,
                "view {seed}: {scale:?} for {truth}"
            );
            assert!(scale.relative_error() < 0.02, "view {seed}: {scale:?}");
            let interval = scale.metres_per_px_lo..=scale.metres_per_px_hi;
            within += usize::from(interval.contains(&truth));
        }
        assert!(within * 10 >= 9 * n as usize, "{within} of {n}");
    }

    /// A view at twenty widths by a lens of 45 to 80 degrees, anywhere in the picture; `aslant` of 1 turns the
    /// tag by up to 25 degrees aside and 12 up or down.
    fn wide_view(seed: u64, aslant: f64) -> View {
        let mut rng = generator(2000, seed);
        let mut chance =
            |most: f64| most * (2.0 * f64::from(rng.next_u32()) / f64::from(u32::MAX) - 1.0);
        let size = Size::new(640, 480);
        let focal_px = 320.0 / (0.5 * (62.5 + chance(17.5)).to_radians()).tan();
        let size_m = 0.16;
        let distance_m = 20.0 * size_m * focal_px / 525.0;
        let at_px = nalgebra::Vector2::new(chance(290.0), chance(200.0));
        let upright = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), chance(0.07));
        let pitched =
            nalgebra::Rotation3::from_axis_angle(&Vector3::x_axis(), chance(0.21) * aslant);
        let aside = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), chance(0.44) * aslant);
        View {
            size,
            focal_px,
            middle_m: (at_px / focal_px).push(1.0) * distance_m,
            turned: (upright * pitched * aside).scaled_axis(),
            size_m,
        }
    }

    /// Errors of the scale of wide views, as shares; how many have the true scale in their interval, and
    /// how many the true roll within two standard deviations.
    fn wide_errors(n: u64, aslant: f64, is_known: bool) -> (Vec<f64>, u64, u64) {
        let (mut errors, mut inside, mut upright) = (Vec::new(), 0, 0);
        for seed in 0..n {
            let view = wide_view(seed, aslant);
            let camera = match is_known {
                true => view.known(),
                false => TagCamera::unknown(view.size),
            };
            let scale = scale(&view, seed as usize * 11, seed, &camera);
            let truth = view.metres_per_px();
            errors.push((scale.metres_per_px / truth - 1.0).abs());
            let interval = scale.metres_per_px_lo..=scale.metres_per_px_hi;
            inside += u64::from(interval.contains(&truth));
            let off_deg = (scale.roll_deg - view.roll_deg()).abs();
            upright += u64::from(off_deg < 2.0 * scale.roll_sd_deg);
        }
        errors.sort_by(f64::total_cmp);
        (errors, inside, upright)
    }

    #[test]
    fn a_tag_off_the_axis_of_a_known_wide_lens() {
        let (errors, inside, upright) = wide_errors(30, 1.0, true);
        assert!(errors[29] < 0.01, "{errors:?}");
        assert!(inside >= 28, "{inside}");
        assert!(upright >= 27, "{upright}");
    }

    #[test]
    fn a_tag_off_the_axis_of_an_unknown_wide_lens() {
        let (errors, inside, upright) = wide_errors(30, 1.0, false);
        assert!(errors[15] < 0.006, "{errors:?}");
        assert!(errors[26] < 0.015, "{errors:?}");
        assert!(inside >= 28, "{inside}");
        assert!(upright >= 27, "{upright}");
    }

    #[test]
    fn a_tag_off_the_axis_that_faces_the_camera() {
        let (errors, inside, _) = wide_errors(12, 0.0, false);
        assert!(errors[11] < 0.01, "{errors:?}");
        assert!(inside >= 11, "{inside}");
    }

    #[test]
    fn the_tag_tells_upright() {
        let view = View {
            size: SIZE,
            focal_px: 900.0,
            middle_m: Vector3::new(0.0, 0.0, 3.0),
            turned: Vector3::new(0.0, 0.0, 7.0_f64.to_radians()),
            size_m: 0.2,
        };
        let tags = find_tags(&picture(&view, 3, 5));
        let seen = TagSeen::of(&tags[0]).expect("a square");
        let scale = scale_of(&[seen; 4], 0.2, &TagCamera::unknown(SIZE)).expect("a scale");
        let off_deg = (scale.roll_deg - 7.0).abs();
        assert!(off_deg < 2.0 * scale.roll_sd_deg, "{scale:?}");
        assert!(scale.roll_sd_deg < 0.3, "{scale:?}");
        assert!((scale.frames, scale.moves_px) == (4, 0.0));
    }

    /// Printouts of the same tag differ in which side is up.
    #[test]
    fn a_tag_that_hangs_upside_down_is_upright() {
        for turned_deg in [7.0, 187.0, -173.0] {
            let view = View {
                size: SIZE,
                focal_px: 900.0,
                middle_m: Vector3::new(0.0, 0.0, 3.0),
                turned: Vector3::new(0.0, 0.0, f64::to_radians(turned_deg)),
                size_m: 0.2,
            };
            let tags = find_tags(&picture(&view, 3, 5));
            let seen = TagSeen::of(&tags[0]).expect("a square");
            let scale = scale_of(&[seen; 4], 0.2, &TagCamera::unknown(SIZE)).expect("a scale");
            assert!(
                (scale.roll_deg - 7.0).abs() < 1.0,
                "{turned_deg}: {scale:?}"
            );
        }
    }

    #[test]
    fn what_is_no_tag_is_none() {
        let plain = Luma {
            size: SIZE,
            pixels: vec![90; SIZE.area()],
        };
        assert!(find_tags(&plain).is_empty());
        // A black square on white, without a code.
        let mut square = Luma {
            size: SIZE,
            pixels: vec![220; SIZE.area()],
        };
        for v in 60..140 {
            for u in 60..140 {
                square.pixels[v * SIZE.width as usize + u] = 20;
            }
        }
        assert!(find_tags(&square).is_empty());
        let empty = Luma {
            size: Size::new(0, 0),
            pixels: Vec::new(),
        };
        assert!(find_tags(&empty).is_empty());
        let mut rng = generator(9, 0);
        let noisy = Luma {
            size: SIZE,
            pixels: (0..SIZE.area()).map(|_| rng.next_u32() as u8).collect(),
        };
        assert!(find_tags(&noisy).is_empty());
    }
}
