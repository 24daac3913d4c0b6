//! Dark, light or undecided: the local threshold of Wang and Olson 2016 sect. III.A.

use crate::model::Luma;

/// Side of a tile, px.
const TILE_PX: usize = 4;
/// Tiles in which brightness differs by less than this are undecided, grey levels (as in AprilTag).
const LEAST_CONTRAST: u8 = 20;

/// Which pixels are darker than the middle between the darkest and the brightest pixel around them.
pub fn dark_pixels(luma: &Luma) -> Vec<bool> {
    let (width, height) = (luma.size.width as usize, luma.size.height as usize);
    let (columns, rows) = (width.div_ceil(TILE_PX), height.div_ceil(TILE_PX));
    let tiles = tile_extremes(luma, columns, rows);
    let mut dark = vec![false; width * height];
    for row in 0..rows {
        for column in 0..columns {
            let around = around(&tiles, columns, rows, column, row);
            if around.high - around.low < LEAST_CONTRAST {
                continue;
            }
            let middle = around.low + (around.high - around.low) / 2;
            for v in row * TILE_PX..((row + 1) * TILE_PX).min(height) {
                for u in column * TILE_PX..((column + 1) * TILE_PX).min(width) {
                    dark[v * width + u] = luma.pixels[v * width + u] <= middle;
                }
            }
        }
    }
    dark
}

/// The darkest and the brightest pixel of some part of a picture.
#[derive(Clone, Copy)]
struct Extremes {
    low: u8,
    high: u8,
}

impl Extremes {
    const NONE: Self = Self {
        low: u8::MAX,
        high: 0,
    };

    fn and(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }
}

fn tile_extremes(luma: &Luma, columns: usize, rows: usize) -> Vec<Extremes> {
    let width = luma.size.width as usize;
    let mut tiles = vec![Extremes::NONE; columns * rows];
    for (k, &value) in luma.pixels.iter().enumerate() {
        let tile = k / width / TILE_PX * columns + k % width / TILE_PX;
        let one = Extremes {
            low: value,
            high: value,
        };
        tiles[tile] = tiles[tile].and(one);
    }
    tiles
}

/// Those of a tile and the eight around it.
fn around(tiles: &[Extremes], columns: usize, rows: usize, column: usize, row: usize) -> Extremes {
    let mut all = Extremes::NONE;
    for r in row.saturating_sub(1)..(row + 2).min(rows) {
        for c in column.saturating_sub(1)..(column + 2).min(columns) {
            all = all.and(tiles[r * columns + c]);
        }
    }
    // Of a picture of no pixels.
    if all.low > all.high {
        return Extremes { low: 0, high: 0 };
    }
    all
}
