//! How the branches of an example sway, by their spectra, and a loop of a new tree that sways so
//! (Li 2011 sect. 5.1 and 5.2).

use crate::model::{NodeId, Pose, Skeleton, Swaying, Unidentified};
use crate::random::Generator;
use crate::signal::interpolation::linear;
use nalgebra::{Rotation3, Vector3};
use rand::RngExt;
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Length of the pieces that a film is cut into, and of a loop that is learned from them, s. Longer
/// ones tell frequencies apart that are nearer to each other, and there are fewer of them.
pub const LOOP_S: f64 = 10.0;
/// A film that is shorter shows no sway, s.
const SHORTEST_FILM_S: f64 = 2.0;
/// Highest rate of the poses of a piece, Hz.
const HIGHEST_RATE_HZ: f64 = 30.0;
/// Share of the frequencies that is kept, from the lowest: the paper's "20 % or so".
const KEPT: usize = 5;
/// Energy that a window of von Hann leaves of a signal.
const HANN_ENERGY: f64 = 3.0 / 8.0;
/// A branch that turns less than this (root of the sum of squares of its amplitudes, rad) does not
/// sway.
const LEAST_TURN: f64 = 1e-6;

/// How the measured branches of an example sway.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionStatistics {
    /// Of every branch in every piece of the film.
    spectra: Vec<TurnSpectrum>,
    /// The levels of these branches.
    levels: Vec<f64>,
    /// Steps of a piece, and how long one is, s.
    steps: usize,
    step_s: f64,
    deepest: u8,
}

/// How one branch turns in one piece of the film: its complex amplitudes about the model axes x, y
/// and z, radians, by frequency from that of the piece's length up. What is above is left out.
#[derive(Clone, Debug, PartialEq)]
struct TurnSpectrum {
    axes: [Vec<Complex<f64>>; 3],
}

impl MotionStatistics {
    /// Of the measured branches of `skeleton` in the poses of a film, in the order of time. `None`
    /// where the film is shorter than two seconds, its times do not grow, or nothing sways.
    ///
    /// The film is cut into pieces of ten seconds, each under a window of von Hann (Welch 1967).
    ///
    /// The paper learns one Dirichlet distribution of the real parts and one of the imaginary parts of
    /// all coefficients, "shifted so that no term is negative". Shifted so, all frequencies have the
    /// same mean and vary alike, and what is drawn is noise without a dominant frequency. Of their
    /// squares it would be "the ratio between the energy of each given frequency"; but neighbouring
    /// frequencies are drawn independently of each other, so that a peak that every branch has
    /// falls apart. So spectra are kept as they are, see [`sample`](Self::sample).
    pub fn of(skeleton: &Skeleton, poses: &[Pose]) -> Option<Self> {
        let (n, measured) = (skeleton.nodes.len(), skeleton.measured());
        let poses: Vec<&Pose> = poses.iter().filter(|p| p.joints.len() == n).collect();
        let (first, last) = (poses.first()?.time_s, poses.last()?.time_s);
        let times: Vec<f64> = poses.iter().map(|p| p.time_s - first).collect();
        let film_s = last - first;
        let grows = times.windows(2).all(|t| t[1] > t[0]);
        if !(grows && film_s >= SHORTEST_FILM_S) {
            return None;
        }
        let piece_s = LOOP_S.min(film_s);
        let rate_hz = ((times.len() - 1) as f64 / film_s).min(HIGHEST_RATE_HZ);
        let steps = 2 * ((0.5 * piece_s * rate_hz) as usize);
        if steps < 2 * KEPT {
            // A piece has no frequency that is kept.
            return None;
        }
        let pieces = Pieces {
            times: &times,
            count: (film_s / piece_s + 1e-9) as usize,
            piece_s,
            steps,
            forward: RealFftPlanner::new().plan_fft_forward(steps),
        };
        let (mut spectra, mut levels) = (Vec::new(), Vec::new());
        for branch in skeleton.moving_branches() {
            if branch.node.index() >= measured {
                continue;
            }
            let level = skeleton.nodes[branch.node.index()].level;
            let turns: Vec<Vector3<f64>> = poses.iter().map(|p| branch.own_turn(p)).collect();
            for piece in 0..pieces.count {
                spectra.push(pieces.spectrum(&turns, piece)?);
                levels.push(f64::from(level));
            }
        }
        let sways = spectra.iter().any(TurnSpectrum::sways);
        sways.then_some(Self {
            spectra,
            levels,
            steps,
            step_s: piece_s / steps as f64,
            deepest: skeleton.deepest_level(),
        })
    }

    /// A loop of a tree that sways like the example: poses at even times, the last of which is the
    /// first again. Each branch has the spectrum of a branch of the example of about its level in one
    /// piece of the film, and phases of its own, which are the same about all three axes: so it swings
    /// in the same directions and at the same frequencies, and yet otherwise (surrogate data with
    /// random phases, Prichard and Theiler 1994). It turns by at most `most_rad` against its carrier,
    /// and a copy in its own plane.
    pub fn sample(&self, skeleton: &Skeleton, most_rad: f64, random: &mut Generator) -> Vec<Pose> {
        let branches = skeleton.moving_branches();
        let levels = LevelShares::of(skeleton);
        let mut synthesis = Synthesis::of(self.steps);
        let mut turns: Vec<Vec<Vector3<f64>>> = Vec::with_capacity(branches.len());
        for branch in &branches {
            let node = &skeleton.nodes[branch.node.index()];
            let share = levels.of_node(branch.node);
            let into_plane = Rotation3::from_axis_angle(&Vector3::y_axis(), node.plane_angle);
            let own = self.loop_of(share, &mut synthesis, random);
            let farthest = own.iter().map(Vector3::norm).fold(0.0, f64::max);
            let scale = if farthest > most_rad {
                most_rad / farthest
            } else {
                1.0
            };
            turns.push(own.iter().map(|turn| into_plane * turn * scale).collect());
        }
        let mut poses = Vec::with_capacity(self.steps + 1);
        for k in 0..=self.steps {
            let now: Vec<Vector3<f64>> = turns.iter().map(|t| t[k % self.steps]).collect();
            poses.push(skeleton.posed(&branches, &now, k as u64, k as f64 * self.step_s));
        }
        poses
    }

    /// How a branch turns whose level is this share of the deepest, radians, by step.
    fn loop_of(
        &self,
        share_of_deepest: f64,
        synthesis: &mut Synthesis,
        random: &mut Generator,
    ) -> Vec<Vector3<f64>> {
        let mut turns = vec![Vector3::zeros(); self.steps];
        let wanted = share_of_deepest * f64::from(self.deepest);
        let Some(of) = at_level(&self.levels, wanted, random) else {
            return turns;
        };
        let spectrum = &self.spectra[of];
        let mut phases = Vec::new();
        for _ in &spectrum.axes[0] {
            phases.push(Complex::cis(random.random_range(0.0..TAU)));
        }
        for (axis, amplitudes) in spectrum.axes.iter().enumerate() {
            let angles = synthesis.angles(amplitudes, &phases);
            for (turn, angle) in turns.iter_mut().zip(angles) {
                turn[axis] = *angle;
            }
        }
        turns
    }
}

impl TurnSpectrum {
    fn sways(&self) -> bool {
        let energy: f64 = self.axes.iter().flatten().map(Complex::norm_sqr).sum();
        energy >= LEAST_TURN * LEAST_TURN
    }
}

/// From amplitudes to the angles of a loop.
struct Synthesis {
    inverse: Arc<dyn ComplexToReal<f64>>,
    spectrum: Vec<Complex<f64>>,
    angles: Vec<f64>,
}

impl Synthesis {
    fn of(steps: usize) -> Self {
        let inverse = RealFftPlanner::new().plan_fft_inverse(steps);
        Self {
            spectrum: inverse.make_input_vec(),
            angles: inverse.make_output_vec(),
            inverse,
        }
    }

    /// The angle at each step of a loop, radians, with the phase of each frequency turned by one of
    /// `phases`, of length 1.
    fn angles(&mut self, amplitudes: &[Complex<f64>], phases: &[Complex<f64>]) -> &[f64] {
        self.spectrum.fill(Complex::default());
        let turned = amplitudes.iter().zip(phases).map(|(a, phase)| a * phase);
        for (bin, amplitude) in self.spectrum[1..].iter_mut().zip(turned) {
            *bin = 0.5 * amplitude;
        }
        let (spectrum, angles) = (&mut self.spectrum, &mut self.angles);
        if self.inverse.process(spectrum, angles).is_err() {
            // A transform of other sizes than those that it was made for; not reached.
            angles.fill(0.0);
        }
        &self.angles
    }
}

/// Pieces of a film, one after the other.
struct Pieces<'a> {
    /// Of the poses, s from the first.
    times: &'a [f64],
    count: usize,
    piece_s: f64,
    steps: usize,
    forward: Arc<dyn RealToComplex<f64>>,
}

impl Pieces<'_> {
    /// The spectrum of a branch that turns as `turns` says by pose. `None` where it is no number.
    fn spectrum(&self, turns: &[Vector3<f64>], piece: usize) -> Option<TurnSpectrum> {
        let axes = [0, 1, 2].map(|axis| {
            let own: Vec<f64> = turns.iter().map(|t| t[axis]).collect();
            self.of_axis(&own, piece)
        });
        let [Some(x), Some(y), Some(z)] = axes else {
            return None;
        };
        Some(TurnSpectrum { axes: [x, y, z] })
    }

    fn of_axis(&self, angles: &[f64], piece: usize) -> Option<Vec<Complex<f64>>> {
        let kept = self.steps / 2 / KEPT;
        let (from_s, step_s) = (
            piece as f64 * self.piece_s,
            self.piece_s / self.steps as f64,
        );
        let mut even = Vec::with_capacity(self.steps);
        for k in 0..self.steps {
            even.push(linear(self.times, angles, from_s + k as f64 * step_s));
        }
        let mean = even.iter().sum::<f64>() / self.steps as f64;
        for (k, angle) in even.iter_mut().enumerate() {
            let window = 0.5 - 0.5 * (TAU * k as f64 / self.steps as f64).cos();
            *angle = (*angle - mean) * window / HANN_ENERGY.sqrt();
        }
        let mut spectrum = self.forward.make_output_vec();
        self.forward.process(&mut even, &mut spectrum).ok()?;
        let scale = 2.0 / self.steps as f64;
        Some(spectrum[1..=kept].iter().map(|x| x * scale).collect())
    }
}

/// Levels as shares of the deepest of their tree.
struct LevelShares<'a> {
    skeleton: &'a Skeleton,
    deepest: f64,
}

impl<'a> LevelShares<'a> {
    fn of(skeleton: &'a Skeleton) -> Self {
        Self {
            skeleton,
            deepest: f64::from(skeleton.deepest_level().max(1)),
        }
    }

    fn of_node(&self, node: NodeId) -> f64 {
        f64::from(self.skeleton.nodes[node.index()].level) / self.deepest
    }
}

/// One of those whose level is nearest to the wanted one, at random: its place; `None` of none.
fn at_level(levels: &[f64], wanted: f64, random: &mut Generator) -> Option<usize> {
    let off = levels.iter().map(|level| (level - wanted).abs());
    let nearest = off.clone().fold(f64::INFINITY, f64::min);
    let alike: Vec<usize> = off
        .enumerate()
        .filter(|(_, off)| *off <= nearest + 1e-9)
        .map(|(i, _)| i)
        .collect();
    (!alike.is_empty()).then(|| alike[random.random_range(0..alike.len())])
}

/// For every node of a new tree how it sways: as one of the branches of `example` of about its
/// level, at random, of which that is known. `sway` is by node of the example. What moves with
/// another node, and copies, have none of their own.
pub fn sample_sway(
    example: &Skeleton,
    sway: &[Swaying],
    new: &Skeleton,
    random: &mut Generator,
) -> Vec<Swaying> {
    let [of_example, of_new] = [example, new].map(LevelShares::of);
    let (mut known, mut levels) = (Vec::new(), Vec::new());
    for node in example.measured_branches() {
        if let Some(Ok(own)) = sway.get(node.index()) {
            known.push(*own);
            levels.push(of_example.of_node(node));
        }
    }
    let mut drawn = vec![Err(Unidentified::NotMeasured); new.nodes.len()];
    for node in new.measured_branches() {
        if let Some(of) = at_level(&levels, of_new.of_node(node), random) {
            drawn[node.index()] = Ok(known[of]);
        }
    }
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Excitation, Interval, Sway};
    use crate::random::generator;

    /// A film of the forked tree, in which every branch sways about z at its own frequency, Hz.
    fn film(frequencies: [f64; 3], length_s: f64) -> Vec<Pose> {
        let skeleton = Skeleton::forked();
        let branches = skeleton.moving_branches();
        let mut poses = Vec::new();
        for k in 0..=(length_s * 30.0) as u64 {
            let time_s = k as f64 / 30.0;
            let turns: Vec<Vector3<f64>> = frequencies
                .iter()
                .map(|f| Vector3::z() * (0.1 * (TAU * f * time_s).sin() + 0.2))
                .collect();
            poses.push(skeleton.posed(&branches, &turns, k, time_s));
        }
        poses
    }

    /// The frequency at which a branch turns most about z in a loop, Hz, and how far it turns.
    fn dominant(poses: &[Pose], branch: usize) -> (f64, f64) {
        let skeleton = Skeleton::forked();
        let branch = &skeleton.moving_branches()[branch];
        let turns: Vec<f64> = poses.iter().map(|p| branch.own_turn(p).z).collect();
        let steps = turns.len() - 1;
        let loop_s = poses[steps].time_s;
        let mut best = (0.0, 0.0);
        for bin in 1..steps / 2 {
            let (mut re, mut im) = (0.0, 0.0);
            for (k, turn) in turns[..steps].iter().enumerate() {
                let (sin, cos) = (TAU * (bin * k) as f64 / steps as f64).sin_cos();
                (re, im) = (re + turn * cos, im + turn * sin);
            }
            let energy: f64 = re * re + im * im;
            if energy > best.1 {
                best = (bin as f64 / loop_s, energy);
            }
        }
        let farthest = turns.iter().map(|t| t.abs()).fold(0.0, f64::max);
        (best.0, farthest)
    }

    #[test]
    fn a_known_frequency_dominates_the_loop_as_it_did_the_film() {
        let skeleton = Skeleton::forked();
        let film = film([1.3; 3], 45.0);
        let learned = MotionStatistics::of(&skeleton, &film).expect("motion");
        let mut random = generator(2, 0);
        for _ in 0..20 {
            let poses = learned.sample(&skeleton, 1.0, &mut random);
            for branch in 0..3 {
                let (frequency_hz, farthest) = dominant(&poses, branch);
                assert!((frequency_hz - 1.3).abs() < 0.11, "{frequency_hz} Hz");
                assert!((0.05..0.25).contains(&farthest), "{farthest} rad");
            }
        }
    }

    #[test]
    fn a_loop_has_no_seam_and_keeps_its_bound() {
        let skeleton = Skeleton::forked();
        let learned = MotionStatistics::of(&skeleton, &film([0.8, 1.1, 2.0], 25.0));
        let poses = learned
            .expect("motion")
            .sample(&skeleton, 0.05, &mut generator(3, 0));
        assert_eq!(poses.len(), 301);
        let (first, last) = (&poses[0], &poses[300]);
        assert_eq!(first.joints, last.joints);
        assert!((last.time_s - 10.0).abs() < 1e-9);
        let mut steps = Vec::new();
        for pair in poses.windows(2) {
            steps.push((pair[1].joints[3].position - pair[0].joints[3].position).norm());
        }
        let largest = steps.iter().copied().fold(0.0, f64::max);
        assert!(steps[299] <= largest && steps[0] <= largest);
        for branch in skeleton.moving_branches() {
            for pose in &poses {
                assert!(branch.own_turn(pose).norm() <= 0.05 + 1e-9);
            }
        }
    }

    #[test]
    fn what_shows_no_sway_gives_nothing() {
        let skeleton = Skeleton::forked();
        assert_eq!(MotionStatistics::of(&skeleton, &[]), None);
        let short = film([1.0; 3], 1.0);
        assert_eq!(MotionStatistics::of(&skeleton, &short), None);
        let mut still = film([1.0; 3], 12.0);
        let rest = still[0].clone();
        for pose in &mut still {
            pose.joints.clone_from(&rest.joints);
        }
        assert_eq!(MotionStatistics::of(&skeleton, &still), None);
        let mut backwards = film([1.0; 3], 12.0);
        backwards[5].time_s = 0.0;
        assert_eq!(MotionStatistics::of(&skeleton, &backwards), None);
    }

    #[test]
    fn a_new_branch_sways_as_one_of_its_level() {
        let skeleton = Skeleton::forked();
        let around = |value: f64| {
            Ok(Sway {
                frequency_hz: Interval {
                    value,
                    lo: value,
                    hi: value,
                },
                damping_ratio: None,
                excitation: Excitation::Wind,
                amplitude_deg: 1.0,
            })
        };
        let none = Err(Unidentified::NotMeasured);
        let sway = [none, around(0.5), around(2.0), around(3.0)];
        let mut seen = Vec::new();
        for seed in 0..30 {
            let drawn = sample_sway(&skeleton, &sway, &skeleton, &mut generator(seed, 0));
            assert!(drawn[0].is_err());
            let hz = |i: usize| drawn[i].expect("known").frequency_hz.value;
            assert_eq!(hz(1), 0.5);
            seen.push(hz(2));
        }
        assert!(seen.contains(&2.0) && seen.contains(&3.0) && !seen.contains(&0.5));
        let nothing = sample_sway(&skeleton, &[], &skeleton, &mut generator(1, 0));
        assert!(nothing.iter().all(Result::is_err));
    }
}
