//! The pattern across the levels of one tree (Hu et al. sect. 5.4).

use super::{cells, figure};
use crate::model::{Interval, Sway};
use crate::report::levels::{Growth, Level, Spread, growth, levels};
use crate::report::plot::{Mark, Slot, across};
use crate::report::study::Study;
use crate::report::text::{spread, trend};

/// Plots and a table of frequency and damping by level; nothing without answers.
pub fn levels_part(study: &Study) -> String {
    let levels = levels(study);
    if study.answers() == 0 {
        return String::new();
    }
    let frequency = |s: &Sway| Some(s.frequency_hz);
    let damping = |s: &Sway| s.damping_ratio;
    let plots = figure(
        across(
            &by_level(&[study], &frequency),
            "level",
            "frequency, Hz",
            "Frequency by level",
        ),
        &told("frequency", growth(study, |s| Some(s.frequency_hz.value))),
    ) + &figure(
        across(
            &by_level(&[study], &damping),
            "level",
            "damping ratio",
            "Damping by level",
        ),
        &told(
            "damping",
            growth(study, |s| s.damping_ratio.map(|d| d.value)),
        ),
    );
    format!(
        "<h3>Pattern across levels</h3><div class=\"plots\">{plots}</div>{}",
        table(&levels)
    )
}

/// The answers of every level, those of several captures beside each other.
pub fn by_level(studies: &[&Study], of: &dyn Fn(&Sway) -> Option<Interval>) -> Vec<Slot> {
    let highest = studies
        .iter()
        .flat_map(|s| s.branches.iter().map(|b| b.level))
        .max()
        .unwrap_or(0);
    let marks = |level: u8| {
        let of_study = |(kind, study): (usize, &&Study)| {
            let known = study
                .branches
                .iter()
                .filter(|b| b.level == level)
                .filter_map(|b| of(&b.known()?));
            let mut all: Vec<Interval> = known.collect();
            all.sort_by(|a, b| a.value.total_cmp(&b.value));
            all.into_iter()
                .map(|of| Mark { of, kind })
                .collect::<Vec<Mark>>()
        };
        studies.iter().enumerate().flat_map(of_study).collect()
    };
    (1..=highest)
        .map(|level| Slot {
            name: level.to_string(),
            marks: marks(level),
        })
        .collect()
}

fn told(what: &str, growth: Option<Growth>) -> String {
    let trend = growth.map_or("too few answers for a trend".into(), |g| trend(what, &g));
    format!("Each branch with its interval; {trend}.")
}

fn table(levels: &[Level]) -> String {
    let head = [
        "level",
        "branches",
        "answers",
        "frequency, Hz",
        "damping ratio",
    ]
    .map(String::from);
    let of = |s: &Option<Spread>| s.as_ref().map_or("-".into(), |s| spread(s, 3));
    let row = |l: &Level| {
        let row = [
            l.level.to_string(),
            l.branches.to_string(),
            l.answers.to_string(),
            of(&l.frequency_hz),
            of(&l.damping_ratio),
        ];
        format!("<tr>{}</tr>", cells("td", "n", &row))
    };
    format!(
        "<div class=\"wide\"><table><caption>Median, and least to largest</caption><tr>{}</tr>{}</table></div>",
        cells("th", "n", &head),
        levels.iter().map(row).collect::<String>()
    )
}
