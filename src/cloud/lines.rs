//! Wood as straight pieces, and which line is nearest in place and direction.

use nalgebra::{Point, Point2, Point3, Vector2};

/// A straight piece of wood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WoodPiece<P> {
    pub from: P,
    pub to: P,
    pub radius: f64,
}

impl<const D: usize> WoodPiece<Point<f64, D>> {
    /// Its length.
    pub fn length(&self) -> f64 {
        (self.to - self.from).norm()
    }

    /// The same in parts of one length, none longer than `longest`; none of what has no length.
    pub fn cut(self, longest: f64) -> impl Iterator<Item = Self> {
        let way = self.to - self.from;
        let count = (way.norm() / longest).ceil() as usize;
        (0..count).map(move |k| {
            let [from, to] = [k, k + 1].map(|k| self.from + way * (k as f64 / count as f64));
            Self { from, to, ..self }
        })
    }
}

impl WoodPiece<Point2<f64>> {
    /// Its middle, and where it points; up where it has no length.
    pub fn place(&self) -> LinePlace {
        let way = self.to - self.from;
        LinePlace {
            at: nalgebra::center(&self.from, &self.to),
            along: way.try_normalize(1e-9).unwrap_or_else(Vector2::y),
        }
    }
}

/// The thickest pieces, so much length together.
pub fn thickest(wood: &[WoodPiece<Point3<f64>>], length: f64) -> Vec<WoodPiece<Point3<f64>>> {
    let mut sorted = wood.to_vec();
    sorted.sort_by(|a, b| b.radius.total_cmp(&a.radius));
    let mut left = length;
    sorted.retain(|piece| {
        left -= piece.length();
        left > 0.0
    });
    sorted
}

/// Places along wood that is seen by `project`, one in each piece.
pub fn places_seen(
    wood: &[WoodPiece<Point3<f64>>],
    project: impl Fn(&Point3<f64>) -> Point2<f64>,
) -> Vec<LinePlace> {
    let mut places = Vec::with_capacity(wood.len());
    for piece in wood {
        let flat = WoodPiece {
            from: project(&piece.from),
            to: project(&piece.to),
            radius: piece.radius,
        };
        places.push(flat.place());
    }
    places
}

/// A place on a line in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinePlace {
    pub at: Point2<f64>,
    /// The direction of the line, of length 1.
    pub along: Vector2<f64>,
}

impl LinePlace {
    /// The direction across the line, of length 1.
    pub fn normal(&self) -> Vector2<f64> {
        Vector2::new(-self.along.y, self.along.x)
    }

    /// The nearest of some places in place and direction, and how far it is off; a right angle
    /// counts as a distance of `across`. `None` where there are no places.
    pub fn nearest_of(&self, places: &[Self], across: f64) -> Option<Nearest> {
        let mut least: Option<Nearest> = None;
        for (place, other) in places.iter().enumerate() {
            let turn = across * self.along.perp(&other.along);
            let square = (other.at - self.at).norm_squared() + turn * turn;
            if least.is_none_or(|least| square < least.off) {
                least = Some(Nearest { place, off: square });
            }
        }
        least.map(|n| Nearest {
            off: n.off.sqrt(),
            ..n
        })
    }
}

/// The nearest of some places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Which one it is.
    pub place: usize,
    /// How far it is off in place and direction.
    pub off: f64,
}
