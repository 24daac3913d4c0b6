//! The shipped configuration file is the documentation of the settings: it must name all of them,
//! and as they are.

use arborcam::config::{self, Config};
use std::collections::BTreeSet;
use std::path::Path;

const SHIPPED: &str = "config/arborcam.toml";

/// `section.key` of every setting.
fn keys(table: &toml::Table) -> BTreeSet<String> {
    let of_section = |(section, value): (&String, &toml::Value)| -> Vec<String> {
        let keys = value
            .as_table()
            .unwrap_or_else(|| panic!("{section} is no section"))
            .keys();
        keys.map(|key| format!("{section}.{key}")).collect()
    };
    table.iter().flat_map(of_section).collect()
}

#[test]
fn the_shipped_file_is_the_defaults_and_names_every_setting() {
    assert_eq!(
        Config::load(Path::new(SHIPPED)).expect("it loads"),
        Config::default()
    );
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
        let above = lines[..i]
            .iter()
            .rev()
            .find(|l| !l.contains(" = "))
            .expect("a line above");
        assert!(
            above.starts_with("# ") && above.len() > 20,
            "line {}: {line} has no comment",
            i + 1
        );
    }
}

/// The range in the comment is the range that is enforced: both ends are taken, beyond them nothing
/// is.
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
            let shown = |x: f64| {
                if whole {
                    format!("{x:.0}")
                } else {
                    format!("{x:?}")
                }
            };
            let step = if whole { 1.0 } else { 1e-3 };
            for (value, taken) in [
                (low, true),
                (high, true),
                (low - step, false),
                (high + step, false),
            ] {
                if key == "window_px" && value == 4.0 || whole && value < 0.0 {
                    continue; // refused for other reasons
                }
                // These two bound each other as well: the other one stands where it leaves the
                // whole range.
                let other = match (section.as_str(), key) {
                    ("accumulate", "window_s") => "min_s = 0.2\n",
                    ("accumulate", "min_s") => "window_s = 120.0\n",
                    _ => "",
                };
                let text = format!("[{section}]\n{key} = {}\n{other}", shown(value));
                let config: Config = toml::from_str(&text).expect("TOML");
                assert_eq!(
                    config.check().is_ok(),
                    taken,
                    "{section}.{key} = {value}, told: {low} to {high}"
                );
            }
            checked += 1;
        }
    }
    assert!(
        checked >= 20,
        "only {checked} ranges were found in the comments"
    );
}

/// `…, 0.1 to 60.` or `…, -1 (none) to 1.` in a comment.
fn told_range(comment: &str) -> Option<(f64, f64)> {
    let words: Vec<&str> = comment
        .split([' ', ','])
        .filter(|w| !w.is_empty() && !w.starts_with('('))
        .collect();
    let number = |w: &&str| w.trim_end_matches('.').parse::<f64>().ok();
    let at = words.windows(3).find_map(|w| {
        Some((number(&w[0])?, w[1], number(&w[2])?)).filter(|(_, to, _)| *to == "to")
    });
    // "300 to 400" is what the papers take.
    at.filter(|_| !comment.contains("above 0 to"))
        .map(|(low, _, high)| (low, high))
}

/// Memory that is shorter than the wait would never see enough: no tree would ever be built, and
/// nothing say why.
#[test]
fn a_wait_longer_than_the_memory_is_refused() {
    let config: Config = toml::from_str("[accumulate]\nwindow_s = 5.0\n").expect("TOML");
    let message = config.check().expect_err("8 s of 5 s").to_string();
    assert!(
        message.contains("accumulate.min_s") && message.contains("accumulate.window_s"),
        "{message}"
    );
}

/// `section.key = value` of every setting, as JSON.
fn flat(config: &Config) -> std::collections::BTreeMap<String, serde_json::Value> {
    let value = serde_json::to_value(config).expect("JSON");
    let of_section =
        |(section, settings): (&String, &serde_json::Value)| -> Vec<(String, serde_json::Value)> {
            let settings = settings.as_object().expect("a section");
            settings
                .iter()
                .map(|(key, value)| (format!("{section}.{key}"), value.clone()))
                .collect()
        };
    value
        .as_object()
        .expect("sections")
        .iter()
        .flat_map(of_section)
        .collect()
}

/// The profile for a small board differs in exactly this; whoever changes a default must look here
/// whether the profile still makes sense. It names nothing that is not different, and gives a
/// reason for everything that is.
#[test]
fn the_small_board_s_profile_differs_where_it_says() {
    const DIFFERENT: &[(&str, f64, f64)] = &[
        ("camera.height", 720.0, 480.0),
        ("camera.width", 1280.0, 640.0),
        ("detect.points", 400.0, 200.0),
        ("dynamics.every_s", 1.0, 5.0),
        ("dynamics.window_s", 60.0, 30.0),
        ("export.animation_s", 60.0, 30.0),
        ("hierarchy.levels", 7.0, 6.0),
        ("shape.attractors", 256.0, 128.0),
        ("shape.planes", 3.0, 2.0),
        ("track.anchor_every", 2.0, 4.0),
        ("track.levels", 3.0, 2.0),
    ];
    let path = Path::new("config/sbc.toml");
    let (profile, default) = (
        flat(&Config::load(path).expect("it loads")),
        flat(&Config::default()),
    );
    let number = |v: &serde_json::Value| v.as_f64().unwrap_or(f64::NAN);
    let differs = |(key, from): (&String, &serde_json::Value)| {
        (profile[key] != *from).then(|| (key.clone(), number(from), number(&profile[key])))
    };
    let found: Vec<_> = default.iter().filter_map(differs).collect();
    let stated: Vec<_> = DIFFERENT
        .iter()
        .map(|(k, a, b)| ((*k).to_owned(), *a, *b))
        .collect();
    assert_eq!(found, stated);
    let text = std::fs::read_to_string(path).expect("file");
    let named = keys(&text.parse().expect("TOML"));
    assert_eq!(named, stated.into_iter().map(|(key, ..)| key).collect());
    let lines: Vec<&str> = text.lines().collect();
    for (i, line) in lines.iter().enumerate().filter(|(_, l)| l.contains(" = ")) {
        let above = lines[..i]
            .iter()
            .rev()
            .find(|l| !l.contains(" = "))
            .expect("a line above");
        assert!(
            above.starts_with("# ") && above.len() > 20,
            "line {}: {line} has no reason",
            i + 1
        );
    }
}

/// A reload must have an answer for every setting, and name none that is not there.
#[test]
fn every_setting_says_when_a_change_counts() {
    let all = flat(&Config::default());
    for key in all.keys() {
        assert!(config::effect(key).is_some(), "{key}");
    }
    for (name, _) in config::EFFECTS {
        let known = all
            .keys()
            .any(|key| key == name || key.starts_with(&format!("{name}.")));
        assert!(known, "{name} is no setting");
    }
}

#[test]
fn a_reload_takes_what_loses_nothing_and_names_the_rest() {
    let (before, mut wanted) = (Config::default(), Config::default());
    (
        wanted.camera.timeout_s,
        wanted.camera.width,
        wanted.hierarchy.levels,
    ) = (9.0, 640, 5);
    let (after, changes) = before.reload(&wanted);
    let mut expected = before.clone();
    expected.camera.timeout_s = 9.0;
    assert_eq!(after, expected);
    let lines: Vec<String> = changes.iter().map(ToString::to_string).collect();
    assert_eq!(lines[0], "camera.timeout_s is now 9.0 (was 3.0)");
    assert!(
        lines[1].starts_with("camera.width stays 1280; 640 counts from the next start: "),
        "{}",
        lines[1]
    );
    assert!(
        lines[2].starts_with("hierarchy.levels stays 7; 5 counts from the next start: "),
        "{}",
        lines[2]
    );
    assert_eq!(lines.len(), 3);
    // What had to wait is still not what the file says, and is told again.
    assert_eq!(after.reload(&wanted).1.len(), 2);
    assert_eq!(before.reload(&before), (before.clone(), Vec::new()));
}
