//! The shipped configuration file is the documentation of the settings: it must name all of them, and as they are.

use arborcam::config::Config;
use std::collections::BTreeSet;
use std::path::Path;

const SHIPPED: &str = "config/arborcam.toml";

/// `section.key` of every setting.
fn keys(table: &toml::Table) -> BTreeSet<String> {
    let of_section = |(section, value): (&String, &toml::Value)| -> Vec<String> {
        let keys = value.as_table().unwrap_or_else(|| panic!("{section} is no section")).keys();
        keys.map(|key| format!("{section}.{key}")).collect()
    };
    table.iter().flat_map(of_section).collect()
}

#[test]
fn the_shipped_file_is_the_defaults_and_names_every_setting() {
    assert_eq!(Config::load(Path::new(SHIPPED)).expect("it loads"), Config::default());
    let text = std::fs::read_to_string(SHIPPED).expect("file");
    let shipped = keys(&text.parse().expect("TOML"));
    let all = keys(&toml::Table::try_from(Config::default()).expect("a table"));
    assert_eq!(shipped, all);
}

/// A setting that nobody explains might as well not be there.
#[test]
fn every_setting_is_explained_with_its_range() {
    let text = std::fs::read_to_string(SHIPPED).expect("file");
    let lines: Vec<&str> = text.lines().collect();
    for (i, line) in lines.iter().enumerate().filter(|(_, l)| l.contains(" = ")) {
        let above = lines[..i].iter().rev().find(|l| !l.contains(" = ")).expect("a line above");
        assert!(above.starts_with("# ") && above.len() > 20, "line {}: {line} has no comment", i + 1);
    }
}

/// The range in the comment is the range that is enforced: both ends are taken, beyond them nothing is.
#[test]
fn the_ranges_that_are_told_are_the_ranges_that_hold() {
    let text = std::fs::read_to_string(SHIPPED).expect("file");
    let (mut section, mut range, mut checked) = (String::new(), None, 0);
    for line in text.lines() {
        if let Some(name) = line.strip_prefix('[') {
            section = name.trim_end_matches(']').to_owned();
        } else if let Some(comment) = line.strip_prefix("# ") {
            range = told_range(comment);
        } else if let (Some((key, default)), Some((low, high))) = (line.split_once(" = "), range) {
            let whole = !default.contains('.');
            let shown = |x: f64| if whole { format!("{x:.0}") } else { format!("{x:?}") };
            let step = if whole { 1.0 } else { 1e-3 };
            for (value, taken) in [(low, true), (high, true), (low - step, false), (high + step, false)] {
                if key == "window_px" && value == 4.0 || whole && value < 0.0 {
                    continue; // refused for other reasons
                }
                // These two bound each other as well: the other one stands where it leaves the whole range.
                let other = match (section.as_str(), key) {
                    ("accumulate", "window_s") => "min_s = 0.2\n",
                    ("accumulate", "min_s") => "window_s = 120.0\n",
                    _ => "",
                };
                let text = format!("[{section}]\n{key} = {}\n{other}", shown(value));
                let config: Config = toml::from_str(&text).expect("TOML");
                assert_eq!(config.check().is_ok(), taken, "{section}.{key} = {value}, told: {low} to {high}");
            }
            checked += 1;
        }
    }
    assert!(checked >= 20, "only {checked} ranges were found in the comments");
}

/// `…, 0.1 to 60.` or `…, -1 (none) to 1.` in a comment.
fn told_range(comment: &str) -> Option<(f64, f64)> {
    let words: Vec<&str> = comment.split([' ', ',']).filter(|w| !w.is_empty() && !w.starts_with('(')).collect();
    let number = |w: &&str| w.trim_end_matches('.').parse::<f64>().ok();
    let at =
        words.windows(3).find_map(|w| Some((number(&w[0])?, w[1], number(&w[2])?)).filter(|(_, to, _)| *to == "to"));
    // "300 to 400" is what the papers take.
    at.filter(|_| !comment.contains("above 0 to")).map(|(low, _, high)| (low, high))
}

/// Memory that is shorter than the wait would never see enough: no tree would ever be built, and nothing say why.
#[test]
fn a_wait_longer_than_the_memory_is_refused() {
    let config: Config = toml::from_str("[accumulate]\nwindow_s = 5.0\n").expect("TOML");
    let message = config.check().expect_err("8 s of 5 s").to_string();
    assert!(message.contains("accumulate.min_s") && message.contains("accumulate.window_s"), "{message}");
}
