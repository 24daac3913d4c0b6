//! The scale of a film with depth.

use crate::config::Config;
use crate::solve::Model;

/// How far from a camera trees are filmed, m.
const DISTANCES_M: std::ops::RangeInclusive<f64> = 0.2..=300.0;
/// Two scales of one film that are farther from each other than this share are not of one tree: a tag is
/// known to 1 %, and depth cameras to some percent.
const ONE_SCALE: f64 = 0.1;

/// Whether two scales, m, are not of one film.
pub fn scales_differ(one_m: f64, other_m: f64) -> bool {
    (one_m / other_m).ln().abs() > ONE_SCALE
}

/// Takes the scale that depth gives of `model` into the settings, if neither the user nor a tag gives
/// one; `None` where it changes nothing. One capture has one scale: that of its first tree.
pub fn take_scale_of_depth(config: &mut Config, model: Option<&Model>) -> Option<String> {
    let depths = model?.depths.as_ref()?;
    if config.export.metres_per_px > 0.0 || config.tag.size_m > 0.0 {
        return None;
    }
    config.export.metres_per_px = depths.metres_per_px;
    Some(format!(
        "by its depth the trunk's foot is {:.2} m away, and a pixel {:.5} m there",
        depths.foot_m, depths.metres_per_px
    ))
}

/// What speaks against the depth of `model`: it is not where trees are, or at odds with the scale in the
/// settings, which a tag or the user gave.
pub fn doubt_of_depth(config: &Config, model: Option<&Model>) -> Option<String> {
    let depths = model?.depths.as_ref()?;
    doubt(config, depths.foot_m, depths.metres_per_px)
}

fn doubt(config: &Config, foot_m: f64, metres_per_px: f64) -> Option<String> {
    if !DISTANCES_M.contains(&foot_m) {
        return Some(format!(
            "by its depth the trunk's foot is {foot_m:.2} m away; see that --depth-unit is right"
        ));
    }
    let given = config.export.metres_per_px;
    let is_other = given > 0.0 && scales_differ(metres_per_px, given);
    let (by, advice) = match config.tag.size_m > 0.0 {
        true => (
            "the tag",
            "the tag hangs beside the trunk, and that its side",
        ),
        false => ("the given scale", "that scale"),
    };
    is_other.then(|| {
        format!(
            "a pixel is {metres_per_px:.5} m at the trunk's foot by its depth, and {given:.5} m by {by}; see that \
             {advice}, --depth-unit and the camera's focal length are right"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_that_is_at_odds_is_doubted() {
        let mut config = Config::default();
        config.export.metres_per_px = 0.004;
        config.tag.size_m = 0.165;
        assert_eq!(doubt(&config, 2.0, 0.0041), None);
        let said = doubt(&config, 2.0, 0.0048).expect("a doubt");
        assert!(said.contains("0.00400 m by the tag"), "{said}");
        let far = doubt(&config, 9800.0, 0.004).expect("a doubt");
        assert!(
            far.contains("9800.00 m") && far.contains("--depth-unit"),
            "{far}"
        );
    }
}
