//! Numbers in JSON with no more decimals than mean something; `null` for what is no number.

use serde::Serializer;

/// With three decimals: shares.
///
/// # Errors
/// Those of the serializer.
pub fn to_3<S: Serializer>(x: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64((x * 1e3).round() / 1e3)
}

/// With four decimals: angles.
///
/// # Errors
/// Those of the serializer.
pub fn to_4<S: Serializer>(x: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64((x * 1e4).round() / 1e4)
}

/// With five decimals: frequencies and damping, as in the tables.
///
/// # Errors
/// Those of the serializer.
pub fn to_5<S: Serializer>(x: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64((x * 1e5).round() / 1e5)
}
