//! Triangles into samples, the nearest on top.

use super::rgba::Rgba;
use super::texture::Texture;
use crate::model::Size;
use nalgebra::Point2;
use std::ops::Range;

/// A corner of a triangle as it is to be drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// Samples from the top left corner.
    pub x: f32,
    pub y: f32,
    /// Greater is nearer the viewer.
    pub z: f32,
    /// 0 to 255.
    pub rgb: [f32; 3],
    pub uv: Point2<f32>,
}

/// Leaves are cut out of their texture where its alpha is less than this, as the model's file says.
const CUT: u8 = 128;
/// Beyond this the arithmetic of edges has no fractions left, and nothing of a tree is there.
const FAR: f32 = 1e6;

/// A depth buffer with colours, several samples a pixel in either direction.
pub(super) struct Canvas {
    size: Size,
    samples: usize,
    width: usize,
    height: usize,
    depth: Vec<f32>,
    colour: Vec<[u8; 3]>,
}

impl Canvas {
    /// Nothing drawn yet; `samples` in either direction of a pixel, at least 1.
    pub fn new(size: Size, samples: u32) -> Self {
        let samples = samples.max(1) as usize;
        let (width, height) = (
            size.width as usize * samples,
            size.height as usize * samples,
        );
        let (depth, colour) = (
            vec![f32::NEG_INFINITY; width * height],
            vec![[0; 3]; width * height],
        );
        Self {
            size,
            samples,
            width,
            height,
            depth,
            colour,
        }
    }

    /// Draws one triangle; its back only if `two_sided`. Corners that are no numbers or far outside
    /// are left out.
    pub fn triangle(&mut self, corners: [Corner; 3], two_sided: bool, texture: Option<&Texture>) {
        let Some(triangle) = Triangle::new(corners, two_sided) else {
            return;
        };
        let rows = covered(corners.map(|p| p.y), self.height);
        let columns = covered(corners.map(|p| p.x), self.width);
        for row in rows {
            for column in columns.clone() {
                let Some(shares) = triangle.shares(column as f32 + 0.5, row as f32 + 0.5) else {
                    continue;
                };
                let at = row * self.width + column;
                let z = triangle.mix(shares, |p| p.z);
                if z <= self.depth[at] {
                    continue;
                }
                if let Some(rgb) = triangle.colour(shares, texture) {
                    self.depth[at] = z;
                    self.colour[at] = rgb;
                }
            }
        }
    }

    /// The picture: of each pixel the mean of its samples, transparent where nothing was drawn.
    pub fn picture(&self) -> Rgba {
        let n = self.samples;
        let mut out = Rgba::of_one(self.size, [0; 4]);
        for (i, pixel) in out.pixels.chunks_exact_mut(4).enumerate() {
            let (x, y) = (
                i % self.size.width as usize * n,
                i / self.size.width as usize * n,
            );
            let (mut sum, mut drawn) = ([0u32; 3], 0u32);
            for row in y..y + n {
                for at in row * self.width + x..row * self.width + x + n {
                    if self.depth[at] > f32::NEG_INFINITY {
                        drawn += 1;
                        (0..3).for_each(|c| sum[c] += u32::from(self.colour[at][c]));
                    }
                }
            }
            if drawn > 0 {
                (0..3).for_each(|c| pixel[c] = ((sum[c] + drawn / 2) / drawn) as u8);
                pixel[3] = (255 * drawn / (n * n) as u32) as u8;
            }
        }
        out
    }
}

/// A triangle whose corners run so that its area is positive.
struct Triangle {
    corners: [Corner; 3],
    /// Twice the area, samples².
    area: f32,
}

impl Triangle {
    /// `None` for what is not drawn: a back unless `two_sided`, no area, or corners that are no
    /// numbers or far outside.
    fn new([a, b, c]: [Corner; 3], two_sided: bool) -> Option<Self> {
        for p in [a, b, c] {
            if !(p.x.abs() < FAR && p.y.abs() < FAR && p.z.is_finite()) {
                return None;
            }
        }
        // Counter-clockwise from outside; rows run downwards, so that a face that is seen has a
        // negative area.
        let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        if area < 0.0 {
            Some(Self {
                corners: [a, c, b],
                area: -area,
            })
        } else if area > 0.0 && two_sided {
            Some(Self {
                corners: [a, b, c],
                area,
            })
        } else {
            None
        }
    }

    /// Shares of the corners at a place (barycentric coordinates); `None` outside.
    fn shares(&self, x: f32, y: f32) -> Option<[f32; 3]> {
        let [a, b, c] = &self.corners;
        let (wa, wb) = (self.share(b, c, x, y), self.share(c, a, x, y));
        let wc = 1.0 - wa - wb;
        let inside = !(wa < 0.0 || wb < 0.0 || wc < 0.0);
        inside.then_some([wa, wb, wc])
    }

    /// Share of the corner across from the edge `p` to `q`.
    fn share(&self, p: &Corner, q: &Corner, x: f32, y: f32) -> f32 {
        ((q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x)) / self.area
    }

    fn mix(&self, [wa, wb, wc]: [f32; 3], value: impl Fn(&Corner) -> f32) -> f32 {
        let [a, b, c] = &self.corners;
        wa * value(a) + wb * value(b) + wc * value(c)
    }

    /// `None` where the texture is cut away.
    fn colour(&self, shares: [f32; 3], texture: Option<&Texture>) -> Option<[u8; 3]> {
        let mut rgb = [0, 1, 2].map(|i| self.mix(shares, |p| p.rgb[i]));
        if let Some(texture) = texture {
            let u = self.mix(shares, |p| p.uv.x);
            let v = self.mix(shares, |p| p.uv.y);
            let [r, g, b, alpha] = texture.at(u, v);
            if alpha < CUT {
                return None;
            }
            rgb[0] = rgb[0] * f32::from(r) / 255.0;
            rgb[1] = rgb[1] * f32::from(g) / 255.0;
            rgb[2] = rgb[2] * f32::from(b) / 255.0;
        }
        Some(rgb.map(|c| (c + 0.5) as u8))
    }
}

/// Samples of a side of `n` whose middles may lie between the corners.
fn covered([p, q, r]: [f32; 3], n: usize) -> Range<usize> {
    let (low, high) = (p.min(q).min(r) - 0.5, p.max(q).max(r) - 0.5);
    let end = ((high.floor() + 1.0).max(0.0) as usize).min(n);
    low.ceil().max(0.0) as usize..end
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(x: f32, y: f32, z: f32, rgb: [f32; 3]) -> Corner {
        Corner {
            x,
            y,
            z,
            rgb,
            uv: Point2::origin(),
        }
    }

    const RED: [f32; 3] = [200.0, 0.0, 0.0];
    const BLUE: [f32; 3] = [0.0, 0.0, 200.0];

    #[test]
    fn the_nearer_triangle_hides_the_other_in_either_order() {
        let far = [
            corner(0.0, 0.0, 1.0, RED),
            corner(0.0, 8.0, 1.0, RED),
            corner(8.0, 0.0, 1.0, RED),
        ];
        let near = [
            corner(0.0, 0.0, 2.0, BLUE),
            corner(0.0, 4.0, 2.0, BLUE),
            corner(4.0, 0.0, 2.0, BLUE),
        ];
        for order in [[far, near], [near, far]] {
            let mut canvas = Canvas::new(Size::new(8, 8), 1);
            order
                .into_iter()
                .for_each(|t| canvas.triangle(t, false, None));
            let picture = canvas.picture();
            assert_eq!(
                (picture.at(1, 1), picture.at(5, 1)),
                ([0, 0, 200, 255], [200, 0, 0, 255])
            );
            assert_eq!(picture.at(7, 7), [0; 4]);
        }
    }

    #[test]
    fn backs_are_drawn_only_of_what_has_two_sides() {
        let back = [
            corner(0.0, 0.0, 1.0, RED),
            corner(8.0, 0.0, 1.0, RED),
            corner(0.0, 8.0, 1.0, RED),
        ];
        for (two_sided, alpha) in [(false, 0), (true, 255)] {
            let mut canvas = Canvas::new(Size::new(8, 8), 2);
            canvas.triangle(back, two_sided, None);
            assert_eq!(canvas.picture().at(1, 1)[3], alpha);
        }
    }

    /// Two triangles that share an edge leave no hole along it, and a border half way through
    /// pixels covers half of them.
    #[test]
    fn a_rectangle_of_two_triangles_is_whole_and_soft_at_its_border() {
        let p = [[1.5, 1.0], [1.5, 7.0], [6.5, 7.0], [6.5, 1.0]]
            .map(|[x, y]| corner(4.0 * x, 4.0 * y, 0.0, RED));
        let mut canvas = Canvas::new(Size::new(8, 8), 4);
        canvas.triangle([p[0], p[1], p[2]], false, None);
        canvas.triangle([p[0], p[2], p[3]], false, None);
        let picture = canvas.picture();
        for y in 1..7 {
            let row: Vec<u8> = (0..8).map(|x| picture.at(x, y)[3]).collect();
            assert_eq!(row, [0, 127, 255, 255, 255, 255, 127, 0]);
        }
    }

    #[test]
    fn what_is_no_number_or_endless_is_left_out() {
        let mut canvas = Canvas::new(Size::new(4, 4), 2);
        for bad in [f32::NAN, f32::INFINITY, 1e30, -1e30] {
            canvas.triangle(
                [
                    corner(bad, 0.0, 0.0, RED),
                    corner(0.0, 8.0, 0.0, RED),
                    corner(8.0, 0.0, 0.0, RED),
                ],
                true,
                None,
            );
        }
        let flat = corner(1.0, 1.0, 0.0, RED);
        canvas.triangle([flat, flat, flat], true, None);
        assert!(canvas.picture().pixels.iter().all(|p| *p == 0));
    }
}
