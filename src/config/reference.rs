//! The settings as users read them: the shipped file, the tables of the documentation, help texts.

use super::setting::{Choice, Range, Setting, SettingValue};
use super::settings::{Config, SECTIONS};

/// Width of the shipped file, characters.
const WIDTH: usize = 100;

const FILE_HEAD: &str = r#"# arborcam: every setting with its default.
#
#     arborcam replay CLIP --config arborcam.toml
#
# A file needs only the lines that differ; the command line overrides the file. Lengths marked "at
# 640 px" are for a picture 640 pixels wide and grow with the picture. An unknown name is an error.
"#;

/// The shipped configuration file: every setting with its default, its text and what is allowed.
pub fn default_file() -> String {
    let config = Config::default();
    let mut values = config.values().into_iter();
    let mut file = FILE_HEAD.to_owned();
    for section in SECTIONS {
        file += "\n";
        comment(&mut file, &section.text());
        file += &format!("[{}]\n", section.name);
        for (setting, value) in section.settings.iter().zip(&mut values) {
            comment(&mut file, &setting.text());
            match allowed(setting, value) {
                none if none.is_empty() => {}
                allowed => comment(&mut file, &format!("Allowed: {allowed}.")),
            }
            file += &format!("{} = {}\n", setting.name, value.as_toml());
        }
    }
    file
}

/// The documentation's tables, one for each section, in Markdown.
pub fn tables() -> String {
    let config = Config::default();
    let mut values = config.values().into_iter();
    let mut text = String::new();
    for section in SECTIONS {
        text += &format!("\n## [{}]\n\n{}\n\n", section.name, section.text());
        text += "| Key | Default | Allowed | What it is |\n|---|---|---|---|\n";
        for (setting, value) in section.settings.iter().zip(&mut values) {
            text += &format!(
                "| `{}` | `{}` | {} | {} |\n",
                setting.name,
                value.as_toml(),
                allowed(setting, value),
                setting.text()
            );
        }
    }
    text
}

/// Text and allowed values of `key`, e.g. `camera.timeout_s`; empty if there is no such setting.
pub fn help(key: &str) -> String {
    let config = Config::default();
    let settings = SECTIONS.iter().flat_map(|section| section.settings);
    for (setting, value) in settings.zip(config.values()) {
        if setting.key == key {
            return described(setting, value);
        }
    }
    String::new()
}

/// The numbers that the setting `key` may have; `None` where every number will do.
pub fn range(key: &str) -> Option<Range> {
    let mut settings = SECTIONS.iter().flat_map(|section| section.settings);
    settings.find(|setting| setting.key == key)?.range
}

fn described(setting: &Setting, value: &dyn SettingValue) -> String {
    match allowed(setting, value) {
        none if none.is_empty() => setting.text(),
        allowed => format!("{} Allowed: {allowed}.", setting.text()),
    }
}

/// The range, or the values to choose from; empty where the kind of value says it all.
fn allowed(setting: &Setting, value: &dyn SettingValue) -> String {
    if let Some(range) = setting.range {
        return range.words.to_owned();
    }
    let choices: Vec<String> = value.choices().iter().map(choice).collect();
    match &choices[..] {
        [] => String::new(),
        [others @ .., last] => format!("{} or {last}", others.join(", ")),
    }
}

fn choice(choice: &Choice) -> String {
    match choice.meaning() {
        "" => choice.value.to_owned(),
        meaning => format!("{} ({meaning})", choice.value),
    }
}

/// Appends `text` as a comment of lines not longer than [`WIDTH`].
fn comment(file: &mut String, text: &str) {
    let mut line = "#".to_owned();
    for word in text.split(' ') {
        if line.len() + 1 + word.len() > WIDTH {
            *file += &line;
            *file += "\n";
            line = "#".to_owned();
        }
        line += " ";
        line += word;
    }
    *file += &line;
    *file += "\n";
}
