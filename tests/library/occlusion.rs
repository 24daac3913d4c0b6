//! Something passes before the tree: tracks do not go along with it, and are the same afterwards.

use crate::support;
use arborcam::config::Config;
use arborcam::model::{Frame, TrackId};
use arborcam::track::Tracker;
use nalgebra::{Point2, Vector2, distance};
use std::collections::{BTreeMap, BTreeSet};

/// The size of a hand, half axes of an ellipse, px; it crosses the crown in two seconds.
const HALF_PX: Vector2<f64> = Vector2::new(44.0, 34.0);
const PASSES: std::ops::Range<usize> = 150..215;
/// When it is judged who is back.
const AFTER: usize = 225;

/// Its middle in frame `k`, px.
fn middle(k: usize) -> Point2<f64> {
    let t = (k - PASSES.start) as f64;
    Point2::new(420.0 - 4.0 * t, 60.0 + 0.8 * t)
}

/// How far out of its middle a place is: 1 at its edge.
fn outness(k: usize, at: Point2<f64>) -> f64 {
    let out = (at - middle(k)).component_div(&HALF_PX);
    out.x.hypot(out.y)
}

/// Dark and light, with edges in all directions, as feathers or fingers have them.
fn brightness(at: Vector2<f64>) -> f64 {
    let mut sum = 0.0;
    for k in (1..=5).map(f64::from) {
        sum += (0.45 * (at.x * (2.4 * k).cos() + at.y * (2.4 * k).sin()) + 1.7 * k * k).sin();
    }
    95.0 + 28.0 * sum
}

fn cover(frame: &mut Frame, k: usize) {
    let (width, m) = (frame.luma.size.width as usize, middle(k));
    for (i, pixel) in frame.luma.pixels.iter_mut().enumerate() {
        let at = Point2::new((i % width) as f64, (i / width) as f64);
        if outness(k, at) < 1.0 {
            *pixel = brightness(at - m).clamp(0.0, 255.0) as u8;
        }
    }
}

type Places = Vec<BTreeMap<TrackId, Point2<f64>>>;

fn follow(covered: bool) -> Places {
    let config = Config::default();
    let mut tracker = Tracker::new(&config.detect, &config.track, &support::outline(), 0);
    let mut decode = support::decoding();
    let mut places = Vec::new();
    for k in 0..=AFTER {
        let mut frame = support::decoded(&mut decode, k);
        if covered && PASSES.contains(&k) {
            cover(&mut frame, k);
        }
        let set = tracker.step(&frame);
        let seen = set.observations.iter();
        places.push(seen.map(|o| (o.id, o.at_px())).collect());
    }
    places
}

#[test]
fn tracks_do_not_go_with_what_passes_before_them_and_come_back() {
    let (free, covered) = (follow(false), follow(true));
    let (mut hidden, mut reported, mut dragged) = (0usize, 0usize, 0usize);
    let mut were_hidden = BTreeSet::new();
    for k in PASSES {
        for (id, at) in free[k].iter().filter(|(_, at)| outness(k, **at) < 0.8) {
            hidden += 1;
            were_hidden.insert(*id);
            if let Some(there) = covered[k].get(id) {
                reported += 1;
                dragged += usize::from(distance(there, at) > 4.0);
            }
        }
    }
    let there: Vec<&TrackId> = were_hidden
        .iter()
        .filter(|id| free[AFTER].contains_key(*id))
        .collect();
    let mut back = 0;
    for &id in &there {
        if let (Some(at), Some(there)) = (free[AFTER].get(id), covered[AFTER].get(id)) {
            back += usize::from(distance(there, at) < 3.0);
        }
    }
    let (n, hidden) = (there.len(), hidden as f64);
    println!(
        "{n} tracks were hidden in {hidden} observations: {reported} reported, {dragged} dragged; {back} are back"
    );
    assert!(
        n >= 12 && hidden >= 150.0,
        "{n} tracks, {hidden} observations"
    );
    // Without a look at their first patches nine of ten go along.
    assert!(
        dragged as f64 <= 0.2 * hidden,
        "{dragged} of {hidden} observations went along"
    );
    assert!(
        back * 10 >= n * 8,
        "{back} of {n} are back under their names"
    );
}
