//! How finely the coordinates of a cloud are written. Programs that write those of a survey, of millions, as numbers of
//! four bytes leave steps of up to half a metre.

use nalgebra::Point3;

/// So many points are looked at, evenly.
const LOOKED_AT: usize = 20_000;
/// An axis has steps if so many points share a coordinate.
const SHARED: usize = 4;

/// The step of the coarsest axis, in the unit of the points; 0 where no axis has steps.
pub(super) fn coarsest(points: &[Point3<f32>]) -> f32 {
    let axes = [0, 1, 2].map(|axis| step(points, axis));
    axes.into_iter().fold(0.0, f32::max)
}

fn step(points: &[Point3<f32>], axis: usize) -> f32 {
    let every = points.len().div_ceil(LOOKED_AT).max(1);
    let mut values: Vec<f32> = points.iter().step_by(every).map(|at| at[axis]).collect();
    let looked_at = values.len();
    values.sort_unstable_by(f32::total_cmp);
    values.dedup();
    if SHARED * values.len() > looked_at {
        return 0.0;
    }
    let gaps = values.windows(2).map(|pair| pair[1] - pair[0]);
    let least = gaps.fold(f32::INFINITY, f32::min);
    if least.is_finite() { least } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_of_a_survey_in_four_bytes_have_steps() {
        let mut fine = Vec::new();
        let mut coarse = Vec::new();
        for i in 0..30_000_u32 {
            let part = |factor: f64| f64::from(i) * factor % 1.0;
            let at = Point3::new(
                5.0 * part(0.618_033_988),
                5.0 * part(0.414_213_562),
                7.0 * part(0.732_050_807),
            );
            fine.push(at.cast::<f32>());
            let north = (4_100_000.0 + at.y) as f32;
            coarse.push(Point3::new(at.x as f32, north - 4_100_000.0, at.z as f32));
        }
        assert_eq!(coarsest(&fine), 0.0);
        assert_eq!(coarsest(&coarse), 0.25);
        assert_eq!(coarsest(&[Point3::origin(); 9]), 0.0);
    }
}
