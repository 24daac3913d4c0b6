//! Light and shadow: a soft sky, a sun over the viewer's left shoulder.

use super::camera::{Camera, View};
use super::canvas::{Canvas, Corner};
use super::model::{Part, Placed, Posed};
use super::rgba::Rgba;
use nalgebra::{Matrix3, Point2, Rotation3, Vector3};

/// How a picture is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Samples of a pixel in either direction, 1 to 8: smoother borders, and thinner twigs that
    /// still show.
    pub samples: u32,
    /// The tree's shadow on the ground, where the view looks down on it.
    pub shadow: bool,
    /// By how much wood is drawn thicker on every side, px: a twig thinner than a sample is else
    /// drawn in pieces.
    pub thicker_px: f64,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            samples: 3,
            shadow: false,
            thicker_px: 0.0,
        }
    }
}

/// Share of the light that a shadow takes away at its darkest.
const SHADE: f32 = 0.4;

/// Draws a tree in its pose; transparent where there is none.
pub fn picture(tree: &Posed, camera: &Camera, look: &Look) -> Rgba {
    let tree = [Placed::at_origin(tree)];
    let picture = drawn(&tree, camera, look);
    if !look.shadow || camera.view.down < 0.05 {
        return picture;
    }
    let mut ground = shadow(&tree, camera);
    ground.put(&picture);
    ground
}

/// Draws trees on a ground; transparent where there is neither. A shadow lies on level ground at
/// height 0, whatever the ground is like: it is for such ground only.
pub fn scene(ground: &Posed, trees: &[Placed], camera: &Camera, look: &Look) -> Rgba {
    let ground = [Placed::at_origin(ground)];
    if !look.shadow || camera.view.down < 0.05 {
        let all: Vec<Placed> = ground.iter().chain(trees).copied().collect();
        return drawn(&all, camera, look);
    }
    let mut picture = drawn(&ground, camera, look);
    picture.put(&shadow(trees, camera));
    picture.put(&drawn(trees, camera, look));
    picture
}

/// All of these without shadows, what is nearer before what is farther.
fn drawn(all: &[Placed], camera: &Camera, look: &Look) -> Rgba {
    let samples = look.samples.clamp(1, 8);
    let mut canvas = Canvas::new(camera.size, samples);
    let mut eye = Eye::new(camera, samples);
    eye.thicker = (look.thicker_px / camera.scale) as f32;
    for placed in all {
        let place = Place::of(placed);
        for part in &placed.posed.parts {
            draw(part, &place, &eye, &mut canvas);
        }
    }
    canvas.picture()
}

/// Where a tree stands, as the inner loop wants it.
struct Place {
    turn: Matrix3<f32>,
    scale: f32,
    foot: Vector3<f32>,
}

impl Place {
    fn of(placed: &Placed) -> Self {
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), placed.turn_rad);
        Self {
            turn: turn.into_inner().cast(),
            scale: placed.scale as f32,
            foot: placed.foot.coords.cast(),
        }
    }

    fn point(&self, p: Vector3<f32>) -> Vector3<f32> {
        self.foot + self.turn * p * self.scale
    }
}

/// A camera and its light as the inner loop wants them.
struct Eye {
    axes: [Vector3<f32>; 3],
    aim: Vector3<f32>,
    /// Middle of the picture, samples.
    middle: Point2<f32>,
    scale: f32,
    sun: Vector3<f32>,
    /// Model units.
    thicker: f32,
}

impl Eye {
    fn new(camera: &Camera, samples: u32) -> Self {
        let n = samples as f32;
        Self {
            axes: camera.view.axes().map(|a| a.cast::<f32>()),
            aim: camera.aim.coords.cast::<f32>(),
            middle: camera.middle_px.map(|m| n * m as f32),
            scale: n * camera.scale as f32,
            sun: sun(camera.view),
            thicker: 0.0,
        }
    }

    fn place(&self, p: Vector3<f32>) -> [f32; 3] {
        let d = p - self.aim;
        let [right, up, towards] = &self.axes;
        [
            self.middle.x + self.scale * d.dot(right),
            self.middle.y - self.scale * d.dot(up),
            d.dot(towards),
        ]
    }
}

/// Towards the sun; it goes round with the viewer, so that every view is lit alike, and stays in
/// the sky from above.
fn sun(view: View) -> Vector3<f32> {
    let [right, _, towards] = View { down: 0.0, ..view }.axes();
    let way: Vector3<f64> = towards * 0.6 + Vector3::y() * 0.75 - right * 0.5;
    way.normalize().cast()
}

fn draw(part: &Part, place: &Place, eye: &Eye, canvas: &mut Canvas) {
    let towards = eye.axes[2];
    let parts = part
        .positions
        .iter()
        .zip(part.normals.iter().zip(&part.colours))
        .enumerate();
    let corners: Vec<Corner> = parts
        .map(|(i, (p, (n, colour)))| {
            let mut normal = place.turn * Vector3::from(*n);
            normal = normal.try_normalize(1e-6).unwrap_or(towards);
            if part.two_sided && normal.dot(&towards) < 0.0 {
                normal = -normal;
            }
            let light = lit(normal, eye.sun, part.two_sided);
            let thicker = if part.two_sided { 0.0 } else { eye.thicker };
            let [x, y, z] = eye.place(place.point(Vector3::from(*p)) + normal * thicker);
            let uv = Point2::from(part.uvs.get(i).copied().unwrap_or_default());
            Corner {
                x,
                y,
                z,
                rgb: colour.map(|c| (f32::from(c) * light).clamp(0.0, 255.0)),
                uv,
            }
        })
        .collect();
    for triangle in triangles(part, &corners) {
        canvas.triangle(triangle, part.two_sided, part.texture);
    }
}

/// The triangles of a part whose corners all are there.
fn triangles<'a>(part: &'a Part, corners: &'a [Corner]) -> impl Iterator<Item = [Corner; 3]> + 'a {
    part.indices.chunks_exact(3).filter_map(|t| {
        let a = *corners.get(t[0] as usize)?;
        let b = *corners.get(t[1] as usize)?;
        let c = *corners.get(t[2] as usize)?;
        Some([a, b, c])
    })
}

/// Share of its colour that a surface shows. Leaves let light through, and theirs has the film's
/// shadows in it already. The bark's has been evened out: in the mean over all that is seen of an
/// upright limb it stays as it was filmed.
fn lit(normal: Vector3<f32>, sun: Vector3<f32>, leaf: bool) -> f32 {
    let (sky, key) = (0.5 + 0.5 * normal.y, normal.dot(&sun));
    if leaf {
        0.72 + 0.13 * sky + 0.25 * key.abs()
    } else {
        0.6 + 0.25 * sky + 0.6 * key.max(0.0)
    }
}

/// The shadow on level ground at height 0: grey with soft borders, transparent elsewhere.
fn shadow(trees: &[Placed], camera: &Camera) -> Rgba {
    let (sun, eye) = (Vector3::new(-0.3, 1.0, 0.15), Eye::new(camera, 1));
    let mut canvas = Canvas::new(camera.size, 1);
    for tree in trees {
        let place = Place::of(tree);
        for part in &tree.posed.parts {
            let corners: Vec<Corner> = part
                .positions
                .iter()
                .map(|p| {
                    let p = place.point(Vector3::from(*p));
                    let [x, y, _] = eye.place(p - sun * p.y.max(0.0));
                    Corner {
                        x,
                        y,
                        z: 0.0,
                        rgb: [0.0; 3],
                        uv: Point2::origin(),
                    }
                })
                .collect();
            for triangle in triangles(part, &corners) {
                canvas.triangle(triangle, true, None);
            }
        }
    }
    let mut picture = canvas.picture();
    let (width, height) = (camera.size.width as usize, camera.size.height as usize);
    let mut cover: Vec<f32> = picture
        .pixels
        .chunks_exact(4)
        .map(|p| f32::from(p[3]) * SHADE)
        .collect();
    let soft = 1 + width.max(height) / 200;
    // Seen from the side the ground is foreshortened, and so is the softness of what lies on it.
    let soft_down = ((soft as f64 * camera.view.down.sin()).round() as usize).max(1);
    for _ in 0..2 {
        blur(&mut cover, width, height, soft, 1, width);
        blur(&mut cover, height, width, soft_down, width, 1);
    }
    for (pixel, cover) in picture.pixels.chunks_exact_mut(4).zip(cover) {
        pixel.copy_from_slice(&[30, 34, 40, cover.round() as u8]);
    }
    picture
}

/// Running mean over `2 radius + 1` values along lines: `n` values `step` apart, `lines` of them
/// `next` apart.
fn blur(values: &mut [f32], n: usize, lines: usize, radius: usize, step: usize, next: usize) {
    let mut line = vec![0.0_f32; n];
    for l in 0..lines {
        let first = l * next;
        for i in 0..n {
            line[i] = values[first + i * step];
        }
        let mut sum: f64 = line.iter().take(radius).map(|v| f64::from(*v)).sum();
        for i in 0..n {
            sum += line.get(i + radius).map_or(0.0, |v| f64::from(*v));
            sum -= i
                .checked_sub(radius + 1)
                .map_or(0.0, |k| f64::from(line[k]));
            values[first + i * step] = (sum / (2 * radius + 1) as f64) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_faces_the_sun_is_brighter_from_every_side() {
        for turn in [0.0, 1.0, 3.0] {
            let sun = sun(View { turn, down: 0.3 });
            assert!(sun.y > 0.5);
            assert!(lit(sun, sun, false) > lit(-sun, sun, false) + 0.5);
        }
    }

    #[test]
    fn an_upright_limb_has_the_colour_that_was_filmed_in_the_mean() {
        for turn in [0.0, 2.0] {
            let view = View { turn, down: 0.0 };
            let [right, _, towards] = view.axes().map(|a| a.cast::<f32>());
            let (mut light, mut width) = (0.0, 0.0);
            for k in -89..90_i8 {
                let (sin, cos) = f32::from(k).to_radians().sin_cos();
                light += cos * lit(towards * cos + right * sin, sun(view), false);
                width += cos;
            }
            assert!((light / width - 1.0).abs() < 0.02, "{}", light / width);
        }
    }

    #[test]
    fn a_blur_keeps_the_sum_and_the_place() {
        let mut values = vec![0.0; 9 * 3];
        values[9 + 4] = 9.0;
        blur(&mut values, 9, 3, 1, 1, 9);
        assert_eq!(values[9..18], [0.0, 0.0, 0.0, 3.0, 3.0, 3.0, 0.0, 0.0, 0.0]);
        blur(&mut values, 3, 9, 1, 9, 1);
        assert!(
            values.iter().map(|v| v.round()).sum::<f32>() == 9.0,
            "{values:?}"
        );
    }
}
