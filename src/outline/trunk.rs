//! The tree's shadow on the ground taken off, and its trunk put where it stands.

use crate::model::Size;
use crate::signal::median;

/// A row is judged with so many above and below it.
const ROWS_ABOUT: usize = 2;
/// Share of a row's pixels beyond each end of its width: single ones far off are not the tree.
const BEYOND: f64 = 0.05;
const LEAST_IN_ROW: usize = 3;
/// So many times as wide as the waist must be what lies below it. A trunk widens to its foot by
/// less.
const WIDENS: f64 = 2.0;
/// Correlation above which structure stays where it is: half of a shadow's pixels do, those of a
/// crown do not.
const STEADY: f32 = 0.6;

/// Where a trunk was found above a shadow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trunk {
    /// Row in which the tree is narrowest.
    pub waist: usize,
}

/// Looks below the crown for a waist under which what changes (`mask`, non-zero) is wide again and
/// keeps its structure (`steady`): that is the tree's shadow on the ground. It is taken off beside
/// the trunk, and the trunk, which hardly moves, is filled from the waist down to the lowest change
/// below it, as wide as the waist.
pub fn stand(size: Size, mask: &mut [u8], steady: &[f32]) -> Option<Trunk> {
    let width = size.width as usize;
    let rows: Vec<Vec<usize>> = mask
        .chunks_exact(width)
        .map(|row| {
            row.iter()
                .enumerate()
                .filter(|(_, m)| **m != 0)
                .map(|(u, _)| u)
                .collect()
        })
        .collect();
    let spans: Vec<Option<(usize, usize)>> = (0..rows.len()).map(|v| span(&rows, v)).collect();
    let crown = crown_row(width, mask, steady)?;
    let waist = waist_row(&spans, crown)?;
    let (left, right) = spans[waist]?;
    let trunk = left..=right;
    let (mut beside, mut foot) = (Vec::new(), waist);
    for (v, row) in rows.iter().enumerate().skip(waist + 1) {
        for u in row {
            if trunk.contains(u) {
                foot = v;
            } else {
                beside.push(steady[v * width + u]);
            }
        }
    }
    if median(beside, f32::total_cmp)? <= STEADY {
        return None;
    }
    for (v, row) in mask.chunks_exact_mut(width).enumerate().skip(waist + 1) {
        row.fill(0);
        if v <= foot {
            row[trunk.clone()].fill(255);
        }
    }
    Some(Trunk { waist })
}

/// The row below `crown` from which on down it widens most; `None` if it widens by less than
/// [`WIDENS`].
fn waist_row(spans: &[Option<(usize, usize)>], crown: usize) -> Option<usize> {
    let mut widest_below = 0.0f64;
    let mut waist: Option<(f64, usize)> = None;
    for v in (crown + 1..spans.len()).rev() {
        let Some((left, right)) = spans[v] else {
            continue;
        };
        let width = (right - left + 1) as f64;
        let widens = widest_below / width;
        if waist.is_none_or(|(most, _)| widens > most) {
            waist = Some((widens, v));
        }
        widest_below = widest_below.max(width);
    }
    let (widens, row) = waist?;
    (widens >= WIDENS).then_some(row)
}

/// First and last column of what changes in the rows about `v`.
fn span(rows: &[Vec<usize>], v: usize) -> Option<(usize, usize)> {
    let about = &rows[v.saturating_sub(ROWS_ABOUT)..(v + ROWS_ABOUT + 1).min(rows.len())];
    let mut columns: Vec<usize> = about.iter().flatten().copied().collect();
    if columns.len() < LEAST_IN_ROW {
        return None;
    }
    columns.sort_unstable();
    let beyond = (BEYOND * columns.len() as f64) as usize;
    Some((columns[beyond], columns[columns.len() - 1 - beyond]))
}

/// The middle row of what changes its structure, or of all that changes.
fn crown_row(width: usize, mask: &[u8], steady: &[f32]) -> Option<usize> {
    let changing: Vec<usize> = (0..mask.len()).filter(|&i| mask[i] != 0).collect();
    let swaying: Vec<usize> = changing
        .iter()
        .copied()
        .filter(|&i| steady[i] < STEADY)
        .collect();
    let judged = if swaying.is_empty() {
        changing
    } else {
        swaying
    };
    Some(judged.get(judged.len() / 2)? / width)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        width: 100,
        height: 80,
    };

    /// A round crown, a trunk, and a shadow on the ground to the right.
    fn scene(shadow_steady: f32) -> (Vec<u8>, Vec<f32>) {
        let (mut mask, mut steady) = (vec![0; SIZE.area()], vec![0.2; SIZE.area()]);
        for v in 0..80i32 {
            for u in 0..100i32 {
                let i = (v * 100 + u) as usize;
                let crown = (u - 50).pow(2) + (v - 25).pow(2) < 20 * 20;
                let trunk = (48..53).contains(&u) && (40..75).contains(&v);
                let shadow = (45..95).contains(&u) && (66..74).contains(&v);
                mask[i] = if crown || trunk || shadow { 255 } else { 0 };
                if shadow {
                    steady[i] = shadow_steady;
                }
            }
        }
        (mask, steady)
    }

    #[test]
    fn a_shadow_is_taken_off_and_the_trunk_stays() {
        let (mut mask, steady) = scene(0.9);
        let trunk = stand(SIZE, &mut mask, &steady).expect("a trunk");
        assert!((45..66).contains(&trunk.waist), "{trunk:?}");
        assert_eq!(mask[70 * 100 + 80], 0, "the shadow");
        assert_eq!(
            (mask[70 * 100 + 50], mask[25 * 100 + 35]),
            (255, 255),
            "trunk and crown"
        );
    }

    /// Low branches that sway are as wide as a shadow, but do not keep their structure.
    #[test]
    fn low_branches_are_no_shadow() {
        let (before, steady) = scene(0.3);
        let mut mask = before.clone();
        assert_eq!(stand(SIZE, &mut mask, &steady), None);
        assert!(mask == before);
    }

    #[test]
    fn a_crown_alone_and_nothing_at_all_stay_as_they_are() {
        let (mut mask, steady) = scene(0.9);
        mask[5000..].fill(0);
        let before = mask.clone();
        assert_eq!(stand(SIZE, &mut mask, &steady), None);
        assert!(mask == before);
        assert_eq!(stand(SIZE, &mut vec![0; SIZE.area()], &steady), None);
    }
}
