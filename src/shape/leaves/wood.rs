//! What wood stands before the leaves, seen from the front.

use super::canvas::Grid;
use super::carry::Carried;
use crate::model::{Pose, Skeleton};
use crate::shape::Limb;

/// Wider wood than this is no tree's, cells.
const WIDEST: f64 = 200.0;

/// Depth of the foremost wood in every cell (model axes in that pose, px); minus infinity where
/// there is none. A limb is drawn as balls along it, half a cell apart.
pub(super) fn front(
    limbs: &[Limb],
    skeleton: &Skeleton,
    pose: Option<&Pose>,
    grid: &Grid,
) -> Vec<f32> {
    let mut depth = vec![f32::NEG_INFINITY; grid.area()];
    let cell_px = 1.0 / grid.length(1.0).max(1e-9);
    for limb in limbs {
        let posed = limb.stations.iter().map(|s| {
            let p = Carried::by(&s.riding, skeleton, pose).posed(&s.at);
            (grid.cell_of(&p), p.z, s.radius.max(0.0))
        });
        let posed: Vec<([f64; 2], f64, f64)> = posed.collect();
        for pair in posed.windows(2) {
            let ((a, az, ar), (b, bz, br)) = (pair[0], pair[1]);
            let way = (b[0] - a[0]).hypot(b[1] - a[1]);
            let sound = way.is_finite() && [az, bz, ar, br].iter().all(|x| x.is_finite());
            // A limb as long as the picture is wide is drawn; one that a torn file makes longer is
            // not.
            if !sound || way > f64::from(grid.size.width.max(grid.size.height)) {
                continue;
            }
            let steps = (2.0 * way).ceil().max(1.0) as usize;
            for k in 0..=steps {
                let t = k as f64 / steps as f64;
                let at = [0, 1].map(|c| a[c] + (b[c] - a[c]) * t);
                ball(
                    &mut depth,
                    grid,
                    at,
                    az + (bz - az) * t,
                    ar + (br - ar) * t,
                    cell_px,
                );
            }
        }
    }
    depth
}

fn ball(depth: &mut [f32], grid: &Grid, at: [f64; 2], z: f64, radius_px: f64, cell_px: f64) {
    let radius = (radius_px / cell_px).clamp(0.5, WIDEST);
    let reach = |k: usize, most: u32| {
        let (low, high) = (
            (at[k] - radius).ceil().max(0.0),
            (at[k] + radius).floor().min(f64::from(most) - 1.0),
        );
        (low <= high).then_some(low as usize..=high as usize)
    };
    let (Some(across), Some(down)) = (reach(0, grid.size.width), reach(1, grid.size.height)) else {
        return;
    };
    for v in down {
        for u in across.clone() {
            let off =
                1.0 - ((u as f64 - at[0]).powi(2) + (v as f64 - at[1]).powi(2)) / (radius * radius);
            if off >= 0.0 {
                let cell = &mut depth[v * grid.size.width as usize + u];
                *cell = cell.max((z + off.sqrt() * radius_px) as f32);
            }
        }
    }
}
