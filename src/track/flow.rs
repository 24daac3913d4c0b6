//! Sparse optical flow: pyramidal Lucas-Kanade on pyramids that are built once a frame (OpenCV).

use crate::model::Luma;
use nalgebra::Point2;
use opencv::core::{
    Mat, Point2f, Size as CvSize, TermCriteria, TermCriteria_Type, Vector, no_array,
};
use opencv::video::{
    OPTFLOW_USE_INITIAL_FLOW, build_optical_flow_pyramid, calc_optical_flow_pyr_lk,
};

/// Smallest eigenvalue of the structure tensor, per window pixel, below which a window has too
/// little texture.
const MIN_EIGENVALUE: f64 = 1e-4;

/// A picture at falling sizes, each with the border that Lucas-Kanade reads beyond its edge.
///
/// Derivatives are left out: computing them again costs less than the memory traffic of keeping
/// them.
#[derive(Default)]
pub struct Pyramid(Vector<Mat>);

impl Pyramid {
    /// Rebuilds the pyramid in place from `luma` with `levels` halvings.
    pub fn rebuild(&mut self, luma: &Luma, window_px: u32, levels: u32) {
        let (rows, cols) = (luma.size.height as i32, luma.size.width as i32);
        let built = Mat::new_rows_cols_with_data(rows, cols, &luma.pixels).and_then(|mat| {
            // Without derivatives OpenCV would take the input itself as level 0, but level 0 must
            // outlive this frame: hence `try_reuse_input_image = false`.
            let border = opencv::core::BORDER_REFLECT_101;
            let constant = opencv::core::BORDER_CONSTANT;
            let window = square(window_px);
            build_optical_flow_pyramid(
                &mat,
                &mut self.0,
                window,
                levels as i32,
                false,
                border,
                constant,
                false,
            )
        });
        if let Err(e) = built {
            tracing::error!("optical flow pyramid of a {} picture: {e}", luma.size);
            self.0.clear();
        }
    }
}

/// Where a point went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flow {
    pub to: Point2<f32>,
    /// The window had texture, the search converged and stayed in the picture.
    pub found: bool,
}

/// Lucas-Kanade with its buffers.
pub struct OpticalFlow {
    window_px: u32,
    from: Vector<Point2f>,
    to: Vector<Point2f>,
    status: Vector<u8>,
}

impl OpticalFlow {
    /// `window_px` is the side of the window, odd.
    pub fn new(window_px: u32) -> Self {
        Self {
            window_px,
            from: Vector::new(),
            to: Vector::new(),
            status: Vector::new(),
        }
    }

    /// Follows `points` (px) from picture `a` to picture `b`, coarse to fine from pyramid level
    /// `levels` down; the search starts where the point was.
    pub fn track(
        &mut self,
        a: &Pyramid,
        b: &Pyramid,
        points: &[Point2<f32>],
        levels: u32,
        out: &mut Vec<Flow>,
    ) {
        out.clear();
        if points.is_empty() || a.0.is_empty() || b.0.is_empty() {
            out.extend(points.iter().map(lost));
            return;
        }
        fill(&mut self.from, points);
        fill(&mut self.to, points);
        let epsilon = TermCriteria_Type::COUNT as i32 | TermCriteria_Type::EPS as i32;
        let done = TermCriteria::new(epsilon, 30, 0.01).and_then(|criteria| {
            calc_optical_flow_pyr_lk(
                &a.0,
                &b.0,
                &self.from,
                &mut self.to,
                &mut self.status,
                // How unlike the windows are is not asked for.
                &mut no_array(),
                square(self.window_px),
                levels as i32,
                criteria,
                OPTFLOW_USE_INITIAL_FLOW,
                MIN_EIGENVALUE,
            )
        });
        if let Err(e) = done {
            tracing::error!("optical flow of {} points: {e}", points.len());
            out.extend(points.iter().map(lost));
            return;
        }
        let found = self.status.iter().map(|s| s != 0);
        out.extend(self.to.iter().zip(found).map(|(p, found)| Flow {
            to: Point2::new(p.x, p.y),
            found,
        }));
    }
}

/// A point that was not found stays where it was.
fn lost(point: &Point2<f32>) -> Flow {
    Flow {
        to: *point,
        found: false,
    }
}

fn square(side_px: u32) -> CvSize {
    CvSize::new(side_px as i32, side_px as i32)
}

fn fill(vector: &mut Vector<Point2f>, points: &[Point2<f32>]) {
    vector.clear();
    vector.reserve(points.len());
    for p in points {
        vector.push(Point2f::new(p.x, p.y));
    }
}
