//! The modes of the whole tree: those that branches have for their own, and those of branches that
//! the tree lacks.

use super::branch_tree::BranchTree;
use super::film::Film;
use super::members::{is_seen, mean_px, share_among};
use super::point_modes::{PointMode, PointModes};
use super::wind;
use crate::model::{Excitation, Interval, NodeId, Sway, Swaying, TreeMode, Unidentified};
use nalgebra::Point2;

/// A mode with this share of its points in one that is known, and its frequency, is that one.
const SHARE_IN_KNOWN: f64 = 0.6;
/// r(1 - cos Θ) of a swing sin ωt: its part at 2ω, for small angles, is this share of rΘ for each
/// radian.
const SECOND_ORDER: f64 = 0.25;
/// Two frequencies are alike within their intervals, within the one share always, and never beyond the other.
const ALIKE: f64 = 0.01;
const UNLIKE: f64 = 0.03;

/// A mode that turns some points about a place.
struct Swing<'a> {
    sway: Sway,
    /// As indices of the film's tracks, in order.
    tracks: &'a [usize],
    pivot_px: Point2<f64>,
    collinearity: Option<f64>,
    /// The branch whose own it is.
    branch: Option<usize>,
}

/// All modes that are known, the slowest first: the answers of `sways` with the points of their
/// branches (`members`), and those of `found` that are none of these.
pub(super) fn modes_of_tree(
    tree: &BranchTree,
    film: &Film,
    members: &[Vec<usize>],
    trunk: NodeId,
    sways: &[Swaying],
    found: Option<&PointModes>,
) -> Vec<TreeMode> {
    let swings = swings(tree, members, sways, found);
    let mut out: Vec<TreeMode> = swings.iter().map(|s| s.mode(tree, film, trunk)).collect();
    out.sort_by(|a, b| {
        let [a, b] = [a, b].map(|mode| mode.sway.frequency_hz.value);
        a.total_cmp(&b)
    });
    out
}

/// Takes their answers from the branches, but for the trunk, whose points move too little with them.
///
/// - Less than the other modes move these points at second order: a point that swings by an angle Θ
///   moves on an arc. Besides what is proportional to Θ it has a displacement of Θ/4 of that, at sums
///   and differences of frequencies. What a linear model finds below that is as likely this, or a
///   neighbour's motion that the tracks have caught, as a mode of the branch. So is what has no damping, at twice or
///   three times the trunk's frequency.
/// - In wind, less than noise does. After a release a fit in phase finds less than that.
pub(super) fn withdraw_small(
    tree: &BranchTree,
    film: &Film,
    members: &[Vec<usize>],
    trunk: NodeId,
    sways: &mut [Swaying],
    found: Option<&PointModes>,
) {
    let swings = swings(tree, members, sways, found);
    let motion_px2: Vec<Vec<f64>> = swings.iter().map(|s| s.motion_px2(film)).collect();
    let mut withdrawn = Vec::new();
    for (own, swing) in swings.iter().enumerate() {
        let Some(branch) = swing.branch.filter(|b| *b != trunk.index()) else {
            continue;
        };
        if sways[trunk.index()].is_ok_and(|trunk| is_overtone(&swing.sway, &trunk)) {
            withdrawn.push((branch, Unidentified::AncestorsSway));
            continue;
        }
        // An angle that is not known says nothing.
        if swing.angle() == 0.0 {
            continue;
        }
        let (mut others_px2, mut angle) = (0.0, 0.0);
        for (other, motion_px2) in motion_px2.iter().enumerate() {
            let here_px2: f64 = swing.tracks.iter().map(|&k| motion_px2[k]).sum();
            if other != own && here_px2 > 0.0 {
                others_px2 += here_px2;
                angle += swings[other].angle();
            }
        }
        let own_px2: f64 = swing.tracks.iter().map(|&k| motion_px2[own][k]).sum();
        let rms_px = (0.5 * own_px2 / swing.tracks.len() as f64).sqrt();
        let is_noise = swing.sway.excitation == Excitation::Wind && rms_px < wind::NOISE_PX;
        if own_px2 < (SECOND_ORDER * angle).powi(2) * others_px2 {
            withdrawn.push((branch, Unidentified::AncestorsSway));
        } else if is_noise {
            withdrawn.push((branch, Unidentified::TooLittleMotion));
        }
    }
    for (branch, reason) in withdrawn {
        sways[branch] = Err(reason);
    }
}

/// Whether what oscillates may be of the second or third order: at twice or three times the frequency of the trunk, and
/// decaying as no mode does that a damping could be found of.
fn is_overtone(own: &Sway, trunk: &Sway) -> bool {
    if own.damping_ratio.is_some() {
        return false;
    }
    let Interval { value, lo, hi } = own.frequency_hz;
    // A wide interval holds other modes, too.
    let low = lo.clamp((1.0 - UNLIKE) * value, (1.0 - ALIKE) * value);
    let high = hi.clamp((1.0 + ALIKE) * value, (1.0 + UNLIKE) * value);
    [2.0, 3.0]
        .into_iter()
        .any(|n| (low..=high).contains(&(n * trunk.frequency_hz.value)))
}

/// The answers of `sways`, and the modes of `found` that are none of these.
fn swings<'a>(
    tree: &BranchTree,
    members: &'a [Vec<usize>],
    sways: &[Swaying],
    found: Option<&'a PointModes>,
) -> Vec<Swing<'a>> {
    let found: &[PointMode] = found.map_or(&[], |found| &found.modes);
    let mut swings: Vec<Swing> = Vec::new();
    for (b, sway) in sways.iter().enumerate() {
        let Ok(sway) = sway else { continue };
        let same = found
            .iter()
            .find(|mode| mode.sway.frequency_hz == sway.frequency_hz);
        swings.push(Swing {
            sway: *sway,
            tracks: &members[b],
            pivot_px: tree.branches[b].base_px,
            collinearity: same.map(|mode| mode.collinearity),
            branch: Some(b),
        });
    }
    for mode in found {
        let is_of_no_branch = mode.is_sure && mode.branch.is_none();
        if is_of_no_branch && !swings.iter().any(|known| is_known(mode, known)) {
            swings.push(Swing {
                sway: mode.sway,
                tracks: &mode.tracks,
                pivot_px: mode.pivot_px,
                collinearity: Some(mode.collinearity),
                branch: None,
            });
        }
    }
    swings
}

fn is_known(mode: &PointMode, known: &Swing) -> bool {
    let ratio = known.sway.frequency_hz.value / mode.mode.frequency_hz;
    share_among(&mode.tracks, known.tracks) >= SHARE_IN_KNOWN && ratio.ln().abs() < mode.same_within
}

impl Swing<'_> {
    /// At its largest, radians; 0 where it is not known.
    fn angle(&self) -> f64 {
        let angle = self.sway.amplitude_deg.to_radians();
        if angle.is_finite() { angle } else { 0.0 }
    }

    /// Squares of the largest displacement of each of the film's points, px².
    fn motion_px2(&self, film: &Film) -> Vec<f64> {
        let mut by_track = vec![0.0; film.tracks.len()];
        for &k in self.tracks {
            let at_px = mean_px(&film.tracks[k].at_px);
            if is_seen(&at_px) {
                let arm_px = at_px - self.pivot_px;
                by_track[k] = self.angle().powi(2) * arm_px.norm_squared();
            }
        }
        by_track
    }

    fn mode(&self, tree: &BranchTree, film: &Film, trunk: NodeId) -> TreeMode {
        let by_track = self.motion_px2(film);
        let mut by_branch = vec![0.0; tree.len()];
        for &k in self.tracks {
            by_branch[film.tracks[k].node.index()] += by_track[k];
        }
        TreeMode {
            sway: self.sway,
            collinearity: self.collinearity,
            node: self.branch.map(|b| tree.branches[b].node),
            is_trunks: self.branch == Some(trunk.index()),
            points: self.tracks.len(),
            motion_px2: tree.values_by_node(&by_branch, 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::film::FilmTrack;
    use super::*;
    use crate::model::{Node, Size, Skeleton};

    fn sway(frequency_hz: f64, amplitude_deg: f64, excitation: Excitation) -> Swaying {
        Ok(Sway {
            frequency_hz: Interval {
                value: frequency_hz,
                lo: 0.99 * frequency_hz,
                hi: 1.01 * frequency_hz,
            },
            damping_ratio: None,
            excitation,
            amplitude_deg,
        })
    }

    /// What is left of the limb's answer: a trunk of 100 px that swings by `trunk_deg`, and a limb of
    /// 50 px on it with five points that swings by `limb_deg`.
    fn limb_after(trunk_deg: f64, limb_deg: f64, excitation: Excitation) -> Swaying {
        limb_at(1.3, trunk_deg, limb_deg, excitation)
    }

    /// The same for a limb of this frequency.
    fn limb_at(limb_hz: f64, trunk_deg: f64, limb_deg: f64, excitation: Excitation) -> Swaying {
        let skeleton = Skeleton {
            nodes: vec![
                Node::made_up(0, None, [0.0, 0.0, 0.0]),
                Node::made_up(1, Some(0), [0.0, 100.0, 0.0]),
                Node::made_up(2, Some(1), [50.0, 100.0, 0.0]),
            ],
            foot_px: Point2::new(300.0, 340.0),
            image_size: Size {
                width: 640,
                height: 360,
            },
        };
        let tracks = (1..=5).map(|k| FilmTrack {
            node: NodeId(2),
            at_px: vec![Point2::new(300.0 + 10.0 * f64::from(k), 240.0); 2],
        });
        let film = Film::new(&[0.0, 0.1], tracks.collect());
        let members = vec![(0..5).collect(); 3];
        let mut sways = vec![
            Err(Unidentified::NotMeasured),
            sway(0.5, trunk_deg, excitation),
            sway(limb_hz, limb_deg, excitation),
        ];
        let tree = BranchTree::of(&skeleton);
        withdraw_small(&tree, &film, &members, NodeId(1), &mut sways, None);
        assert!(sways[1].is_ok(), "the trunk's stays");
        sways[2]
    }

    #[test]
    fn what_an_arc_makes_is_no_mode() {
        // At 16 degrees an arc makes 7 % of 29 px: 2.0 px, which the limb does by 3.5 degrees.
        let release = Excitation::Release;
        let by_arc = Err(Unidentified::AncestorsSway);
        assert_eq!(limb_after(16.0, 2.5, release), by_arc);
        assert!(limb_after(16.0, 6.0, release).is_ok());
        assert!(limb_after(1.0, 2.5, release).is_ok());
    }

    #[test]
    fn an_overtone_of_the_trunk_is_no_mode() {
        let release = Excitation::Release;
        let by_arc = Err(Unidentified::AncestorsSway);
        // The trunk sways at 0.5 Hz.
        assert_eq!(limb_at(1.003, 16.0, 12.0, release), by_arc);
        assert_eq!(limb_at(1.495, 16.0, f64::NAN, release), by_arc);
        assert!(limb_at(1.3, 16.0, f64::NAN, release).is_ok());
        assert!(limb_at(1.2, 16.0, 12.0, release).is_ok());
    }

    #[test]
    fn noise_is_no_mode_in_wind() {
        let noise = Err(Unidentified::TooLittleMotion);
        assert_eq!(limb_after(0.2, 0.3, Excitation::Wind), noise);
        assert!(limb_after(0.2, 0.6, Excitation::Wind).is_ok());
        assert!(limb_after(0.2, 0.3, Excitation::Release).is_ok());
    }
}
