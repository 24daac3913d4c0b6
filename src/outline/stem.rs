//! The trunk of a tree in a picture in which none was drawn: the line from the crown down to the ground along
//! which colours differ most from those at both its sides, of all lines (dynamic programming, Montanari 1971).
//! An edge of a wall differs from one side alone, a window or a post is short.

use crate::model::{Outline, Rgb, Size};
use nalgebra::{Point2, Vector3, Vector4};
use std::ops::Range;

/// Half the widths of a stripe that are tried, px: a trunk 3 to 17 px wide, in a picture 480 px wide.
const HALF_WIDTHS: [i64; 7] = [1, 2, 3, 4, 5, 6, 8];
/// Half the height of a stripe, px: textures are evened out over it.
const HALF_ROWS: i64 = 3;
/// Between a stripe and what is beside it, px: the edge is soft.
const EDGE_PX: i64 = 1;
/// A stripe is no plainer than this, grey levels: noise and texture of a picture.
const PLAIN_LEVELS: f64 = 8.0;
/// A stripe that differs by less than this from one of its sides, in deviations of its own colours, is more
/// likely none; what is above the second bound is as sure as that.
const LEAST_CONTRAST: f64 = 1.0;
const MOST_CONTRAST: f64 = 4.0;
/// What a step aside costs, in the same unit.
const ASIDE: f64 = 0.3;
/// The line begins above this share of the crown's height from its top down, and ends below the second.
const FROM: f64 = 0.5;
const TO: f64 = 0.75;
/// Share of the tree's height that is taken of the trunk: above, limbs part from it.
const TRUNK_SHARE: f64 = 0.3;
/// Rows at least, px.
const LEAST_ROWS: usize = 8;
/// The line is evened out over so many rows to each side: a trunk has no corners.
const EVEN_ROWS: usize = 4;

/// The trunk below a crown, or in the outline of a whole tree: a line from the foot up, px; `None` where there
/// is none. The picture should be a reduced one, see [`HALF_WIDTHS`].
pub fn stem(picture: &Rgb, crown: &Outline) -> Option<Vec<Point2<f64>>> {
    let [left, top, right, bottom] = crown.bounds_px()?.map(|px| px as usize);
    let height = (bottom - top + 1) as f64;
    let ways = Ways::down(
        &Sums::of(picture),
        left..right + 1,
        top + (FROM * height) as usize,
    );
    let line = ways.best(top + (TO * height) as usize)?;
    // A stripe at the foot reaches so far below it.
    let line = line
        .get(HALF_ROWS as usize..)
        .filter(|line| !line.is_empty())?;
    let trunk_rows = TRUNK_SHARE * (line[0].v - top) as f64;
    let trunk = &line[..line.len().min(trunk_rows as usize)];
    (trunk.len() >= LEAST_ROWS).then(|| evened(trunk))
}

/// A pixel.
#[derive(Clone, Copy, Debug)]
struct Pixel {
    u: usize,
    v: usize,
}

/// Every column is the mean of those next to it along the line.
fn evened(line: &[Pixel]) -> Vec<Point2<f64>> {
    let mut out = Vec::with_capacity(line.len());
    for (k, pixel) in line.iter().enumerate() {
        // As many to each side: else the ends of a slope would be drawn in.
        let reach = EVEN_ROWS.min(k).min(line.len() - 1 - k);
        let near = &line[k - reach..=k + reach];
        let sum: usize = near.iter().map(|other| other.u).sum();
        let mean = sum as f64 / near.len() as f64;
        out.push(Point2::new(mean, pixel.v as f64));
    }
    out
}

/// The best way down that ends at a pixel.
#[derive(Clone, Copy, Debug)]
struct Way {
    score: f64,
    /// Column of the pixel before it; `None` where it begins.
    before: Option<usize>,
}

/// The best ways down to every pixel of some columns, row by row.
struct Ways {
    columns: Range<usize>,
    first_row: usize,
    all: Vec<Way>,
}

impl Ways {
    fn down(sums: &Sums, columns: Range<usize>, first_row: usize) -> Self {
        let mut ways = Self {
            columns: columns.clone(),
            first_row,
            all: Vec::new(),
        };
        for v in first_row..sums.size.height as usize {
            for u in columns.clone() {
                let pixel = Pixel { u, v };
                let own = sums.contrast(pixel).min(MOST_CONTRAST) - LEAST_CONTRAST;
                let way = ways.before(pixel).map_or(
                    Way {
                        score: own,
                        before: None,
                    },
                    |before| Way {
                        score: before.score + own,
                        ..before
                    },
                );
                ways.all.push(way);
            }
        }
        ways
    }

    /// The best way to a pixel without its own score; `None` where it had better begin there.
    fn before(&self, pixel: Pixel) -> Option<Way> {
        let v = pixel.v.checked_sub(1)?;
        let mut best: Option<Way> = None;
        for (u, aside) in [
            (pixel.u, 0.0),
            (pixel.u.wrapping_sub(1), ASIDE),
            (pixel.u + 1, ASIDE),
        ] {
            let Some(above) = self.at(Pixel { u, v }) else {
                continue;
            };
            let score = above.score - aside;
            if score > best.map_or(0.0, |best| best.score) {
                best = Some(Way {
                    score,
                    before: Some(u),
                });
            }
        }
        best
    }

    fn at(&self, pixel: Pixel) -> Option<&Way> {
        let row = pixel.v.checked_sub(self.first_row)?;
        let is_inside = self.columns.contains(&pixel.u);
        let place = row * self.columns.len() + pixel.u.wrapping_sub(self.columns.start);
        self.all.get(place).filter(|_| is_inside)
    }

    /// The pixels of the best of all that end in this row or below, from its end up.
    fn best(&self, least_row: usize) -> Option<Vec<Pixel>> {
        let wide = self.columns.len();
        let ends = self.all.iter().enumerate();
        let ends = ends.skip(least_row.saturating_sub(self.first_row) * wide);
        let (end, _) = ends.max_by(|(_, a), (_, b)| a.score.total_cmp(&b.score))?;
        let mut pixel = Pixel {
            u: self.columns.start + end % wide,
            v: self.first_row + end / wide,
        };
        let mut line = vec![pixel];
        while let Some(u) = self.at(pixel).and_then(|way| way.before) {
            pixel = Pixel { u, v: pixel.v - 1 };
            line.push(pixel);
        }
        Some(line)
    }
}

/// Colours summed up over all pixels above and to the left of each (Crow 1984), by which the mean of a box
/// takes no time.
struct Sums {
    size: Size,
    /// Red, green and blue, and the sum of their squares.
    sums: Vec<Vector4<f64>>,
}

impl Sums {
    fn of(picture: &Rgb) -> Self {
        let size = picture.size;
        let wide = size.width as usize + 1;
        let mut sums = vec![Vector4::zeros(); wide * (size.height as usize + 1)];
        let (pixels, _) = picture.pixels.as_chunks::<3>();
        for (i, pixel) in pixels.iter().enumerate() {
            let colour = Vector3::from(pixel.map(f64::from));
            let own = colour.push(colour.norm_squared());
            let at = (i / size.width as usize + 1) * wide + i % size.width as usize + 1;
            sums[at] = own + sums[at - 1] + sums[at - wide] - sums[at - wide - 1];
        }
        Self { size, sums }
    }

    /// How far a stripe at a pixel differs from that side from which it does less, in deviations of its own
    /// colours; of the widths that fit into the picture the best.
    fn contrast(&self, pixel: Pixel) -> f64 {
        let (u, v) = (pixel.u as i64, pixel.v as i64);
        let mut best = 0.0_f64;
        for half in HALF_WIDTHS {
            let [inner, outer] = [half + EDGE_PX + 1, 2 * half + EDGE_PX];
            let sides = [
                self.mean(u - outer..u - inner + 1, v),
                self.mean(u + inner..u + outer + 1, v),
            ];
            let (Some(own), [Some(left), Some(right)]) =
                (self.mean(u - half..u + half + 1, v), sides)
            else {
                break;
            };
            let variance = (own.w - own.xyz().norm_squared()).max(0.0);
            let deviation = (variance + PLAIN_LEVELS.powi(2)).sqrt();
            let [left, right] = [left, right].map(|side| (own.xyz() - side.xyz()).norm());
            best = best.max(left.min(right) / deviation);
        }
        best
    }

    /// The means over some columns and the rows about `v` that are in the picture; `None` where columns are
    /// not.
    fn mean(&self, columns: Range<i64>, v: i64) -> Option<Vector4<f64>> {
        let [width, height] = [self.size.width, self.size.height].map(i64::from);
        if columns.start < 0 || columns.end > width {
            return None;
        }
        let [first, last] = [(v - HALF_ROWS).max(0), (v + HALF_ROWS + 1).min(height)];
        let sum = self.until(columns.end, last)
            - self.until(columns.start, last)
            - self.until(columns.end, first)
            + self.until(columns.start, first);
        Some(sum / ((columns.end - columns.start) * (last - first)) as f64)
    }

    /// The sum over all before this column and this row.
    fn until(&self, u: i64, v: i64) -> Vector4<f64> {
        self.sums[v as usize * (self.size.width as usize + 1) + u as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::seed_of_part;

    /// A crown on a trunk that leans, before a wall with windows, maybe without the trunk.
    fn picture(has_trunk: bool) -> (Rgb, Outline) {
        let size = Size::new(300, 200);
        let (mut pixels, mut mask) = (Vec::new(), Vec::new());
        for i in 0..size.area() {
            let (u, v) = ((i % 300) as f64, (i / 300) as f64);
            let is_crown = (u - 150.0).hypot(v - 60.0) < 50.0;
            let middle = 150.0 + 0.1 * (v - 60.0);
            let is_trunk = has_trunk && (u - middle).abs() < 4.0 && (60.0..180.0).contains(&v);
            let is_window = (115.0..127.0).contains(&u) && (110.0..130.0).contains(&v);
            let colour: [u8; 3] = match (is_crown, is_trunk, is_window) {
                (true, ..) => [40, 110, 40],
                (_, true, _) => [70, 50, 40],
                (.., true) => [30, 30, 60],
                _ if v > 140.0 => [90, 130, 60],
                _ => [170, 140, 130],
            };
            let noise = (seed_of_part(2, i as u64) % 20) as u8;
            pixels.extend(colour.map(|c| c + noise));
            mask.push(if is_crown { 255 } else { 0 });
        }
        let crown = Outline {
            size,
            mask,
            polygon_px: Vec::new(),
            matte: None,
            other_foot_px: None,
        };
        (Rgb { size, pixels }, crown)
    }

    #[test]
    fn a_trunk_is_found_below_a_crown() {
        let (picture, crown) = picture(true);
        let line = stem(&picture, &crown).expect("a trunk");
        let foot = line[0];
        assert!(
            (foot.y - 180.0).abs() < 5.0 && (foot.x - 162.0).abs() < 3.0,
            "{foot}"
        );
        for at in &line {
            let middle = 150.0 + 0.1 * (at.y - 60.0);
            assert!((at.x - middle).abs() < 3.0, "{at}");
        }
        assert!(line[line.len() - 1].y < 150.0, "{line:?}");
    }

    #[test]
    fn a_crown_without_a_trunk_has_none() {
        let (picture, crown) = picture(false);
        let line = stem(&picture, &crown);
        // What differs a little by chance is short.
        assert!(
            line.as_ref().is_none_or(|line| line[0].y < 150.0),
            "{line:?}"
        );
    }
}
