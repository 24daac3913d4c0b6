//! A second trunk in an outline that was found by motion: a leg of it beside the lowest one that moves least
//! at its lower end. Boughs that hang down move most there.
//!
//! How far something moves is seen by how much brightness changes for the gradient that it has (the constraint
//! of optical flow, Lucas and Kanade 1981): changes alone are small before a ground of the same colour.

use crate::model::Luma;
use nalgebra::Point2;

/// How far a leg reaches below what parts it from a lower one (its topographic prominence), as a share of the
/// outline's height.
const LEAST_PROMINENCE: f64 = 0.1;
/// The lowest third of a trunk moves by less than this share of its uppermost third: trunks of made films have
/// .38 to .82, boughs .91 and more.
const STILL_SHARE: f32 = 0.85;

/// A column in which the outline reaches lower than beside it.
#[derive(Clone, Copy, Debug)]
struct Leg {
    u: usize,
    /// Its lowest row.
    lowest: usize,
    /// The lowest row of the highest place between it and a lower leg.
    parts_at: usize,
}

/// The lower end, px, of the most prominent trunk but the lowest one in a `mask` (not 0 inside) of a film with
/// this `picture`, the brightness of whose pixels changes so over time (`deviation`, standard deviations);
/// `None` where there is one trunk.
pub fn second_foot(picture: &Luma, mask: &[u8], deviation: &[f32]) -> Option<Point2<i32>> {
    let width = picture.size.width as usize;
    let lowest = lowest_rows(width, mask);
    let reached: Vec<usize> = lowest.iter().flatten().copied().collect();
    let bottom = reached.iter().max()?;
    let top = mask.iter().position(|m| *m != 0)? / width;
    let least = (LEAST_PROMINENCE * (bottom - top + 1) as f64).ceil() as usize;
    let mut legs = legs(&lowest);
    legs.retain(|leg| {
        leg.lowest - leg.parts_at >= least
            && stands_still(&rows_down(leg, picture, mask, deviation))
    });
    let leg = legs.iter().max_by_key(|leg| leg.lowest - leg.parts_at)?;
    Some(Point2::new(leg.u as i32, leg.lowest as i32))
}

/// The lowest row of every column that is inside.
fn lowest_rows(width: usize, mask: &[u8]) -> Vec<Option<usize>> {
    let mut lowest = vec![None; width];
    for (v, row) in mask.chunks_exact(width).enumerate() {
        for (column, pixel) in lowest.iter_mut().zip(row) {
            if *pixel != 0 {
                *column = Some(v);
            }
        }
    }
    lowest
}

/// All legs but the lowest.
fn legs(lowest: &[Option<usize>]) -> Vec<Leg> {
    let mut legs = Vec::new();
    for (u, row) in lowest.iter().enumerate() {
        let Some(row) = *row else { continue };
        // Of legs that reach equally low the one farthest to the left counts as the lowest.
        let left = parting(lowest[..u].iter().rev(), |other| other >= row);
        let right = parting(lowest[u + 1..].iter(), |other| other > row);
        if let Some(parts_at) = left.into_iter().chain(right).max()
            && parts_at < row
        {
            legs.push(Leg {
                u,
                lowest: row,
                parts_at,
            });
        }
    }
    legs
}

/// The highest place on the way to the next column that reaches lower; `None` where none does, or where the
/// outline ends before.
fn parting<'a>(
    way: impl Iterator<Item = &'a Option<usize>>,
    is_lower: impl Fn(usize) -> bool,
) -> Option<usize> {
    let mut highest = usize::MAX;
    for row in way {
        let row = (*row)?;
        if is_lower(row) {
            return Some(highest);
        }
        highest = highest.min(row);
    }
    None
}

/// A row of a leg: sums of the squares of what its pixels change by over time, and of their gradient.
#[derive(Clone, Copy, Debug)]
struct LegRow {
    change_sq: f32,
    gradient_sq: f32,
}

/// The rows of a leg, from where it parts down.
fn rows_down(leg: &Leg, picture: &Luma, mask: &[u8], deviation: &[f32]) -> Vec<LegRow> {
    let width = picture.size.width as usize;
    let mut rows = Vec::new();
    for v in leg.parts_at + 1..=leg.lowest {
        let row = v * width;
        let is_outside = |u: &usize| mask[row + u] == 0;
        if is_outside(&leg.u) {
            continue;
        }
        let first = (0..leg.u).rev().find(is_outside).map_or(0, |u| u + 1);
        let end = (leg.u..width).find(is_outside).unwrap_or(width);
        rows.push(LegRow {
            change_sq: (first..end).map(|u| deviation[row + u].powi(2)).sum(),
            gradient_sq: (first..end).map(|u| gradient_sq(picture, u, v)).sum(),
        });
    }
    rows
}

/// The square of the gradient of brightness at a pixel, by central differences; at the border of the picture
/// of those that are in it.
fn gradient_sq(picture: &Luma, u: usize, v: usize) -> f32 {
    let [width, height] = [picture.size.width, picture.size.height].map(|side| side as usize);
    let at = |u: usize, v: usize| f32::from(picture.pixels[v * width + u]);
    let across = at((u + 1).min(width - 1), v) - at(u.saturating_sub(1), v);
    let down = at(u, (v + 1).min(height - 1)) - at(u, v.saturating_sub(1));
    (across.powi(2) + down.powi(2)) / 4.0
}

/// Whether a leg of these rows moves least at its lower end.
fn stands_still(rows: &[LegRow]) -> bool {
    let third = rows.len().div_ceil(3);
    let upper_px = displacement_px(&rows[..third]);
    let lower_px = displacement_px(&rows[rows.len() - third..]);
    matches!((upper_px, lower_px), (Some(upper), Some(lower)) if lower <= STILL_SHARE * upper)
}

/// How far these rows move, px (standard deviation); `None` where nothing is to be seen in them.
fn displacement_px(rows: &[LegRow]) -> Option<f32> {
    let change_sq: f32 = rows.iter().map(|row| row.change_sq).sum();
    let gradient_sq: f32 = rows.iter().map(|row| row.gradient_sq).sum();
    (gradient_sq > 0.0).then(|| (change_sq / gradient_sq).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;

    const SIZE: Size = Size {
        width: 60,
        height: 50,
    };

    /// A film: its first picture, what moves, and how brightness changes.
    struct Scene {
        picture: Luma,
        mask: Vec<u8>,
        deviation: Vec<f32>,
    }

    impl Scene {
        fn second_foot(&self) -> Option<Point2<i32>> {
            second_foot(&self.picture, &self.mask, &self.deviation)
        }
    }

    /// A crown with a trunk from row 20 down to 45 and something beside it that ends at row 38, which moves by
    /// `upper` px at its upper end and by `lower` at its lower end, and is as dark there as the ground.
    fn scene(upper: f32, lower: f32) -> Scene {
        let mut mask = vec![0; SIZE.area()];
        let mut deviation = vec![20.0; SIZE.area()];
        let mut pixels = vec![0; SIZE.area()];
        for v in 0..50 {
            for u in 0..60 {
                let crown = (3..20).contains(&v) && (5..55).contains(&u);
                let trunk = (20..=45).contains(&v) && (18..22).contains(&u);
                let beside = (20..=38).contains(&v) && (40..43).contains(&u);
                let i = v * 60 + u;
                mask[i] = if crown || trunk || beside { 255 } else { 0 };
                let contrast = 4.0 - 3.0 * v as f32 / 50.0;
                pixels[i] = (128.0 + 10.0 * contrast * (-1.0_f32).powi((u / 2) as i32)) as u8;
                if beside {
                    let moves_px = upper + (lower - upper) * (v as f32 - 20.0) / 18.0;
                    deviation[i] = 10.0 * contrast * moves_px;
                }
            }
        }
        Scene {
            picture: Luma { size: SIZE, pixels },
            mask,
            deviation,
        }
    }

    #[test]
    fn a_leg_that_stands_still_at_its_lower_end_is_a_second_trunk() {
        let foot = scene(1.5, 0.2).second_foot().expect("a second trunk");
        assert!((40..43).contains(&foot.x) && foot.y == 38, "{foot}");
    }

    #[test]
    fn a_bough_that_hangs_down_is_none() {
        assert_eq!(scene(0.8, 1.2).second_foot(), None);
    }

    #[test]
    fn one_trunk_a_crown_alone_and_nothing_have_no_second_foot() {
        let mut scene = scene(1.5, 0.2);
        for row in scene.mask.chunks_exact_mut(60) {
            row[30..].fill(0);
        }
        assert_eq!(scene.second_foot(), None);
        scene.mask[20 * 60..].fill(0);
        assert_eq!(scene.second_foot(), None);
        scene.mask.fill(0);
        assert_eq!(scene.second_foot(), None);
    }

    /// Two trunks that reach equally low are two.
    #[test]
    fn one_of_two_that_reach_as_low_is_the_second() {
        let mut scene = scene(1.5, 0.2);
        for v in 39..=45 {
            let row = v * 60 + 40..v * 60 + 43;
            scene.mask[row.clone()].fill(255);
            scene.deviation[row].fill(1.0);
        }
        let foot = scene.second_foot().expect("a second trunk");
        assert_eq!(foot.y, 45);
    }
}
