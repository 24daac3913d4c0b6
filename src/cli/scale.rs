//! How large a pixel is at the tree.

use super::ended::Ended;
use crate::config::Config;
use crate::model::Size;
use anyhow::anyhow;
use clap::Args;

/// The largest size of a pixel that is believed, m.
const LARGEST_M: f64 = 1e6;

/// The options on the scale.
#[derive(Clone, Debug, Default, Args)]
pub struct ScaleArgs {
    /// Metres in a pixel at the tree; lengths are then in metres. 0 for pixels.
    #[arg(long, value_name = "M")]
    metres_per_px: Option<f64>,
    /// The same by a known length: two points of the picture (px from the left and from the top)
    /// and how far they are apart at the tree, e.g. 310,340:305,80=2.6
    #[arg(long, value_name = "U,V:U,V=METRES", value_parser = length, conflicts_with = "metres_per_px")]
    scale: Option<Known>,
}

/// A known length in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Known {
    /// Its ends, px.
    ends: [[f64; 2]; 2],
    metres_per_px: f64,
}

impl ScaleArgs {
    /// The command line over the settings.
    pub fn set(&self, config: &mut Config) {
        if let Some(metres) = self
            .scale
            .map(|known| known.metres_per_px)
            .or(self.metres_per_px)
        {
            config.export.metres_per_px = metres;
        }
    }

    /// Refuses a known length that was not measured in a picture of this size.
    pub fn fits(&self, size: Size) -> Result<(), Ended> {
        for [u, v] in self.scale.iter().flat_map(|known| known.ends) {
            // To the rim of the last pixel, as a mouse may tell it.
            let inside = (-0.5..=f64::from(size.width)).contains(&u)
                && (-0.5..=f64::from(size.height)).contains(&v);
            if !inside {
                return Err(Ended::BadUsage(anyhow!(
                    "--scale: {u},{v} lies off the picture, which is {size} pixels; give two \
                     points of a frame of this film"
                )));
            }
        }
        Ok(())
    }
}

fn length(text: &str) -> Result<Known, String> {
    let ([a, b], metres) = drawn(text)
        .ok_or("give two points and their distance in metres, like 310,340:305,80=2.6")?;
    let px = (a[0] - b[0]).hypot(a[1] - b[1]);
    if px < 1.0 {
        return Err("the two points must be at least a pixel apart".into());
    }
    let metres_per_px = metres / px;
    if metres_per_px > 0.0 && metres_per_px <= LARGEST_M {
        Ok(Known {
            ends: [a, b],
            metres_per_px,
        })
    } else {
        Err("the distance must be more than 0 metres".into())
    }
}

/// Two points, px, and how far they are apart, m.
fn drawn(text: &str) -> Option<([[f64; 2]; 2], f64)> {
    let (points, metres) = text.split_once('=')?;
    let (a, b) = points.split_once(':')?;
    let metres = number(metres.trim().trim_end_matches('m'))?;
    Some(([point(a)?, point(b)?], metres))
}

fn point(text: &str) -> Option<[f64; 2]> {
    let (u, v) = text.split_once(',')?;
    Some([number(u)?, number(v)?])
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
                ends: [[0.0, 0.0], [30.0, 40.0]],
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
        ] {
            assert!(length(bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn a_length_off_the_picture_is_refused() {
        let fits = |text| {
            ScaleArgs {
                metres_per_px: None,
                scale: length(text).ok(),
            }
            .fits(Size::new(640, 360))
            .is_ok()
        };
        assert!(fits("0,0:640,360=1") && ScaleArgs::default().fits(Size::new(1, 1)).is_ok());
        assert!(
            !fits("0,0:641,10=1")
                && !fits("10,361:20,20=1")
                && !fits("-2,0:20,20=1")
                && !fits("1e300,0:2,2=1")
        );
    }
}
