//! The same for programs.

use super::compare::{Change, Comparison, Row};
use super::levels::{Growth, Spread, growth, levels};
use super::matching::Match;
use super::pattern::{CommonPeak, LevelPeaks, Pattern, pattern, peaks_of};
use super::study::{Branch, Gap, Study};
use crate::dynamics::{DominantPeak, FALSE_ALARM, Start};
use crate::model::{Interval, Unidentified};
use serde_json::{Map, Value, json};

/// One object: `captures`, and `comparison`, which is `null` for one capture. What is not known is
/// `null`.
pub fn json(studies: &[Study], comparison: Option<&Comparison>) -> Value {
    json!({
        "captures": studies.iter().map(capture).collect::<Vec<Value>>(),
        "comparison": comparison.map(|c| compared(studies, c)),
    })
}

fn gap(gap: &Gap) -> Value {
    json!({ "after_s": gap.after_s, "length_s": gap.length_s })
}

fn capture(study: &Study) -> Value {
    let onset = study.onset;
    json!({
        "name": study.name,
        "source": study.source,
        "captured_at": study.origin.captured_at,
        "user_notes": study.origin.notes,
        "verdict": study.verdict,
        "from_s": study.span_s.lo,
        "to_s": study.span_s.hi,
        "frames": study.frames,
        "rate_hz": study.rate_hz(),
        "gaps": study.gaps.iter().map(gap).collect::<Vec<Value>>(),
        "excitation": onset.map(|o| o.excitation.word()),
        "excitation_given": study.given.is_some(),
        "from_rest": onset.map(|o| o.start == Start::Rest),
        "released_s": onset.filter(|o| o.excitation == crate::model::Excitation::Release).map(|o| o.at_s),
        "metres_per_px": (study.metres_per_px > 0.0).then_some(study.metres_per_px),
        "branches": study.branches.iter().map(|b| branch(study, b)).collect::<Vec<Value>>(),
        "levels": levels(study).iter().map(|l| json!({
            "level": l.level,
            "branches": l.branches,
            "answers": l.answers,
            "frequency_hz": l.frequency_hz.as_ref().map(spread),
            "damping_ratio": l.damping_ratio.as_ref().map(spread),
        })).collect::<Vec<Value>>(),
        "growth_by_level_percent": {
            "frequency": growth(study, |s| Some(s.frequency_hz.value)).map(grown),
            "damping": growth(study, |s| s.damping_ratio.map(|d| d.value)).map(grown),
        },
        "dominant_peaks": dominant(&pattern(study)),
        "modes": study.modes,
        "notes": study.notes,
    })
}

fn branch(study: &Study, branch: &Branch) -> Value {
    let (sway, tip) = (branch.known(), branch.tip_from_foot_px);
    let metres = (study.metres_per_px > 0.0).then_some(branch.amplitude_px() * study.metres_per_px);
    json!({
        "node_id": branch.name,
        "branch": branch.piece,
        "order": branch.order,
        "parent_id": branch.parent,
        "level": branch.level,
        "points": branch.points,
        "end_px": [study.foot_px.x + tip.x, study.foot_px.y - tip.y],
        "length_px": branch.length_px(),
        "identifiable": sway.is_some(),
        "frequency_hz": sway.map(|s| interval(&s.frequency_hz)),
        "damping_ratio": sway.and_then(|s| s.damping_ratio).map(|d| interval(&d)),
        "amplitude_deg": sway.map(|_| branch.amplitude_deg),
        "amplitude_by_points_deg": sway.map(|_| branch.by_points_deg),
        "amplitude_in_angle_deg": sway.map(|_| branch.in_angle_deg),
        "amplitude_px": sway.map(|_| branch.amplitude_px()),
        "amplitude_m": sway.and(metres),
        "spectrum_peak_hz": branch.reference.map(|r| r.peak_hz),
        "half_power_damping": branch.reference.map(|r| r.damping_ratio),
        "dominant_peaks": branch.over_background.as_ref().map(|_| peaks(&peaks_of(branch))),
        "unidentified": branch.sway.err().map(Unidentified::word),
        "why": branch.why(),
        "participation": branch.participation,
    })
}

fn dominant(pattern: &Pattern) -> Value {
    let common = pattern.common.as_ref().ok();
    json!({
        "false_alarm": FALSE_ALARM,
        "resolution_hz": pattern.resolution_hz,
        "levels": pattern.levels.iter().map(level_peaks).collect::<Vec<Value>>(),
        "common": common.into_iter().flatten().map(common_peak).collect::<Vec<Value>>(),
        "no_common": pattern.common.as_ref().err().map(|why| why.word()),
        "why": pattern.common.as_ref().err().map(|why| why.to_string()),
    })
}

fn level_peaks(level: &LevelPeaks) -> Value {
    json!({
        "level": level.level,
        "orders": level.orders.clone().collect::<Vec<u32>>(),
        "branches": level.branches,
        "peaks": peaks(&level.peaks),
    })
}

fn common_peak(peak: &CommonPeak) -> Value {
    json!({
        "frequency_hz": peak.frequency_hz,
        "over_background": peak.over_background,
        "branches_with": peak.branches_with,
        "branches": peak.branches,
    })
}

fn peaks(of: &[DominantPeak]) -> Value {
    of.iter()
        .map(|p| json!({ "frequency_hz": p.frequency_hz, "over_background": p.over_background }))
        .collect()
}

fn compared(studies: &[Study], comparison: &Comparison) -> Value {
    let rows: Vec<Value> = comparison
        .rows_of_first()
        .map(|row| compared_row(studies, row))
        .collect();
    let (mut found_again, mut not_matched) = (Map::new(), Map::new());
    for (study, share) in studies[1..].iter().zip(&comparison.shares) {
        found_again.insert(study.name.clone(), (*share).into());
    }
    for (study, names) in studies[1..].iter().zip(&comparison.left_over) {
        not_matched.insert(study.name.clone(), names.clone().into());
    }
    json!({
        "same_tree": comparison.same_tree,
        "same_tree_given": comparison.said,
        "found_again": found_again,
        "branches": rows,
        "not_matched": not_matched,
    })
}

fn compared_row(studies: &[Study], row: &Row) -> Value {
    let captures: Vec<Value> = (0..studies.len())
        .map(|k| compared_cell(studies, row, k))
        .collect();
    json!({ "node_id": row.name, "in": captures })
}

/// A branch of the first capture in capture `k`.
fn compared_cell(studies: &[Study], row: &Row, k: usize) -> Value {
    let found = row.matches.get(k);
    let (off, by) = match found {
        Some(Match::Found { off, by, .. }) => (Some(*off), Some(by.word())),
        _ => (None, None),
    };
    let first = row.sway(studies, 0).filter(|_| k > 0);
    let both = first.zip(row.sway(studies, k));
    json!({
        "capture": studies[k].name,
        "node_id": row.branch(studies, k).map(|b| b.name),
        "unclear": matches!(found, Some(Match::Unclear)),
        "matched_by": by,
        "off": off,
        "frequency_change_percent": both.and_then(|(a, b)| Change::of_frequency(&a, &b)).map(|c| change(&c)),
        "damping_change_percent": both.and_then(|(a, b)| Change::of_damping(&a, &b)).map(|c| change(&c)),
    })
}

fn interval(i: &Interval) -> Value {
    json!({ "value": i.value, "lo": i.lo, "hi": i.hi })
}

fn change(c: &Change) -> Value {
    json!({ "value": c.percent.value, "lo": c.percent.lo, "hi": c.percent.hi, "beyond": c.beyond })
}

fn spread(s: &Spread) -> Value {
    json!({ "n": s.n, "median": s.median, "least": s.least, "largest": s.largest })
}

fn grown(g: Growth) -> Value {
    json!({ "value": g.percent.value, "lo": g.percent.lo, "hi": g.percent.hi, "branches": g.branches })
}
