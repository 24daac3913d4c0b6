//! How large a pixel is at the tree.

use crate::config::Config;
use clap::Args;

/// The largest size of a pixel that is believed, m.
const LARGEST_M: f64 = 1e6;

/// The options on the scale.
#[derive(Clone, Debug, Default, Args)]
pub struct ScaleArgs {
    /// Metres in a pixel at the tree; lengths are then in metres. 0 for pixels.
    #[arg(long, value_name = "M")]
    metres_per_px: Option<f64>,
    /// The same by a known length: two points of the picture (px from the left and from the top) and how far they are apart
    /// at the tree, e.g. 310,340:305,80=2.6
    #[arg(long, value_name = "U,V:U,V=METRES", value_parser = length, conflicts_with = "metres_per_px")]
    scale: Option<f64>,
}

impl ScaleArgs {
    /// The command line over the settings.
    pub fn set(&self, config: &mut Config) {
        if let Some(metres) = self.scale.or(self.metres_per_px) {
            config.export.metres_per_px = metres;
        }
    }
}

/// Metres in a pixel by a known length.
fn length(text: &str) -> Result<f64, String> {
    let how = || "give two points and their distance in metres, like 310,340:305,80=2.6".to_owned();
    let number = |t: &str| t.trim().parse().ok().filter(|x: &f64| x.is_finite());
    let point = |t: &str| {
        let (u, v) = t.split_once(',')?;
        Some([number(u)?, number(v)?])
    };
    let (points, metres) = text.split_once('=').ok_or_else(how)?;
    let (a, b) = points.split_once(':').ok_or_else(how)?;
    let (a, b) = point(a).zip(point(b)).ok_or_else(how)?;
    let metres = number(metres.trim().trim_end_matches('m')).ok_or_else(how)?;
    let px = (a[0] - b[0]).hypot(a[1] - b[1]);
    if px < 1.0 {
        return Err("the two points must be at least a pixel apart".into());
    }
    let scale = metres / px;
    if scale > 0.0 && scale <= LARGEST_M { Ok(scale) } else { Err("the distance must be more than 0 metres".into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_length_gives_the_scale() {
        assert_eq!(length("0,0:30,40=2.5"), Ok(0.05));
        assert_eq!(length("10,0 : 10,100 = 1m"), Ok(0.01));
        for bad in
            ["", "1", "0,0:30,40", "0,0:0,0=1", "0,0:30,40=0", "0,0:30,40=-1", "0,0:30=1", "a,0:3,4=1", "0,0:3,4=nan"]
        {
            assert!(length(bad).is_err(), "{bad:?}");
        }
    }
}
