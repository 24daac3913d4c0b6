//! The units that a LAS file's coordinate system names: keys of GeoTIFF 1.0, or well-known text.

use super::Units;
use super::epsg::{self, System};
use crate::import::error::ImportError;

/// Records on the coordinate system.
const GEO_KEYS: u16 = 34735;
const WKT: u16 = 2112;
/// Keys in them (GeoTIFF 1.0 sect. 6.2): what the coordinates are, and their units along and up.
const MODEL_TYPE: u64 = 1024;
const SYSTEM: u64 = 3072;
const LINEAR_UNITS: u64 = 3076;
const VERTICAL_SYSTEM: u64 = 4096;
const VERTICAL_UNITS: u64 = 4099;
/// Keys that say nothing: undefined, and by the user.
const NOTHING: [u64; 2] = [0, 32767];
/// Coordinates that are angles.
const GEOGRAPHIC: u64 = 2;
/// Units (GeoTIFF 1.0 sect. 6.3.1.3), m.
const UNITS: [(u64, f64); 3] = [(9001, 1.0), (9002, 0.3048), (9003, 1200.0 / 3937.0)];
/// Where the upright part of a system begins in text of version 1 and 2, in small letters.
const VERTICAL_PARTS: [&str; 2] = ["vert_cs[", "vertcrs["];
/// Plausible units, m.
const PLAUSIBLE_M: std::ops::RangeInclusive<f64> = 1e-4..=1e4;

/// What a record says of units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Said {
    Nothing,
    Units(Units),
    /// A coordinate system by its EPSG number, of which the unit is not known.
    UnknownSystem(u64),
}

/// The units that a record names.
///
/// # Errors
/// Its coordinates are angles.
pub(super) fn units_of(record: u16, data: &[u8]) -> Result<Said, ImportError> {
    match record {
        GEO_KEYS => of_keys(data),
        WKT => of_text(&String::from_utf8_lossy(data).to_lowercase()),
        _ => Ok(Said::Nothing),
    }
}

fn angles() -> ImportError {
    ImportError::unsupported(
        "its coordinates are longitudes and latitudes",
        "project it to metres with the program of your survey",
    )
}

fn of_keys(data: &[u8]) -> Result<Said, ImportError> {
    let numbers: Vec<u64> = data.chunks_exact(2).map(super::las_file::number).collect();
    let keys = numbers.get(4..).unwrap_or_default();
    if value_of(keys, MODEL_TYPE) == Some(GEOGRAPHIC) {
        return Err(angles());
    }
    let code = value_of(keys, SYSTEM);
    let system = code.map_or(System::Unknown, epsg::system);
    let (of_system, heights_of_system) = match system {
        System::Angles => return Err(angles()),
        System::Lengths { along_m, up_m } => (Some(along_m), up_m),
        System::Unknown => (None, None),
    };
    let Some(along_m) = unit_of(keys, LINEAR_UNITS).or(of_system) else {
        return Ok(code.map_or(Said::Nothing, Said::UnknownSystem));
    };
    let heights = value_of(keys, VERTICAL_SYSTEM).and_then(epsg::heights_m);
    let up_m = unit_of(keys, VERTICAL_UNITS)
        .or(heights)
        .or(heights_of_system);
    Ok(Said::Units(Units {
        along_m,
        up_m: up_m.unwrap_or(along_m),
    }))
}

/// The unit that a key names, m.
fn unit_of(keys: &[u64], key: u64) -> Option<f64> {
    let value = value_of(keys, key)?;
    let unit = UNITS.iter().find(|(code, _)| *code == value);
    unit.map(|(_, metres)| *metres)
}

/// The value of a key, where it says something; each is four numbers.
fn value_of(keys: &[u64], wanted: u64) -> Option<u64> {
    let mut all = keys.chunks_exact(4);
    let value = all.find(|key| key[0] == wanted).map(|key| key[3]);
    value.filter(|value| !NOTHING.contains(value))
}

/// The last unit of length in each part of the text is that of its coordinates: those before it are
/// of ellipsoids and parameters.
fn of_text(text: &str) -> Result<Said, ImportError> {
    if text.contains("geog") && !text.contains("projc") {
        return Err(angles());
    }
    let cut = VERTICAL_PARTS.iter().filter_map(|part| text.find(part));
    let (along, up) = text.split_at(cut.min().unwrap_or(text.len()));
    Ok(match last_length(along) {
        Some(along_m) => Said::Units(Units {
            along_m,
            up_m: last_length(up).unwrap_or(along_m),
        }),
        None => Said::Nothing,
    })
}

/// The length of the last unit of length that is named, m.
fn last_length(text: &str) -> Option<f64> {
    let mut last = None;
    let named = text.split("unit[\"").skip(1).filter_map(|rest| {
        let (name, rest) = rest.split_once("\",")?;
        let end = rest.find([',', ']'])?;
        Some((name, rest[..end].trim().parse::<f64>().ok()?))
    });
    for (name, length) in named {
        let is_angle = ["degree", "radian", "grad", "gon", "second"];
        if !is_angle.iter().any(|angle| name.contains(angle)) && PLAUSIBLE_M.contains(&length) {
            last = Some(length);
        }
    }
    last
}

#[cfg(test)]
mod tests {
    use super::*;

    const US_FOOT_M: f64 = 1200.0 / 3937.0;

    fn keys(pairs: &[(u16, u16)]) -> Vec<u8> {
        let mut numbers = vec![1, 1, 0, pairs.len() as u16];
        for (key, value) in pairs {
            numbers.extend([*key, 0, 1, *value]);
        }
        numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
    }

    fn units(record: u16, data: &[u8]) -> Option<Units> {
        match units_of(record, data).expect("no angles") {
            Said::Units(units) => Some(units),
            Said::Nothing | Said::UnknownSystem(_) => None,
        }
    }

    #[test]
    fn a_number_of_the_register_names_units_where_no_key_does() {
        let feet = units(GEO_KEYS, &keys(&[(1024, 1), (3072, 2263)])).expect("units");
        assert_eq!((feet.along_m, feet.up_m), (US_FOOT_M, US_FOOT_M));
        let mixed = units(GEO_KEYS, &keys(&[(3072, 2263), (4096, 5703)])).expect("units");
        assert_eq!((mixed.along_m, mixed.up_m), (US_FOOT_M, 1.0));
        // What a key says counts.
        let stated = units(GEO_KEYS, &keys(&[(3072, 2263), (3076, 9001)])).expect("units");
        assert_eq!((stated.along_m, stated.up_m), (1.0, 1.0));
        for (code, said) in [
            (20050, Said::UnknownSystem(20050)),
            (32767, Said::Nothing),
            (0, Said::Nothing),
        ] {
            let found = units_of(GEO_KEYS, &keys(&[(1024, 1), (3072, code)]));
            assert_eq!(found, Ok(said));
        }
        assert!(units_of(GEO_KEYS, &keys(&[(3072, 4326)])).is_err());
    }

    #[test]
    fn units_are_read_from_keys() {
        let feet = units(GEO_KEYS, &keys(&[(1024, 1), (3076, 9003)])).expect("units");
        assert_eq!((feet.along_m, feet.up_m), (US_FOOT_M, US_FOOT_M));
        let mixed = units(GEO_KEYS, &keys(&[(3076, 9001), (4099, 9002)])).expect("units");
        assert_eq!((mixed.along_m, mixed.up_m), (1.0, 0.3048));
        assert_eq!(units(GEO_KEYS, &keys(&[(1024, 1)])), None);
        assert_eq!(units(GEO_KEYS, &keys(&[(3076, 9003)])[..5]), None);
        assert_eq!(units(7, &keys(&[(3076, 9003)])), None);
        assert!(units_of(GEO_KEYS, &keys(&[(1024, 2)])).is_err());
    }

    #[test]
    fn units_are_read_from_text() {
        let geographic =
            "GEOGCS[\"x\",SPHEROID[\"s\",6378137,298.25],UNIT[\"degree\",0.0174532925]]";
        let cases = [
            (
                "UNIT[\"US survey foot\",0.304800609601219,AUTHORITY[\"EPSG\",\"9003\"]]",
                "",
                US_FOOT_M,
                US_FOOT_M,
            ),
            ("UNIT[\"metre\",1]", "", 1.0, 1.0),
            (
                "UNIT[\"foot\",0.3048]",
                ",VERT_CS[\"v\",UNIT[\"metre\",1.0]]",
                0.3048,
                1.0,
            ),
            (
                "CS[Cartesian,2],LENGTHUNIT[\"m\",1]",
                ",VERTCRS[\"v\",LENGTHUNIT[\"foot\",0.3048]]",
                1.0,
                0.3048,
            ),
        ];
        for (along, up, along_m, up_m) in cases {
            let text = format!("COMPD_CS[\"c\",PROJCS[\"p\",{geographic},{along}]{up}]");
            let found = units(WKT, text.as_bytes()).expect("units");
            assert!((found.along_m - along_m).abs() < 1e-9, "{text}: {found:?}");
            assert!((found.up_m - up_m).abs() < 1e-9, "{text}: {found:?}");
        }
        assert!(units_of(WKT, geographic.as_bytes()).is_err());
        assert_eq!(units(WKT, b"LOCAL_CS[\"x\"]"), None);
        assert_eq!(units(WKT, b"PROJCS[\"x\",UNIT[\"m\",1e30]]"), None);
    }
}
