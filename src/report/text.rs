//! The table that is printed.

mod compared;

use super::columns::{Table, wrapped};
use super::compare::Comparison;
use super::levels::{Growth, Level, Spread, growth, levels};
use super::pattern::{LevelPeaks, Pattern, pattern};
use super::study::{Branch, Study};
use super::values::{interval, number, percent, spread};
use super::words;
use crate::dynamics::HalfPower;
use crate::model::ModeSummary;
pub use compared::{heading, lost, unmatched};

/// Everything as text, a table a capture, and what compares them; for a terminal of `columns`, if
/// that is not wide enough, without what is needed least.
pub fn text(studies: &[Study], comparison: Option<&Comparison>, columns: Option<usize>) -> String {
    let mut out: Vec<String> = studies.iter().map(|study| one(study, columns)).collect();
    out.extend(comparison.map(|c| compared::compared(studies, c, columns)));
    out.join("\n")
}

fn one(study: &Study, columns: Option<usize>) -> String {
    let Study {
        name,
        source,
        branches,
        ..
    } = study;
    let mut top = format!(
        "{name}: {source}, {}, {}\n",
        words::frames(study),
        words::gaps(study)
    );
    let origin = study.origin.lines();
    if !origin.is_empty() {
        top += &format!("{}\n", origin.join(", "));
    }
    if let Some(verdict) = &study.verdict {
        top += &format!("{} (of the whole capture)\n", verdict.labelled_line());
    }
    top += &format!("{}\n", words::excitation(study));
    let (answers, all) = (study.answers(), words::number_of(branches.len(), "branch"));
    top += &format!(
        "{answers} of {all} have a frequency that this film shows; intervals are 95 %\n\n"
    );
    let metres = study.metres_per_px > 0.0;
    let mut heads = vec![("node", 0), ("branch", 2), ("on", 1), ("points", 7)];
    heads.extend([
        ("frequency, Hz", 0),
        ("damping ratio", 0),
        ("sway, deg", 3),
        ("end, px", 5),
    ]);
    heads.extend(metres.then_some(("end, m", 4)));
    heads.extend([("peak, Hz", 8), ("eq. 6", 8)]);
    let mut table = Table::new(&heads);
    branches.iter().for_each(|b| table.push(row(study, b)));
    let (table, without) = table.within(columns);
    let mut notes = String::new();
    if !without.iter().any(|head| head == "eq. 6") {
        notes += "  peak and eq. 6: the largest peak of the angle's spectrum and its half-power \
                  damping, for reference\n";
    }
    if branches
        .iter()
        .any(|b| b.sway.is_ok() && !b.amplitude_deg.is_finite())
    {
        notes += "  sway -: a branch's points and its angle do not agree on how far it sways\n";
    }
    notes += &left_out(&without);
    let mut out = format!(
        "{}{table}\n{}\n",
        wrapped(&top, columns),
        wrapped(&notes, columns)
    );
    if !study.modes.is_empty() {
        out += &mode_table(&study.modes, columns);
    }
    let by_level = levels(study);
    if by_level.iter().any(|l| l.answers > 0) {
        out += &level_table(&by_level, columns);
        out += &wrapped(&trends(study), columns);
    }
    out + &peak_table(&pattern(study), columns)
}

fn left_out(heads: &[String]) -> String {
    match heads {
        [] => String::new(),
        _ => format!(
            "  for want of room without: {}; a wider terminal or --json has them\n",
            heads.join("; ")
        ),
    }
}

/// The largest peak and its half-power damping, for a branch that has nothing else.
fn peak_words(peak: HalfPower) -> String {
    format!(
        "; peak {} Hz, eq. 6 {}",
        number(peak.peak_hz, 2),
        number(peak.damping_ratio, 3)
    )
}

fn row(study: &Study, branch: &Branch) -> Vec<String> {
    let parent = branch.parent.map_or("foot".into(), |p| p.to_string());
    let mut row = vec![
        branch.name.to_string(),
        branch.piece.clone(),
        parent,
        branch.points.to_string(),
    ];
    match branch.sway {
        Err(_) => {
            let why = branch.why().unwrap_or_default();
            let peak = branch.reference.filter(|_| study.by_markers);
            row.push(format!(
                "  none: {why}{}",
                peak.map_or(String::new(), peak_words)
            ));
        }
        Ok(sway) => {
            row.push(interval(&sway.frequency_hz, 3));
            row.push(
                sway.damping_ratio
                    .map_or("unknown".into(), |d| interval(&d, 3)),
            );
            row.push(number(branch.amplitude_deg, 2));
            row.push(number(branch.amplitude_px(), 1));
            if study.metres_per_px > 0.0 {
                row.push(number(branch.amplitude_px() * study.metres_per_px, 4));
            }
            row.push(number(branch.reference.map_or(f64::NAN, |r| r.peak_hz), 2));
            row.push(number(
                branch.reference.map_or(f64::NAN, |r| r.damping_ratio),
                3,
            ));
        }
    }
    row
}

/// The heads of the table of modes, and how soon each can be spared.
pub const MODE_HEADS: [(&str, u8); 8] = [
    ("mode", 0),
    ("frequency, Hz", 0),
    ("damping ratio", 0),
    ("collinearity", 3),
    ("points", 2),
    ("node", 1),
    ("branch", 0),
    ("energy", 1),
];
/// Trunk and limbs whose share of a mode's energy is printed.
const LIMBS_OF_MODE: usize = 3;

fn mode_table(modes: &[ModeSummary], columns: Option<usize>) -> String {
    let mut table = Table::new(&MODE_HEADS);
    for mode in modes {
        table.push(mode_cells(mode).to_vec());
    }
    let (table, without) = table.within(columns);
    let notes = "  modes of the whole tree; branch: the one whose own mode it is, - where the tree \
                 lacks it; energy: the largest shares of trunk and limbs\n";
    format!(
        "{table}{}\n",
        wrapped(&format!("{notes}{}", left_out(&without)), columns)
    )
}

/// A row of the table of modes, by [`MODE_HEADS`].
pub fn mode_cells(mode: &ModeSummary) -> [String; 8] {
    [
        mode.mode.to_string(),
        interval(&mode.sway.frequency_hz, 3),
        mode.sway
            .damping_ratio
            .map_or("unknown".into(), |d| interval(&d, 3)),
        number(mode.collinearity.unwrap_or(f64::NAN), 2),
        mode.points.to_string(),
        mode.node.map_or("-".into(), |node| node.0.to_string()),
        mode.branch.clone().unwrap_or("-".into()),
        mode.energy_words(LIMBS_OF_MODE),
    ]
}

fn level_table(levels: &[Level], columns: Option<usize>) -> String {
    let heads = [
        ("level", 0),
        ("branches", 2),
        ("answers", 1),
        ("frequency, Hz", 0),
        ("damping ratio", 0),
    ];
    let mut table = Table::new(&heads);
    for l in levels {
        table.push(level_cells(l).to_vec());
    }
    format!("{}  (median, least to largest)\n", table.within(columns).0)
}

/// A row of the table of levels.
pub fn level_cells(level: &Level) -> [String; 5] {
    [
        level.level.to_string(),
        level.branches.to_string(),
        level.answers.to_string(),
        spread_or_dash(level.frequency_hz.as_ref()),
        spread_or_dash(level.damping_ratio.as_ref()),
    ]
}

fn spread_or_dash(of: Option<&Spread>) -> String {
    of.map_or("-".into(), |s| spread(s, 3))
}

/// The heads of the table of dominant peaks, and how soon each can be spared.
pub const PEAK_HEADS: [(&str, u8); 4] = [
    ("level", 0),
    ("order", 2),
    ("branches", 1),
    ("dominant peaks, Hz", 0),
];

fn peak_table(pattern: &Pattern, columns: Option<usize>) -> String {
    let mut out = String::from("\n");
    if !pattern.levels.is_empty() {
        let mut table = Table::new(&PEAK_HEADS);
        for level in &pattern.levels {
            table.push(peak_cells(level).to_vec());
        }
        out += &table.within(columns).0;
        let what = "  peaks of the angle's spectrum that half of the branches of a level have, the \
                    clearest first (Hu et al. sect. 5.4); order: botanical\n";
        out += &wrapped(what, columns);
    }
    out + &wrapped(&format!("  {}\n", words::common_peaks(pattern)), columns)
}

/// A row of the table of dominant peaks, by [`PEAK_HEADS`].
pub fn peak_cells(level: &LevelPeaks) -> [String; 4] {
    let (lowest, highest) = (level.orders.start(), level.orders.end());
    let orders = if lowest == highest {
        lowest.to_string()
    } else {
        format!("{lowest} to {highest}")
    };
    let peaks = level.peaks.iter().map(|p| number(p.frequency_hz, 2));
    let peaks: Vec<String> = peaks.collect();
    let peaks = if peaks.is_empty() {
        "none".into()
    } else {
        peaks.join(", ")
    };
    [
        level.level.to_string(),
        orders,
        level.branches.to_string(),
        peaks,
    ]
}

/// How frequency and damping grow with the level, in words.
pub fn trends(study: &Study) -> String {
    let growths = [
        ("frequency", growth(study, |s| Some(s.frequency_hz.value))),
        (
            "damping",
            growth(study, |s| s.damping_ratio.map(|d| d.value)),
        ),
    ];
    let mut out = String::new();
    for (what, growth) in growths {
        if let Some(growth) = growth {
            out += &format!("  {}\n", trend(what, &growth));
        }
    }
    out
}

/// `frequency by level: +12 % a level (+5 to +20 %, of 9 branches)`, and whether that is more than
/// chance.
pub fn trend(what: &str, growth: &Growth) -> String {
    let chance = if growth.percent.holds(0.0) {
        "; no trend beyond chance"
    } else {
        ""
    };
    format!(
        "{what} by level: {} a level, of {} branches{chance}",
        percent(&growth.percent),
        growth.branches
    )
}
