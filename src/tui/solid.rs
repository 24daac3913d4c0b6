//! The wood of the tree as the screen draws it: coarse, made once for each tree.

use super::theme::Theme;
use crate::draw;
use crate::geometry::{Mesh, bare_wood};
use crate::model::{Size, Skeleton, Snapshot};
use std::sync::Arc;

/// A cell has eight dots; more triangles than these would not be seen.
const TRIANGLES: usize = 4000;

/// A mesh, and the tree that it is of.
#[derive(Clone, Debug, Default)]
pub struct Solid {
    of: Option<Arc<Skeleton>>,
    mesh: Arc<Mesh>,
}

impl Solid {
    /// The same if it is of this tree already, else a new one.
    pub fn followed_by(self, skeleton: &Arc<Skeleton>) -> Self {
        if self.of.as_ref().is_some_and(|of| Arc::ptr_eq(of, skeleton)) {
            return self;
        }
        Self {
            of: Some(skeleton.clone()),
            mesh: Arc::new(bare_wood(skeleton, TRIANGLES)),
        }
    }

    /// The tree in its present pose, its branches in their colours; transparent where it is not.
    pub fn picture(&self, s: &Snapshot, camera: &draw::Camera, theme: Theme) -> Option<draw::Rgba> {
        let skeleton = self.of.as_deref().filter(|_| camera.size.area() > 0)?;
        let mut colours = Vec::with_capacity(skeleton.nodes.len());
        for (i, node) in skeleton.nodes.iter().enumerate() {
            let branch = s.node_colour.get(i).copied().flatten();
            colours.push(theme.wood_rgb(branch, node.copy_of.is_some()));
        }
        let model = draw::Model {
            branch_rgb: &colours,
            ..draw::Model::bare(skeleton, &self.mesh, theme.wood_rgb(None, false))
        };
        let look = draw::Look {
            samples: 1,
            shadow: false,
            thicker_px: 0.5,
        };
        Some(draw::picture(
            &model.posed(s.pose.as_deref(), &[]),
            camera,
            &look,
        ))
    }
}

/// Dots of a cell of braille, across and down.
pub const BRAILLE: Size = Size {
    width: 2,
    height: 4,
};

/// Cells of braille from a picture with [`BRAILLE`] dots in each: letter and mean colour, row by
/// row; `None` where there is no dot.
pub fn braille(picture: &draw::Rgba) -> impl Iterator<Item = Option<(char, [u8; 3])>> + '_ {
    const BITS: [[u32; 2]; 4] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];
    let (columns, rows) = (
        picture.size.width / BRAILLE.width,
        picture.size.height / BRAILLE.height,
    );
    (0..rows).flat_map(move |row| {
        (0..columns).map(move |column| {
            let (mut bits, mut sum, mut n) = (0, [0u32; 3], 0);
            for (y, pair) in (0..).zip(BITS) {
                for (x, bit) in (0..).zip(pair) {
                    let [r, g, b, a] =
                        picture.at(BRAILLE.width * column + x, BRAILLE.height * row + y);
                    if a > 0 {
                        bits |= bit;
                        n += 1;
                        (0..3).for_each(|c| sum[c] += u32::from([r, g, b][c]));
                    }
                }
            }
            let letter = char::from_u32(0x2800 + bits)?;
            (n > 0).then(|| (letter, sum.map(|s| (s / n) as u8)))
        })
    })
}
