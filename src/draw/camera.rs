//! Where the tree is seen from: orthographic, as the film is taken to be.

use crate::model::{Size, Skeleton};
use nalgebra::{Point2, Point3, Vector3};

/// A direction to look from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// How far the viewer has walked round the tree, counter-clockwise seen from above, radians: 0
    /// is where the film was taken from, a quarter turn its right.
    pub turn: f64,
    /// How far the viewer looks down, radians: 0 level, a quarter turn from above.
    pub down: f64,
}

impl View {
    pub const FRONT: View = View {
        turn: 0.0,
        down: 0.0,
    };
    pub const SIDE: View = View {
        turn: std::f64::consts::FRAC_PI_2,
        down: 0.0,
    };
    pub const TOP: View = View {
        turn: 0.0,
        down: std::f64::consts::FRAC_PI_2,
    };

    /// Unit vectors in model axes: to the right and up in the picture, and towards the viewer.
    pub fn axes(self) -> [Vector3<f64>; 3] {
        let ((turn_sin, turn_cos), (down_sin, down_cos)) =
            (self.turn.sin_cos(), self.down.sin_cos());
        let right = Vector3::new(turn_cos, 0.0, -turn_sin);
        let towards = Vector3::new(turn_sin * down_cos, down_sin, turn_cos * down_cos);
        [right, towards.cross(&right), towards]
    }
}

/// The upright cylinder about the trunk's foot that holds a tree: it has one size from all sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingCylinder {
    pub low: Point3<f64>,
    pub high: Point3<f64>,
    /// Farthest from the upright line through the foot.
    pub radius: f64,
}

impl BoundingCylinder {
    /// Of points in model axes; those that are no numbers are left out. `None` if none is left.
    pub fn of(points: impl IntoIterator<Item = Point3<f64>>) -> Option<Self> {
        points
            .into_iter()
            .filter(|p| p.coords.iter().all(|c| c.is_finite() && c.abs() < 1e12))
            .fold(None, |all, p| {
                let one = Self {
                    low: p,
                    high: p,
                    radius: p.x.hypot(p.z),
                };
                Some(all.map_or(one, |all: Self| all.with(&one)))
            })
    }

    /// What holds both.
    pub fn with(&self, other: &Self) -> Self {
        let (low, high) = (self.low.inf(&other.low), self.high.sup(&other.high));
        Self {
            low,
            high,
            radius: self.radius.max(other.radius),
        }
    }

    fn corners(&self) -> impl Iterator<Item = Point3<f64>> {
        let ends = [self.low, self.high];
        (0..8).map(move |i: usize| {
            let [x, y, z] = [ends[i & 1], ends[i >> 1 & 1], ends[i >> 2 & 1]];
            Point3::new(x.x, y.y, z.z)
        })
    }
}

/// An orthographic camera: a view, what lies in the middle of its picture, and how large.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    pub view: View,
    /// The point of the model that is shown at `middle_px`.
    pub aim: Point3<f64>,
    /// Rgba pixels, the top left corner of the picture being (0, 0).
    pub middle_px: Point2<f64>,
    /// Rgba pixels for one unit of the model.
    pub scale: f64,
    pub size: Size,
}

/// Share of the picture that is left free around the tree.
const MARGIN: f64 = 0.05;

impl Camera {
    /// Shows all of `bounds`, as large as it fits. With `steady` the tree keeps size and place when
    /// it turns.
    pub fn fitting(bounds: &BoundingCylinder, view: View, steady: bool, size: Size) -> Self {
        let [right, up, _] = view.axes();
        let mut aim = nalgebra::center(&bounds.low, &bounds.high);
        let [mut across, mut high] = [right, up].map(|axis| {
            let along = bounds.corners().map(|c| (c - aim).dot(&axis));
            2.0 * along.fold(0.0, f64::max)
        });
        if steady {
            (aim.x, aim.z) = (0.0, 0.0);
            across = 2.0 * bounds.radius;
            high = (bounds.high.y - bounds.low.y) * view.down.cos().abs()
                + across * view.down.sin().abs();
        }
        let keep = 1.0 - 2.0 * MARGIN;
        let scale =
            (keep * f64::from(size.width) / across).min(keep * f64::from(size.height) / high);
        // What has no extent is a dot in the middle, whatever the scale.
        let scale = if scale.is_finite() && scale > 0.0 {
            scale
        } else {
            1.0
        };
        Self {
            view,
            aim,
            middle_px: Point2::new(f64::from(size.width) / 2.0, f64::from(size.height) / 2.0),
            scale,
            size,
        }
    }

    /// The film's own camera: what it draws lies over the filmed frame drawn at this size.
    pub fn of_film(skeleton: &Skeleton, size: Size) -> Self {
        let film = skeleton.image_size;
        let across = f64::from(size.width) / f64::from(film.width.max(1));
        let down = f64::from(size.height) / f64::from(film.height.max(1));
        let scale = across.min(down);
        let left = (f64::from(size.width) - scale * f64::from(film.width)) / 2.0;
        let top = (f64::from(size.height) - scale * f64::from(film.height)) / 2.0;
        // The centre of the film's first pixel is 0, its corner -0.5.
        let foot_px = skeleton.foot_px;
        let middle_px = Point2::new(
            left + scale * (foot_px.x + 0.5),
            top + scale * (foot_px.y + 0.5),
        );
        Self {
            view: View::FRONT,
            aim: Point3::origin(),
            middle_px,
            scale,
            size,
        }
    }

    /// Where a point of the model is in the picture, px from its top left corner, and how near the
    /// viewer, model units.
    pub fn project(&self, p: &Point3<f64>) -> [f64; 3] {
        let [right, up, towards] = self.view.axes();
        let d = p - self.aim;
        [
            self.middle_px.x + self.scale * d.dot(&right),
            self.middle_px.y - self.scale * d.dot(&up),
            d.dot(&towards),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where x, y and z point in each view: right, down and nearer.
    #[test]
    fn every_view_shows_the_axes_where_a_viewer_standing_there_sees_them() {
        for (view, x, y, z) in [
            (
                View::FRONT,
                [1.0, 0.0, 0.0],
                [0.0, -1.0, 0.0],
                [0.0, 0.0, 1.0],
            ),
            (
                View::SIDE,
                [0.0, 0.0, 1.0],
                [0.0, -1.0, 0.0],
                [-1.0, 0.0, 0.0],
            ),
            (View::TOP, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]),
        ] {
            let camera = Camera {
                view,
                aim: Point3::origin(),
                middle_px: Point2::origin(),
                scale: 1.0,
                size: Size::new(10, 10),
            };
            for (point, expected) in [
                (Point3::new(1.0, 0.0, 0.0), x),
                (Point3::new(0.0, 1.0, 0.0), y),
            ]
            .into_iter()
            .chain([(Point3::new(0.0, 0.0, 1.0), z)])
            {
                let seen = camera.project(&point);
                assert!(
                    (0..3).all(|i| (seen[i] - expected[i]).abs() < 1e-12),
                    "{view:?} {point}: {seen:?}"
                );
            }
        }
    }

    #[test]
    fn the_whole_tree_is_in_the_picture_from_everywhere() {
        let points = [
            [-40.0, 0.0, 3.0],
            [70.0, 200.0, -90.0],
            [5.0, 120.0, 60.0],
            [f64::NAN, 1.0, 1.0],
        ];
        let points = points.map(|[x, y, z]| Point3::new(x, y, z));
        let bounds = BoundingCylinder::of(points).unwrap();
        for size in [Size::new(640, 480), Size::new(100, 900)] {
            for step in 0..24 {
                let turn = std::f64::consts::TAU * f64::from(step) / 24.0;
                for down in [0.0, 0.2, 1.2] {
                    for steady in [false, true] {
                        let camera = Camera::fitting(&bounds, View { turn, down }, steady, size);
                        for p in &points[..3] {
                            let [x, y, _] = camera.project(p);
                            let inside = x >= 0.0
                                && y >= 0.0
                                && x <= f64::from(size.width)
                                && y <= f64::from(size.height);
                            assert!(inside, "{p} at {x} {y}, {camera:?}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn the_films_camera_puts_a_node_on_its_own_pixel() {
        let skeleton = Skeleton {
            nodes: Vec::new(),
            foot_px: [325.5, 336.0].into(),
            image_size: Size::new(640, 360),
        };
        // Twice as large, with bars above and below.
        let camera = Camera::of_film(&skeleton, Size::new(1280, 800));
        let p = Point3::new(8.0, 78.0, 5.0);
        let seen_px = skeleton.image_from_model(&p);
        let [x, y, _] = camera.project(&p);
        assert!(
            (x - 2.0 * (seen_px.x + 0.5)).abs() < 1e-9
                && (y - 40.0 - 2.0 * (seen_px.y + 0.5)).abs() < 1e-9,
            "{x} {y}"
        );
    }
}
