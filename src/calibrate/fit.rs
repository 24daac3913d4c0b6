//! The lens and the place of the board in every view, fitted together to all corners (Zhang 2000 sect. 3.3).

use super::board::{Board, BoardView};
use super::homographies::{camera_matrix, homography};
use crate::bounds::Bounds;
use crate::model::{Distortion, Lens, Size};
use crate::signal::least_squares::{
    LeastSquares, NormalEquations, ParameterLimits, Stopping, levenberg_marquardt,
};
use crate::signal::median;
use nalgebra::{Matrix3, Point2, Point3, Rotation3, Vector2, Vector3};

/// Parameters of the lens: focal lengths, middle, k1, k2, p1, p2; and of each view: turn and shift.
const OF_LENS: usize = 8;
const OF_VIEW: usize = 6;
/// Focal length by the width of the picture where homographies do not give it: as of a lens of 50
/// degrees.
const FOCAL_SHARE: f64 = 1.1;
/// A parameter is moved by so much of its own size to see what corners owe to it.
const NUDGE: f64 = 1e-6;
/// What lies nearer to the camera than that, in squares, is behind it.
const NEAREST: f64 = 1e-3;
/// A corner that has no place in the picture is so far off, px.
const NOWHERE_PX: f64 = 1e4;
const STOPPING: Stopping = Stopping {
    max_steps: 100,
    min_gain: 1e-12,
    min_relative_gain: 1e-10,
};

/// A lens fitted to views of a board.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    problem: Problem,
    x: Vec<f64>,
}

impl Fit {
    /// The best; `None` where a view is no picture of a plane.
    pub fn of(board: Board, views: &[BoardView], size: Size) -> Option<Self> {
        let places = board.places();
        let mut homographies = Vec::with_capacity(views.len());
        for view in views {
            homographies.push(homography(&places, &view.corners_px)?);
        }
        let camera = start_camera(&homographies, size);
        let mut x = vec![0.0; OF_LENS];
        x[0] = camera[(0, 0)];
        x[1] = camera[(1, 1)];
        x[2] = camera[(0, 2)];
        x[3] = camera[(1, 2)];
        for h in &homographies {
            let placed = Placed::of(h, &camera)?;
            x.extend(placed.turn.scaled_axis().iter());
            x.extend(placed.shift.iter());
        }
        let problem = Problem {
            size,
            places,
            views: views.to_vec(),
        };
        let limits = limits(&x, size);
        let x = levenberg_marquardt(&problem, x, &limits, &STOPPING);
        Some(Self { problem, x })
    }

    pub fn lens(&self) -> Lens {
        self.problem.lens(&self.x)
    }

    /// Root of the mean square by which corners are off, px.
    pub fn rms_px(&self) -> f64 {
        let corners = self.problem.places.len() * self.problem.views.len();
        (self.problem.cost(&self.x) / corners as f64).sqrt()
    }

    /// Standard deviations of the parameters of the lens; `None` where some are open.
    pub fn deviations(&self) -> Option<[f64; OF_LENS]> {
        let measured = 2 * self.problem.places.len() * self.problem.views.len();
        let free = measured.checked_sub(self.x.len()).filter(|n| *n > 0)?;
        let noise = (self.problem.cost(&self.x) / free as f64).sqrt();
        let all = self.problem.normal_equations(&self.x).deviations()?;
        let own = std::array::from_fn(|k| noise * all[k]);
        own.iter().all(|sd: &f64| sd.is_finite()).then_some(own)
    }

    /// The views that are off by no more than this many times the median of all.
    pub fn sharp_views(&self, times: f64) -> Vec<BoardView> {
        let lens = self.lens();
        let offs: Vec<f64> = (0..self.problem.views.len())
            .map(|k| self.problem.cost_of_view(&lens, &self.x, k).sqrt())
            .collect();
        let most = times * median(offs.clone(), f64::total_cmp).unwrap_or(0.0);
        let views = self.problem.views.iter().zip(&offs);
        views
            .filter(|(_, off)| **off <= most)
            .map(|(view, _)| view.clone())
            .collect()
    }
}

/// The camera that homographies give, if it is plausible; else one of the usual width.
fn start_camera(homographies: &[Matrix3<f64>], size: Size) -> Matrix3<f64> {
    let [width, height] = [size.width, size.height].map(f64::from);
    // Counted from the middle, in widths: the numbers of the equations are then alike in size.
    let to_unit = Matrix3::new(
        1.0 / width,
        0.0,
        -0.5 * (width - 1.0) / width,
        0.0,
        1.0 / width,
        -0.5 * (height - 1.0) / width,
        0.0,
        0.0,
        1.0,
    );
    let unit: Vec<Matrix3<f64>> = homographies.iter().map(|h| to_unit * h).collect();
    let usual = Matrix3::from_diagonal(&Vector3::new(FOCAL_SHARE, FOCAL_SHARE, 1.0));
    let camera = camera_matrix(&unit).filter(is_plausible).unwrap_or(usual);
    let from_unit = to_unit.try_inverse().unwrap_or_else(Matrix3::identity);
    from_unit * camera
}

/// Whether a camera that counts from the middle, in widths, is that of a usual lens.
fn is_plausible(camera: &Matrix3<f64>) -> bool {
    (0.2..20.0).contains(&camera[(0, 0)])
        && (0.5..2.0).contains(&(camera[(1, 1)] / camera[(0, 0)]))
        && camera[(0, 2)].abs() < 0.5
        && camera[(1, 2)].abs() < 0.5
}

/// A parameter without bounds, and how far it goes in one step.
fn free(max_step: f64) -> ParameterLimits {
    ParameterLimits {
        bounds: Bounds::new(f64::NEG_INFINITY, f64::INFINITY),
        max_step,
    }
}

/// How far each parameter may go.
fn limits(x: &[f64], size: Size) -> Vec<ParameterLimits> {
    let width = f64::from(size.width);
    let focal = ParameterLimits {
        bounds: Bounds::new(0.05 * width, 100.0 * width),
        max_step: 0.3 * width,
    };
    let mut limits = vec![focal, focal, free(0.1 * width), free(0.1 * width)];
    limits.extend([free(0.5), free(0.5), free(0.05), free(0.05)]);
    for view in x[OF_LENS..].chunks(OF_VIEW) {
        let far = 0.3 * view[5].abs().max(1.0);
        limits.extend([
            free(0.3),
            free(0.3),
            free(0.3),
            free(far),
            free(far),
            free(far),
        ]);
    }
    limits
}

/// Where the board is against the camera, in squares.
struct Placed {
    turn: Rotation3<f64>,
    shift: Vector3<f64>,
}

impl Placed {
    /// By its homography (Zhang 2000 sect. 3.1).
    fn of(homography: &Matrix3<f64>, camera: &Matrix3<f64>) -> Option<Self> {
        let own = camera.try_inverse()? * homography;
        let mut scale = 2.0 / (own.column(0).norm() + own.column(1).norm());
        if own[(2, 2)] < 0.0 {
            scale = -scale;
        }
        let [first, second, shift] = [0, 1, 2].map(|k| scale * own.column(k));
        let third = first.cross(&second);
        let svd = Matrix3::from_columns(&[first, second, third]).svd(true, true);
        let turn = svd.u? * svd.v_t?;
        Some(Self {
            turn: Rotation3::from_matrix(&turn),
            shift,
        })
    }

    fn of_parameters(own: &[f64]) -> Self {
        Self {
            turn: Rotation3::new(Vector3::new(own[0], own[1], own[2])),
            shift: Vector3::new(own[3], own[4], own[5]),
        }
    }

    /// Where the lens shows a place of the board, px.
    fn seen(&self, lens: &Lens, place: &Point2<f64>) -> Option<Point2<f64>> {
        let at = self.turn * Point3::new(place.x, place.y, 0.0) + self.shift;
        let straight = Vector2::new(at.x, at.y) / at.z;
        (at.z > NEAREST)
            .then(|| lens.distorted(lens.middle_px + straight.component_mul(&lens.focal_px)))
    }
}

/// All corners that were seen.
#[derive(Clone, Debug)]
struct Problem {
    size: Size,
    places: Vec<Point2<f64>>,
    views: Vec<BoardView>,
}

impl Problem {
    fn lens(&self, x: &[f64]) -> Lens {
        Lens {
            size: self.size,
            focal_px: Vector2::new(x[0], x[1]),
            middle_px: Point2::new(x[2], x[3]),
            distortion: Distortion::RadialTangential([x[4], x[5], x[6], x[7], 0.0]),
            readout_s: 0.0,
        }
    }

    /// From where corners should be to where they were seen in a view, px.
    fn misses(&self, lens: &Lens, own: &[f64], view: usize) -> Vec<Vector2<f64>> {
        let placed = Placed::of_parameters(own);
        let corners = self.places.iter().zip(&self.views[view].corners_px);
        corners
            .map(|(place, seen)| match placed.seen(lens, place) {
                Some(at) => seen - at,
                None => Vector2::repeat(NOWHERE_PX),
            })
            .collect()
    }

    fn cost_of_view(&self, lens: &Lens, x: &[f64], view: usize) -> f64 {
        let misses = self.misses(lens, of_view(x, view), view);
        misses.iter().map(|m| m.norm_squared()).sum()
    }
}

/// The parameters of one view.
fn of_view(x: &[f64], view: usize) -> &[f64] {
    &x[OF_LENS + OF_VIEW * view..OF_LENS + OF_VIEW * (view + 1)]
}

impl LeastSquares for Problem {
    fn cost(&self, x: &[f64]) -> f64 {
        let lens = self.lens(x);
        let views = 0..self.views.len();
        views.map(|view| self.cost_of_view(&lens, x, view)).sum()
    }

    fn normal_equations(&self, x: &[f64]) -> NormalEquations {
        let mut normal = NormalEquations::zeros(x.len());
        for view in 0..self.views.len() {
            let misses = self.misses(&self.lens(x), of_view(x, view), view);
            let first = OF_LENS + OF_VIEW * view;
            let owners: Vec<usize> = (0..OF_LENS).chain(first..first + OF_VIEW).collect();
            let mut slopes = Vec::with_capacity(owners.len());
            for parameter in &owners {
                let step = NUDGE * x[*parameter].abs().max(1.0);
                let mut moved = x.to_vec();
                moved[*parameter] += step;
                let after = self.misses(&self.lens(&moved), of_view(&moved, view), view);
                let changes = misses.iter().zip(&after).map(|(a, b)| (a - b) / step);
                slopes.push(changes.collect::<Vec<Vector2<f64>>>());
            }
            for (a, of_a) in owners.iter().zip(&slopes) {
                for (b, of_b) in owners.iter().zip(&slopes) {
                    let products = of_a.iter().zip(of_b).map(|(a, b)| a.dot(b));
                    normal.hessian[(*a, *b)] += products.sum::<f64>();
                }
                let products = of_a.iter().zip(&misses).map(|(a, miss)| a.dot(miss));
                normal.gradient[*a] += products.sum::<f64>();
            }
        }
        normal
    }
}
