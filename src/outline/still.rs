//! Pictures with the camera's motion taken off.

use crate::model::{CameraMotion, Luma};
use opencv::core::{BORDER_REPLICATE, Mat, Scalar, Size as CvSize};
use opencv::imgproc::{INTER_CUBIC, WARP_INVERSE_MAP, warp_affine};
use opencv::prelude::*;

/// The picture with what stands still in its steady place; its edge goes on where the camera has
/// moved it away.
pub fn without_motion(luma: &Luma, camera: &CameraMotion) -> opencv::Result<Luma> {
    let (rows, cols) = (luma.size.height as i32, luma.size.width as i32);
    let picture = Mat::new_rows_cols_with_data(rows, cols, &luma.pixels)?;
    let affine = camera.affine_rows();
    let affine = Mat::new_rows_cols_with_data(2, 3, &affine)?;
    let mut steady = Mat::default();
    warp_affine(
        &picture,
        &mut steady,
        &affine,
        CvSize::new(cols, rows),
        INTER_CUBIC | WARP_INVERSE_MAP,
        BORDER_REPLICATE,
        Scalar::default(),
    )?;
    Ok(Luma {
        size: luma.size,
        pixels: steady.data_bytes()?.to_vec(),
    })
}
