//! The scale of the picture at the tree, m/px.

use super::command_error::CommandError;
use super::common::parse_within;
use super::unused;
use crate::config::Config;
use crate::model::Size;
use crate::views::PreparedTree;
use anyhow::anyhow;
use clap::Args;
use nalgebra::Point2;
use std::ops::RangeInclusive;

/// Plausible sizes of a pixel, m: a shrub of 0.1 m in the largest picture has 6e-6, a tree of 130 m in one of
/// 16 px has 8.
const METRES_PER_PX: RangeInclusive<f64> = 1e-6..=10.0;

/// The options for the scale.
#[derive(Clone, Debug, Default, Args)]
pub struct ScaleArgs {
    /// Size of a pixel at the tree, m; lengths are then in metres. 0: lengths are in pixels.
    #[arg(long, value_name = "M", value_parser = pixel_size)]
    metres_per_px: Option<f64>,
    /// The same from a known length: two points of the picture (px from the left and from the top)
    /// and their distance at the tree, m, e.g. 310,340:305,80=2.6
    #[arg(long, value_name = "U,V:U,V=METRES", value_parser = length, conflicts_with = "metres_per_px")]
    scale: Option<Known>,
}

/// The height of a tree whose scale no film tells.
#[derive(Clone, Debug, Default, Args)]
pub struct HeightArgs {
    /// Height of the tree, m, where no scale is known: lengths are then in metres.
    #[arg(long, value_name = "M", value_parser = height)]
    height: Option<f64>,
}

impl HeightArgs {
    pub fn is_given(&self) -> bool {
        self.height.is_some()
    }

    /// Gives a tree the height, and says so where that changes nothing.
    pub fn set(&self, tree: &mut PreparedTree) {
        if let Some(height_m) = self.height
            && !tree.set_height(height_m)
        {
            unused::note("--height", "the scale of the tree is known");
        }
    }
}

/// Parses `--height`, m.
fn height(text: &str) -> Result<f64, String> {
    parse_within(
        text,
        1e-3..=1e4,
        "give a number of metres from 0.001 to 10000",
    )
}

/// A known length in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Known {
    /// Its end points, px.
    ends: [Point2<f64>; 2],
    metres_per_px: f64,
}

impl ScaleArgs {
    /// Whether any option is given.
    pub fn is_given(&self) -> bool {
        self.metres_per_px().is_some()
    }

    /// The scale that is given.
    pub fn metres_per_px(&self) -> Option<f64> {
        let known = self.scale.map(|known| known.metres_per_px);
        known.or(self.metres_per_px)
    }

    /// Applies the options of the command line.
    pub fn set(&self, config: &mut Config) {
        if let Some(metres) = self.metres_per_px() {
            config.export.metres_per_px = metres;
        }
    }

    /// Checks that the known length was measured in a picture of this size.
    ///
    /// # Errors
    /// A point lies outside of the picture.
    pub fn check_size(&self, size: Size) -> Result<(), CommandError> {
        for end in self.scale.iter().flat_map(|known| known.ends) {
            let (u, v) = (end.x, end.y);
            // A mouse position may be up to the outer edge of the last pixel.
            let inside = (-0.5..=f64::from(size.width)).contains(&u)
                && (-0.5..=f64::from(size.height)).contains(&v);
            if !inside {
                return Err(CommandError::BadUsage(anyhow!(
                    "--scale: {u},{v} lies off the picture, which is {size} pixels; give two \
                     points of a frame of this film"
                )));
            }
        }
        Ok(())
    }
}

/// Parses `--metres-per-px`.
fn pixel_size(text: &str) -> Result<f64, String> {
    match number(text) {
        Some(metres) if metres == 0.0 || METRES_PER_PX.contains(&metres) => Ok(metres),
        _ => Err("give the metres of a pixel, 0.000001 to 10, or 0 for lengths in pixels".into()),
    }
}

/// Parses `U,V:U,V=METRES`.
fn length(text: &str) -> Result<Known, String> {
    let ([a, b], metres) = points_and_distance(text)
        .ok_or("give two points and their distance in metres, like 310,340:305,80=2.6")?;
    let px = (a.x - b.x).hypot(a.y - b.y);
    if px < 1.0 {
        return Err("the two points must be at least a pixel apart".into());
    }
    let metres_per_px = metres / px;
    if metres_per_px <= 0.0 {
        return Err("the distance must be more than 0 metres".into());
    }
    if !METRES_PER_PX.contains(&metres_per_px) {
        return Err(format!(
            "a pixel would have {metres_per_px} m, and 0.000001 to 10 are taken; give the distance in metres"
        ));
    }
    Ok(Known {
        ends: [a, b],
        metres_per_px,
    })
}

/// Splits `U,V:U,V=METRES` into two points, px, and their distance, m.
fn points_and_distance(text: &str) -> Option<([Point2<f64>; 2], f64)> {
    let (points, metres) = text.split_once('=')?;
    let (a, b) = points.split_once(':')?;
    let metres = number(metres.trim().trim_end_matches('m'))?;
    Some(([point(a)?, point(b)?], metres))
}

/// Parses `U,V`, px.
fn point(text: &str) -> Option<Point2<f64>> {
    let (u, v) = text.split_once(',')?;
    Some(Point2::new(number(u)?, number(v)?))
}

fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|x: &f64| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_length_gives_the_scale() {
        assert_eq!(
            length("0,0:30,40=2.5"),
            Ok(Known {
                ends: [Point2::new(0.0, 0.0), Point2::new(30.0, 40.0)],
                metres_per_px: 0.05
            })
        );
        assert_eq!(
            length("10,0 : 10,100 = 1m").map(|known| known.metres_per_px),
            Ok(0.01)
        );
        for bad in [
            "",
            "1",
            "0,0:30,40",
            "0,0:0,0=1",
            "0,0:30,40=0",
            "0,0:30,40=-1",
            "0,0:30=1",
            "a,0:3,4=1",
            "0,0:3,4=nan",
            "0,0:3,4=51",
        ] {
            assert!(length(bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn a_pixel_has_a_plausible_size() {
        for (text, expected) in [("0", Some(0.0)), ("0.004", Some(0.004)), ("10", Some(10.0))] {
            assert_eq!(pixel_size(text).ok(), expected);
        }
        for bad in ["1e9", "10.5", "1e-9", "-1", "nan", "wide"] {
            assert!(
                pixel_size(bad).is_err_and(|e| e.contains("0.000001 to 10")),
                "{bad}"
            );
        }
        for bad in ["0,0:600,0=0.00006", "0,0:600,0=60000"] {
            assert!(
                length(bad).is_err_and(|e| e.contains("0.000001 to 10")),
                "{bad}"
            );
        }
    }

    /// Whether a known length is accepted for a picture of 640x360.
    fn fits(text: &str) -> bool {
        let Ok(known) = length(text) else {
            return false;
        };
        let args = ScaleArgs {
            metres_per_px: None,
            scale: Some(known),
        };
        args.check_size(Size::new(640, 360)).is_ok()
    }

    #[test]
    fn a_length_off_the_picture_is_refused() {
        assert!(fits("0,0:640,360=1"));
        assert!(ScaleArgs::default().check_size(Size::new(1, 1)).is_ok());
        assert!(
            !fits("0,0:641,10=1")
                && !fits("10,361:20,20=1")
                && !fits("-2,0:20,20=1")
                && !fits("1e300,0:2,2=1")
        );
    }
}
