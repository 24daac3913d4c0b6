//! The envelope: the outline turned about its axis (surface of revolution, Li 2011 sect. 3 after
//! Okabe et al.), the hull of the skeleton turned (Zeng 2015 sect. 5.5), or a drawn shape.

use crate::bounds::Bounds;
use crate::config::EnvelopeKind;
use crate::model::{NodeDepth, Outline};
use crate::signal::convex_hull;
use nalgebra::{Point2, Point3};

/// Farthest from the foot that a point of a hull is, px: there is a disc for every pixel of its
/// height.
const FARTHEST_OF_HULL: f64 = 32_768.0;

/// A stack of discs, one a pixel row: at height y the tree lies within `radius` of (`centre_x`, y,
/// 0), model axes, px. A drawn shape has, besides, what of each row is inside as seen from the
/// front.
#[derive(Clone, Debug, PartialEq)]
pub struct Envelope {
    /// Height of the lowest disc; the others follow one pixel apart.
    bottom_y: f64,
    discs: Vec<Disc>,
    /// Stretches of x of every disc that are inside, from left to right; empty: all is.
    stretches: Vec<Vec<Bounds>>,
    /// Where a depth camera has seen measured nodes; empty: nowhere.
    seen: Vec<Option<NodeDepth>>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Disc {
    centre_x: f64,
    radius: f64,
}

impl Disc {
    fn between(ends: Bounds) -> Self {
        Self {
            centre_x: (ends.lo + ends.hi) / 2.0,
            radius: ends.length() / 2.0,
        }
    }
}

impl Envelope {
    /// Turns `outline` about the middle of each of its rows; rows that the region does not touch
    /// are bridged.
    pub fn of_revolution(outline: &Outline, foot_px: Point2<f64>) -> Self {
        Self::turned(
            outline.bounds_px(),
            outline.size.width as usize,
            &outline.mask,
            foot_px,
        )
    }

    /// As [`of_revolution`](Self::of_revolution), cut as `mask` is seen from the front: where a row
    /// of the shape has gaps, as between the lobes of a heart, so has the envelope through its
    /// whole depth. The depth is that of the whole row, as lobes that were turned each for itself
    /// would meet in a step.
    pub fn of_drawn(outline: &Outline, foot_px: Point2<f64>) -> Self {
        let mut envelope = Self::of_revolution(outline, foot_px);
        let width = outline.size.width as usize;
        // Not from the heights: those of a foot that is far away are not exact.
        let Some([_, top, _, bottom]) = outline.bounds_px() else {
            return envelope;
        };
        let rows = (top..=bottom)
            .rev()
            .map(|v| &outline.mask[v as usize * width..][..width]);
        envelope.stretches = rows.map(|row| stretches(row, foot_px.x)).collect();
        envelope
    }

    /// Turns the convex hull of `points` (model axes, px; z is not looked at), half a pixel wider
    /// all around. Points farther from the foot than any picture is large are left out.
    pub fn of_hull(points: &[Point3<f64>]) -> Self {
        let flat: Vec<Point2<f64>> = points
            .iter()
            .map(|p| p.xy())
            .filter(|p| p.iter().all(|c| c.abs() <= FARTHEST_OF_HULL))
            .collect();
        let hull = convex_hull(&flat);
        let (mut bottom, mut top) = (f64::INFINITY, f64::NEG_INFINITY);
        for corner in &hull {
            bottom = bottom.min(corner.y.floor());
            top = top.max(corner.y.ceil());
        }
        if bottom > top {
            return Self::empty();
        }
        let rows = (top - bottom) as usize + 1;
        let mut discs = Vec::with_capacity(rows);
        for k in 0..rows {
            let ends = crossed(&hull, bottom + k as f64);
            discs.push(Disc::between(Bounds::new(ends.lo - 0.5, ends.hi + 0.5)));
        }
        Self {
            bottom_y: bottom,
            discs,
            stretches: Vec::new(),
            seen: Vec::new(),
        }
    }

    /// Of a filmed tree whose measured nodes are at `places` (model axes, px), as the settings name
    /// it.
    pub fn of_filmed(
        kind: EnvelopeKind,
        outline: &Outline,
        foot_px: Point2<f64>,
        places: &[Point3<f64>],
    ) -> Self {
        match kind {
            EnvelopeKind::Revolution => Self::of_revolution(outline, foot_px),
            EnvelopeKind::Hull => Self::of_hull(places),
        }
    }

    /// The same where a depth camera has seen measured nodes: a node may be where it was seen, though
    /// that is outside.
    pub fn with_seen(self, seen: &[Option<NodeDepth>]) -> Self {
        Self {
            seen: seen.to_vec(),
            ..self
        }
    }

    /// Where a depth camera has seen the measured node `i`; `None` where it has not, and for copies.
    pub fn seen(&self, i: usize) -> Option<NodeDepth> {
        self.seen.get(i).copied().flatten()
    }

    fn empty() -> Self {
        Self {
            bottom_y: 0.0,
            discs: Vec::new(),
            stretches: Vec::new(),
            seen: Vec::new(),
        }
    }

    fn turned(bounds: Option<[u32; 4]>, width: usize, mask: &[u8], foot_px: Point2<f64>) -> Self {
        let Some([_, top, _, bottom]) = bounds else {
            return Self::empty();
        };
        let mut discs = Vec::new();
        let mut last = Disc {
            centre_x: 0.0,
            radius: 0.5,
        };
        for v in (top..=bottom).rev() {
            let row = &mask[v as usize * width..][..width];
            let ends = row
                .iter()
                .position(|&m| m != 0)
                .zip(row.iter().rposition(|&m| m != 0));
            if let Some((left, right)) = ends {
                last = Disc::between(Bounds::new(
                    left as f64 - 0.5 - foot_px.x,
                    right as f64 + 0.5 - foot_px.x,
                ));
            }
            discs.push(last);
        }
        Self {
            bottom_y: foot_px.y - f64::from(bottom),
            discs,
            stretches: Vec::new(),
            seen: Vec::new(),
        }
    }

    /// Greatest width, px.
    pub fn width(&self) -> f64 {
        self.discs
            .iter()
            .map(|d| 2.0 * d.radius)
            .fold(0.0, f64::max)
    }

    /// From its lowest row to its highest, px.
    pub fn height(&self) -> f64 {
        self.discs.len() as f64
    }

    fn row_at(&self, y: f64) -> Option<usize> {
        let row = (y - self.bottom_y).round();
        // Half a pixel beyond the last rows still belongs to them: positions there come from pixels
        // inside.
        (row >= 0.0 && (row as usize) < self.discs.len()).then_some(row as usize)
    }

    /// Whether `p` lies inside.
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        self.row_at(p.y).is_some_and(|k| {
            let d = self.discs[k];
            let dx = p.x - d.centre_x;
            dx * dx + p.z * p.z <= d.radius * d.radius && self.is_seen_inside(k, p.x)
        })
    }

    fn is_seen_inside(&self, row: usize, x: f64) -> bool {
        self.stretches
            .get(row)
            .is_none_or(|of| of.iter().any(|stretch| stretch.contains(x)))
    }

    /// How deep the envelope is at (`x`, `y`): it reaches from -depth to depth in z; `None`
    /// outside.
    pub fn depth(&self, x: f64, y: f64) -> Option<f64> {
        let k = self.row_at(y)?;
        let d = self.discs[k];
        let depth_sq = d.radius.powi(2) - (x - d.centre_x).powi(2);
        (depth_sq >= 0.0 && self.is_seen_inside(k, x)).then(|| depth_sq.sqrt())
    }

    /// `p` moved towards the axis, at its own height, until it is inside; above and below the
    /// envelope to its ends.
    pub fn clamp(&self, p: &Point3<f64>) -> Point3<f64> {
        if self.discs.is_empty() || self.contains(p) {
            return *p;
        }
        let y =
            p.y.clamp(self.bottom_y, self.bottom_y + (self.discs.len() - 1) as f64);
        let Some(k) = self.row_at(y) else { return *p };
        let d = self.discs[k];
        let x = self.nearest_inside(k, p.x);
        let (dx, dz) = (x - d.centre_x, p.z);
        // Just inside, so that rounding does not put it out again.
        let shrink = (0.999 * d.radius / dx.hypot(dz).max(1e-9)).min(1.0);
        let drawn_in = d.centre_x + shrink * dx;
        if self.is_seen_inside(k, drawn_in) {
            return Point3::new(drawn_in, y, shrink * dz);
        }
        // Towards the axis lies a gap: only the depth gives way.
        let depth = (d.radius.powi(2) - dx * dx).max(0.0).sqrt();
        Point3::new(x, y, 0.999 * dz.clamp(-depth, depth))
    }

    fn nearest_inside(&self, row: usize, x: f64) -> f64 {
        let stretches = self.stretches.get(row).map_or(&[][..], Vec::as_slice);
        let clamped = stretches.iter().map(|stretch| stretch.clamp(x));
        clamped
            .min_by(|a, b| (a - x).abs().total_cmp(&(b - x).abs()))
            .unwrap_or(x)
    }

    /// `m` points spread evenly over the surface, by area: heights at equal shares of the surface,
    /// each point turned by the golden angle against the one before. No chance is involved. What
    /// would lie in a gap of a drawn shape lies on its wall.
    pub fn attractors(&self, m: usize) -> Vec<Point3<f64>> {
        let mut area = Vec::with_capacity(self.discs.len());
        let mut total = 0.0;
        for (k, d) in self.discs.iter().enumerate() {
            let below = self.discs[k.saturating_sub(1)];
            let slope = (d.radius - below.radius).hypot(d.centre_x - below.centre_x);
            total += d.radius * slope.hypot(1.0);
            area.push(total);
        }
        let golden_angle = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        (0..m)
            .filter_map(|i| {
                let wanted = (i as f64 + 0.5) / m as f64 * total;
                let row = area
                    .partition_point(|&a| a < wanted)
                    .min(self.discs.len().checked_sub(1)?);
                let (d, angle) = (self.discs[row], i as f64 * golden_angle);
                let (sin, cos) = angle.sin_cos();
                let x = self.nearest_inside(row, d.centre_x + d.radius * cos);
                Some(Point3::new(x, self.bottom_y + row as f64, d.radius * sin))
            })
            .collect()
    }
}

/// What of a row of a mask is inside, x from the foot, px.
fn stretches(row: &[u8], foot_u: f64) -> Vec<Bounds> {
    let mut out: Vec<Bounds> = Vec::new();
    let mut open = false;
    for (u, &m) in row.iter().enumerate() {
        let x = u as f64 - foot_u;
        match out.last_mut().filter(|_| open) {
            Some(last) if m != 0 => last.hi = x + 0.5,
            None if m != 0 => out.push(Bounds::new(x - 0.5, x + 0.5)),
            _ => {}
        }
        open = m != 0;
    }
    out
}

/// Where the horizontal line at `y` enters and leaves a convex polygon; beyond its ends, as at its
/// nearest corner.
fn crossed(hull: &[Point2<f64>], y: f64) -> Bounds {
    let mut crossings_x = Vec::with_capacity(2);
    for (a, b) in hull.iter().zip(hull.iter().cycle().skip(1)) {
        if !(a.y.min(b.y)..=a.y.max(b.y)).contains(&y) {
            continue;
        }
        // Of a level side both corners; the second is the first of the next side.
        let t = if a.y == b.y {
            0.0
        } else {
            (y - a.y) / (b.y - a.y)
        };
        crossings_x.push(a.x + t * (b.x - a.x));
    }
    if let Some(ends) = Bounds::of(crossings_x) {
        return ends;
    }
    let corner = hull
        .iter()
        .min_by(|a, b| (a.y - y).abs().total_cmp(&(b.y - y).abs()));
    corner.map_or(Bounds::default(), |c| Bounds::new(c.x, c.x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;

    /// A damaged file may say that the foot, or a node, is anywhere.
    #[test]
    fn numbers_from_a_damaged_file_give_an_envelope_all_the_same() {
        let size = Size::new(8, 6);
        let outline = Outline {
            size,
            mask: vec![255; 48],
            polygon_px: Vec::new(),
            matte: None,
            other_foot_px: None,
        };
        for foot in [1e18, -1e18, 7.5] {
            let envelope = Envelope::of_drawn(&outline, Point2::new(foot, foot));
            assert_eq!((envelope.discs.len(), envelope.stretches.len()), (6, 6));
        }
        let far = [
            Point3::origin(),
            Point3::new(3.0, 40.0, 0.0),
            Point3::new(1e9, 1e9, 0.0),
            Point3::new(0.0, 1e300, 0.0),
        ];
        assert_eq!(Envelope::of_hull(&far).height(), 41.0);
        assert_eq!(Envelope::of_hull(&far[2..]).height(), 0.0);
    }
}
