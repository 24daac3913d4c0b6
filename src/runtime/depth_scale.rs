//! The scale of a film with depth.

use crate::config::Config;
use crate::solve::Model;

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
