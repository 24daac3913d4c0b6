//! The envelope: the outline turned about its axis (surface of revolution, Li et al. section 3 after Okabe et al.).

use crate::model::Outline;
use nalgebra::Point3;

/// A stack of discs, one a pixel row: at height y the tree lies within `radius` of (`centre_x`, y, 0), model axes, px.
#[derive(Clone, Debug, PartialEq)]
pub struct Envelope {
    /// Height of the lowest disc; the others follow one pixel apart.
    bottom_y: f64,
    discs: Vec<Disc>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Disc {
    centre_x: f64,
    radius: f64,
}

impl Envelope {
    /// Turns `outline` about the middle of each of its rows; rows that the region does not touch are bridged.
    pub fn of_revolution(outline: &Outline, foot_px: [f64; 2]) -> Self {
        let width = outline.size.width as usize;
        let Some([_, top, _, bottom]) = outline.bounds_px() else {
            return Self { bottom_y: 0.0, discs: Vec::new() };
        };
        let mut discs = Vec::new();
        let mut last = Disc { centre_x: 0.0, radius: 0.5 };
        for v in (top..=bottom).rev() {
            let row = &outline.mask[v as usize * width..][..width];
            let ends = row.iter().position(|&m| m != 0).zip(row.iter().rposition(|&m| m != 0));
            if let Some((left, right)) = ends {
                let centre_x = (left + right) as f64 / 2.0 - foot_px[0];
                last = Disc { centre_x, radius: (right - left + 1) as f64 / 2.0 };
            }
            discs.push(last);
        }
        Self { bottom_y: foot_px[1] - f64::from(bottom), discs }
    }

    /// Greatest width, px.
    pub fn width(&self) -> f64 {
        self.discs.iter().map(|d| 2.0 * d.radius).fold(0.0, f64::max)
    }

    fn disc_at(&self, y: f64) -> Option<Disc> {
        let row = (y - self.bottom_y).round();
        // Half a pixel beyond the last rows still belongs to them: positions there come from pixels inside.
        (row >= 0.0).then(|| self.discs.get(row as usize).copied()).flatten()
    }

    /// Whether `p` lies inside.
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        self.disc_at(p.y).is_some_and(|d| (p.x - d.centre_x).hypot(p.z) <= d.radius)
    }

    /// `p` moved towards the axis, at its own height, until it is inside; above and below the envelope to its ends.
    pub fn clamp(&self, p: &Point3<f64>) -> Point3<f64> {
        if self.discs.is_empty() || self.contains(p) {
            return *p;
        }
        let y = p.y.clamp(self.bottom_y, self.bottom_y + (self.discs.len() - 1) as f64);
        let Some(d) = self.disc_at(y) else { return *p };
        let (dx, dz) = (p.x - d.centre_x, p.z);
        // Just inside, so that rounding does not put it out again.
        let shrink = (0.999 * d.radius / dx.hypot(dz).max(1e-9)).min(1.0);
        Point3::new(d.centre_x + shrink * dx, y, shrink * dz)
    }

    /// `m` points spread evenly over the surface, by area: heights at equal shares of the surface, each point turned by
    /// the golden angle against the one before. No chance is involved.
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
                let row = area.partition_point(|&a| a < wanted).min(self.discs.len().checked_sub(1)?);
                let (d, angle) = (self.discs[row], i as f64 * golden_angle);
                let (sin, cos) = angle.sin_cos();
                Some(Point3::new(d.centre_x + d.radius * cos, self.bottom_y + row as f64, d.radius * sin))
            })
            .collect()
    }
}
