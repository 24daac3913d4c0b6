//! The pattern across the levels of one tree (Hu et al. sect. 5.4).

use super::{ValueOf, cells, damping_of, figure, frequency_of};
use crate::model::Interval;
use crate::report::levels::{Growth, Level, growth, levels};
use crate::report::plot::{Mark, Slot, across};
use crate::report::study::Study;
use crate::report::text::{level_cells, trend};

/// Plots and a table of frequency and damping by level; nothing without answers.
pub fn levels_part(study: &Study) -> String {
    let levels = levels(study);
    if study.answers() == 0 {
        return String::new();
    }
    let plots = figure(
        across(
            &by_level(&[study], frequency_of),
            "level",
            "frequency, Hz",
            "Frequency by level",
        ),
        &told("frequency", growth(study, |s| Some(s.frequency_hz.value))),
    ) + &figure(
        across(
            &by_level(&[study], damping_of),
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
pub fn by_level(studies: &[&Study], of: ValueOf) -> Vec<Slot> {
    let highest = studies
        .iter()
        .flat_map(|s| s.branches.iter().map(|b| b.level))
        .max()
        .unwrap_or(0);
    let mut slots = Vec::with_capacity(highest.into());
    for level in 1..=highest {
        let mut marks = Vec::new();
        for (kind, study) in studies.iter().enumerate() {
            let known = of_level(study, level, of);
            marks.extend(known.into_iter().map(|of| Mark { of, kind }));
        }
        slots.push(Slot {
            name: level.to_string(),
            marks,
        });
    }
    slots
}

/// The known values of one level, the least first.
fn of_level(study: &Study, level: u8, of: ValueOf) -> Vec<Interval> {
    let branches = study.branches.iter().filter(|b| b.level == level);
    let mut all: Vec<Interval> = branches.filter_map(|b| of(&b.known()?)).collect();
    all.sort_by(|a, b| a.value.total_cmp(&b.value));
    all
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
    let mut rows = String::new();
    for level in levels {
        rows += &format!("<tr>{}</tr>", cells("td", "n", &level_cells(level)));
    }
    format!(
        "<div class=\"wide\"><table><caption>Median, and least to largest</caption><tr>{}</tr>{rows}</table></div>",
        cells("th", "n", &head),
    )
}
