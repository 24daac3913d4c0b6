//! The ground of a forest as a mesh.

use super::mesh::Mesh;
use crate::model::Ground;
use nalgebra::{Point2, Vector3};

/// Colour of the ground (sRGB): dry grass.
pub const GROUND_RGB: [u8; 3] = [124, 122, 86];

/// The surface of the ground, m: two triangles between every four samples; without joints and texture
/// coordinates.
pub fn ground(ground: &Ground) -> Mesh {
    let [columns, rows] = [ground.samples.width, ground.samples.height].map(|n| n.max(2));
    let mut mesh = Mesh::default();
    for row in 0..rows {
        for column in 0..columns {
            let at = place(ground, column, row, columns, rows);
            let height_m = ground.height_m(at);
            mesh.positions
                .push([at.x as f32, height_m as f32, at.y as f32]);
            mesh.normals.push(upward(ground, at, columns, rows));
        }
    }
    for row in 0..rows - 1 {
        for column in 0..columns - 1 {
            let far_left = row * columns + column;
            let near_left = far_left + columns;
            mesh.indices.extend([far_left, near_left, far_left + 1]);
            mesh.indices
                .extend([far_left + 1, near_left, near_left + 1]);
        }
    }
    mesh
}

/// Where a corner of the mesh is, (x, z), m.
fn place(ground: &Ground, column: u32, row: u32, columns: u32, rows: u32) -> Point2<f64> {
    let across = f64::from(column) / f64::from(columns - 1);
    let along = f64::from(row) / f64::from(rows - 1);
    Point2::new(
        (across - 0.5) * ground.width_m,
        (along - 0.5) * ground.depth_m,
    )
}

/// The normal at a corner, of length 1, by central differences over the neighbouring corners.
fn upward(ground: &Ground, at: Point2<f64>, columns: u32, rows: u32) -> [f32; 3] {
    let step_x = ground.width_m / f64::from(columns - 1);
    let step_z = ground.depth_m / f64::from(rows - 1);
    let right = ground.height_m(at + nalgebra::Vector2::new(step_x, 0.0));
    let left = ground.height_m(at - nalgebra::Vector2::new(step_x, 0.0));
    let near = ground.height_m(at + nalgebra::Vector2::new(0.0, step_z));
    let far = ground.height_m(at - nalgebra::Vector2::new(0.0, step_z));
    let slope = Vector3::new(
        (left - right) / (2.0 * step_x),
        1.0,
        (far - near) / (2.0 * step_z),
    );
    slope.normalize().cast::<f32>().into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;

    #[test]
    fn the_surface_goes_through_the_samples_and_faces_up() {
        let hill = Ground {
            width_m: 8.0,
            depth_m: 4.0,
            relief_m: 2.0,
            samples: Size::new(3, 3),
            heights: vec![0, 0, 0, 0, u16::MAX, 0, 0, 0, 0],
        };
        for (of, corners) in [(hill, 9), (Ground::flat(3.0, 5.0), 4)] {
            let mesh = ground(&of);
            assert_eq!(mesh.positions.len(), corners);
            assert_eq!(mesh.corners_against_winding(), 0);
            for [x, y, z] in &mesh.positions {
                let height_m = of.height_m(Point2::new(f64::from(*x), f64::from(*z)));
                assert!((f64::from(*y) - height_m).abs() < 1e-6);
            }
            assert!(mesh.normals.iter().all(|n| n[1] > 0.5));
        }
    }
}
