//! What a capture is judged by: the facts of one that is at its end.

use super::finish::{CaptureJob, timing};
use crate::model::{
    CaptureFacts, PointFacts, Rgb, Skeleton, SwayFacts, Swaying, Unidentified, Verdict,
};
use crate::signal::statistics::quantile;
use crate::solve::Model;

/// Share of the points that move less than a capture is said to move: trunk and limbs near it hold
/// most of the points and hardly move, the quarter farthest out tells the sway.
const QUIETER: f64 = 0.75;

/// Level of the trunk.
const TRUNK: u8 = 1;

/// What a capture is worth whose tree is `tree`, with its sway where that was analysed.
pub fn verdict(job: &CaptureJob, tree: Option<&Model>) -> Verdict {
    Verdict::of(&facts(job, tree))
}

fn facts(job: &CaptureJob, tree: Option<&Model>) -> CaptureFacts {
    let (timing, quality) = (timing(job), job.quality.figures(tree));
    let shaking = job.quality.shaking().so_far();
    let mut log = job.log.clone();
    log.close();
    let amplitudes_px = log.last(job.config.dynamics.window_s).amplitudes_px();
    CaptureFacts {
        amplitude_px: quantile(amplitudes_px, QUIETER),
        filmed_s: (timing.duration_s - timing.away_s) * (1.0 - shaking.lost_share),
        rate_hz: timing.measured_rate_hz,
        highest_hz: job.config.dynamics.highest_hz,
        points: PointFacts {
            followed: quality.tracks_total,
            alive: quality.tracks_alive_end,
            lost_per_s: quality.lost_per_s,
        },
        brightness: job.picture.as_ref().and_then(|p| mean_grey(&p.rgb)),
        foot: tree.map(|tree| tree.foot.basis),
        sway: tree.and_then(|tree| sway(&tree.skeleton, &tree.modes)),
        shake: shaking.shake,
        is_camera_unknown: !shaking.is_known(),
        camera_moved_at_s: shaking.lost_since_s,
    }
}

/// What was found of the sway, by node index; `None` where some of it was not looked at.
fn sway(skeleton: &Skeleton, modes: &[Swaying]) -> Option<SwayFacts> {
    let mut facts = SwayFacts::default();
    for node in skeleton.measured_branches() {
        match modes.get(node.index())? {
            Err(Unidentified::NotInTime) => return None,
            Err(Unidentified::NotMeasured) => continue,
            Err(_) => {}
            Ok(sway) => {
                facts.identified += 1;
                if skeleton.nodes[node.index()].level == TRUNK {
                    facts.trunk_hz = Some(sway.frequency_hz.value);
                }
            }
        }
        facts.branches += 1;
    }
    Some(facts)
}

/// Mean grey of a picture, 0 to 255; `None` without a pixel.
fn mean_grey(rgb: &Rgb) -> Option<f64> {
    let sum: u64 = rgb.pixels.iter().map(|value| u64::from(*value)).sum();
    let values = rgb.pixels.len();
    (values > 0).then(|| sum as f64 / values as f64)
}
