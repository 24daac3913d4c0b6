//! Where the trunk leaves the ground.

use super::{Outline, Size};
use nalgebra::Point2;
use serde::{Deserialize, Serialize};

/// No trunk is thicker than this share of the tree's height.
const THICKEST_TRUNK: f64 = 0.12;
/// Lowest share of the outline's height in which the foot is looked for.
const FOOT_ROWS: f64 = 1.0 / 30.0;

/// Where the trunk leaves the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    pub position_px: Point2<f64>,
    /// Half the outline's width there, px: an upper bound of the trunk's radius, as outlines are
    /// drawn wide.
    pub half_width_px: f64,
    pub basis: FootBasis,
    /// Where another trunk stands that the outline holds.
    pub other_px: Option<Point2<i32>>,
}

/// A row of the trunk in an outline: its columns, the last one included, px.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrunkRow {
    pub v: u32,
    pub first: u32,
    pub last: u32,
}

/// What the place of a foot rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FootBasis {
    /// The outline ends there, as narrow as a trunk.
    Outline,
    /// The outline reaches the picture's lower edge there, as narrow as a trunk: the foot itself is
    /// not in the picture.
    CutOff,
    /// The line that the user drew along the trunk begins there.
    Drawn,
    /// The outline has no trunk: the foot is taken to be below the middle of the crown.
    Guessed,
}

impl Foot {
    /// The foot of the tree in `outline`. Its lowest rows may hold the trunk, and beside it boughs
    /// that hang as low: of the parts that are no wider than a trunk can be and go on upwards, the
    /// one that reaches lowest is the trunk. Where all are wider (a shadow on the ground that
    /// moved, a crown without a trunk, a whole picture), the foot is what lies below the middle of
    /// the crown, `crown_u` px from the left.
    pub fn of(outline: &Outline, crown_u: Option<f64>) -> Self {
        let Some(bounds) = outline.bounds_px() else {
            return Self {
                position_px: Point2::origin(),
                half_width_px: 1.0,
                basis: FootBasis::Guessed,
                other_px: outline.other_foot_px,
            };
        };
        let [left, top, right, bottom] = bounds.map(f64::from);
        let height = bottom - top + 1.0;
        let thickest_px = THICKEST_TRUNK * height;
        let parts = low_parts(outline, (bottom - FOOT_ROWS * height).ceil() as u32);
        let trunks = parts
            .iter()
            .filter(|part| part.goes_up && part.width_px() <= thickest_px);
        if let Some(trunk) = trunks.max_by_key(|part| part.lowest) {
            let is_cut_off = trunk.lowest + 1 >= outline.size.height;
            return Self {
                position_px: Point2::new(trunk.middle(), f64::from(trunk.lowest)),
                half_width_px: trunk.width_px() / 2.0,
                basis: if is_cut_off {
                    FootBasis::CutOff
                } else {
                    FootBasis::Outline
                },
                other_px: outline.other_foot_px,
            };
        }
        let first = parts.first().map_or(left, |part| f64::from(part.first));
        let last = parts.last().map_or(right, |part| f64::from(part.last));
        let u = crown_u.unwrap_or((first + last) / 2.0).clamp(first, last);
        Self {
            position_px: Point2::new(u, bottom),
            half_width_px: (last - first + 1.0).min(thickest_px) / 2.0,
            basis: FootBasis::Guessed,
            other_px: outline.other_foot_px,
        }
    }

    /// The trunk in `outline`, from the foot up to this share of the outline's height, or as far as
    /// it is no wider than a trunk can be.
    pub fn trunk_rows(&self, outline: &Outline, share: f64) -> Vec<TrunkRow> {
        let Some([_, top, _, bottom]) = outline.bounds_px() else {
            return Vec::new();
        };
        let height = f64::from(bottom - top) + 1.0;
        let lowest = self.position_px.y as u32;
        let highest = f64::from(lowest) - share * height;
        let mut below = TrunkRow {
            v: lowest,
            first: (self.position_px.x - self.half_width_px).max(0.0) as u32,
            last: (self.position_px.x + self.half_width_px) as u32,
        };
        let mut rows = Vec::new();
        for v in (highest.max(0.0) as u32..=lowest).rev() {
            let Some(row) = row_above(outline, below, v) else {
                break;
            };
            if f64::from(row.last - row.first + 1) > THICKEST_TRUNK * height {
                break;
            }
            rows.push(row);
            below = row;
        }
        rows
    }

    /// The same at the lower end of the line that the user drew along the trunk, where that is in
    /// the `picture`.
    pub fn at_drawn_trunk(self, line_px: &[Point2<f64>], picture: Size) -> Self {
        let ends = line_px.first().into_iter().chain(line_px.last());
        let ends = ends.filter(|end| picture.contains(**end));
        let Some(lower) = ends.max_by(|a, b| a.y.total_cmp(&b.y)) else {
            return self;
        };
        Self {
            position_px: *lower,
            basis: FootBasis::Drawn,
            ..self
        }
    }
}

/// The part of the row `v` of an outline that goes on from the row `below`: all that is joined to
/// the columns of that; `None` where nothing is.
fn row_above(outline: &Outline, below: TrunkRow, v: u32) -> Option<TrunkRow> {
    let width = outline.size.width;
    let has = |u: &u32| outline.has(*u, v);
    let columns = below.first..=below.last.min(width.saturating_sub(1));
    let first = columns.clone().find(has)?;
    let last = columns.rev().find(has)?;
    Some(TrunkRow {
        v,
        first: (0..=first).rev().take_while(has).last()?,
        last: (last..width).take_while(has).last()?,
    })
}

/// A part of the lowest rows of an outline, apart from others by columns without outline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct LowPart {
    first: u32,
    last: u32,
    /// Its lowest row.
    lowest: u32,
    /// Whether the outline goes on above it.
    goes_up: bool,
}

impl LowPart {
    fn width_px(&self) -> f64 {
        f64::from(self.last - self.first + 1)
    }

    fn middle(&self) -> f64 {
        f64::from(self.first + self.last) / 2.0
    }
}

/// The parts of `outline` from row `from` on down, from left to right.
fn low_parts(outline: &Outline, from: u32) -> Vec<LowPart> {
    let mut parts: Vec<LowPart> = Vec::new();
    for u in 0..outline.size.width {
        let mut in_rows = (from..outline.size.height).filter(|&v| outline.has(u, v));
        let Some(highest) = in_rows.next() else {
            continue;
        };
        let column = LowPart {
            first: u,
            last: u,
            lowest: in_rows.next_back().unwrap_or(highest),
            goes_up: highest == from,
        };
        match parts.last_mut().filter(|part| part.last + 1 == u) {
            Some(part) => {
                part.last = u;
                part.lowest = part.lowest.max(column.lowest);
                part.goes_up |= column.goes_up;
            }
            None => parts.push(column),
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        width: 100,
        height: 110,
    };

    /// An outline that holds the pixels within these boxes `[left, top, right, bottom]`.
    fn outline(boxes: &[[u32; 4]]) -> Outline {
        let mut mask = vec![0; SIZE.area()];
        for [left, top, right, bottom] in boxes {
            for v in *top..=*bottom {
                let row = (v * SIZE.width) as usize;
                mask[row + *left as usize..=row + *right as usize].fill(255);
            }
        }
        Outline {
            size: SIZE,
            mask,
            polygon_px: Vec::new(),
            matte: None,
            other_foot_px: None,
        }
    }

    const CROWN: [u32; 4] = [10, 5, 90, 60];
    const TRUNK: [u32; 4] = [28, 60, 33, 99];

    #[test]
    fn the_foot_is_where_the_outline_ends_as_narrow_as_a_trunk() {
        let foot = Foot::of(&outline(&[CROWN, TRUNK]), Some(60.0));
        assert_eq!(foot.position_px, Point2::new(30.5, 99.0));
        assert_eq!((foot.half_width_px, foot.basis), (3.0, FootBasis::Outline));
    }

    /// The middle of both would be between them, where nothing is.
    #[test]
    fn boughs_that_hang_down_beside_the_trunk_do_not_move_the_foot() {
        for bough in [[80, 60, 86, 98], [60, 60, 90, 99]] {
            let foot = Foot::of(&outline(&[CROWN, TRUNK, bough]), Some(60.0));
            assert_eq!(foot.position_px, Point2::new(30.5, 99.0), "{bough:?}");
        }
        // A speck that moved, but is joined to nothing.
        let foot = Foot::of(&outline(&[CROWN, TRUNK, [70, 100, 71, 101]]), Some(60.0));
        assert_eq!(foot.position_px, Point2::new(30.5, 99.0));
    }

    #[test]
    fn a_trunk_goes_up_as_far_as_it_is_one() {
        let leaning = [[28, 80, 33, 99], [30, 60, 35, 79]];
        let outline = outline(&[CROWN, leaning[0], leaning[1], [70, 60, 75, 98]]);
        let foot = Foot::of(&outline, None);
        let rows = foot.trunk_rows(&outline, 0.3);
        assert!(rows.iter().map(|row| row.v).eq((70..=99).rev()), "{rows:?}");
        let ends = [rows.first(), rows.last()].map(|row| row.map(|row| (row.first, row.last)));
        assert_eq!(ends, [Some((28, 33)), Some((30, 35))]);
        let rows = foot.trunk_rows(&outline, 1.0);
        assert_eq!(rows.last().map(|row| row.v), Some(61), "no crown");
    }

    #[test]
    fn a_trunk_that_leaves_the_picture_is_cut_off() {
        let foot = Foot::of(&outline(&[CROWN, [28, 60, 33, 109]]), None);
        assert_eq!(foot.position_px, Point2::new(30.5, 109.0));
        assert_eq!(foot.basis, FootBasis::CutOff);
    }

    #[test]
    fn a_crown_without_a_trunk_has_its_foot_below_its_middle() {
        let foot = Foot::of(&outline(&[CROWN]), Some(40.0));
        assert_eq!(foot.position_px, Point2::new(40.0, 60.0));
        assert_eq!(foot.basis, FootBasis::Guessed);
        assert_eq!(Foot::of(&outline(&[]), Some(40.0)).half_width_px, 1.0);
    }

    #[test]
    fn a_drawn_trunk_begins_at_its_foot_whichever_end_that_is() {
        let found = Foot::of(&outline(&[CROWN, TRUNK]), None);
        let line = [Point2::new(35.0, 97.0), Point2::new(40.0, 70.0)];
        for line in [line, [line[1], line[0]]] {
            let foot = found.at_drawn_trunk(&line, SIZE);
            assert_eq!(foot.position_px, Point2::new(35.0, 97.0));
            assert_eq!(foot.basis, FootBasis::Drawn);
        }
        let nowhere = [Point2::new(f64::NAN, 90.0), Point2::new(1e300, -5.0)];
        for line in [&[][..], &nowhere] {
            assert_eq!(found.at_drawn_trunk(line, SIZE), found);
        }
    }
}
