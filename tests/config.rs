//! The shipped configuration file and the tables of the documentation are made from the declared
//! settings, and the declared ranges and effects are those that hold.
//!
//! After a change of a setting, `ARBORCAM_UPDATE=1 cargo test --test config` writes both files
//! again.

use arborcam::config::{self, Config, Effect, SECTIONS, Setting};
use std::collections::BTreeSet;
use std::path::Path;

const SHIPPED: &str = "config/arborcam.toml";
const DOCUMENTED: &str = "docs/settings.md";
/// What stands above the tables in the documentation.
const MADE: &str = "<!-- Made from src/config/settings.rs, see tests/config.rs. -->\n";

fn settings() -> impl Iterator<Item = &'static Setting> {
    SECTIONS.iter().flat_map(|section| section.settings)
}

/// `section.key` of every setting.
fn keys(table: &toml::Table) -> BTreeSet<String> {
    let mut all = BTreeSet::new();
    for (section, value) in table {
        let settings = value
            .as_table()
            .unwrap_or_else(|| panic!("{section} is no section"));
        all.extend(settings.keys().map(|key| format!("{section}.{key}")));
    }
    all
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

/// Holds a file of the repository equal to what the program makes, or writes it.
fn compare(path: &str, made: &str) {
    if std::env::var_os("ARBORCAM_UPDATE").is_some() {
        std::fs::write(path, made).expect("write");
    }
    let text = std::fs::read_to_string(path).expect("file");
    assert_eq!(
        text, made,
        "{path} is not what src/config/settings.rs says; see the top of this file"
    );
}

#[test]
fn the_shipped_file_is_made_from_the_declared_settings() {
    compare(SHIPPED, &config::default_file());
}

#[test]
fn the_documentation_s_tables_are_made_from_the_declared_settings() {
    let text = std::fs::read_to_string(DOCUMENTED).expect("file");
    let (prose, _) = text.split_once(MADE).expect("the line above the tables");
    compare(DOCUMENTED, &format!("{prose}{MADE}{}", config::tables()));
}

/// A setting that nobody explains might as well not be there.
#[test]
fn every_setting_is_explained_with_its_range() {
    // Any whole number from 0 on.
    const WITHOUT_RANGE: [&str; 3] = ["track.anchor_every", "wood.seed", "wind.seed"];
    let defaults = flat(&Config::default());
    for setting in settings() {
        let (key, text) = (setting.key, setting.text());
        assert!(text.len() > 20 && text.ends_with('.'), "{key}: {text}");
        assert!(!text.contains(['|', '\n']), "{key}: {text}");
        assert_eq!(
            setting.range.is_some(),
            defaults[key].is_number() && !WITHOUT_RANGE.contains(&key),
            "{key}"
        );
    }
}

/// Both ends of a declared range are accepted, and nothing beyond them.
#[test]
fn the_declared_ranges_are_the_ranges_that_hold() {
    let defaults = flat(&Config::default());
    let mut checked = 0;
    for setting in settings() {
        let Some(range) = setting.range else {
            continue;
        };
        let step = if defaults[setting.key].is_f64() {
            1e-3
        } else {
            1.0
        };
        for (value, taken) in [
            (range.low, true),
            (range.high, true),
            (range.low - step, false),
            (range.high + step, false),
        ] {
            let shown = if step == 1.0 {
                format!("{value:.0}")
            } else {
                format!("{value:?}")
            };
            // These two bound each other as well: the other one stands where it leaves the whole
            // range.
            let other = match setting.key {
                "accumulate.window_s" => "min_s = 0.2\n",
                "accumulate.min_s" => "window_s = 120.0\n",
                _ => "",
            };
            let (section, name) = setting.key.split_once('.').expect("section.name");
            let text = format!("[{section}]\n{name} = {shown}\n{other}");
            assert_eq!(
                Config::parse(&text, "file").is_ok(),
                taken,
                "{} = {shown}, declared: {}",
                setting.key,
                range.words
            );
        }
        checked += 1;
    }
    assert!(checked >= 65, "only {checked} settings have a range");
}

/// One message for each way in which a range is declared, and for no number.
#[test]
fn a_value_out_of_range_is_refused_with_what_is_allowed() {
    for (entry, message) in [
        (
            "[camera]\nwidth = 8",
            "camera.width = 8 is out of range; allowed: 16 to 16384",
        ),
        (
            "[track]\nwindow_px = 16",
            "track.window_px = 16 is out of range; allowed: an odd number",
        ),
        (
            "[track]\nfb_limit_px = 0.0",
            "track.fb_limit_px = 0 is out of range; allowed: greater than 0",
        ),
        (
            "[detect]\nquality = 0.0",
            "detect.quality = 0 is out of range; allowed: above 0, at most 1",
        ),
        (
            "[hierarchy]\nagreement = -1.5",
            "hierarchy.agreement = -1.5 is out of range; allowed: -1 to 1",
        ),
        (
            "[skeleton]\nfold = 1.0",
            "skeleton.fold = 1 is out of range; allowed: 0 to 0.95",
        ),
        (
            "[skeleton]\nstrokes_px = [[[1.0, 2.0], [3.0, 4.0]], [[1.0, 2.0]]]",
            "skeleton.strokes_px = 1 is out of range; allowed: 2 to 1000 points in each line",
        ),
        (
            "[skeleton]\nstrokes_px = [[[1.0, 2.0], [3.0, inf]]]",
            "skeleton.strokes_px = inf is out of range; allowed: finite numbers",
        ),
        (
            "[wood]\ntwig_px = -1.0",
            "wood.twig_px = -1 is out of range; allowed: 0 (no twigs) to 500",
        ),
        (
            "[motion]\nmax_step_deg = nan",
            "motion.max_step_deg = NaN is out of range; allowed: 0.01 to 180",
        ),
        (
            "[export]\nmetres_per_px = -1.0",
            "export.metres_per_px = -1 is out of range; allowed: 0 (pixels) or more",
        ),
    ] {
        let error = Config::parse(entry, "file").expect_err(entry);
        assert_eq!(error.to_string(), format!("configuration: {message}"));
    }
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
    let mut all = std::collections::BTreeMap::new();
    for (section, settings) in value.as_object().expect("sections") {
        for (key, value) in settings.as_object().expect("a section") {
            all.insert(format!("{section}.{key}"), value.clone());
        }
    }
    all
}

fn number(value: &serde_json::Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
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
    let found: Vec<_> = default
        .iter()
        .filter(|(key, from)| profile[*key] != **from)
        .map(|(key, from)| (key.clone(), number(from), number(&profile[key])))
        .collect();
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
    for setting in settings() {
        assert!(
            all.contains_key(setting.key),
            "{} is no setting",
            setting.key
        );
    }
    // What changes while frames flow, and loses none: of filming these, and all of the wind.
    let now: Vec<&str> = settings()
        .filter(|setting| setting.effect == Effect::Now && !setting.key.starts_with("wind."))
        .map(|setting| setting.key)
        .collect();
    assert_eq!(
        now,
        [
            "camera.timeout_s",
            "camera.reconnect",
            "camera.retry_delay_s"
        ]
    );
    let wind = settings().filter(|setting| setting.key.starts_with("wind."));
    for setting in wind {
        assert_eq!(setting.effect, Effect::Now, "{}", setting.key);
    }
}

/// A file lies over the settings of a capture as over the defaults, the command line over both.
#[test]
fn the_command_line_overrides_the_file_and_the_file_what_is_below() {
    let dir = tempfile::tempdir().expect("tempdir");
    let file = dir.path().join("mine.toml");
    std::fs::write(&file, "[shape]\nplanes = 2\npasses = 1\n").expect("write");
    let mut own = Config::default();
    (own.shape.planes, own.shape.attractors) = (5, 99);
    let config = own
        .layered(Some(&file), |c| c.shape.passes = 7)
        .expect("all in range");
    let mut expected = own.clone();
    (expected.shape.planes, expected.shape.passes) = (2, 7);
    assert_eq!(config, expected);
    assert_eq!(own.layered(None, |_| {}).expect("as it is"), own);
    let error = own
        .layered(Some(&file), |c| c.shape.planes = 0)
        .expect_err("no plane");
    assert!(error.to_string().contains("shape.planes = 0"), "{error}");
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
