//! Triangles into samples, the nearest on top.

use super::rgba::Rgba;
use super::texture::Texture;
use crate::model::Size;

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
    pub uv: [f32; 2],
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
    pub fn triangle(
        &mut self,
        [a, mut b, mut c]: [Corner; 3],
        two_sided: bool,
        texture: Option<&Texture>,
    ) {
        let sound = |p: &Corner| p.x.abs() < FAR && p.y.abs() < FAR && p.z.is_finite();
        if ![a, b, c].iter().all(sound) {
            return;
        }
        let mut area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        // Counter-clockwise from outside; rows run downwards, so that a face that is seen has a
        // negative area.
        if area > 0.0 && !two_sided {
            return;
        }
        if area < 0.0 {
            (b, c, area) = (c, b, -area);
        }
        if area.is_nan() || area <= 0.0 {
            return;
        }
        // A sample is drawn if its middle lies inside.
        let span = |p: f32, q: f32, r: f32, n: usize| {
            let (low, high) = (p.min(q).min(r) - 0.5, p.max(q).max(r) - 0.5);
            (
                low.ceil().max(0.0) as usize,
                ((high.floor() + 1.0).max(0.0) as usize).min(n),
            )
        };
        let (left, right) = span(a.x, b.x, c.x, self.width);
        let (top, bottom) = span(a.y, b.y, c.y, self.height);
        let share = |p: &Corner, q: &Corner, x: f32, y: f32| {
            ((q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x)) / area
        };
        for row in top..bottom {
            let y = row as f32 + 0.5;
            for column in left..right {
                let x = column as f32 + 0.5;
                let (wa, wb) = (share(&b, &c, x, y), share(&c, &a, x, y));
                let wc = 1.0 - wa - wb;
                if wa < 0.0 || wb < 0.0 || wc < 0.0 {
                    continue;
                }
                let at = row * self.width + column;
                let z = wa * a.z + wb * b.z + wc * c.z;
                if z <= self.depth[at] {
                    continue;
                }
                let mix = |of: fn(&Corner, usize) -> f32, i| {
                    wa * of(&a, i) + wb * of(&b, i) + wc * of(&c, i)
                };
                let mut rgb = [0, 1, 2].map(|i| mix(|p, i| p.rgb[i], i));
                if let Some(texture) = texture {
                    let [r, g, b, alpha] =
                        texture.at(mix(|p, _| p.uv[0], 0), mix(|p, _| p.uv[1], 0));
                    if alpha < CUT {
                        continue;
                    }
                    rgb = [
                        rgb[0] * f32::from(r),
                        rgb[1] * f32::from(g),
                        rgb[2] * f32::from(b),
                    ]
                    .map(|c| c / 255.0);
                }
                self.depth[at] = z;
                self.colour[at] = rgb.map(|c| (c + 0.5) as u8);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(x: f32, y: f32, z: f32, rgb: [f32; 3]) -> Corner {
        Corner {
            x,
            y,
            z,
            rgb,
            uv: [0.0; 2],
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
