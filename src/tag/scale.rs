//! How large a pixel is beside a tag, and which way is up.

use super::decode::Tag;
use super::homography::Homography;
use crate::model::{Interval, TagScale};
use crate::signal::median;
use nalgebra::{Matrix2, Point2, Vector2, distance};

/// Ink and blur make all edges of a square a little thicker or thinner: this much, px, is added to the
/// standard deviation of each corner, and does not shrink with the number of frames.
const EDGE_BIAS_PX: f64 = 0.1;
/// A corner is moved so far to see what the scale owes to it, px.
const NUDGE_PX: f64 = 0.01;

/// One sight of a tag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TagSeen {
    pub tag: Tag,
    /// Its middle, px.
    pub middle_px: Point2<f64>,
    /// Pixels for one side of the tag, across the direction in which it is seen aslant.
    side_px: f64,
    /// Standard deviation of that by the scatter along the edges, px, and by a bias of all edges.
    scatter_px: f64,
    bias_px: f64,
    /// Angle from the upright of the picture to that of the tag, clockwise, degrees.
    roll_deg: f64,
    /// How far it turns, degrees, where each corner moves by a pixel of its own.
    roll_per_px: f64,
    /// How much shorter the tag is along the direction in which it is seen aslant, 0 to 1.
    foreshortened: f64,
}

impl TagSeen {
    /// What one sight says; `None` where the corners are no square seen from the front.
    pub fn of(tag: &Tag) -> Option<Self> {
        let shape = Shape::of(&tag.corners_px)?;
        let (mut squares, mut bias, mut turns) = (0.0, 0.0, 0.0);
        let middle = Point2::from(
            tag.corners_px
                .iter()
                .map(|c| c.coords)
                .sum::<Vector2<f64>>()
                / 4.0,
        );
        for k in 0..4 {
            let mut gradient = Vector2::zeros();
            for axis in 0..2 {
                let mut moved = tag.corners_px;
                moved[k][axis] += NUDGE_PX;
                let nudged = Shape::of(&moved)?;
                gradient[axis] = (nudged.side_px - shape.side_px) / NUDGE_PX;
                turns += ((nudged.roll_deg - shape.roll_deg) / NUDGE_PX).powi(2);
            }
            squares += gradient.norm_squared();
            // Both edges of a corner move outwards.
            let outwards = (tag.corners_px[k] - middle).normalize() * std::f64::consts::SQRT_2;
            bias += gradient.dot(&outwards);
        }
        Some(Self {
            tag: *tag,
            middle_px: shape.middle_px,
            side_px: shape.side_px,
            scatter_px: tag.corner_sd_px * squares.sqrt(),
            bias_px: EDGE_BIAS_PX * bias.abs(),
            roll_deg: shape.roll_deg,
            roll_per_px: turns.sqrt(),
            foreshortened: shape.foreshortened,
        })
    }
}

/// A square in the picture.
struct Shape {
    middle_px: Point2<f64>,
    side_px: f64,
    roll_deg: f64,
    foreshortened: f64,
}

impl Shape {
    fn of(corners_px: &[Point2<f64>; 4]) -> Option<Self> {
        let homography = Homography::of_square(corners_px)?;
        let jacobian: Matrix2<f64> = homography.jacobian();
        let lengths = jacobian.singular_values();
        let (long, short) = (lengths.max(), lengths.min());
        let down = jacobian.column(1).into_owned();
        let is_sound = long.is_finite() && short > 0.0 && jacobian.determinant() > 0.0;
        is_sound.then(|| Self {
            middle_px: homography.apply(Point2::origin()),
            side_px: long,
            roll_deg: upright_deg((-down.x).atan2(down.y).to_degrees()),
            foreshortened: short / long,
        })
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
pub fn scale_of(seen: &[TagSeen], size_m: f64) -> Option<TagScale> {
    let first = seen.first()?;
    let middle =
        |value: fn(&TagSeen) -> f64| median(seen.iter().map(value).collect(), f64::total_cmp);
    let side_px = middle(|s| s.side_px)?;
    let scatter_px = middle(|s| s.scatter_px)?;
    // Noise is another one in each frame, and the rest is not.
    let sd_px = (scatter_px * scatter_px / seen.len() as f64)
        .sqrt()
        .hypot(middle(|s| s.bias_px)?);
    let mean = Point2::from(
        seen.iter()
            .map(|s| s.middle_px.coords)
            .sum::<Vector2<f64>>()
            / seen.len() as f64,
    );
    let squares: f64 = seen
        .iter()
        .map(|s| distance(&s.middle_px, &mean).powi(2))
        .sum();
    let at = |off: f64| size_m / (side_px + off).max(f64::MIN_POSITIVE);
    Some(TagScale {
        id: first.tag.id,
        size_m,
        frames: seen.len(),
        metres_per_px: at(0.0),
        metres_per_px_lo: at(Interval::Z * sd_px),
        metres_per_px_hi: at(-Interval::Z * sd_px),
        roll_deg: middle(|s| s.roll_deg)?,
        roll_sd_deg: roll_sd_deg(seen)?,
        foreshortened: middle(|s| s.foreshortened)?,
        moves_px: (squares / seen.len() as f64).sqrt(),
    })
}

/// How surely the upright of the tag is known by its edges, degrees: as of the scale, noise is another one
/// in each frame, and a bias of a corner is not.
fn roll_sd_deg(seen: &[TagSeen]) -> Option<f64> {
    let noise = seen.iter().map(|s| s.roll_per_px * s.tag.corner_sd_px);
    let noise = median(noise.collect(), f64::total_cmp)?;
    let bias = seen.iter().map(|s| s.roll_per_px * EDGE_BIAS_PX);
    let bias = median(bias.collect(), f64::total_cmp)?;
    Some((noise * noise / seen.len() as f64).sqrt().hypot(bias))
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
        focal_px: f64,
        middle_m: Vector3<f64>,
        turned: Vector3<f64>,
        size_m: f64,
    }

    impl View {
        fn to_tag(&self) -> Matrix3<f64> {
            let turn = nalgebra::Rotation3::from_scaled_axis(self.turned);
            let right = turn * Vector3::x() * self.size_m;
            let down = turn * Vector3::y() * self.size_m;
            let camera = Matrix3::new(
                self.focal_px,
                0.0,
                f64::from(SIZE.width) / 2.0,
                0.0,
                self.focal_px,
                f64::from(SIZE.height) / 2.0,
                0.0,
                0.0,
                1.0,
            );
            let to_picture = camera * Matrix3::from_columns(&[right, down, self.middle_m]);
            to_picture.try_inverse().expect("a view")
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
        let mut pixels = Vec::with_capacity(SIZE.area());
        for v in 0..SIZE.height as usize {
            for u in 0..SIZE.width as usize {
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
        Luma { size: SIZE, pixels }
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
                // The picture is a part of one of 1280 px with a field of view of 60 degrees.
                focal_px: 1108.0,
                middle_m: Vector3::new(chance(0.2), chance(0.15), distance_m),
                turned: Vector3::new(chance(0.25), chance(0.4), chance(0.3)),
                size_m,
            };
            let id = seed as usize * 13;
            let tags = find_tags(&picture(&view, id, seed));
            assert_eq!(tags.len(), 1, "view {seed}");
            assert_eq!(usize::from(tags[0].id), id);
            let seen = TagSeen::of(&tags[0]).expect("a square");
            let scale = scale_of(&[seen], size_m).expect("a scale");
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

    #[test]
    fn the_tag_tells_upright() {
        let view = View {
            focal_px: 900.0,
            middle_m: Vector3::new(0.0, 0.0, 3.0),
            turned: Vector3::new(0.0, 0.0, 7.0_f64.to_radians()),
            size_m: 0.2,
        };
        let tags = find_tags(&picture(&view, 3, 5));
        let seen = TagSeen::of(&tags[0]).expect("a square");
        let scale = scale_of(&[seen; 4], 0.2).expect("a scale");
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
                focal_px: 900.0,
                middle_m: Vector3::new(0.0, 0.0, 3.0),
                turned: Vector3::new(0.0, 0.0, f64::to_radians(turned_deg)),
                size_m: 0.2,
            };
            let tags = find_tags(&picture(&view, 3, 5));
            let seen = TagSeen::of(&tags[0]).expect("a square");
            let scale = scale_of(&[seen; 4], 0.2).expect("a scale");
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
