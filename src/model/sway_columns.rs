//! Frequency and damping of a sway as columns of tables and keys of JSON.

use super::{Excitation, Interval, Sway};
use serde::Serialize;

/// Frequency and damping with their 95 % intervals, in the order of the columns; no number (`null`
/// in JSON) where a value is not known. JSON has five decimals, as the tables do.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SwayColumns {
    /// Undamped natural frequency, Hz.
    #[serde(serialize_with = "super::rounded::to_5")]
    pub frequency_hz: f64,
    #[serde(serialize_with = "super::rounded::to_5")]
    pub frequency_lo_hz: f64,
    #[serde(serialize_with = "super::rounded::to_5")]
    pub frequency_hi_hz: f64,
    /// Share of critical damping.
    #[serde(serialize_with = "super::rounded::to_5")]
    pub damping_ratio: f64,
    #[serde(serialize_with = "super::rounded::to_5")]
    pub damping_lo: f64,
    #[serde(serialize_with = "super::rounded::to_5")]
    pub damping_hi: f64,
}

impl SwayColumns {
    /// What the columns are called.
    pub const NAMES: [&str; 6] = [
        "frequency_hz",
        "frequency_lo_hz",
        "frequency_hi_hz",
        "damping_ratio",
        "damping_lo",
        "damping_hi",
    ];

    /// The columns of a sway; `None` has no numbers.
    pub fn of(sway: Option<&Sway>) -> Self {
        let frequency = ends(sway.map(|s| s.frequency_hz));
        let damping = ends(sway.and_then(|s| s.damping_ratio));
        Self {
            frequency_hz: frequency.value,
            frequency_lo_hz: frequency.lo,
            frequency_hi_hz: frequency.hi,
            damping_ratio: damping.value,
            damping_lo: damping.lo,
            damping_hi: damping.hi,
        }
    }

    /// The columns with these values, in the order of [`NAMES`](Self::NAMES).
    pub fn of_values(values: [f64; 6]) -> Self {
        let [
            frequency_hz,
            frequency_lo_hz,
            frequency_hi_hz,
            damping_ratio,
            damping_lo,
            damping_hi,
        ] = values;
        Self {
            frequency_hz,
            frequency_lo_hz,
            frequency_hi_hz,
            damping_ratio,
            damping_lo,
            damping_hi,
        }
    }

    /// The frequency, which counts with its interval only.
    pub fn frequency(&self) -> Option<Interval> {
        let ends = [self.frequency_lo_hz, self.frequency_hi_hz];
        interval(self.frequency_hz, ends).filter(|f| f.value > 0.0)
    }

    /// The sway that they say, of what made it so large; `None` without a frequency.
    pub fn sway(&self, excitation: Excitation, amplitude_deg: f64) -> Option<Sway> {
        Some(Sway {
            frequency_hz: self.frequency()?,
            damping_ratio: interval(self.damping_ratio, [self.damping_lo, self.damping_hi]),
            excitation,
            amplitude_deg,
        })
    }

    /// In the order of [`NAMES`](Self::NAMES).
    pub fn values(&self) -> [f64; 6] {
        [
            self.frequency_hz,
            self.frequency_lo_hz,
            self.frequency_hi_hz,
            self.damping_ratio,
            self.damping_lo,
            self.damping_hi,
        ]
    }
}

/// A value and its ends, where they are an interval.
fn interval(value: f64, [lo, hi]: [f64; 2]) -> Option<Interval> {
    let is_one = 0.0 <= lo && lo <= value && value <= hi && hi.is_finite();
    is_one.then_some(Interval { value, lo, hi })
}

/// The interval; no numbers where there is none.
fn ends(interval: Option<Interval>) -> Interval {
    interval.unwrap_or(Interval {
        value: f64::NAN,
        lo: f64::NAN,
        hi: f64::NAN,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_names_are_the_keys_of_json_and_stand_in_the_order_of_the_values() {
        let columns = SwayColumns::of(Some(&Sway {
            frequency_hz: Interval {
                value: 0.7,
                lo: 0.69,
                hi: 0.7123456,
            },
            damping_ratio: None,
            excitation: Excitation::Wind,
            amplitude_deg: 1.0,
        }));
        let json = serde_json::to_string(&columns).expect("json");
        let pairs = SwayColumns::NAMES
            .iter()
            .zip(["0.7", "0.69", "0.71235", "null", "null", "null"]);
        let pairs: Vec<String> = pairs.map(|(name, x)| format!("\"{name}\":{x}")).collect();
        assert_eq!(json, format!("{{{}}}", pairs.join(",")));
        assert_eq!(columns.values()[..3], [0.7, 0.69, 0.7123456]);
        assert!(columns.values()[3..].iter().all(|x| x.is_nan()));
        assert!(SwayColumns::of(None).values().iter().all(|x| x.is_nan()));
    }
}
