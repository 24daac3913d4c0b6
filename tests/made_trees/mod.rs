//! Trees of oscillators with known answers, filmed as points: what the sway is tested on.
//!
//! Every branch obeys th'' + 2 zeta w th' + w² (th - drive) = 0 against its parent and carries its
//! children; points lie along it. The picture is the projection from the front, with noise, drift
//! of points, gaps and uneven times.

#![allow(dead_code)]

use arborcam::dynamics::{Film, FilmTrack};
use arborcam::model::{Node, NodeId, NodeName, Size, Skeleton};
use nalgebra::{Point2, Point3, Vector2, Vector3};
use std::f64::consts::TAU;

/// Random numbers (SplitMix64). The trees of these tests, and with them the figures in
/// docs/dynamics.md, are drawn from it: they stay the same whatever the program draws from.
pub struct Chance(u64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x1234_5678_9ABC_DEF1)
    }

    /// Evenly within 0 to 1.
    pub fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.even()
    }

    pub fn normal(&mut self) -> f64 {
        (-2.0 * self.even().max(1e-300).ln()).sqrt() * (TAU * self.even()).cos()
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// Held still, and let go at this time, s.
    Release(f64),
    /// Let go at either time, s: before the second the hand pulls for 1.5 s and holds still for a
    /// second.
    Twice([f64; 2]),
    /// Already in free motion when the film begins.
    Decay,
    Wind,
}

/// How a tree is filmed.
#[derive(Clone, Copy, Debug)]
pub struct Filming {
    pub seconds: f64,
    pub rate_hz: f64,
    /// Noise of a point in a frame, px, and the share of a frame by which times are uneven.
    pub noise_px: f64,
    pub jitter: f64,
    /// Share of frames that are missing, and of points that are lost for a while.
    pub lost: f64,
    pub gaps: f64,
}

impl Default for Filming {
    fn default() -> Self {
        Self {
            seconds: 12.0,
            rate_hz: 30.0,
            noise_px: 0.2,
            jitter: 0.1,
            lost: 0.03,
            gaps: 0.15,
        }
    }
}

pub struct MadeBranch {
    pub parent: Option<usize>,
    pub frequency_hz: f64,
    pub damping: f64,
    base: Vector3<f64>,
    way: Vector3<f64>,
    /// Where on its parent it begins, share of the parent's length.
    at: f64,
    axes: [Vector3<f64>; 2],
    pull: [f64; 2],
}

pub struct MadeTree {
    pub branches: Vec<MadeBranch>,
    /// Node k + 1 is branch k.
    pub skeleton: Skeleton,
    pub film: Film,
    /// Angles of every branch at the film's times, radians: both axes.
    pub angles: Vec<[Vec<f64>; 2]>,
}

/// Share of its turn that a branch makes along its length; the rest it makes at its base.
const FLEX: f64 = 0.6;

impl MadeTree {
    pub fn new(seed: u64, drive: Drive, filming: &Filming) -> Self {
        let mut chance = Chance::new(seed);
        let branches = grow(&mut chance);
        let skeleton = skeleton(&branches);
        let frames = (filming.seconds * filming.rate_hz) as usize;
        let frame = |k: usize| {
            let at = (k as f64 + filming.jitter * (chance.even() - 0.5)) / filming.rate_hz;
            (chance.even() >= filming.lost).then_some(at)
        };
        let times: Vec<f64> = (0..frames).filter_map(frame).collect();
        let angles: Vec<[Vec<f64>; 2]> = branches
            .iter()
            .map(|b| b.angles(&times, drive, &mut chance))
            .collect();
        let mut tracks = Vec::new();
        for (k, b) in branches.iter().enumerate() {
            let n = if k == 0 {
                6
            } else {
                3 + (chance.even() * 6.0) as usize
            };
            for _ in 0..n {
                let share = chance.between(0.25, 1.0);
                let at = b.base + b.way * share + Vector3::from_fn(|_, _| 2.0 * chance.normal());
                let at_px = seen(
                    &branches,
                    &angles,
                    k,
                    share,
                    at,
                    times.len(),
                    filming,
                    &mut chance,
                );
                tracks.push(FilmTrack {
                    node: NodeId(k as u32 + 1),
                    at_px,
                });
            }
        }
        Self {
            film: Film::new(&times, tracks),
            branches,
            skeleton,
            angles,
        }
    }
}

fn grow(chance: &mut Chance) -> Vec<MadeBranch> {
    let mut out = vec![MadeBranch {
        parent: None,
        frequency_hz: chance.between(0.35, 0.8),
        damping: chance.between(0.015, 0.06),
        base: Vector3::zeros(),
        way: Vector3::new(
            chance.between(-15.0, 15.0),
            chance.between(170.0, 230.0),
            0.0,
        ),
        at: 0.0,
        axes: [Vector3::z(), Vector3::x()],
        pull: [chance.between(0.02, 0.05), chance.between(-0.03, 0.03)],
    }];
    let mut from = 0;
    for (level, many) in [(1, [2, 4]), (2, [0, 2])] {
        let to = out.len();
        for parent in from..to {
            let n = many[0] + (chance.even() * (many[1] - many[0] + 1) as f64) as usize;
            for _ in 0..n {
                let p = &out[parent];
                let at = chance.between(0.35, 1.0);
                let side = chance.between(-1.0, 1.0);
                let depth = chance.between(-0.7, 0.7);
                let along = p.way.normalize();
                let way = (along + Vector3::new(1.2 * side, 0.0, depth)).normalize()
                    * p.way.norm()
                    * chance.between(0.4, 0.6);
                let first = way
                    .cross(&Vector3::y())
                    .try_normalize(1e-6)
                    .unwrap_or_else(Vector3::x);
                let second = way.normalize().cross(&first);
                let branch = MadeBranch {
                    parent: Some(parent),
                    frequency_hz: p.frequency_hz * chance.between(1.12, 1.7),
                    damping: chance.between(0.02, 0.05 + 0.02 * level as f64),
                    base: p.base + p.way * at,
                    way,
                    at,
                    axes: [first, second],
                    pull: [chance.normal() * 0.09, chance.normal() * 0.09],
                };
                out.push(branch);
            }
        }
        from = to;
    }
    out
}

impl MadeBranch {
    fn angles(&self, times: &[f64], drive: Drive, chance: &mut Chance) -> [Vec<f64>; 2] {
        let (w, z) = (TAU * self.frequency_hz, self.damping);
        let root = (1.0 - z * z).sqrt();
        let free = |t: f64, a: f64| {
            a * (-z * w * t).exp() * ((w * root * t).cos() + z / root * (w * root * t).sin())
        };
        match drive {
            Drive::Release(at_s) => self
                .pull
                .map(|a| times.iter().map(|t| free((t - at_s).max(0.0), a)).collect()),
            Drive::Twice([first, second]) => self.pull.map(|a| {
                let at = |t: &f64| match (t - (second - 2.5)) / 1.5 {
                    hand if hand < 0.0 => free((t - first).max(0.0), a),
                    hand if hand < 1.0 => free(t - first, a) * (1.0 - hand) + a * hand,
                    _ => free((t - second).max(0.0), a),
                };
                times.iter().map(at).collect()
            }),
            Drive::Decay => {
                let since: f64 = chance.between(0.5, 1.5);
                self.pull
                    .map(|a| times.iter().map(|t| free(t + since, a)).collect())
            }
            Drive::Wind => self
                .pull
                .map(|a| blown(times, w, z, 0.6 * a.abs().max(0.02), chance)),
        }
    }
}

/// Driven by gusts and turbulence, from long before the film.
fn blown(times: &[f64], w: f64, z: f64, strength: f64, chance: &mut Chance) -> Vec<f64> {
    let dt: f64 = 1.0 / 240.0;
    let (mut gust, mut turbulence, mut angle, mut speed) = (0.0, 0.0, 0.0, 0.0);
    let mut t = -20.0;
    let mut out = Vec::with_capacity(times.len());
    for &wanted in times {
        while t < wanted {
            gust += -gust * dt / 1.5 + (2.0 * dt / 1.5).sqrt() * chance.normal();
            turbulence += -turbulence * dt / 0.2 + (2.0 * dt / 0.2).sqrt() * chance.normal();
            let drive = strength * (0.6 * gust + 0.8 * turbulence);
            speed += dt * (-2.0 * z * w * speed - w * w * (angle - drive));
            angle += dt * speed;
            t += dt;
        }
        out.push(angle);
    }
    out
}

/// How far a branch has turned at a share of its length, and by what its points were shifted up to
/// there.
fn turned(share: f64) -> (f64, f64) {
    (
        (1.0 - FLEX) + FLEX * share,
        (1.0 - FLEX) + 0.5 * FLEX * share,
    )
}

#[allow(clippy::too_many_arguments)]
fn seen(
    branches: &[MadeBranch],
    angles: &[[Vec<f64>; 2]],
    branch: usize,
    share: f64,
    at: Vector3<f64>,
    frames: usize,
    filming: &Filming,
    chance: &mut Chance,
) -> Vec<Point2<f64>> {
    let gap = (chance.even() < filming.gaps).then(|| {
        let from = (chance.even() * frames as f64) as usize;
        from..from + frames / 5
    });
    let mut drift = Vector2::zeros();
    (0..frames)
        .map(|k| {
            let mut moved = Vector3::zeros();
            let (mut b, mut s) = (branch, share);
            let mut on_it = true;
            loop {
                let it = &branches[b];
                let turn = it.axes[0] * angles[b][0][k] + it.axes[1] * angles[b][1][k];
                let (whole, shifted) = turned(s);
                // Up to the place on the branch it bends; beyond, all rides along.
                let place = it.base + it.way * s;
                moved += turn.cross(&(it.way * s)) * shifted;
                if !on_it {
                    moved += turn.cross(&(at - place)) * whole;
                }
                on_it = false;
                let Some(parent) = it.parent else { break };
                (b, s) = (parent, it.at);
            }
            drift
                .iter_mut()
                .for_each(|d| *d = 0.95 * *d + 0.3 * filming.noise_px * chance.normal());
            if gap.as_ref().is_some_and(|g| g.contains(&k)) {
                return Point2::new(f64::NAN, f64::NAN);
            }
            let noise = Vector2::from_fn(|_, _| filming.noise_px * chance.normal());
            let place = Point2::new(320.0 + at.x + moved.x, 340.0 - at.y - moved.y);
            place + noise + drift
        })
        .collect()
}

fn skeleton(branches: &[MadeBranch]) -> Skeleton {
    let node = |k: usize, parent: Option<u32>, at: Vector3<f64>, level: u8| Node {
        name: NodeName(k as u32),
        parent: parent.map(NodeId),
        level,
        position: Point3::from(at),
        radius: 1.0,
        n_tracks: 5,
        certainty: 1.0,
        copy_of: None,
        plane_angle: 0.0,
        moves_with: None,
        kind: Default::default(),
    };
    let foot = node(0, None, Vector3::zeros(), 0);
    let ends = branches.iter().enumerate().map(|(k, b)| {
        let parent = b.parent.map_or(0, |p| p as u32 + 1);
        node(
            k + 1,
            Some(parent),
            b.base + b.way,
            if b.parent.is_some() { 2 } else { 1 },
        )
    });
    let nodes = std::iter::once(foot).chain(ends).collect();
    Skeleton {
        nodes,
        foot_px: Point2::new(320.0, 340.0),
        image_size: Size {
            width: 640,
            height: 360,
        },
    }
}
