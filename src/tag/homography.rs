//! Plane to picture: the homography of four points.

use nalgebra::{Matrix2, Matrix3, Point2, SMatrix, SVector, Vector3};

/// The corners of the unit square around the origin, upper left first, clockwise in the picture.
pub const SQUARE: [Point2<f64>; 4] = [
    Point2::new(-0.5, -0.5),
    Point2::new(0.5, -0.5),
    Point2::new(0.5, 0.5),
    Point2::new(-0.5, 0.5),
];

/// Takes points of a plane to points of the picture, px.
#[derive(Clone, Copy, Debug)]
pub struct Homography(Matrix3<f64>);

impl Homography {
    /// The one that takes [`SQUARE`] to these corners; `None` where three of them are on a line.
    pub fn of_square(corners_px: &[Point2<f64>; 4]) -> Option<Self> {
        let mut a = SMatrix::<f64, 8, 8>::zeros();
        let mut b = SVector::<f64, 8>::zeros();
        for (k, (from, to)) in SQUARE.iter().zip(corners_px).enumerate() {
            let rows = [
                [
                    from.x,
                    from.y,
                    1.0,
                    0.0,
                    0.0,
                    0.0,
                    -to.x * from.x,
                    -to.x * from.y,
                ],
                [
                    0.0,
                    0.0,
                    0.0,
                    from.x,
                    from.y,
                    1.0,
                    -to.y * from.x,
                    -to.y * from.y,
                ],
            ];
            for (i, row) in rows.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    a[(2 * k + i, j)] = *value;
                }
                b[2 * k + i] = to[i];
            }
        }
        let h = a.lu().solve(&b)?;
        let matrix = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0);
        matrix.iter().all(|x| x.is_finite()).then_some(Self(matrix))
    }

    /// Where a point of the plane is in the picture, px.
    pub fn apply(&self, at: Point2<f64>) -> Point2<f64> {
        let to = self.0 * Vector3::new(at.x, at.y, 1.0);
        Point2::new(to.x / to.z, to.y / to.z)
    }

    /// How the picture changes with the plane at the origin, px for one unit.
    pub fn jacobian(&self) -> Matrix2<f64> {
        let m = &self.0;
        let at = self.apply(Point2::origin());
        Matrix2::new(
            m[(0, 0)] - at.x * m[(2, 0)],
            m[(0, 1)] - at.x * m[(2, 1)],
            m[(1, 0)] - at.y * m[(2, 0)],
            m[(1, 1)] - at.y * m[(2, 1)],
        )
    }
}
