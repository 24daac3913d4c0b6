//! Made-up captures for the tests of this folder.

use super::{Branch, Study};
use crate::bounds::Bounds;
use crate::model::{Excitation, Interval, Sway, Unidentified};
use nalgebra::Point2;

/// Where the branches of a tree end, and the points on them lie, the trunk's first.
pub const TREE: [Point2<f64>; 6] = [
    Point2::new(0.0, 100.0),
    Point2::new(-80.0, 180.0),
    Point2::new(-40.0, 240.0),
    Point2::new(10.0, 260.0),
    Point2::new(70.0, 230.0),
    Point2::new(90.0, 150.0),
];

/// A tree whose branches end at `tips`, each carried by the trunk, without frequencies.
pub fn study(tips: &[Point2<f64>]) -> Study {
    let branches = tips.iter().enumerate().map(|(i, tip)| Branch {
        name: i as u32 + 1,
        piece: String::new(),
        marker: None,
        order: 0,
        parent: (i > 0).then_some(1),
        level: if i > 0 { 2 } else { 1 },
        points: 9,
        base_from_foot_px: if i > 0 { tips[0] } else { Point2::origin() },
        tip_from_foot_px: *tip,
        centre_from_foot_px: *tip,
        spread_px: 0.0,
        sway: Err(Unidentified::TooShort),
        participation: Vec::new(),
        amplitude_deg: f64::NAN,
        by_points_deg: f64::NAN,
        in_angle_deg: f64::NAN,
        times_s: Vec::new(),
        plane_deg: Vec::new(),
        space_deg: Vec::new(),
        fitted_deg: None,
        spectrum: None,
        reference: None,
        over_background: None,
        way_px: Vec::new(),
    });
    Study {
        name: String::new(),
        source: String::new(),
        origin: Default::default(),
        verdict: None,
        size: [640, 360],
        span_s: Bounds::new(0.0, 1.0),
        frames: 30,
        gaps: Vec::new(),
        onset: None,
        used_s: Bounds::new(0.0, 1.0),
        given: None,
        metres_per_px: 0.0,
        highest_hz: 5.0,
        foot_px: Point2::new(320.0, 340.0),
        outline_px: Vec::new(),
        picture: None,
        by_markers: false,
        branches: branches.collect(),
        modes: Vec::new(),
        notes: Vec::new(),
    }
}

/// Gives a branch a frequency that is known within 1 %, and a damping ratio within 10 %.
pub fn set_frequency(study: &mut Study, branch: usize, frequency_hz: f64) {
    study.branches[branch].sway = Ok(Sway {
        frequency_hz: within(frequency_hz, 0.01),
        damping_ratio: Some(within(0.05, 0.1)),
        excitation: Excitation::Release,
        amplitude_deg: 2.0,
    });
    study.branches[branch].amplitude_deg = 2.0;
}

fn within(value: f64, half: f64) -> Interval {
    Interval {
        value,
        lo: value * (-half).exp(),
        hi: value * half.exp(),
    }
}
