//! What files for others say of a branch's sway.

use super::number;
use crate::model::Swaying;
use serde::Serialize;
use serde_json::{Map, Value, json};

/// A branch's sway as the six columns of `nodes.csv`; no number (`null` in JSON) where a value is
/// not known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Columns {
    pub frequency_hz: f64,
    pub frequency_lo_hz: f64,
    pub frequency_hi_hz: f64,
    /// Share of critical damping.
    pub damping_ratio: f64,
    pub damping_lo: f64,
    pub damping_hi: f64,
}

impl Columns {
    /// The columns of one branch.
    pub fn of(sway: &Swaying) -> Self {
        let columns =
            |i: Option<crate::model::Interval>| i.map_or([f64::NAN; 3], |i| [i.value, i.lo, i.hi]);
        let [frequency_hz, frequency_lo_hz, frequency_hi_hz] =
            columns(sway.ok().map(|s| s.frequency_hz));
        let [damping_ratio, damping_lo, damping_hi] =
            columns(sway.ok().and_then(|s| s.damping_ratio));
        Self {
            frequency_hz,
            frequency_lo_hz,
            frequency_hi_hz,
            damping_ratio,
            damping_lo,
            damping_hi,
        }
    }

    /// In the order of the columns.
    pub fn values(&self) -> [f64; 6] {
        let Self {
            frequency_hz,
            frequency_lo_hz,
            frequency_hi_hz,
            damping_ratio,
            damping_lo,
            damping_hi,
        } = *self;
        [
            frequency_hz,
            frequency_lo_hz,
            frequency_hi_hz,
            damping_ratio,
            damping_lo,
            damping_hi,
        ]
    }
}

/// All cells of `nodes.csv` that say something of a branch's sway, in the order of their columns.
pub(super) fn cells(sway: &Swaying) -> [String; 10] {
    let told = |x: f64, decimals: usize| {
        let mut text = String::new();
        number::push(&mut text, x, decimals);
        text
    };
    let [a, b, c, d, e, f] = Columns::of(sway).values().map(|x| told(x, 5));
    let identifiable = if sway.is_ok() { "true" } else { "false" };
    let excitation = sway.map_or("", |s| s.excitation.word());
    let amplitude = told(sway.map_or(f64::NAN, |s| s.amplitude_deg), 4);
    let why = sway.err().map_or("", crate::model::Unidentified::word);
    [
        a,
        b,
        c,
        d,
        e,
        f,
        identifiable.into(),
        excitation.into(),
        amplitude,
        why.into(),
    ]
}

/// For the `extras` of a joint: what is known of its sway, with 95 % intervals; nothing for one
/// that was not measured.
pub fn extras(sway: &Swaying) -> Value {
    let mut all = Map::new();
    let mut put = |name: &str, value: f64, lo: f64, hi: f64| {
        if value.is_finite() && lo.is_finite() && hi.is_finite() {
            all.insert(name.into(), value.into());
            all.insert(format!("{name}_interval_95"), json!([lo, hi]));
        }
    };
    match sway {
        Err(crate::model::Unidentified::NotMeasured) => return Value::Null,
        Err(why) => drop(all.insert("unidentified".into(), why.word().into())),
        Ok(sway) => {
            let f = sway.frequency_hz;
            put("frequency_hz", f.value, f.lo, f.hi);
            sway.damping_ratio
                .into_iter()
                .for_each(|d| put("damping_ratio", d.value, d.lo, d.hi));
            all.insert("excitation".into(), sway.excitation.word().into());
        }
    }
    all.insert("identifiable".into(), sway.is_ok().into());
    all.into()
}
