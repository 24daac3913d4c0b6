//! A tree as paths: middle lines from where they leave another one to their tips.

use nalgebra::{Point3, Vector3};

/// Places to both sides that the direction of a path is taken from.
const DIRECTION_REACH: usize = 3;
/// Places that a side path's first direction is taken from.
const DEPARTURE_PLACES: usize = 6;
/// The same in its radii.
const DEPARTURE_RADII: f64 = 2.0;
/// A side path leaves no farther below the place where barks part than they are away there, times
/// this: branches stand off by 15 degrees and more.
const FARTHEST_BACK: f64 = 4.0;
/// A direction is unsure by about this, radians: lines that meet as well as that sooner do.
const UNSURE_DIRECTION: f64 = 0.15;
/// Places without a circle are passed over between circles so many radii apart.
const WIDEST_GAP_RADII: f64 = 4.0;
/// Rounds in which a path is smoothed by the weights 1, 2, 1.
const SMOOTHINGS: usize = 2;
/// A side path is kept if its tip stands out of the wood that it leaves by more than this share of
/// that wood's radius, besides the least length.
const STANDS_OUT: f64 = 0.5;

/// Which place of which path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Joint {
    pub path: usize,
    pub place: usize,
}

/// A middle line.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Path {
    /// Where it leaves another one, earlier in the list; `None` for the trunk.
    pub on: Option<Joint>,
    /// From its base to its tip.
    pub places: Vec<Place>,
}

/// A place of a path.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Place {
    pub at: Point3<f64>,
    /// The thinned points that belong to it.
    pub points: Vec<u32>,
    /// Radius as it was measured there, m, where it could be.
    pub measured: Option<Measured>,
    /// Radius that it is given, m.
    pub radius: f64,
}

/// A radius that points show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measured {
    pub radius: f64,
    /// Standard deviation of the points about the circle, m.
    pub spread: f64,
    /// Points that it rests on.
    pub points: usize,
    /// Whether a circle was fitted; else it is the points' mean distance from the middle line.
    pub is_circle: bool,
}

impl Place {
    pub fn new(at: Point3<f64>) -> Self {
        Self {
            at,
            points: Vec::new(),
            measured: None,
            radius: 0.0,
        }
    }

    fn has_circle(&self) -> bool {
        self.measured.is_some_and(|m| m.is_circle)
    }
}

impl Path {
    /// Its direction at a place; up where it has none.
    pub fn direction(&self, place: usize) -> Vector3<f64> {
        let from = place.saturating_sub(DIRECTION_REACH);
        let to = (place + DIRECTION_REACH).min(self.places.len() - 1);
        let way = self.places[to].at - self.places[from].at;
        way.try_normalize(1e-9).unwrap_or_else(Vector3::z)
    }

    /// Distance of two places; 0 where there is none of the second.
    pub fn apart(&self, place: usize, other: usize) -> f64 {
        let other = self.places.get(other);
        other.map_or(0.0, |other| (other.at - self.places[place].at).norm())
    }

    /// Leads the line straight between two places: there its points are those of a fork, and its
    /// circles none of one limb.
    fn straighten(&mut self, from: usize, to: usize) {
        let to = to.min(self.places.len() - 1);
        if from + 1 >= to {
            return;
        }
        let (begin, way) = (
            self.places[from].at,
            self.places[to].at - self.places[from].at,
        );
        for k in from + 1..to {
            let share = (k - from) as f64 / (to - from) as f64;
            self.places[k].at = begin + way * share;
            self.places[k].measured = None;
        }
    }

    /// Length from a place to the tip.
    pub fn length_from(&self, place: usize) -> f64 {
        self.places[place..]
            .windows(2)
            .map(|p| (p[1].at - p[0].at).norm())
            .sum()
    }

    /// The first place with a circle, if it is near the base; else the base.
    fn first_circle(&self) -> usize {
        let first = self.places.iter().position(Place::has_circle).unwrap_or(0);
        let way = (self.places[first].at - self.places[0].at).norm();
        if way <= WIDEST_GAP_RADII * radius_near(self, first) {
            first
        } else {
            0
        }
    }

    /// The stretch that a side path's first direction is taken from: from where it is free of what
    /// it leaves, as long as it is thick, and some places at least.
    fn first_stretch(&self) -> (Point3<f64>, Point3<f64>) {
        let first = self.first_circle();
        let begin = self.places[first].at;
        let radius = radius_near(self, first);
        let free = DEPARTURE_RADII * radius;
        let mut from_first = self.places[first..].iter();
        let far = from_first.position(|p| (p.at - begin).norm() > free);
        let far = far.unwrap_or(0);
        let last = first + far.max(DEPARTURE_PLACES - 1);
        (begin, self.places[last.min(self.places.len() - 1)].at)
    }

    /// Distance of a point from its line.
    pub fn distance_to(&self, at: &Point3<f64>) -> Off {
        let mut best = Off {
            place: 0,
            distance: (self.places[0].at - at).norm(),
        };
        for (k, ends) in self.places.windows(2).enumerate() {
            let way = ends[1].at - ends[0].at;
            let t = ((at - ends[0].at).dot(&way) / way.norm_squared().max(1e-18)).clamp(0.0, 1.0);
            let distance = (ends[0].at + t * way - at).norm();
            if distance < best.distance {
                best = Off {
                    place: k + usize::from(t > 0.5),
                    distance,
                };
            }
        }
        best
    }
}

/// How far something is from a path, and at which place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Off {
    pub place: usize,
    pub distance: f64,
}

/// Takes out the paths that hardly leave the wood that they grow from, with all that they carry;
/// their points fall to the places that they left. `least` is the length that a twig has at least,
/// m.
pub(super) fn prune(paths: &mut Vec<Path>, least: f64) {
    let mut keep = vec![true; paths.len()];
    for i in 0..paths.len() {
        let Some(on) = paths[i].on else {
            continue;
        };
        keep[i] = keep[on.path] && {
            let (parent, own) = (&paths[on.path], &paths[i]);
            let outs = own.places.iter().map(|p| parent.distance_to(&p.at));
            outs.into_iter().any(|off| {
                let radius = radius_near(parent, off.place);
                off.distance > (1.0 + STANDS_OUT) * radius + least
            })
        };
        if !keep[i] {
            let points: Vec<u32> = paths[i]
                .places
                .iter()
                .flat_map(|p| p.points.iter().copied())
                .collect();
            let into = standing(paths, &keep, on);
            paths[into.path].places[into.place].points.extend(points);
        }
    }
    retain(paths, &keep);
}

/// The largest number of forks on a way from the foot to a tip.
pub(super) fn forks_on_one_way(paths: &[Path]) -> usize {
    let mut of_path: Vec<Vec<usize>> = paths.iter().map(|_| Vec::new()).collect();
    for on in paths.iter().filter_map(|p| p.on) {
        of_path[on.path].push(on.place);
    }
    let mut forks_to_base = vec![0; paths.len()];
    let mut most = 0;
    for (i, path) in paths.iter().enumerate() {
        of_path[i].sort_unstable();
        of_path[i].dedup();
        if let Some(on) = path.on {
            let below = of_path[on.path].partition_point(|place| *place <= on.place);
            forks_to_base[i] = forks_to_base[on.path] + below;
        }
        most = most.max(forks_to_base[i] + of_path[i].len());
    }
    most
}

/// The joint on the nearest path below that is kept.
fn standing(paths: &[Path], keep: &[bool], mut on: Joint) -> Joint {
    while !keep[on.path] {
        let Some(below) = paths[on.path].on else {
            break;
        };
        on = below;
    }
    on
}

/// Takes out paths; none that is kept may grow from one that is not.
fn retain(paths: &mut Vec<Path>, keep: &[bool]) {
    let mut new_place = Vec::with_capacity(keep.len());
    let mut next = 0;
    for keep in keep {
        new_place.push(next);
        next += usize::from(*keep);
    }
    let mut flags = keep.iter();
    paths.retain(|_| flags.next() == Some(&true));
    for path in paths {
        if let Some(on) = &mut path.on {
            on.path = new_place[on.path];
        }
    }
}

/// The measured radius nearest to a place, m; 0 where there is none on the path.
pub(super) fn radius_near(path: &Path, place: usize) -> f64 {
    let known = path
        .places
        .iter()
        .enumerate()
        .filter_map(|(k, p)| Some((k.abs_diff(place), p.measured?.radius)));
    known
        .min_by_key(|(far, _)| *far)
        .map_or(0.0, |(_, radius)| radius)
}

/// Takes the unrest out of the middle lines; their ends stay.
pub(super) fn smooth(paths: &mut [Path]) {
    for path in paths {
        for _ in 0..SMOOTHINGS {
            let before: Vec<Point3<f64>> = path.places.iter().map(|p| p.at).collect();
            for (place, around) in path.places.iter_mut().skip(1).zip(before.windows(3)) {
                place.at = Point3::from(
                    0.25 * around[0].coords + 0.5 * around[1].coords + 0.25 * around[2].coords,
                );
            }
        }
    }
}

/// Lets every side path leave where its own line meets that of its parent: the level sets of a fork
/// part only where the barks do.
pub(super) fn set_joints(paths: &mut [Path]) {
    for i in 0..paths.len() {
        set_joint(paths, i);
    }
}

/// The same, and leads the parents straight from there to where barks part.
pub(super) fn set_joints_and_straighten(paths: &mut [Path]) {
    for i in 0..paths.len() {
        if let Some(moved) = set_joint(paths, i) {
            paths[moved.path].straighten(moved.to_place, moved.from_place + 1);
        }
    }
}

/// By which a joint was moved along the path that it is on.
struct MovedJoint {
    path: usize,
    from_place: usize,
    to_place: usize,
}

/// Moves the joint of one path; `None` for the trunk, and what has no direction.
fn set_joint(paths: &mut [Path], own: usize) -> Option<MovedJoint> {
    let on = paths[own].on?;
    let (begin, end) = paths[own].first_stretch();
    let departure = Departure {
        begin,
        along: (end - begin).try_normalize(1e-9)?,
    };
    let parent = &paths[on.path];
    let joint = parent.places[on.place].at;
    // Not farther back than the bark is away, some times.
    let most = FARTHEST_BACK * (begin - joint).norm();
    let near = (0..parent.places.len()).filter(|k| (parent.places[*k].at - joint).norm() <= most);
    let best = near.min_by(|a, b| {
        let [a, b] = [a, b].map(|k| departure.off(&parent.places[*k].at));
        a.total_cmp(&b)
    });
    let place = best.unwrap_or(on.place);
    paths[own].on = Some(Joint { place, ..on });
    Some(MovedJoint {
        path: on.path,
        from_place: on.place,
        to_place: place,
    })
}

/// The line by which a side path leaves.
struct Departure {
    begin: Point3<f64>,
    /// Of length 1.
    along: Vector3<f64>,
}

impl Departure {
    /// How badly a place fits as its joint, m.
    fn off(&self, at: &Point3<f64>) -> f64 {
        let way = at - self.begin;
        // Behind the first place, as the line goes on backwards.
        let back = way.dot(&self.along).min(0.0);
        (way - self.along * back).norm() - UNSURE_DIRECTION * back
    }
}

/// Leads every side path straight from the bark that it leaves to its first circle, with places as
/// far from each other as `stretch`, m. What it carries stays where it was.
pub(super) fn lead_from_bark(paths: &mut [Path], stretch: f64) {
    for i in 0..paths.len() {
        let Some(on) = paths[i].on else {
            continue;
        };
        let joint = paths[on.path].places[on.place].at;
        let bark = radius_near(&paths[on.path], on.place);
        let first = paths[i].first_circle();
        let way = paths[i].places[first].at - joint;
        let free = way.norm() - bark;
        let count = (free / stretch) as usize;
        let mut places: Vec<Place> = Vec::new();
        for k in 0..count {
            let far = bark + free * k as f64 / count as f64;
            places.push(Place::new(joint + way * (far / way.norm())));
        }
        let old = paths[i].places.split_off(first);
        for place in std::mem::replace(&mut paths[i].places, places) {
            let into = match nearest_place(&paths[i].places, &place.at) {
                Some(nearest) => &mut paths[i].places[nearest],
                None => &mut paths[on.path].places[on.place],
            };
            into.points.extend(place.points);
        }
        paths[i].places.extend(old);
        // What grows from it does so where it did.
        for on in paths
            .iter_mut()
            .filter_map(|p| p.on.as_mut())
            .filter(|on| on.path == i)
        {
            let share = count as f64 / first.max(1) as f64;
            on.place = match on.place.checked_sub(first) {
                Some(after) => count + after,
                None => (on.place as f64 * share) as usize,
            };
        }
    }
}

fn nearest_place(places: &[Place], at: &Point3<f64>) -> Option<usize> {
    let squares = places.iter().map(|p| (p.at - at).norm_squared());
    let nearest = squares.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
    nearest.map(|(place, _)| place)
}

/// Leads thick wood straight over places without a circle, between those with one.
pub(super) fn bridge_gaps(paths: &mut [Path]) {
    for path in paths {
        let circles: Vec<usize> = (0..path.places.len())
            .filter(|k| path.places[*k].measured.is_some_and(|m| m.is_circle))
            .collect();
        for ends in circles.windows(2) {
            let way = path.places[ends[1]].at - path.places[ends[0]].at;
            if way.norm() <= WIDEST_GAP_RADII * path.places[ends[0]].radius {
                path.straighten(ends[0], ends[1]);
            }
        }
    }
}
