//! Joints and weights of a mesh as small whole numbers: a quarter of the room that numbers with a
//! point take.

use crate::geometry::Mesh;

/// The share that is the whole.
const WHOLE: u16 = u16::MAX;

/// Four numbers a vertex.
pub(super) struct Rows {
    rows: Vec<[u16; 4]>,
    /// Each fits into one byte.
    bytes: bool,
}

/// Joints of every vertex and their shares.
pub(super) struct Skinning {
    pub joints: Rows,
    /// Of 255 where one byte is exact, else of 65535; each row adds up to that.
    pub weights: Rows,
}

impl Rows {
    /// Size of a number, 1 or 2, and the bytes of all, little end first.
    pub fn le_bytes(&self) -> (usize, Vec<u8>) {
        if self.bytes {
            (1, self.rows.iter().flatten().map(|&x| x as u8).collect())
        } else {
            (
                2,
                self.rows
                    .iter()
                    .flatten()
                    .flat_map(|x| x.to_le_bytes())
                    .collect(),
            )
        }
    }
}

pub(super) fn skinning(mesh: &Mesh) -> Skinning {
    let (joints, weights): (Vec<[u16; 4]>, Vec<[u16; 4]>) = mesh
        .joints
        .iter()
        .zip(&mesh.weights)
        .map(|(j, w)| whole_shares(*j, *w))
        .unzip();
    let small = joints.iter().flatten().all(|&j| j <= u16::from(u8::MAX));
    // What rides on one branch alone has no other shares than all and none.
    let all_or_none = weights.iter().flatten().all(|&w| w == 0 || w == WHOLE);
    Skinning {
        joints: Rows {
            rows: joints,
            bytes: small,
        },
        weights: Rows {
            rows: weights,
            bytes: all_or_none,
        },
    }
}

/// Shares that add up to [`WHOLE`], each joint named once, and 0 where it has no share: what
/// validators ask for.
fn whole_shares(joints: [u16; 4], weights: [f32; 4]) -> ([u16; 4], [u16; 4]) {
    let mut merged: [(u16, f64); 4] = [(0, 0.0); 4];
    let mut used = 0;
    for (joint, weight) in joints
        .into_iter()
        .zip(weights)
        .filter(|(_, w)| *w > 0.0 && w.is_finite())
    {
        match merged[..used].iter().position(|(j, _)| *j == joint) {
            Some(k) => merged[k].1 += f64::from(weight),
            None => {
                merged[used] = (joint, f64::from(weight));
                used += 1;
            }
        }
    }
    let sum: f64 = merged.iter().map(|(_, w)| w).sum();
    if sum <= 0.0 {
        return ([joints[0], 0, 0, 0], [WHOLE, 0, 0, 0]);
    }
    let mut shares = merged.map(|(_, w)| (w / sum * f64::from(WHOLE)).round() as i64);
    // The largest takes what rounding has left over.
    let largest = (0..4).max_by_key(|&k| shares[k]).unwrap_or(0);
    shares[largest] += i64::from(WHOLE) - shares.iter().sum::<i64>();
    let shares = shares.map(|s| s.clamp(0, i64::from(WHOLE)) as u16);
    (
        std::array::from_fn(|k| if shares[k] > 0 { merged[k].0 } else { 0 }),
        shares,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up_and_joints_are_named_once() {
        let cases = [
            (
                [3, 5, 0, 0],
                [0.25, 0.75, 0.0, 0.0],
                ([3, 5, 0, 0], [16384, 49151, 0, 0]),
            ),
            (
                [3, 3, 0, 0],
                [0.5, 0.5, 0.0, 0.0],
                ([3, 0, 0, 0], [65535, 0, 0, 0]),
            ),
            // Too small a share is none, and then the joint is none either.
            (
                [3, 5, 7, 0],
                [1.0, 1e-7, 0.0, 0.0],
                ([3, 0, 0, 0], [65535, 0, 0, 0]),
            ),
            (
                [4, 5, 0, 0],
                [f32::NAN, -1.0, 0.0, 0.0],
                ([4, 0, 0, 0], [65535, 0, 0, 0]),
            ),
            (
                [1, 2, 3, 4],
                [2.0, 2.0, 2.0, 2.0],
                ([1, 2, 3, 4], [16384, 16384, 16384, 16383]),
            ),
        ];
        for (joints, weights, wanted) in cases {
            let (j, w) = whole_shares(joints, weights);
            assert_eq!(w.iter().map(|&w| u32::from(w)).sum::<u32>(), 65535);
            assert_eq!(j, wanted.0, "{weights:?}");
            assert!(
                w.iter().zip(wanted.1).all(|(a, b)| a.abs_diff(b) <= 3),
                "{w:?} and {:?}",
                wanted.1
            );
        }
    }
}
