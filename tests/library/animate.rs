//! Trees that are made to move: against solutions known otherwise, and for what a viewer would see.

use crate::synthetic;
use arborcam::animate::{
    Animator, Known, Loudness, Magnify, Noise, Oscillation, Pull, SoundError, Transition, Wind,
    magnify, place_to_pull, speed_m_s, tune,
};
use arborcam::bounds::Bounds;
use arborcam::config;
use arborcam::model::{Node, NodeId, NodeName, Pose, Size, Skeleton};
use nalgebra::{Point3, Vector2, Vector3};
use std::f64::consts::TAU;
use std::sync::Arc;

const FPS: f64 = 30.0;

fn settings(force: f64) -> config::Wind {
    config::Wind {
        force,
        ..config::Wind::default()
    }
}

/// Frequencies that grow with the level and differ from branch to branch, 0.5 to 5 Hz; every fifth
/// is not known.
fn measured(skeleton: &Skeleton) -> Vec<Known> {
    let known = |(i, node): (usize, &Node)| {
        let frequency_hz =
            0.5 * 1.5_f64.powi(i32::from(node.level) - 1) * (1.0 + 0.2 * synthetic::noise(i, 3));
        let damping_ratio = 0.04 + 0.02 * synthetic::noise(i, 4);
        if i % 5 == 3 {
            Known::default()
        } else {
            Known {
                frequency_hz: Some(frequency_hz),
                damping_ratio: Some(damping_ratio),
            }
        }
    };
    skeleton.nodes.iter().enumerate().map(known).collect()
}

fn animator(skeleton: &Arc<Skeleton>, wind: &config::Wind, period_s: f64) -> Animator {
    let air = Wind::new(wind, period_s, 0.03);
    Animator::new(skeleton.clone(), &measured(skeleton), wind, air)
}

fn frames(animator: &mut Animator, count: u64) -> Vec<Pose> {
    let frame = |k| {
        let pose = animator.pose(k);
        animator.advance(1.0 / FPS);
        pose
    };
    (0..count).map(frame).collect()
}

/// How branch `i` has turned against the one that carries it, rad about each axis.
fn turn(skeleton: &Skeleton, pose: &Pose, i: usize) -> Vector3<f64> {
    let parent = skeleton.nodes[i].parent.expect("a parent").index();
    (pose.joints[parent].rotation.inverse() * pose.joints[i].rotation).scaled_axis()
}

fn farthest(a: &Pose, b: &Pose) -> f64 {
    a.joints
        .iter()
        .zip(&b.joints)
        .map(|(a, b)| (a.position - b.position).norm())
        .fold(0.0, f64::max)
}

fn assert_whole(skeleton: &Skeleton, pose: &Pose, most_deg: f64) {
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let Some(p) = node.parent.map(|p| p.index()) else {
            continue;
        };
        let rest = (node.position - skeleton.nodes[p].position).norm();
        let length = (pose.joints[i].position - pose.joints[p].position).norm();
        assert!(
            (length / rest - 1.0).abs() < 1e-9,
            "branch {i} is {length} px long, at rest {rest}"
        );
        let turned = turn(skeleton, pose, i).norm().to_degrees();
        assert!(
            turned <= most_deg + 1e-6,
            "branch {i} has turned by {turned} degrees"
        );
    }
}

/// Explicit Euler, as in the paper, would gain energy at 4 Hz and 30 frames a second; whoever
/// exports at another rate would get another motion.
#[test]
fn a_step_of_any_length_is_what_a_thousand_small_ones_give() {
    for (case, &(frequency_hz, damping)) in [
        (0.3, 0.0),
        (0.7, 0.02),
        (4.4, 0.15),
        (2.0, 1.0),
        (1.0, 2.5),
        (50.0, 0.05),
    ]
    .iter()
    .enumerate()
    {
        for step_s in [0.001, 1.0 / 30.0, 0.5, 3.0] {
            let transition = Transition::new(frequency_hz, damping, step_s);
            let omega = TAU * frequency_hz;
            let (mut exact, mut fine) = (Oscillation { x: 0.3, v: -1.0 }, Vector2::new(0.3, -1.0));
            for k in 0..4 {
                let (u0, u1) = (synthetic::noise(case, k), synthetic::noise(case, k + 1));
                exact = transition.step(exact, u0, u1);
                let parts = (4000.0 * step_s * frequency_hz).ceil().max(1000.0);
                let h = step_s / parts;
                // Of place and speed.
                let slope = |t: f64, s: Vector2<f64>| {
                    let u = u0 + (u1 - u0) * t / step_s;
                    Vector2::new(s.y, omega * omega * (u - s.x) - 2.0 * damping * omega * s.y)
                };
                for j in 0..parts as u64 {
                    let t = j as f64 * h;
                    let a = slope(t, fine);
                    let b = slope(t + 0.5 * h, fine + 0.5 * h * a);
                    let c = slope(t + 0.5 * h, fine + 0.5 * h * b);
                    let d = slope(t + h, fine + h * c);
                    fine += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
                }
                let off = (exact.x - fine.x)
                    .abs()
                    .max((exact.v - fine.y).abs() / omega);
                assert!(
                    off < 1e-7,
                    "{frequency_hz} Hz, damping {damping}, step {step_s} s: off by {off}"
                );
            }
        }
    }
}

/// The spectrum of branch turns over an hour of wind, fitted with the resonance that eq. 7 gives
/// it.
#[test]
fn in_wind_every_branch_sways_with_the_frequency_that_was_measured() {
    let skeleton = Arc::new(synthetic::tree(4, 1));
    let known = measured(&skeleton);
    let mut animator = animator(&skeleton, &settings(5.0), 4096.0);
    animator.warm_up();
    let (long, laps) = (2048, 50);
    let n = skeleton.nodes.len();
    let mut power = vec![vec![0.0; long / 2]; n];
    let mut planner = realfft::RealFftPlanner::<f64>::new();
    let fft = planner.plan_fft_forward(long);
    for _ in 0..laps {
        let poses = frames(&mut animator, long as u64);
        for (i, power) in power.iter_mut().enumerate().skip(1) {
            let turns: Vec<Vector3<f64>> = poses.iter().map(|p| turn(&skeleton, p, i)).collect();
            for axis in 0..3 {
                let mean = turns.iter().map(|t| t[axis]).sum::<f64>() / long as f64;
                let window = |k: usize| 0.5 - 0.5 * (TAU * k as f64 / long as f64).cos();
                let mut signal: Vec<f64> = (0..long)
                    .map(|k| (turns[k][axis] - mean) * window(k))
                    .collect();
                let mut spectrum = fft.make_output_vec();
                fft.process(&mut signal, &mut spectrum)
                    .expect("lengths agree");
                power
                    .iter_mut()
                    .zip(&spectrum)
                    .for_each(|(p, c)| *p += c.norm_sqr());
            }
        }
    }
    let mut worst: f64 = 0.0;
    for i in (1..n).filter(|&i| known[i].frequency_hz.is_some()) {
        let (wanted_hz, damping) = (
            known[i].frequency_hz.unwrap(),
            known[i].damping_ratio.unwrap(),
        );
        let hz = |k: usize| k as f64 * FPS / long as f64;
        let near: Vec<usize> = (1..long / 2)
            .filter(|&k| (0.6..1.6).contains(&(hz(k) / wanted_hz)))
            .collect();
        // What drives it goes with a power of the frequency: fitted along, as a straight line
        // between logarithms.
        let misfit = |frequency_hz: f64, damping: f64| {
            let rest = |k: usize| {
                let u = hz(k) / frequency_hz;
                power[i][k].ln() + ((1.0 - u * u).powi(2) + (2.0 * damping * u).powi(2)).ln()
            };
            let points: Vec<(f64, f64)> = near.iter().map(|&k| (hz(k).ln(), rest(k))).collect();
            let count = points.len() as f64;
            let (mx, my) = points
                .iter()
                .fold((0.0, 0.0), |(x, y), p| (x + p.0 / count, y + p.1 / count));
            let (xx, xy) = points.iter().fold((0.0, 0.0), |(a, b), p| {
                (a + (p.0 - mx).powi(2), b + (p.0 - mx) * (p.1 - my))
            });
            points
                .iter()
                .map(|p| (p.1 - my - xy / xx * (p.0 - mx)).powi(2))
                .sum::<f64>()
        };
        let grid = |k: i32| wanted_hz * (1.0 + 0.0005 * f64::from(k));
        let dampings = [0.7, 0.85, 1.0, 1.2, 1.5].map(|d| d * damping);
        let best = |k: &i32| {
            dampings
                .iter()
                .map(|&d| misfit(grid(*k), d))
                .fold(f64::INFINITY, f64::min)
        };
        let found = (-80..=80)
            .min_by(|a, b| best(a).total_cmp(&best(b)))
            .unwrap();
        worst = worst.max((grid(found) / wanted_hz - 1.0).abs());
    }
    println!(
        "frequencies of {n} branches in an hour of wind: off by at most {:.2} %",
        100.0 * worst
    );
    assert!(
        worst < 0.01,
        "a branch sways {} % beside its frequency",
        100.0 * worst
    );
}

#[test]
fn pulled_it_hangs_still_as_far_as_asked_and_let_go_every_branch_rings_with_its_own_frequency() {
    let skeleton = Arc::new(synthetic::tree(4, 1));
    let known = measured(&skeleton);
    let mut animator = animator(&skeleton, &settings(0.0), 128.0);
    // A branch rings if the rope has bent it: all below the node that is pulled.
    let tip = NodeId(skeleton.nodes.len() as u32 - 1);
    let reached = animator.pull_aside(tip, 30.0, 8.0);
    assert!(
        (reached - 8.0).abs() < 0.01,
        "it leans by {reached} degrees"
    );
    let pulled = frames(&mut animator, 30);
    assert!(
        farthest(&pulled[0], &pulled[29]) < 1e-9,
        "it moves in its rope"
    );
    let foot = skeleton.nodes[0].position;
    let aside = pulled[0].joints[tip.index()].position - skeleton.nodes[tip.index()].position;
    let (sin, cos) = 30.0_f64.to_radians().sin_cos();
    assert!(
        aside.dot(&Vector3::new(cos, 0.0, -sin)) > 0.0,
        "pulled to the right and away from the camera it goes {aside}"
    );
    let line = |p: &Point3<f64>| p - foot;
    let lean = line(&pulled[0].joints[tip.index()].position)
        .angle(&line(&skeleton.nodes[tip.index()].position));
    assert!((lean.to_degrees() - 8.0).abs() < 0.01);
    animator.pull(None);
    let swings = frames(&mut animator, 600);
    let (mut at, mut rang) = (Some(tip), 0);
    while let Some(node) = at {
        let i = node.index();
        at = skeleton.nodes[i].parent;
        let (Some(frequency_hz), Some(damping)) = (known[i].frequency_hz, known[i].damping_ratio)
        else {
            continue;
        };
        if at.is_none() {
            continue;
        }
        // Its axis does not turn; the times of its passages through rest tell the damped frequency.
        let first = turn(&skeleton, &swings[0], i);
        let along: Vec<f64> = swings
            .iter()
            .map(|p| turn(&skeleton, p, i).dot(&first))
            .collect();
        let zeros: Vec<f64> = (1..along.len())
            .filter(|&k| along[k - 1] < 0.0 && along[k] >= 0.0)
            .map(|k| (k as f64 - along[k] / (along[k] - along[k - 1])) / FPS)
            .take(6)
            .collect();
        let damped_hz = (zeros.len() - 1) as f64 / (zeros[zeros.len() - 1] - zeros[0]);
        let natural_hz = damped_hz / (1.0 - damping * damping).sqrt();
        assert!(
            (natural_hz / frequency_hz - 1.0).abs() < 0.01,
            "branch {i}: {natural_hz} Hz, measured {frequency_hz}"
        );
        rang += 1;
    }
    assert!(rang >= 3, "{rang} branches rang");
    assert!(
        farthest(&swings[599], &animator_at_rest(&skeleton)) < 2.0,
        "after 20 s it still swings"
    );
}

fn animator_at_rest(skeleton: &Arc<Skeleton>) -> Pose {
    animator(skeleton, &settings(0.0), 128.0).pose(0)
}

/// A single straight branch in any direction: what pulls along it must not bend, stretch or twist
/// it.
#[test]
fn a_force_along_a_branch_moves_nothing_and_one_across_it_bends_it_that_way() {
    for way in [
        Vector3::new(0.0, 100.0, 0.0),
        Vector3::new(60.0, 20.0, -30.0),
        Vector3::new(0.0, 0.0, 80.0),
    ] {
        let skeleton = Arc::new(chain(&[way]));
        let mut animator = animator(&skeleton, &settings(0.0), 128.0);
        let unit = way.normalize();
        animator.pull(Some(Pull {
            node: NodeId(1),
            force: unit * 1e4,
        }));
        animator.settle();
        assert!(
            farthest(&animator.pose(0), &animator_at_rest(&skeleton)) < 1e-9,
            "pulled along {way}"
        );
        let across = unit.cross(&Vector3::new(0.3, 0.5, 0.8)).normalize();
        animator.pull(Some(Pull {
            node: NodeId(1),
            force: across + unit * 5.0,
        }));
        animator.settle();
        let pose = animator.pose(0);
        let moved = (pose.joints[1].position - skeleton.nodes[1].position).normalize();
        let turned = turn(&skeleton, &pose, 1);
        assert!(
            moved.dot(&across) > 0.99,
            "pulled across {way} it goes along {moved}"
        );
        assert!(
            turned.dot(&unit).abs() < 1e-9 * turned.norm().max(1.0),
            "it is twisted"
        );
        assert_whole(&skeleton, &pose, 40.0);
    }
}

/// Branches end to end, each of them so long.
fn chain(ways: &[Vector3<f64>]) -> Skeleton {
    let mut at = Point3::origin();
    let node = |parent, level, position| Node {
        name: NodeName(u32::from(level)),
        parent,
        level,
        position,
        radius: 6.0 / (1.0 + f64::from(level)),
        n_tracks: 5,
        certainty: 0.5,
        copy_of: None,
        plane_angle: 0.0,
        moves_with: None,
        kind: Default::default(),
    };
    let mut nodes = vec![node(None, 0, at)];
    for (k, way) in ways.iter().enumerate() {
        at += way;
        nodes.push(node(Some(NodeId(k as u32)), k as u8 + 1, at));
    }
    Skeleton {
        nodes,
        foot_px: [320.0, 340.0].into(),
        image_size: Size::new(640, 360),
    }
}

#[test]
fn ten_minutes_of_hurricane_leave_the_tree_whole() {
    let skeleton = Arc::new(synthetic::tree(6, 2));
    let wind = config::Wind {
        gusts: 1.0,
        ..settings(12.0)
    };
    let mut animator = animator(&skeleton, &wind, 1024.0);
    animator.warm_up();
    let rest = animator_at_rest(&skeleton);
    let mut far = [0.0f64; 10];
    for far in &mut far {
        for (k, pose) in frames(&mut animator, 1800).iter().enumerate() {
            *far = far.max(farthest(pose, &rest));
            if k % 50 == 0 {
                assert_whole(&skeleton, pose, wind.max_bend_deg);
            }
        }
    }
    println!("farthest from rest in each minute: {far:.0?} px");
    let height = skeleton
        .nodes
        .iter()
        .map(|n| n.position.y)
        .fold(0.0, f64::max);
    assert!(
        far.iter().all(|f| (0.1 * height..2.0 * height).contains(f)),
        "{far:?} px, the tree is {height}"
    );
    assert!(far[9] < 1.5 * far[0], "it grows: {far:?}");
}

#[test]
fn a_loop_comes_back_to_its_first_pose_and_goes_on_as_it_began() {
    let skeleton = Arc::new(synthetic::tree(5, 2));
    // Slow branches and a lap of two swings of the trunk: what was before rings on into the next
    // lap.
    for (lap_s, force) in [(4.0, 3.0), (7.3, 8.0), (1.0, 12.0)] {
        let count = (lap_s * FPS).round() as u64;
        let lap_s = count as f64 / FPS;
        let mut animator = animator(&skeleton, &settings(force), lap_s);
        animator.close(lap_s, FPS);
        let poses = frames(&mut animator, 2 * count + 1);
        let seam = (0..=count as usize)
            .map(|k| farthest(&poses[k], &poses[k + count as usize]))
            .fold(0.0, f64::max);
        assert!(
            seam < 1e-3,
            "lap of {lap_s} s at force {force}: {seam} px apart"
        );
        assert!(
            farthest(&poses[0], &poses[count as usize / 2]) > 0.1,
            "nothing moves at force {force}"
        );
    }
}

#[test]
fn more_wind_moves_more_and_none_moves_nothing() {
    let skeleton = Arc::new(synthetic::tree(5, 2));
    let rest = animator_at_rest(&skeleton);
    let mut before = 0.0;
    for force in [0.0, 1.0, 3.0, 5.0, 7.0, 9.0] {
        let mut animator = animator(&skeleton, &settings(force), 128.0);
        animator.warm_up();
        let poses = frames(&mut animator, 600);
        let moved = poses.iter().map(|p| farthest(p, &rest)).fold(0.0, f64::max);
        if force == 0.0 {
            assert!(moved < 1e-9, "in still air it moves by {moved} px");
        } else {
            assert!(
                moved > 1.3 * before,
                "force {force} moves it by {moved} px, less by {before}"
            );
        }
        before = moved;
    }
    // It leans to where the wind blows to.
    for (direction_deg, towards) in [
        (0.0, Vector3::x()),
        (90.0, -Vector3::z()),
        (180.0, -Vector3::x()),
    ] {
        let wind = config::Wind {
            direction_deg,
            gusts: 0.1,
            ..settings(7.0)
        };
        let mut animator = animator(&skeleton, &wind, 128.0);
        animator.warm_up();
        let pose = animator.pose(0);
        let lean: Vector3<f64> = pose
            .joints
            .iter()
            .zip(&rest.joints)
            .map(|(a, b)| a.position - b.position)
            .sum();
        assert!(
            lean.normalize().dot(&towards) > 0.8,
            "to {direction_deg} degrees it leans along {lean}"
        );
    }
}

/// All branches at once look like one piece of rubber: gusts must take their time across the crown.
#[test]
fn gusts_travel_across_the_crown_with_the_wind() {
    let wind = config::Wind {
        gusts: 0.3,
        ..settings(5.0)
    };
    let (air, apart_m) = (Wind::new(&wind, 512.0, 0.1), 14.0);
    let places = [0.0, apart_m / 0.1].map(|x| Point3::new(x, 50.0, 0.0));
    let pressure = |place: &Point3<f64>, time_s: f64, own_s: f64| {
        air.pressure(&air.at(time_s).expect("wind"), place, own_s).x
    };
    let series = |k: usize| -> Vec<f64> {
        let all: Vec<f64> = (0..10_000)
            .map(|j| pressure(&places[k], j as f64 / 20.0, 17.0 * k as f64))
            .collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        all.iter().map(|p| p - mean).collect()
    };
    let (here, there) = (series(0), series(1));
    let alike = |lag: usize| (0..9000).map(|j| here[j] * there[j + lag]).sum::<f64>();
    let lag_s = (0..200)
        .max_by(|a, b| alike(*a).total_cmp(&alike(*b)))
        .unwrap() as f64
        / 20.0;
    let expected_s = apart_m / speed_m_s(5.0);
    assert!(
        (lag_s - expected_s).abs() < 0.15,
        "it takes {lag_s} s, the wind takes {expected_s}"
    );
    // And branches side by side do not tremble together: each has eddies of its own.
    let beside: Vec<f64> = (0..10_000)
        .map(|j| pressure(&places[0], j as f64 / 20.0, 333.0))
        .collect();
    let mean = beside.iter().sum::<f64>() / beside.len() as f64;
    let norm = |s: &[f64]| s.iter().map(|x| x * x).sum::<f64>().sqrt();
    let beside: Vec<f64> = beside.iter().map(|p| p - mean).collect();
    let likeness =
        here.iter().zip(&beside).map(|(a, b)| a * b).sum::<f64>() / norm(&here) / norm(&beside);
    assert!(
        (0.4..0.95).contains(&likeness),
        "two branches at one place feel the same by {likeness}"
    );
}

#[test]
fn noise_has_the_power_law_that_was_asked_for_and_no_seam() {
    for beta in [0.0, 1.0, 5.0 / 3.0, 3.0] {
        let period_s = 256.0;
        let noise = Noise::new(period_s, beta, 0.05, 7);
        let n = 16_384;
        let mut values: Vec<f64> = (0..n)
            .map(|k| noise.at(k as f64 * period_s / n as f64))
            .collect();
        let mean = values.iter().sum::<f64>() / n as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64;
        assert!(
            mean.abs() < 1e-9 && (variance - 1.0).abs() < 0.02,
            "beta {beta}: mean {mean}, variance {variance}"
        );
        assert!(
            (noise.at(3.21) - noise.at(3.21 + period_s)).abs() < 1e-6,
            "beta {beta}: it does not come round"
        );
        assert!((noise.at(-1.0) - noise.at(period_s - 1.0)).abs() < 1e-6);
        let mut planner = realfft::RealFftPlanner::<f64>::new();
        let fft = planner.plan_fft_forward(n);
        let mut spectrum = fft.make_output_vec();
        fft.process(&mut values, &mut spectrum)
            .expect("lengths agree");
        let power = |low_hz: f64, high_hz: f64| {
            let of = (low_hz * period_s) as usize..(high_hz * period_s) as usize;
            let count = of.len() as f64;
            spectrum[of].iter().map(|c| c.norm_sqr()).sum::<f64>() / count
        };
        let slope = (power(0.5, 0.6) / power(4.0, 4.8)).log2() / 3.0;
        assert!(
            (slope - beta).abs() < 0.1,
            "asked for 1/f^{beta}, got 1/f^{slope}"
        );
    }
}

#[test]
fn a_branch_keeps_what_was_measured_and_others_get_what_fits() {
    let skeleton = synthetic::tree(5, 3);
    let settings = config::Wind::default();
    let known = measured(&skeleton);
    let tuned = tune(&skeleton, &known, &settings);
    let measured_nodes = skeleton.measured();
    for (i, node) in skeleton.nodes.iter().enumerate().skip(1) {
        match (node.copy_of, known[i].frequency_hz) {
            (Some(original), _) => assert_eq!(tuned[i], tuned[original.index()], "copy {i}"),
            (None, Some(frequency_hz)) => assert_eq!(tuned[i].frequency_hz, frequency_hz),
            // 1.5 a level: within the range of the levels about it.
            (None, None) => {
                let usual = 0.5 * 1.5_f64.powi(i32::from(node.level) - 1);
                let off = tuned[i].frequency_hz / usual;
                assert!(
                    (0.5..2.0).contains(&off),
                    "node {i} of level {}: {:?}",
                    node.level,
                    tuned[i]
                );
                assert!((0.02..0.06).contains(&tuned[i].damping_ratio));
            }
        }
    }
    // Nothing known: the trunk as the settings say, and the thinner and shorter the faster.
    for nothing in [
        vec![],
        vec![
            Known {
                frequency_hz: Some(f64::NAN),
                damping_ratio: Some(-1.0)
            };
            measured_nodes
        ],
    ] {
        let tuned = tune(&skeleton, &nothing, &settings);
        assert!((tuned[1].frequency_hz - settings.trunk_hz).abs() < 1e-9 && !tuned[1].measured);
        let mean = |level: u8| {
            let of: Vec<f64> = (1..measured_nodes)
                .filter(|&i| skeleton.nodes[i].level == level)
                .map(|i| tuned[i].frequency_hz)
                .collect();
            of.iter().sum::<f64>() / of.len() as f64
        };
        let means: Vec<f64> = (1..=5).map(mean).collect();
        assert!(
            means.windows(2).all(|m| m[1] > 0.9 * m[0]) && means[4] > 2.0 * means[0],
            "{means:?}"
        );
        assert!(
            tuned
                .iter()
                .all(|t| t.frequency_hz < 8.1 && t.damping_ratio == settings.damping_ratio)
        );
    }
}

fn wav(samples: &[f32], channels: u16) -> Vec<u8> {
    let spec = hound::WavSpec {
        channels,
        sample_rate: 8000,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = hound::WavWriter::new(&mut bytes, spec).expect("header");
    samples
        .iter()
        .for_each(|s| writer.write_sample(*s).expect("sample"));
    writer.finalize().expect("end");
    bytes.into_inner()
}

#[test]
fn a_sound_blows_as_loud_as_it_is_and_a_bad_one_is_refused() {
    // Four seconds of a tone, four of silence.
    let tone = |k: usize| {
        if k < 32_000 {
            (0.4 * k as f64).sin() as f32
        } else {
            0.0
        }
    };
    let samples: Vec<f32> = (0..64_000).map(tone).collect();
    let sound = Loudness::of_wav(&wav(&samples, 1)).expect("a sound");
    assert!((sound.length_s() - 8.0).abs() < 0.05);
    assert!(
        sound.at(1.0) > 1.2 && sound.at(6.0) < 0.01 && sound.at(9.0) > 1.2,
        "loud and still in turn"
    );
    let stereo: Vec<f32> = samples.iter().flat_map(|s| [*s, *s]).collect();
    let both = Loudness::of_wav(&wav(&stereo, 2)).expect("a sound");
    assert!(
        (0..80).all(|k| (both.at(0.1 * f64::from(k)) - sound.at(0.1 * f64::from(k))).abs() < 0.05)
    );
    let looped = sound.looped(5.0);
    assert!(
        (looped.at(4.9999) - looped.at(0.0)).abs() < 0.01,
        "the loop's seam"
    );
    let skeleton = Arc::new(synthetic::tree(4, 1));
    let wind = settings(6.0);
    let air = Wind::new(&wind, 128.0, 0.03).driven_by(sound);
    let mut animator = Animator::new(skeleton.clone(), &measured(&skeleton), &wind, air);
    let poses = frames(&mut animator, 240);
    let rest = animator_at_rest(&skeleton);
    // On average over two swings of the trunk: it goes on ringing in the silence.
    let lean = |frames: std::ops::Range<usize>| {
        let aside = |p: &Pose| {
            p.joints
                .iter()
                .zip(&rest.joints)
                .map(|(a, b)| a.position.x - b.position.x)
                .sum::<f64>()
        };
        poses[frames].iter().map(aside).sum::<f64>()
    };
    let (loud, silent) = (lean(60..120), lean(180..240));
    assert!(
        loud > 4.0 * silent.abs(),
        "it leans by {loud} in the sound and by {silent} in the silence"
    );
    let refused = |bytes: &[u8]| Loudness::of_wav(bytes).expect_err("it is refused");
    assert!(matches!(refused(&[]), SoundError::Unreadable(_)));
    assert!(matches!(
        refused(b"RIFF....WAVEfmt broken"),
        SoundError::Unreadable(_)
    ));
    assert!(matches!(refused(&wav(&[], 1)), SoundError::Empty));
    assert!(matches!(
        refused(&wav(&[0.0, f32::NAN, 0.1], 1)),
        SoundError::NoNumber(1)
    ));
    assert!(matches!(refused(&wav(&[0.25; 500], 1)), SoundError::Silent));
    let whole = wav(&samples, 1);
    for cut in [3, 20, 43, 44, 45, 1001] {
        let _ = Loudness::of_wav(&whole[..cut]);
    }
    // Whatever its header says, it is refused or gives numbers.
    let short = wav(&samples[..500], 1);
    for k in 0..20_000 {
        let mut bytes = short.clone();
        for change in 0..3 {
            let at = (synthetic::noise(k, change).abs() * 70.0) as usize;
            bytes[at] = [0, 1, 255, 128, (k % 256) as u8][(k / 7 + change) % 5];
        }
        if let Ok(sound) = Loudness::of_wav(&bytes) {
            assert!(sound.at(0.3).is_finite() && sound.length_s() <= 3600.1);
        }
    }
}

#[test]
fn magnified_motion_is_the_filmed_one_but_larger_and_stays_whole() {
    let skeleton = synthetic::tree(4, 2);
    let film = synthetic::sway(&skeleton, 301);
    let as_filmed = Magnify {
        by: 1.0,
        speed: 1.0,
        band_hz: None,
        most_rad: 40.0_f64.to_radians(),
        looped: false,
    };
    let made =
        |wanted: Magnify, count| magnify(&skeleton, &film, &wanted, FPS, count).expect("poses");
    // The film's own times are not quite even.
    let same = made(as_filmed, 300);
    assert!(
        (0..=300).all(|k| farthest(&same[k], &film[k]) < 0.3),
        "as filmed it is as filmed"
    );
    let spread = |poses: &[Pose], i: usize| {
        let turns: Vec<Vector3<f64>> = poses.iter().map(|p| turn(&skeleton, p, i)).collect();
        let mean = turns.iter().sum::<Vector3<f64>>() / turns.len() as f64;
        (turns.iter().map(|t| (t - mean).norm_squared()).sum::<f64>() / turns.len() as f64).sqrt()
    };
    let (twice, none) = (
        made(
            Magnify {
                by: 2.0,
                ..as_filmed
            },
            300,
        ),
        made(
            Magnify {
                by: 0.0,
                ..as_filmed
            },
            300,
        ),
    );
    for i in 1..skeleton.nodes.len() {
        let larger = spread(&twice, i) / spread(&same, i);
        assert!(
            (larger - 2.0).abs() < 0.05,
            "branch {i} moves {larger} times as far"
        );
        assert!(spread(&none, i) < 1e-9);
    }
    for pose in &made(
        Magnify {
            by: 100.0,
            ..as_filmed
        },
        300,
    ) {
        assert_whole(&skeleton, pose, 40.0);
    }
    // At half the speed it is where it was in the film half the time before.
    let slow = made(
        Magnify {
            speed: 0.5,
            ..as_filmed
        },
        300,
    );
    assert!(farthest(&slow[200], &same[100]) < 1e-6);
    // The film is over: it goes back.
    let long = made(as_filmed, 600);
    assert!(farthest(&long[600], &same[0]) < 0.3);
    let lap = made(
        Magnify {
            by: 3.0,
            looped: true,
            ..as_filmed
        },
        150,
    );
    assert!(farthest(&lap[0], &lap[150]) < 1e-9, "the loop's ends");
    let step = |k: usize| farthest(&lap[k], &lap[k + 1]);
    let usual = (0..140).map(step).fold(0.0, f64::max);
    assert!(
        farthest(&lap[149], &lap[0]) < 1.5 * usual,
        "it jumps at the seam"
    );
    assert!(
        magnify(
            &skeleton,
            &film,
            &Magnify {
                looped: true,
                ..as_filmed
            },
            FPS,
            300
        )
        .is_err(),
        "no film left to blend"
    );
    assert!(magnify(&skeleton, &film[..5], &as_filmed, FPS, 30).is_err());
    let mut back = film.clone();
    back[100].time_s = back[50].time_s;
    assert!(
        magnify(&skeleton, &back, &as_filmed, FPS, 30).is_err(),
        "times that run backwards"
    );
    let high = Magnify {
        band_hz: Some(Bounds::new(20.0, 30.0)),
        ..as_filmed
    };
    assert!(
        magnify(&skeleton, &film, &high, FPS, 30).is_err(),
        "above what the film shows"
    );
}

#[test]
fn a_band_magnifies_what_lies_in_it_and_nothing_else() {
    let skeleton = chain(&[Vector3::new(0.0, 100.0, 0.0)]);
    let mut film = synthetic::sway(&skeleton, 601);
    let (slow, fast) = (0.05, 0.02);
    for pose in &mut film {
        let t = pose.time_s;
        let angle = slow * (TAU * 0.4 * t).sin() + fast * (TAU * 2.0 * t).sin();
        let turned = nalgebra::UnitQuaternion::from_scaled_axis(Vector3::z() * angle);
        pose.joints[1].rotation = turned;
        pose.joints[1].position = pose.joints[0].position + turned * Vector3::new(0.0, 100.0, 0.0);
    }
    let wanted = Magnify {
        by: 3.0,
        speed: 1.0,
        band_hz: Some(Bounds::new(1.0, 4.0)),
        most_rad: 0.7,
        looped: false,
    };
    let made = magnify(&skeleton, &film, &wanted, FPS, 600).expect("poses");
    let part = |hz: f64| {
        let along = |wave: fn(f64) -> f64| {
            let product = |p: &Pose| turn(&skeleton, p, 1).z * wave(TAU * hz * p.time_s);
            // Away from the ends, where the mirror has a corner; whole swings.
            made[75..525].iter().map(product).sum::<f64>() * 2.0 / 450.0
        };
        along(f64::sin).hypot(along(f64::cos))
    };
    assert!(
        (part(0.4) / slow - 1.0).abs() < 0.02,
        "slow sway {} of {slow}",
        part(0.4)
    );
    assert!(
        (part(2.0) / (3.0 * fast) - 1.0).abs() < 0.03,
        "fast sway {} of {}",
        part(2.0),
        3.0 * fast
    );
}

#[test]
fn the_same_seed_gives_the_same_motion_and_another_gives_another() {
    let skeleton = Arc::new(synthetic::tree(5, 2));
    let made = |seed: u32| {
        let mut animator = animator(
            &skeleton,
            &config::Wind {
                seed,
                ..settings(5.0)
            },
            128.0,
        );
        animator.warm_up();
        frames(&mut animator, 60)
    };
    let one = made(1);
    assert_eq!(one, made(1));
    assert!(farthest(&one[59], &made(2)[59]) > 0.5);
}

/// What a damaged or a very small capture may hold.
#[test]
fn odd_trees_neither_bring_it_down_nor_tear() {
    let straight = |n: usize| chain(&vec![Vector3::new(3.0, 40.0, 1.0); n]);
    let mut flat = straight(4);
    flat.nodes[2].position = flat.nodes[1].position;
    flat.nodes.iter_mut().for_each(|n| n.radius = 0.0);
    let mut torn = straight(4);
    torn.nodes[3].position.x = f64::NAN;
    torn.nodes[2].radius = f64::INFINITY;
    let mut alone = straight(1);
    alone.nodes.truncate(1);
    for (what, skeleton) in [
        ("one branch", straight(1)),
        ("stubs", flat),
        ("no numbers", torn),
        ("a foot", alone),
    ] {
        let skeleton = Arc::new(skeleton);
        let mut animator = animator(&skeleton, &settings(8.0), 128.0);
        animator.warm_up();
        assert_eq!(
            place_to_pull(&skeleton)
                .index()
                .min(skeleton.nodes.len() - 1),
            place_to_pull(&skeleton).index()
        );
        let reached = animator.pull_aside(place_to_pull(&skeleton), 0.0, 5.0);
        assert!(
            reached.is_finite() || what == "no numbers",
            "{what}: {reached}"
        );
        animator.pull(None);
        let pose = frames(&mut animator, 30).pop().expect("poses");
        // What hangs on a branch whose place is no number has none either.
        let sound =
            |i: usize| (0..=i).all(|j| skeleton.nodes[j].position.iter().all(|x| x.is_finite()));
        let places = pose
            .joints
            .iter()
            .enumerate()
            .filter(|(i, _)| sound(*i))
            .map(|(_, j)| j.position);
        assert!(
            places.flat_map(|p| [p.x, p.y, p.z]).all(f64::is_finite),
            "{what}"
        );
        animator.close(1.0, FPS);
    }
}
