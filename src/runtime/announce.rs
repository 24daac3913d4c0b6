//! What is said when a tree comes into effect.

use super::shaking::{CameraShownBy, ShakeMeter};
use super::shared::Shared;
use crate::model::{Background, FootBasis, Shake, TrackSet, WoodSight};
use crate::solve::Model;
use nalgebra::Point2;
use std::sync::Arc;

/// The warning of a tree in whose film no wood is seen.
const NO_WOOD: &str = "no wood is seen in the film (leaves, night, fog, or a background of the \
                       wood's colour): the tree is that of the motion alone";
/// That of a tree whose trunk ends at the picture's lower edge.
const FOOT_CUT_OFF: &str = "the foot of the trunk is not in the picture: the tree is taken to stand \
                            on the picture's lower edge, and sways about that; film it whole";
/// That of a tree whose outline has no trunk.
const FOOT_GUESSED: &str = "the foot of the trunk is a guess, below the middle of the crown: draw \
                            the outline with the foot as its lowest edge, or a line along the \
                            trunk (--trunk FILE)";
/// That of one whose wood was not looked for to the end.
const TOO_SHORT_FOR_WOOD: &str = "the wood was not looked for, as the end was wanted: the tree is \
                                  that of the motion alone, and its copies in depth are made up; \
                                  film some seconds longer";

/// The warning where the camera's own motion is not known.
const CAMERA_UNCLEAR: &str = "nothing around the outline shows how the camera moves: what it shakes \
                              cannot be separated from the tree's sway; use a firm tripod, and film \
                              more of the ground and of what stands still";
/// That where it is known by the foot of the trunk alone.
const CAMERA_BY_FOOT: &str = "nothing around the outline shows how the camera moves: the foot of the \
                              trunk shows how far it shifts, and not how it turns; film more of the \
                              ground and of what stands still";
/// They are given with the tree, after so much film, s.
const CAMERA_JUDGED_S: f64 = 3.0;

/// The tree that was last told of.
#[derive(Default)]
pub struct Announced {
    tree: Option<Arc<Model>>,
    /// The warning that the first one was worth little.
    warned: Option<String>,
    wood: WoodSight,
    /// What was said of the camera: that it looks elsewhere, is not known, trembles.
    is_lost: bool,
    shown_by: CameraShownBy,
    shakes: bool,
    /// Time of the first frame, s.
    begun_s: Option<f64>,
}

impl Announced {
    /// Tells of `tree` if it is a new one. One built early is worth less than `threshold`
    /// (accumulation measure), and the capture is to say so until a refinement has made up for it.
    pub fn tell(&mut self, tree: &Arc<Model>, threshold: f64, shared: &Shared) {
        if self
            .tree
            .as_ref()
            .is_some_and(|known| Arc::ptr_eq(known, tree))
        {
            return;
        }
        let first = self.tree.replace(tree.clone()).is_none();
        let nodes = tree.skeleton.measured();
        if tree.refinements > 0 {
            let kept = tree.kept;
            shared.tell(format!(
                "the tree was refined at {:.0} s: {kept} of {nodes} nodes keep their numbers",
                tree.time_s
            ));
            tracing::info!(
                "tree refined at {:.1} s: {kept} of {nodes} nodes go on",
                tree.time_s
            );
            if tree.evidence.measure >= threshold {
                self.warned
                    .take()
                    .into_iter()
                    .for_each(|warning| shared.withdraw(&warning));
            }
        } else if first {
            self.warned = little_motion(tree, threshold);
            self.warned
                .iter()
                .for_each(|warning| shared.warn(warning.clone()));
            match tree.foot.basis {
                FootBasis::CutOff => shared.warn(FOOT_CUT_OFF.into()),
                FootBasis::Guessed => shared.warn(FOOT_GUESSED.into()),
                FootBasis::Outline | FootBasis::Drawn => {}
            }
            if let Some(other_px) = tree.foot.other_px {
                shared.warn(two_trunks(other_px));
            }
            let (points, time_s) = (tree.evidence.moving.len(), tree.time_s);
            tracing::info!(
                "tree built at {time_s:.1} s: {nodes} nodes from {points} moving points"
            );
        }
    }

    /// Tells whether the tree's wood is seen, where that is another answer than before. At the end
    /// of the film (`ended`) it is a warning that the search was cut short.
    pub fn tell_of_wood(&mut self, sight: WoodSight, ended: bool, shared: &Shared) {
        let was_told = sight == self.wood;
        self.wood = sight;
        match sight {
            WoodSight::Sought if ended => shared.warn(TOO_SHORT_FOR_WOOD.into()),
            // It is being looked for again.
            WoodSight::Sought if !was_told => shared.withdraw(NO_WOOD),
            WoodSight::NotSeen if !was_told => shared.warn(NO_WOOD.into()),
            WoodSight::Seen if !was_told => {
                shared.withdraw(NO_WOOD);
                shared.tell("the tree runs along the wood that is seen".into());
                tracing::info!("tree along the wood that is seen");
            }
            _ => {}
        }
    }
}

impl Announced {
    /// The film begins anew: what was warned of because of its tree does not hold for the next one.
    pub fn restart(&mut self, shared: &Shared) {
        let said = std::mem::take(self);
        let other_px = said.tree.and_then(|tree| tree.foot.other_px);
        let of_tree = said.warned.into_iter().chain(other_px.map(two_trunks));
        for warning in of_tree {
            shared.withdraw(&warning);
        }
        let of_sight = [NO_WOOD, FOOT_CUT_OFF, FOOT_GUESSED].into_iter();
        for warning in of_sight.chain(camera_warning(said.shown_by)) {
            shared.withdraw(warning);
        }
    }

    /// Says how the camera itself moves, up to the frame of `tracks`.
    pub fn tell_of_camera(&mut self, tracks: &TrackSet, meter: &ShakeMeter, shared: &Shared) {
        let time_s = tracks.time_s;
        let begun_s = *self.begun_s.get_or_insert(time_s);
        let is_lost = tracks.camera.background == Background::Lost;
        if is_lost != self.is_lost {
            self.is_lost = is_lost;
            match is_lost {
                true => shared.warn(camera_lost(time_s)),
                false => shared.tell(format!("the camera is back where it was at {time_s:.1} s")),
            }
        }
        let is_judged = self.tree.is_some() && time_s - begun_s >= CAMERA_JUDGED_S;
        if is_judged && !is_lost {
            self.tell_what_shows_camera(meter.so_far().shown_by(), shared);
        }
        self.tell_of_shake(meter, shared);
    }

    /// Warns where the camera's motion is not known as well as it should be, and withdraws what is
    /// not so any more.
    fn tell_what_shows_camera(&mut self, shown_by: CameraShownBy, shared: &Shared) {
        let before = std::mem::replace(&mut self.shown_by, shown_by);
        if shown_by == before {
            return;
        }
        camera_warning(before)
            .into_iter()
            .for_each(|warning| shared.withdraw(warning));
        camera_warning(shown_by)
            .into_iter()
            .for_each(|warning| shared.warn(warning.into()));
    }

    fn tell_of_shake(&mut self, meter: &ShakeMeter, shared: &Shared) {
        if let Some(shake) = meter.newest().filter(Shake::is_strong)
            && !self.shakes
        {
            self.shakes = true;
            let hz = shake.frequency_hz.map(|hz| format!(" at {hz:.1} Hz"));
            shared.tell(format!(
                "the camera trembles by {:.1} px{}: that is taken off",
                shake.rms_px,
                hz.unwrap_or_default()
            ));
        }
    }
}

/// The warning where the camera's motion is not known as well as it should be.
fn camera_warning(shown_by: CameraShownBy) -> Option<&'static str> {
    match shown_by {
        CameraShownBy::Background => None,
        CameraShownBy::Foot => Some(CAMERA_BY_FOOT),
        CameraShownBy::Nothing => Some(CAMERA_UNCLEAR),
    }
}

/// The warning of a camera that looks elsewhere, or sees nothing.
fn camera_lost(time_s: f64) -> String {
    format!(
        "the camera was turned, zoomed, refocused or covered at {time_s:.1} s: what it films from \
         then on does not count; point it back, or start again"
    )
}

/// The warning that goes with a tree that was asked for before the measure had reached `threshold`.
pub fn little_motion(tree: &Model, threshold: f64) -> Option<String> {
    let measure = tree.evidence.measure;
    (tree.forced && measure < threshold).then(|| {
        // Never rounded up to the threshold.
        let measure = (100.0 * measure).floor() / 100.0;
        format!(
            "the tree was built from little motion (accumulation {measure:.2} of {threshold}); \
             branches may be wrong: film longer, or in more wind"
        )
    })
}

/// The warning where the outline that was found by motion holds another trunk.
fn two_trunks(other_px: Point2<i32>) -> String {
    format!(
        "another trunk stands in the outline that was found, at {},{}: some of the branches may be those \
         of another tree; draw an outline around one tree (key o, or --outline FILE)",
        other_px.x, other_px.y
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_that_begins_anew_has_no_warning_of_the_tree_before() {
        let shared = Shared::default();
        let mut announced = Announced {
            warned: Some("little motion".into()),
            shown_by: CameraShownBy::Nothing,
            ..Announced::default()
        };
        for warning in [
            "little motion",
            NO_WOOD,
            FOOT_GUESSED,
            CAMERA_UNCLEAR,
            "the disk is slow",
        ] {
            shared.warn(warning.into());
        }
        announced.restart(&shared);
        assert_eq!(shared.warnings(), ["the disk is slow"]);
        assert!(announced.warned.is_none());
    }
}
