//! The macros by which settings are declared, see `settings.rs`. They make the structs, their
//! defaults and the list that the check, the shipped file and the documentation are derived from.

/// The sections of the configuration, each with its keys:
///
/// ```text
/// /// Text of the section.
/// name: Type, EFFECT {
///     /// Text of the key: what it is, its unit, when to change it.
///     key: type [range] = default, EFFECT;
/// }
/// ```
///
/// The effect of a key is that of its section where none is given; a range is written as for
/// [`range!`].
macro_rules! settings {
    ($(
        $(#[doc = $section_text:literal])+
        $section:ident: $Section:ident, $section_effect:ident {
            $(
                $(#[doc = $text:literal])+
                $key:ident: $Type:ty $([$($range:tt)+])? = $default:expr $(, $effect:ident)?;
            )+
        }
    )+) => {
        /// Everything that can be set, a section for each stage.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct Config {
            $(
                $(#[doc = $section_text])+
                pub $section: $Section,
            )+
        }

        $(
            $(#[doc = $section_text])+
            #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
            #[serde(default, deny_unknown_fields)]
            pub struct $Section {
                $(
                    $(#[doc = $text])+
                    pub $key: $Type,
                )+
            }

            impl Default for $Section {
                fn default() -> Self {
                    Self { $($key: $default,)+ }
                }
            }
        )+

        /// Every section, in the order of the file.
        pub const SECTIONS: &[Section] = &[$(
            Section {
                name: stringify!($section),
                text: &[$($section_text),+],
                settings: &[$(
                    Setting {
                        key: concat!(stringify!($section), ".", stringify!($key)),
                        name: stringify!($key),
                        text: &[$($text),+],
                        range: first!($(Some(range!($($range)+)),)? None),
                        effect: first!($($effect,)? $section_effect),
                    },
                )+],
            },
        )+];

        impl Config {
            /// The value of every setting, in the order of [`SECTIONS`].
            pub(super) fn values(&self) -> Vec<&dyn SettingValue> {
                vec![$($(&self.$section.$key,)+)+]
            }
        }
    };
}

/// The first of its arguments: what is given, else what follows.
macro_rules! first {
    ($first:expr $(, $others:expr)*) => {
        $first
    };
}

/// A range of numbers; its words are made from the numbers as they are written.
macro_rules! range {
    (above 0) => {
        Range { low: f64::MIN_POSITIVE, high: 1e9, words: "greater than 0" }
    };
    (above 0, at most $high:literal) => {
        Range { low: 1e-9, high: $high as f64, words: concat!("above 0, at most ", $high) }
    };
    ($low:literal $(($meaning:literal))? or more) => {
        Range { low: $low as f64, high: 1e6, words: concat!($low, $(" (", $meaning, ")",)? " or more") }
    };
    ($low:literal $(($meaning:literal))? to $high:literal) => {
        Range {
            low: $low as f64,
            high: $high as f64,
            words: concat!($low, $(" (", $meaning, ")",)? " to ", $high),
        }
    };
}

/// An enum that a setting is chosen from: each value as it is written in a file, with what it means
/// where the value itself does not say it.
macro_rules! choice {
    (
        $(#[doc = $text:literal])+
        $Name:ident {
            $($(#[doc = $meaning:literal])? $Variant:ident = $value:literal,)+
        }
    ) => {
        $(#[doc = $text])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub enum $Name {
            $(
                $(#[doc = $meaning])?
                #[serde(rename = $value)]
                $Variant,
            )+
        }

        impl SettingValue for $Name {
            fn number(&self) -> Option<f64> {
                None
            }

            fn as_toml(&self) -> String {
                match self {
                    $(Self::$Variant => format!("{:?}", $value),)+
                }
            }

            fn choices(&self) -> &'static [Choice] {
                &[$(Choice { value: $value, meaning: concat!($($meaning)?) },)+]
            }
        }
    };
}

pub(super) use {choice, first, range, settings};
