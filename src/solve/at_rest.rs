//! The outline where the tree rests. It was drawn in one picture, in which the tree may have been
//! pulled aside or blown over.

use crate::hierarchy::rest_position_px;
use crate::model::{Outline, Size, TrackLog, TrackTable};
use crate::motion::Spread;
use nalgebra::{Point2, Vector2};

/// Rounds in which the place at rest is found that moves to a given one.
const ROUNDS: usize = 8;

/// `outline` carried along from the pose in which the first points of `log` were found to the rest
/// pose, as the points of the rows `moving` of `table` say. As it is where that pose is no longer
/// remembered, or where no point was seen in it.
pub(super) fn at_rest(
    outline: &Outline,
    log: &TrackLog,
    table: &TrackTable,
    moving: &[usize],
    foot_px: Point2<f64>,
) -> Outline {
    let Some(first) = log.first_of_film() else {
        return outline.clone();
    };
    let (mut rest_px, mut displacements) = (Vec::new(), Vec::new());
    for &row in moving {
        let id = table.ids[row];
        if let Ok(k) = first.observations.binary_search_by_key(&id, |o| o.id) {
            let at_rest_px = rest_position_px(table, row);
            rest_px.push(at_rest_px);
            displacements.push(Some(first.observations[k].at_px() - at_rest_px));
        }
    }
    let Some(spread) = Spread::new(outline.size, &rest_px, foot_px) else {
        return outline.clone();
    };
    let field = spread.displacements(&displacements);
    Outline {
        size: outline.size,
        mask: carried(&outline.mask, &field, outline.size),
        matte: outline
            .matte
            .as_ref()
            .map(|matte| carried(matte, &field, outline.size)),
        polygon_px: polygon_at_rest(outline, &field),
        other_foot_px: outline.other_foot_px,
    }
}

/// A picture of this size, each pixel from where it was displaced to by `field`.
fn carried(picture: &[u8], field: &[Vector2<f32>], size: Size) -> Vec<u8> {
    let (width, height) = (size.width as usize, size.height as usize);
    let mut out = Vec::with_capacity(picture.len());
    for v in 0..height {
        for u in 0..width {
            let moved = field[v * width + u];
            let from_u = nearest(u as f32 + moved.x, width);
            let from_v = nearest(v as f32 + moved.y, height);
            out.push(picture[from_v * width + from_u]);
        }
    }
    out
}

/// The pixel nearest to `at` among `n`.
fn nearest(at: f32, n: usize) -> usize {
    (at.round().max(0.0) as usize).min(n.saturating_sub(1))
}

/// The corners of the polygon at the places that `field` displaces to where they are.
fn polygon_at_rest(outline: &Outline, field: &[Vector2<f32>]) -> Vec<Point2<i32>> {
    let (width, height) = (outline.size.width as usize, outline.size.height as usize);
    let mut polygon_px = Vec::with_capacity(outline.polygon_px.len());
    for corner in &outline.polygon_px {
        let is = corner.cast::<f32>();
        let mut rest = is;
        for _ in 0..ROUNDS {
            let (u, v) = (nearest(rest.x, width), nearest(rest.y, height));
            rest = is - field[v * width + u];
        }
        let (u, v) = (nearest(rest.x, width), nearest(rest.y, height));
        polygon_px.push(Point2::new(u as i32, v as i32));
    }
    polygon_px
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Observation, TrackId, TrackSet};

    const SIZE: Size = Size {
        width: 120,
        height: 100,
    };
    const FOOT: Point2<f64> = Point2::new(60.0, 99.0);

    /// A crown between 40 and 80 px from the left at rest, which leans by 15 px in the picture in
    /// which it was drawn.
    fn leaning_outline() -> Outline {
        let mut mask = vec![0; SIZE.area()];
        for v in 10..100 {
            let lean = 15.0 * (99.0 - v as f64) / 90.0;
            for u in 0..120 {
                let rest = u as f64 - lean;
                let half_px = if v < 60 { 20.0 } else { 4.0 };
                if (rest - 60.0).abs() <= half_px {
                    mask[v * 120 + u] = 255;
                }
            }
        }
        Outline {
            size: SIZE,
            mask,
            polygon_px: vec![Point2::new(95, 10)],
            matte: None,
            other_foot_px: None,
        }
    }

    /// Points over the crown that swing about their rest for three sways, from the lean on.
    fn log() -> TrackLog {
        let mut log = TrackLog::new(100.0);
        for frame in 0..=180u32 {
            let swing = (f64::from(frame) / 180.0 * 6.0 * std::f64::consts::PI).cos();
            let observation = |id: u32| {
                let (u, v) = (
                    42.0 + f64::from(id % 5) * 9.0,
                    12.0 + f64::from(id / 5) * 8.0,
                );
                let lean = 15.0 * (99.0 - v) / 90.0;
                Observation {
                    id: TrackId(id),
                    u_px: (u + lean * swing) as f32,
                    v_px: v as f32,
                    fb_error_px: 0.0,
                    error_px: None,
                    confirmed: true,
                    depth: None,
                }
            };
            log.push(TrackSet {
                frame: frame.into(),
                time_s: f64::from(frame) / 30.0,
                observations: (0..30).map(observation).collect(),
                ..TrackSet::default()
            });
        }
        log
    }

    fn middle_of_row(outline: &Outline, v: u32) -> f64 {
        let inside = (0..SIZE.width).filter(|u| outline.has(*u, v));
        let all: Vec<f64> = inside.map(f64::from).collect();
        all.iter().sum::<f64>() / all.len() as f64
    }

    #[test]
    fn an_outline_of_a_pulled_tree_stands_up() {
        let (drawn, log) = (leaning_outline(), log());
        let table = crate::hierarchy::table(log.all());
        let rows: Vec<usize> = (0..table.ids.len()).collect();
        let rest = at_rest(&drawn, &log, &table, &rows, FOOT);
        for v in [20, 35, 55, 80] {
            let (is, was) = (middle_of_row(&rest, v), middle_of_row(&drawn, v));
            assert!((is - 60.0).abs() < 3.0, "row {v}: {was} to {is}");
        }
        // Above the highest points the field goes no farther than they do.
        let corner = rest.polygon_px[0];
        assert!((corner.x - 80).abs() <= 3, "{corner}");
    }

    #[test]
    fn it_stays_where_its_picture_is_forgotten_or_nothing_moves() {
        let drawn = leaning_outline();
        let mut short = TrackLog::new(1.0);
        for set in log().drain() {
            short.push(TrackSet::clone(&set));
        }
        let table = crate::hierarchy::table(short.all());
        let rows: Vec<usize> = (0..table.ids.len()).collect();
        assert_eq!(at_rest(&drawn, &short, &table, &rows, FOOT), drawn);
        assert_eq!(at_rest(&drawn, &log(), &table, &[], FOOT), drawn);
    }
}
