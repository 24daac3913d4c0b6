//! The units of coordinate systems that are named by their number in the EPSG register alone.

/// Units in the definitions of systems by PROJ, m.
const NAMED: [(&str, f64); 4] = [
    ("m", 1.0),
    ("ft", 0.3048),
    ("us-ft", US_FOOT_M),
    ("link", 0.201168),
];
const US_FOOT_M: f64 = 1200.0 / 3937.0;

/// Systems of heights and depths that count in feet, and the length of theirs, m: all that EPSG 10.076 has.
const HEIGHTS_IN_FEET: [(u64, f64); 14] = [
    (5614, 0.3048),
    (5702, US_FOOT_M),
    (5754, 0.304_800_749_1),
    (6130, 0.3048),
    (6131, 0.3048),
    (6132, 0.3048),
    (6358, US_FOOT_M),
    (6359, US_FOOT_M),
    (6360, US_FOOT_M),
    (8050, 0.3048),
    (8051, 0.3048),
    (8052, US_FOOT_M),
    (8228, 0.3048),
    (8897, 0.3048),
];
/// Other systems of heights count in metres. Lower numbers are of other things, and greater ones came later.
const HEIGHTS: std::ops::RangeInclusive<u64> = 3855..=9999;
/// GeoTIFF 1.0 names heights by numbers of its own (sect. 6.3.4), which say no unit.
const OF_GEOTIFF: std::ops::RangeInclusive<u64> = 5001..=5199;

/// What is known of a coordinate system.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum System {
    /// Its unit, m, and that of its heights where it has any.
    Lengths {
        along_m: f64,
        up_m: Option<f64>,
    },
    /// Its coordinates are longitudes and latitudes.
    Angles,
    Unknown,
}

/// The coordinate system of this number.
pub(super) fn system(code: u64) -> System {
    let code = u16::try_from(code).ok();
    match code.and_then(crs_definitions::from_code) {
        Some(definition) => of_definition(definition.proj4),
        None => System::Unknown,
    }
}

/// The unit of a system of heights, m; `None` where it is not known.
pub(super) fn heights_m(code: u64) -> Option<f64> {
    let in_feet = HEIGHTS_IN_FEET.iter().find(|(own, _)| *own == code);
    match in_feet {
        Some((_, foot_m)) => Some(*foot_m),
        None => (HEIGHTS.contains(&code) && !OF_GEOTIFF.contains(&code)).then_some(1.0),
    }
}

/// What a definition such as `+proj=lcc +lat_1=41 +units=us-ft` says.
fn of_definition(text: &str) -> System {
    if parameter(text, "+proj=") == Some("longlat") {
        return System::Angles;
    }
    match length_m(text, "+to_meter=", "+units=") {
        Some(along_m) => System::Lengths {
            along_m,
            up_m: length_m(text, "+vto_meter=", "+vunits="),
        },
        None => System::Unknown,
    }
}

/// A length that is given as a number, or by name.
fn length_m(text: &str, number: &str, name: &str) -> Option<f64> {
    if let Some(metres) = parameter(text, number) {
        return metres.parse().ok();
    }
    let name = parameter(text, name)?;
    let unit = NAMED.iter().find(|(own, _)| *own == name);
    unit.map(|(_, metres)| *metres)
}

fn parameter<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    text.split_whitespace()
        .find_map(|word| word.strip_prefix(key))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_systems_are_those_of_the_register() {
        let lengths = |along_m| System::Lengths {
            along_m,
            up_m: None,
        };
        for (code, expected) in [
            // New York Long Island, Oregon North, UTM 32, a grid in chains of 100 links.
            (2263, lengths(US_FOOT_M)),
            (2992, lengths(0.3048)),
            (25832, lengths(1.0)),
            (3167, lengths(20.116756)),
            (4326, System::Angles),
            (1, System::Unknown),
            (20050, System::Unknown),
            (70_000, System::Unknown),
        ] {
            assert_eq!(system(code), expected, "{code}");
        }
        // Amersfoort with heights.
        let both = System::Lengths {
            along_m: 1.0,
            up_m: Some(1.0),
        };
        assert_eq!(system(7415), both);
        let heights = [5703, 6360, 8228, 5103, 0].map(heights_m);
        assert_eq!(
            heights,
            [Some(1.0), Some(US_FOOT_M), Some(0.3048), None, None]
        );
    }
}
