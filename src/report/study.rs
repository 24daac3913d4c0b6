//! One capture, analysed: what the table, the JSON and the page are made from.

use super::decaying::decaying;
use super::pieces::{averaged, looked_at_s, pieces};
use crate::bounds::Bounds;
use crate::dynamics::{
    Analysis, Film, HalfPower, LEAST_PERIODS, Onset, RelativeSpectrum, Spectrum,
    angle_in_space_deg, angle_to_parent_deg, spectrum,
};
use crate::model::{
    BotanicalBranches, Excitation, ModeSummary, NodeId, Origin, Participation, Pose, Skeleton,
    Sway, Swaying, Unidentified, Verdict, participation, reason,
};
use nalgebra::{Point2, Vector2, distance};

/// A step from frame to frame that is so many times the usual one is a gap.
const GAP: f64 = 1.6;
/// The points and the angle of the model see a branch's amplitude in different ways; farther apart
/// than so many times, neither is shown.
const AGREE: f64 = 1.5;

/// What a [`Study`] is made from.
#[derive(Clone, Copy, Debug)]
pub struct Given<'a> {
    /// What the capture is called in the report.
    pub name: &'a str,
    /// What was filmed: the name of the source.
    pub source: &'a str,
    /// When it was filmed, and what the user noted.
    pub origin: &'a Origin,
    /// What the capture was found to be worth.
    pub verdict: Option<&'a Verdict>,
    pub skeleton: &'a Skeleton,
    /// The points that were analysed, and poses of the same time; none where `motion.csv` is
    /// missing.
    pub film: &'a Film,
    pub poses: &'a [Pose],
    pub analysis: &'a Analysis,
    /// What the user says made it sway.
    pub excitation: Option<Excitation>,
    /// 0 where no scale is known.
    pub metres_per_px: f64,
    /// Highest frequency that is looked for, Hz.
    pub highest_hz: f64,
    /// Corners of the region that was tracked, px; empty if unknown.
    pub outline_px: &'a [Point2<i32>],
    /// A frame of the film as a `data:` address.
    pub picture: Option<&'a str>,
    /// What the reader should know, one sentence each.
    pub notes: &'a [String],
}

/// One capture, analysed.
#[derive(Clone, Debug)]
pub struct Study {
    pub name: String,
    /// What was filmed, without the folders that it lies in.
    pub source: String,
    /// When it was filmed, and what the user noted.
    pub origin: Origin,
    /// What the capture was found to be worth; `None` where nobody judged.
    pub verdict: Option<Verdict>,
    /// Size of the picture, px.
    pub size: [u32; 2],
    /// First and last frame that were analysed, s since the first of the capture, and how many
    /// there are.
    pub span_s: Bounds,
    pub frames: usize,
    pub gaps: Vec<Gap>,
    pub onset: Option<Onset>,
    /// First and last moment that the answers come from, s.
    pub used_s: Bounds,
    /// What the user says made it sway; `None` where the signal told.
    pub given: Option<Excitation>,
    /// 0 where no scale is known.
    pub metres_per_px: f64,
    /// Highest frequency that was looked for, Hz.
    pub highest_hz: f64,
    /// The trunk's foot in the picture, px.
    pub foot_px: Point2<f64>,
    pub outline_px: Vec<Point2<i32>>,
    pub picture: Option<String>,
    pub branches: Vec<Branch>,
    /// The branches are those between coloured markers: of those without a frequency the peak of the angle
    /// is said.
    pub by_markers: bool,
    /// The modes of the whole tree, the slowest first.
    pub modes: Vec<ModeSummary>,
    pub notes: Vec<String>,
}

/// A time without frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// The last moment before it.
    pub after_s: f64,
    /// From there to the next frame.
    pub length_s: f64,
}

/// One measured branch.
#[derive(Clone, Debug)]
pub struct Branch {
    /// The node that it ends in, as in `nodes.csv`.
    pub name: u32,
    /// What this piece of a botanical branch is called, as in the model's file; and the order of
    /// that branch, 0 for the trunk.
    pub piece: String,
    pub order: u32,
    /// The coloured marker in which it ends, by the name that the user gave it.
    pub marker: Option<String>,
    /// The branch that carries it; `None` for the trunk.
    pub parent: Option<u32>,
    pub level: u8,
    /// Points on it and on all that it carries.
    pub points: u32,
    /// Where it begins and ends in the picture at rest, px to the right of the trunk's foot and
    /// above it.
    pub base_from_foot_px: Point2<f64>,
    pub tip_from_foot_px: Point2<f64>,
    /// Where the points on it and on all that it carries lie on average, in the same way, and their
    /// root mean square distance from there. No numbers where there are none.
    pub centre_from_foot_px: Point2<f64>,
    pub spread_px: f64,
    pub sway: Swaying,
    /// The modes of the tree in which its points swing, the largest share first.
    pub participation: Vec<Participation>,
    /// Amplitude of the branch's own oscillation in its angle to the one that carries it, degrees;
    /// no number where unknown.
    pub amplitude_deg: f64,
    /// What it is taken from: by the turn of the points about the place where the branch begins at
    /// rest, which a move of that place makes larger or smaller; and after a release by the angle
    /// in the picture's plane, as in [`fitted_deg`](Self::fitted_deg). No numbers where unknown.
    pub by_points_deg: f64,
    pub in_angle_deg: f64,
    /// When every angle was, s; empty without poses. The angles are to the branch that carries it,
    /// less their mean, degrees: in the picture's plane and in space (Hu et al. eq. 1); no number
    /// where it has no direction.
    pub times_s: Vec<f64>,
    pub plane_deg: Vec<f64>,
    pub space_deg: Vec<f64>,
    /// After a release: the part of the angle in the picture's plane that has the branch's own
    /// frequency and damping.
    pub fitted_deg: Option<Vec<f64>>,
    /// Of the angle in the picture's plane, degrees, over the time that the answer comes from; in
    /// wind a mean over pieces.
    pub spectrum: Option<Spectrum>,
    pub reference: Option<HalfPower>,
    /// Power of the same angle over a smooth background, by its true times. `None` without poses,
    /// of a film that is too short, and of an angle that does not change.
    pub over_background: Option<RelativeSpectrum>,
    /// Where its end went: to the right of its place at rest and above it, px, by
    /// [`times_s`](Self::times_s).
    pub way_px: Vec<Vector2<f64>>,
}

impl Study {
    /// Puts together what is reported of a capture.
    pub fn of(given: &Given) -> Self {
        let Given {
            skeleton,
            film,
            analysis,
            ..
        } = *given;
        let times = &film.times_s;
        let usual_s = film.step_s();
        let gaps = times
            .windows(2)
            .filter(|w| w[1] - w[0] > GAP * usual_s)
            .map(|w| Gap {
                after_s: w[0],
                length_s: w[1] - w[0],
            })
            .collect();
        let ends = times
            .first()
            .zip(times.last())
            .map_or(Bounds::default(), |(a, b)| Bounds::new(*a, *b));
        let source = given
            .source
            .rsplit(['/', '\\'])
            .find(|part| !part.is_empty())
            .unwrap_or_default();
        let mut study = Self {
            name: given.name.into(),
            source: source.into(),
            origin: given.origin.clone(),
            verdict: given.verdict.cloned(),
            size: [skeleton.image_size.width, skeleton.image_size.height],
            span_s: ends,
            frames: times.len(),
            gaps,
            onset: analysis.onset,
            used_s: analysis
                .onset
                .map_or(ends, |onset| used_s(&onset, times, ends)),
            given: given.excitation,
            metres_per_px: given.metres_per_px,
            highest_hz: given.highest_hz,
            foot_px: skeleton.foot_px,
            outline_px: given.outline_px.to_vec(),
            picture: given.picture.map(str::to_owned),
            branches: Vec::new(),
            by_markers: false,
            modes: ModeSummary::all(&analysis.modes, skeleton),
            notes: given.notes.to_vec(),
        };
        let botanical = skeleton.botanical_branches();
        let clouds = point_clouds(skeleton, film);
        for node in skeleton.measured_branches() {
            let sway = analysis
                .sway
                .get(node.index())
                .copied()
                .unwrap_or(Err(Unidentified::NotMeasured));
            let mut branch = branch(given, &botanical, node, sway, study.used_s);
            if let Some(cloud) = clouds.get(node.index()) {
                branch.centre_from_foot_px = cloud.centre();
                branch.spread_px = cloud.spread();
            }
            study.branches.push(branch);
        }
        study
    }

    /// Frames a second, by their real times; no number for less than two.
    pub fn rate_hz(&self) -> f64 {
        let span_s = self.span_s.length();
        if span_s > 0.0 {
            (self.frames.saturating_sub(1)) as f64 / span_s
        } else {
            f64::NAN
        }
    }

    /// How much higher than the foot, or farther from it, the tree's farthest branch ends, px.
    pub fn size_px(&self) -> f64 {
        self.branches
            .iter()
            .map(|b| b.tip_from_foot_px.coords.norm())
            .fold(0.0, f64::max)
    }

    /// Which branch is the trunk: of those that nothing carries, the one with most points.
    pub fn trunk(&self) -> Option<usize> {
        let branches = self.branches.iter().enumerate();
        let stems = branches.filter(|(_, b)| b.parent.is_none());
        // Of as many points the first.
        let most = stems.max_by_key(|(i, b)| (b.points, std::cmp::Reverse(*i)));
        most.map(|(i, _)| i)
    }

    /// The branch of a number.
    pub fn branch(&self, name: u32) -> Option<&Branch> {
        self.branches.iter().find(|b| b.name == name)
    }

    /// How many branches have a frequency.
    pub fn answers(&self) -> usize {
        self.branches.iter().filter(|b| b.sway.is_ok()).count()
    }
}

impl Branch {
    /// What it is called where captures are compared: its marker, else its node as in `nodes.csv`.
    pub fn called(&self) -> String {
        self.marker.clone().unwrap_or_else(|| self.name.to_string())
    }

    /// What is known of its sway.
    pub fn known(&self) -> Option<Sway> {
        self.sway.ok()
    }

    /// Why it has no frequency of its own, and with which modes of the tree it moves; `None` where
    /// it has one.
    pub fn why(&self) -> Option<String> {
        self.sway.err().map(|why| reason(why, &self.participation))
    }

    /// Its length in the picture at rest, px.
    pub fn length_px(&self) -> f64 {
        distance(&self.base_from_foot_px, &self.tip_from_foot_px)
    }

    /// What the amplitude is at the branch's end, px in the picture; no number where unknown.
    pub fn amplitude_px(&self) -> f64 {
        self.amplitude_deg.to_radians() * self.length_px()
    }
}

/// First and last moment of the frames that an analysis has used, of a film from and to these
/// `ends`, s.
fn used_s(onset: &Onset, times_s: &[f64], ends: Bounds) -> Bounds {
    let first = times_s.get(onset.from);
    let last = times_s.get(onset.to.saturating_sub(1));
    Bounds::new(
        first.copied().unwrap_or(ends.lo),
        last.copied().unwrap_or(ends.hi),
    )
}

fn branch(
    given: &Given,
    botanical: &BotanicalBranches,
    node: NodeId,
    sway: Swaying,
    used_s: Bounds,
) -> Branch {
    let (skeleton, poses) = (given.skeleton, given.poses);
    let own = &skeleton.nodes[node.index()];
    let parent = skeleton.moving_parent(node).unwrap_or_default();
    let begin = skeleton.begin(node).unwrap_or_default();
    let (base, tip) = (place(skeleton, begin), place(skeleton, node));
    let times_s: Vec<f64> = poses.iter().map(|p| p.time_s).collect();
    let plane_deg = centred(angle_to_parent_deg(skeleton, poses, node));
    let space_deg = centred(angle_in_space_deg(skeleton, poses, node));
    let (spectrum, reference) = seen_in(given, &times_s, &plane_deg, used_s);
    let over_background = over_background(given, &times_s, &plane_deg, used_s);
    let released = sway.ok().filter(|s| s.excitation == Excitation::Release);
    let fitted = released.zip(given.analysis.onset).and_then(|(own, onset)| {
        let others = others_seen(given, node);
        decaying(&times_s, &plane_deg, used_s, onset.at_s, &own, &others)
    });
    let by_points_deg = sway.map_or(f64::NAN, |s| s.amplitude_deg);
    let in_angle_deg = fitted.as_ref().map_or(f64::NAN, |f| f.amplitude_deg);
    let amplitude_deg = if poses.len() > 1 && released.is_some() {
        agreed(by_points_deg, in_angle_deg)
    } else {
        by_points_deg
    };
    let parent_node = own.parent.and(skeleton.nodes.get(parent.index()));
    Branch {
        name: own.name.0,
        piece: botanical.piece_name(node),
        marker: None,
        order: botanical.order(node),
        parent: parent_node.filter(|p| p.parent.is_some()).map(|p| p.name.0),
        level: own.level,
        points: own.n_tracks,
        base_from_foot_px: base,
        tip_from_foot_px: tip,
        centre_from_foot_px: Point2::new(f64::NAN, f64::NAN),
        spread_px: f64::NAN,
        sway,
        participation: participation(&given.analysis.modes, botanical, node),
        amplitude_deg,
        by_points_deg,
        in_angle_deg,
        way_px: way_px(poses, node, tip),
        times_s,
        plane_deg,
        space_deg,
        fitted_deg: fitted.map(|f| f.curve_deg),
        spectrum,
        reference,
        over_background,
    }
}

/// Where the points of a branch lie: how many, the sum of their places, px to the right and up from
/// the foot, and that of the squares of their distances from it.
#[derive(Clone, Copy, Debug, Default)]
struct Cloud {
    points: f64,
    sum: Vector2<f64>,
    squares: f64,
}

impl Cloud {
    fn add(&mut self, other: Self) {
        self.points += other.points;
        self.sum += other.sum;
        self.squares += other.squares;
    }

    fn centre(&self) -> Point2<f64> {
        Point2::from(self.sum / self.points)
    }

    fn spread(&self) -> f64 {
        let square = self.squares / self.points - self.centre().coords.norm_squared();
        // Of one point it is 0, and may come out less.
        if square < 0.0 { 0.0 } else { square.sqrt() }
    }
}

/// The points on every node and on all that it carries, by their mean places in the film.
fn point_clouds(skeleton: &Skeleton, film: &Film) -> Vec<Cloud> {
    let mut clouds = vec![Cloud::default(); skeleton.nodes.len()];
    for track in &film.tracks {
        let seen = track.at_px.iter().filter(|p| p.x.is_finite());
        let frames = seen.clone().count() as f64;
        let sum: Vector2<f64> = seen.map(|p| p - skeleton.foot_px).sum();
        let place = Vector2::new(sum.x, -sum.y) / frames;
        if let Some(cloud) = clouds.get_mut(track.node.index())
            && frames > 0.0
        {
            cloud.add(Cloud {
                points: 1.0,
                sum: place,
                squares: place.norm_squared(),
            });
        }
    }
    // Parents stand before their children.
    for i in (1..clouds.len()).rev() {
        if let Some(parent) = skeleton.nodes[i].parent {
            let own = clouds[i];
            clouds[parent.index()].add(own);
        }
    }
    clouds
}

/// Where a node is at rest, px to the right and up from the foot.
fn place(skeleton: &Skeleton, node: NodeId) -> Point2<f64> {
    skeleton.nodes[node.index()].position.xy()
}

/// How far a node was from `rest` in every pose, px to the right and up; no numbers where a pose
/// lacks it.
fn way_px(poses: &[Pose], node: NodeId, rest: Point2<f64>) -> Vec<Vector2<f64>> {
    let mut way = Vec::with_capacity(poses.len());
    for pose in poses {
        way.push(match pose.joints.get(node.index()) {
            Some(joint) => joint.position.xy() - rest,
            None => Vector2::new(f64::NAN, f64::NAN),
        });
    }
    way
}

/// Spectrum and reference of an angle over the time that the analysis has used.
fn seen_in(
    given: &Given,
    times_s: &[f64],
    angle_deg: &[f64],
    used_s: Bounds,
) -> (Option<Spectrum>, Option<HalfPower>) {
    let (mut used_times_s, mut used_deg) = (Vec::new(), Vec::new());
    for (time_s, deg) in times_s.iter().zip(angle_deg) {
        if used_s.contains(*time_s) {
            used_times_s.push(*time_s);
            used_deg.push(*deg);
        }
    }
    seen(&used_times_s, &used_deg, is_driven(given), given.highest_hz)
}

/// Whether wind drove the tree, as far as is known.
fn is_driven(given: &Given) -> bool {
    let onset = given.analysis.onset;
    onset.is_none_or(|o| o.excitation == Excitation::Wind)
}

/// Power of an angle over its background in the time that the analysis has used; of a film in wind
/// in its pieces.
fn over_background(
    given: &Given,
    times_s: &[f64],
    angle_deg: &[f64],
    used_s: Bounds,
) -> Option<RelativeSpectrum> {
    let pieces = if is_driven(given) {
        pieces(used_s)
    } else {
        vec![used_s]
    };
    let lowest_hz = LEAST_PERIODS / pieces.first()?.length();
    let highest_hz = given.highest_hz.min(0.5 / given.film.step_s());
    let within_hz = Bounds::new(lowest_hz, highest_hz);
    RelativeSpectrum::of(times_s, angle_deg, &pieces, within_hz)
}

/// The sways of the branches that carry this one and of those that leave its end, which is seen to
/// move with them, too.
fn others_seen(given: &Given, node: NodeId) -> Vec<Sway> {
    let skeleton = given.skeleton;
    let carried = (0..skeleton.nodes.len() as u32)
        .map(NodeId)
        .filter(|n| *n != node && skeleton.mover(*n) == *n)
        .filter(|n| skeleton.begin(*n) == Some(node));
    let mut out = Vec::new();
    for other in skeleton.carriers(node).chain(carried) {
        if let Some(Ok(sway)) = given.analysis.sway.get(other.index()) {
            out.push(*sway);
        }
    }
    out
}

/// An amplitude that is seen in an angle, if the points do not contradict it.
fn agreed(by_points: f64, in_angle: f64) -> f64 {
    let apart = (in_angle / by_points).ln().abs();
    if apart <= AGREE.ln() {
        in_angle
    } else {
        f64::NAN
    }
}

/// The spectrum of an angle, of one that wind has `driven` as a mean over pieces, and what its
/// largest peak says.
fn seen(
    times_s: &[f64],
    angle_deg: &[f64],
    driven: bool,
    highest_hz: f64,
) -> (Option<Spectrum>, Option<HalfPower>) {
    let spectrum = if driven {
        averaged(times_s, angle_deg)
    } else {
        spectrum(times_s, angle_deg)
    };
    let span_s = times_s
        .last()
        .zip(times_s.first())
        .map_or(0.0, |(b, a)| b - a);
    // What is slower is drift, that the bins of the piece cannot tell from sway.
    let piece_s = if driven { looked_at_s(span_s) } else { span_s };
    let reference = spectrum
        .as_ref()
        .filter(|_| piece_s > 0.0)
        .and_then(|s| s.half_power(Bounds::new(LEAST_PERIODS / piece_s, highest_hz)));
    (spectrum, reference)
}

/// Less their mean.
fn centred(mut angles: Vec<f64>) -> Vec<f64> {
    let seen = angles.iter().filter(|a| a.is_finite());
    let mean = seen.clone().sum::<f64>() / (seen.count() as f64).max(1.0);
    angles.iter_mut().for_each(|a| *a -= mean);
    angles
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A stub of two points that its parent takes along seems to turn by 30 degrees: no number
    /// that only one witness gives.
    #[test]
    fn an_amplitude_that_points_and_angle_do_not_agree_on_is_not_told() {
        assert_eq!((agreed(3.0, 4.0), agreed(4.0, 3.0)), (4.0, 3.0));
        for (points, angle) in [
            (30.6, 4.4),
            (1.5, 17.1),
            (f64::NAN, 1.0),
            (1.0, f64::NAN),
            (0.0, 1.0),
            (0.0, 0.0),
        ] {
            assert!(agreed(points, angle).is_nan(), "{points} and {angle}");
        }
    }

    /// Points at these places, px.
    fn cloud(places: &[[f64; 2]]) -> Cloud {
        let mut cloud = Cloud::default();
        for place in places {
            let place = Vector2::from(*place);
            cloud.add(Cloud {
                points: 1.0,
                sum: place,
                squares: place.norm_squared(),
            });
        }
        cloud
    }

    #[test]
    fn the_points_of_a_branch_have_a_centre_and_a_spread() {
        let mut all = cloud(&[[10.0, 103.0], [10.0, 97.0]]);
        assert_eq!(
            (all.centre(), all.spread()),
            (Point2::new(10.0, 100.0), 3.0)
        );
        all.add(cloud(&[[7.0, 100.0], [13.0, 100.0]]));
        assert_eq!(
            (all.centre(), all.spread()),
            (Point2::new(10.0, 100.0), 3.0)
        );
        // Squares that are not quite even must not make it no number.
        assert!(cloud(&[[0.1, 0.7]]).spread() < 1e-6);
        assert!(cloud(&[]).spread().is_nan() && cloud(&[]).centre().x.is_nan());
    }

    /// Pieces of 20 s cannot tell a sway of 20 s from drift, however many minutes of wind there
    /// are.
    #[test]
    fn drift_that_is_as_slow_as_a_piece_is_not_the_reference() {
        let times: Vec<f64> = (0..3600).map(|k| f64::from(k) / 30.0).collect();
        let angle: Vec<f64> = times
            .iter()
            .map(|t| 1.5 * (TAU * 0.05 * t).sin() + (TAU * 0.8 * t).sin())
            .collect();
        // In one piece of two minutes it is a sway like any other.
        for (driven, expected_hz, off_hz) in [(true, 0.8, 0.03), (false, 0.05, 0.01)] {
            let (_, reference) = seen(&times, &angle, driven, 5.0);
            let peak_hz = reference.unwrap().peak_hz;
            assert!((peak_hz - expected_hz).abs() < off_hz, "{peak_hz} Hz");
        }
    }
}
