//! Films that are not in one piece: a piece was cut out, or the picture stood still, while the times
//! ran on.
//!
//! Phases do not join across such a place, and what is fitted across it is no tree's. A cut is
//! known by a jump: in one frame many points are off the way on which they come and go on. A
//! release, a gust or a bump changes how fast points move, and moves none of them at once.

use super::film::{Film, FilmTrack};
use super::members::{is_seen, mean_px};
use crate::model::FilmCut;
use crate::signal::statistics::median;
use nalgebra::{Point2, distance};
use std::ops::Range;

/// Share of the points that jump where a film is cut. In 57,000 frames of 113 films that are not, in
/// wind, after releases, from a trembling camera, as H.264, with frames repeated or left out, with
/// people before the tree, it was 0.13 at most, and where a tree was found 0.08; where half a second
/// or more was cut out it was more than this at 851 of 855 places.
const JUMP_SHARE: f64 = 0.15;
/// And so many points: of 50, of which 3 of 100 jump by chance in any frame, one in 10,000 frames has
/// as many.
const LEAST_JUMPING: u32 = 8;
/// A point jumps that is off its way by so many times what is usual for it in the frames around (a
/// median): of a normal distribution these are seven standard deviations.
const FAR_OFF: f64 = 6.0;
/// And by so many times its steps before and after: a change of its speed, however great, leaves it
/// off by half of the larger of the two at most.
const LONE: f64 = 2.0;
/// What is usual is taken from so many frames and those before and after, so that what was usual
/// before a release does not count alone: a second at 30 frames/s.
const USUAL_FRAMES: usize = 30;
/// It is at least this, px: a fifth of the tracker's noise on a good picture.
const LEAST_USUAL_PX: f64 = 0.02;
/// Frames farther apart than this, in usual steps, have true times between them: they are a gap, and
/// no cut.
const LONGEST_STEPS: f64 = 2.5;

/// Three quarters of the points move by less than this, px, from a picture to the same picture once
/// more: by none in MJPEG, by up to 0.02 while H.264 still refines it.
const STILL_PX: f64 = 0.02;
const STIRRING_SHARE: f64 = 0.25;
/// Fewer points than this say nothing of that: no tree is built of fewer that move.
const LEAST_POINTS: u32 = 16;
/// What moved just before and after by more than this, px a frame, did not come to rest.
const MOVING_PX: f64 = 0.1;
/// Frames that are just before or just after: H.264 fades into and out of a picture that stands.
const BESIDE_FRAMES: usize = 3;
/// A picture stands still if it stays for longer, s: a film that has fewer pictures a second than
/// four is poor in any case.
const STALL_S: f64 = 0.25;

/// Times of cuts that are listed at most.
const MOST_LISTED: usize = 3;

/// The part of a film that is in one piece.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Take {
    /// What is used of the film: all of it where nothing is missing.
    pub film: Film,
    /// Where the film is cut or its picture stands still, s.
    pub cuts_s: Vec<f64>,
    /// How much of the film is left out, s.
    pub left_out_s: f64,
}

/// A place at which a film does not join.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Cut {
    /// The frames that belong to neither side: none of a jump, those of a picture that stands still.
    between: Range<usize>,
}

impl Take {
    /// The part between cuts that says most of frequencies; the whole film where it has none.
    pub fn of(film: Film) -> Self {
        let cuts = cuts(&film);
        if cuts.is_empty() {
            return Self {
                film,
                ..Self::default()
            };
        }
        let mut cuts_s = Vec::with_capacity(cuts.len());
        let (mut from, mut best, mut most) = (0, 0..0, 0.0);
        let end = film.times_s.len();
        let last = Cut { between: end..end };
        for cut in cuts.iter().chain([&last]) {
            cuts_s.extend(film.times_s.get(cut.between.start));
            let part = from..cut.between.start;
            let information = information(&film, part.clone());
            if information > most {
                (best, most) = (part, information);
            }
            from = cut.between.end;
        }
        let part = film.part(best).into_owned();
        Self {
            left_out_s: film.span_s() - part.span_s(),
            film: part,
            cuts_s,
        }
    }

    /// What the film lacks; `None` where it is in one piece.
    pub fn cut(&self) -> Option<FilmCut> {
        Some(FilmCut {
            at_s: *self.cuts_s.first()?,
            left_out_s: self.left_out_s,
        })
    }

    /// What is to be said of a film that is not in one piece.
    pub fn warning(&self) -> Option<String> {
        if self.cuts_s.is_empty() {
            return None;
        }
        let listed = self.cuts_s.iter().take(MOST_LISTED);
        let times: Vec<String> = listed.map(|s| format!("{s:.1} s")).collect();
        let further = match self.cuts_s.len() - times.len() {
            0 => String::new(),
            n => format!(" and {n} times more"),
        };
        let used = match (self.film.times_s.first(), self.film.times_s.last()) {
            (Some(from), Some(to)) => format!("from {from:.1} to {to:.1} s"),
            _ => "of none of its parts".into(),
        };
        Some(format!(
            "the film is cut, or its picture stands still, at {}{further}, and its times run on: \
             its sway is that {used}; `arborcam analyze --from S --to S DIR` looks at another part",
            times.join(", ")
        ))
    }
}

/// What some frames say of the frequencies of the points, up to a factor: the inverse of the
/// variance of a frequency, which is as the squares of the motion times the square of the time (Rife
/// and Boorstyn 1974).
fn information(film: &Film, frames: Range<usize>) -> f64 {
    let Some(times_s) = film.times_s.get(frames.clone()) else {
        return 0.0;
    };
    let span_s = times_s
        .last()
        .zip(times_s.first())
        .map_or(0.0, |(b, a)| b - a);
    let mut squares = 0.0;
    for track in &film.tracks {
        let at_px = track.at_px.get(frames.clone()).unwrap_or_default();
        let mean = mean_px(at_px);
        let seen = at_px.iter().filter(|p| is_seen(p));
        squares += seen.map(|p| (p - mean).norm_squared()).sum::<f64>();
    }
    squares * span_s * span_s
}

/// The places at which a film does not join, in order.
fn cuts(film: &Film) -> Vec<Cut> {
    let steps_s = steps_around(film);
    let mut tally = Tally::new(film.times_s.len());
    for track in &film.tracks {
        tally.note(track, &steps_s);
    }
    let mut cuts = tally.stalls(&film.times_s);
    for k in tally.jumps() {
        // The jump at the end of a picture that stands still is a part of that.
        if !cuts
            .iter()
            .any(|cut| cut.between.start <= k && k <= cut.between.end)
        {
            cuts.push(Cut { between: k..k });
        }
    }
    cuts.sort_unstable_by_key(|cut| cut.between.start);
    cuts
}

/// The time steps around a frame, s.
#[derive(Clone, Copy, Debug)]
struct Steps {
    /// Between the two frames before it.
    before: f64,
    /// From the frame before to it.
    into: f64,
    /// From it to the next.
    after: f64,
}

/// Those of every frame; `None` where a gap is among them.
fn steps_around(film: &Film) -> Vec<Option<Steps>> {
    let longest_s = LONGEST_STEPS * film.step_s();
    let mut out = vec![None; film.times_s.len()];
    for (k, times_s) in film.times_s.windows(4).enumerate() {
        let steps = Steps {
            before: times_s[1] - times_s[0],
            into: times_s[2] - times_s[1],
            after: times_s[3] - times_s[2],
        };
        let is_even = [steps.before, steps.into, steps.after]
            .iter()
            .all(|s| *s <= longest_s);
        out[k + 2] = is_even.then_some(steps);
    }
    out
}

/// How many points do what in every frame.
struct Tally {
    frames: Vec<Count>,
}

/// How many points do what in one frame.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    /// Were seen in the frame before, too; of these stir, and move for sure.
    followed: u32,
    stirring: u32,
    moving: u32,
    /// Were seen in all frames around; of these jump.
    judged: u32,
    jumping: u32,
}

/// How a point comes into a frame.
#[derive(Clone, Copy, Debug)]
struct Arrival {
    /// Distance from where it would be by its speed before and after, px.
    off_px: f64,
    /// The larger of its steps before and after, px.
    beside_px: f64,
}

impl Arrival {
    /// `None` for a point that is not seen all the time.
    fn of(at_px: &[Point2<f64>], k: usize, steps: &Steps) -> Option<Self> {
        let around = at_px.get(k.checked_sub(2)?..k + 2)?;
        if !around.iter().all(is_seen) {
            return None;
        }
        let before = (around[1] - around[0]) * (steps.into / steps.before);
        let after = (around[3] - around[2]) * (steps.into / steps.after);
        let expected = 0.5 * (before + after);
        Some(Self {
            off_px: (around[2] - around[1] - expected).norm(),
            beside_px: before.norm().max(after.norm()),
        })
    }

    /// Whether it is a jump of a point that is off its way by `usual_px` else.
    fn is_jump(&self, usual_px: f64) -> bool {
        self.off_px > FAR_OFF * usual_px.max(LEAST_USUAL_PX) && self.off_px > LONE * self.beside_px
    }
}

impl Tally {
    fn new(frames: usize) -> Self {
        Self {
            frames: vec![Count::default(); frames],
        }
    }

    /// Takes the next point.
    fn note(&mut self, track: &FilmTrack, steps_s: &[Option<Steps>]) {
        let at_px = &track.at_px;
        for (count, pair) in self.frames.iter_mut().skip(1).zip(at_px.windows(2)) {
            if pair.iter().all(is_seen) {
                let moved_px = distance(&pair[0], &pair[1]);
                count.followed += 1;
                count.stirring += u32::from(moved_px > STILL_PX);
                count.moving += u32::from(moved_px > MOVING_PX);
            }
        }
        let mut arrivals = Vec::with_capacity(steps_s.len());
        for (k, steps) in steps_s.iter().enumerate() {
            arrivals.push(steps.and_then(|steps| Arrival::of(at_px, k, &steps)));
        }
        let usual_px = usual_px(&arrivals);
        for (k, (count, arrival)) in self.frames.iter_mut().zip(&arrivals).enumerate() {
            if let Some(arrival) = arrival {
                count.judged += 1;
                count.jumping += u32::from(arrival.is_jump(usual_px[k / USUAL_FRAMES]));
            }
        }
    }

    /// The frames into which many points jump.
    fn jumps(&self) -> Vec<usize> {
        let mut out = Vec::new();
        for (k, count) in self.frames.iter().enumerate() {
            let around = k.saturating_sub(1)..(k + 2).min(self.frames.len());
            // After a picture that was repeated points make up for what they were behind.
            let is_repeated = self.frames[around].iter().any(Count::is_still);
            if count.is_jump() && !is_repeated {
                out.push(k);
            }
        }
        out
    }

    /// Where the picture stands still while the tree moves.
    fn stalls(&self, times_s: &[f64]) -> Vec<Cut> {
        let mut out = Vec::new();
        let mut from = 0;
        while from < self.frames.len() {
            let still = self.frames[from..]
                .iter()
                .take_while(|count| count.is_still());
            let to = from + still.count();
            if to > from && self.is_stall(from..to, times_s) {
                out.push(Cut { between: from..to });
            }
            from = to + 1;
        }
        out
    }

    /// Whether frames that show the same picture as the one before them are more than a pause of
    /// the tree.
    fn is_stall(&self, still: Range<usize>, times_s: &[f64]) -> bool {
        let (Some(first_s), Some(next_s)) = (
            times_s.get(still.start.saturating_sub(1)),
            times_s.get(still.end),
        ) else {
            return false;
        };
        let before = &self.frames[still.start.saturating_sub(BESIDE_FRAMES)..still.start];
        let after = still.end..(still.end + BESIDE_FRAMES).min(self.frames.len());
        next_s - first_s > STALL_S
            && before.iter().any(Count::is_moving)
            && self.frames[after].iter().any(Count::is_moving)
    }
}

impl Count {
    /// Whether many points jump.
    fn is_jump(&self) -> bool {
        self.jumping >= LEAST_JUMPING
            && f64::from(self.jumping) >= JUMP_SHARE * f64::from(self.judged)
    }

    /// Whether it shows the same picture as the frame before.
    fn is_still(&self) -> bool {
        self.followed >= LEAST_POINTS && !self.is_share(self.stirring)
    }

    /// Whether many points move.
    fn is_moving(&self) -> bool {
        self.followed >= LEAST_POINTS && self.is_share(self.moving)
    }

    fn is_share(&self, some: u32) -> bool {
        f64::from(some) >= STIRRING_SHARE * f64::from(self.followed)
    }
}

/// How far a point is usually off its way, px, in each [`USUAL_FRAMES`] and the ones beside them: the
/// largest of their medians.
fn usual_px(arrivals: &[Option<Arrival>]) -> Vec<f64> {
    let mut medians_px = Vec::with_capacity(arrivals.len() / USUAL_FRAMES + 1);
    for some in arrivals.chunks(USUAL_FRAMES) {
        let off_px: Vec<f64> = some
            .iter()
            .flatten()
            .map(|arrival| arrival.off_px)
            .collect();
        medians_px.push(median(off_px, f64::total_cmp).unwrap_or(0.0));
    }
    let mut out = Vec::with_capacity(medians_px.len());
    for i in 0..medians_px.len() {
        let around = &medians_px[i.saturating_sub(1)..(i + 2).min(medians_px.len())];
        out.push(around.iter().copied().fold(0.0, f64::max));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::NOT_SEEN;
    use crate::model::NodeId;
    use crate::random::generator;
    use nalgebra::Vector2;
    use rand::RngExt;
    use std::f64::consts::TAU;

    const RATE_HZ: f64 = 30.0;
    /// Points from the foot, which stands still, to the tips.
    const POINTS: usize = 60;

    fn even(frames: usize) -> Vec<f64> {
        (0..frames).map(|k| k as f64 / RATE_HZ).collect()
    }

    /// A film of which frame k shows the tree as it is at `shown_s[k]`, with noise of `noise_px` at
    /// most; the same picture has the same noise.
    fn film(
        times_s: &[f64],
        shown_s: &[f64],
        noise_px: f64,
        sway: fn(f64) -> Vector2<f64>,
    ) -> Film {
        let mut random = generator(3, 0);
        let mut tracks = Vec::new();
        for i in 0..POINTS {
            let reach = i as f64 / POINTS as f64;
            let rest = Point2::new(300.0 + i as f64, 200.0);
            let mut at_px: Vec<Point2<f64>> = Vec::new();
            for (k, shown) in shown_s.iter().enumerate() {
                if k > 0 && shown_s[k - 1] == *shown {
                    at_px.push(at_px[k - 1]);
                    continue;
                }
                let noise =
                    Vector2::new(random.random::<f64>() - 0.5, random.random::<f64>() - 0.5);
                // Branches far out lag behind.
                at_px.push(rest + reach * sway(shown - 0.1 * reach) + 2.0 * noise_px * noise);
            }
            tracks.push(FilmTrack {
                node: NodeId(1),
                at_px,
            });
        }
        Film::new(times_s, tracks)
    }

    fn decay(hz: f64, px: f64, t: f64) -> f64 {
        if t < 0.0 {
            px
        } else {
            px * (-0.03 * TAU * hz * t).exp() * (TAU * hz * t).cos()
        }
    }

    /// Released at 0.
    fn released(t: f64) -> Vector2<f64> {
        Vector2::new(decay(0.6, 12.0, t) + decay(2.3, 3.0, t), decay(1.4, 2.0, t))
    }

    /// Held until 4 s.
    fn held(t: f64) -> Vector2<f64> {
        released(t - 4.0)
    }

    /// Sways all the time; a gust begins with a jerk at 5 s.
    fn windy(t: f64) -> Vector2<f64> {
        let gust = 20.0 * (1.0 - (-2.0 * (t - 5.0).max(0.0)).exp());
        Vector2::new(gust + 9.0 * (TAU * 0.5 * t).sin(), (TAU * 1.9 * t).sin())
    }

    /// Of something hard against the trunk at 5 s, which rings.
    fn hit(t: f64) -> Vector2<f64> {
        let ring = 4.0 * (-(t - 5.0).max(0.0)).exp() * (TAU * 4.0 * (t - 5.0).max(0.0)).sin();
        windy(t.min(5.0)) + Vector2::new(ring, 0.0)
    }

    /// Twelve seconds, in which the picture is that of `shown` for each frame's number.
    fn edited(shown: impl Fn(usize) -> usize, sway: fn(f64) -> Vector2<f64>) -> Film {
        let shown_s: Vec<f64> = (0..360).map(|k| shown(k) as f64 / RATE_HZ).collect();
        film(&even(360), &shown_s, 0.15, sway)
    }

    /// What is left is given as its first and last frame's time, s.
    fn check(name: &str, film: Film, cuts_s: &[f64], left_s: [f64; 2]) {
        let whole_s = film.span_s();
        let take = Take::of(film);
        let close = |found: f64, expected: f64| (found - expected).abs() < 0.05;
        assert!(
            take.cuts_s.len() == cuts_s.len()
                && take.cuts_s.iter().zip(cuts_s).all(|(a, b)| close(*a, *b)),
            "{name}: {:?}",
            take.cuts_s
        );
        let ends_s = (
            take.film.times_s[0],
            take.film.times_s[take.film.times_s.len() - 1],
        );
        assert!(
            close(ends_s.0, left_s[0]) && close(ends_s.1, left_s[1]),
            "{name}: {ends_s:?}"
        );
        let left_out_s = whole_s - (ends_s.1 - ends_s.0);
        assert!(
            close(take.left_out_s, left_out_s),
            "{name}: {}",
            take.left_out_s
        );
        assert_eq!(take.warning().is_some(), !cuts_s.is_empty(), "{name}");
    }

    /// `frames` are missing from frame `at` on.
    fn cut(at: usize, frames: usize) -> impl Fn(usize) -> usize {
        move |k| if k < at { k } else { k + frames }
    }

    /// The picture of frame `at` stays for `frames`; then the film goes on with the next one, or
    /// with the one that is due.
    fn stalled(at: usize, frames: usize, skips: bool) -> impl Fn(usize) -> usize {
        move |k| match k {
            k if k <= at => k,
            k if k <= at + frames => at,
            k if skips => k,
            k => k - frames,
        }
    }

    const WHOLE_S: [f64; 2] = [0.0, 359.0 / RATE_HZ];

    #[test]
    fn of_a_film_that_is_cut_the_part_counts_that_says_most() {
        let end_s = WHOLE_S[1];
        check(
            "two seconds",
            edited(cut(150, 60), released),
            &[5.0],
            [0.0, 149.0 / RATE_HZ],
        );
        check(
            "one",
            edited(cut(240, 30), released),
            &[8.0],
            [0.0, 239.0 / RATE_HZ],
        );
        check(
            "half of one",
            edited(cut(210, 15), windy),
            &[7.0],
            [0.0, 209.0 / RATE_HZ],
        );
        check(
            "soon after the release",
            edited(cut(30, 30), released),
            &[1.0],
            [1.0, end_s],
        );
        let twice = |k| cut(100, 40)(cut(270, 30)(k));
        check(
            "twice",
            edited(twice, windy),
            &[100.0 / RATE_HZ, 9.0],
            [100.0 / RATE_HZ, 269.0 / RATE_HZ],
        );
    }

    #[test]
    fn a_picture_that_stands_still_is_a_cut_whether_the_film_skips_what_it_missed_or_not() {
        for skips in [false, true] {
            check(
                "two seconds",
                edited(stalled(150, 60, skips), released),
                &[151.0 / RATE_HZ],
                [0.0, 5.0],
            );
        }
        let film = edited(stalled(60, 120, false), windy);
        check(
            "four seconds",
            film,
            &[61.0 / RATE_HZ],
            [181.0 / RATE_HZ, WHOLE_S[1]],
        );
    }

    /// Each of these would be cut in two by a test for sudden changes.
    #[test]
    fn a_film_in_one_piece_stays_whole() {
        check("released", edited(|k| k, released), &[], WHOLE_S);
        check("held, then released", edited(|k| k, held), &[], WHOLE_S);
        check("a gust", edited(|k| k, windy), &[], WHOLE_S);
        check("a blow", edited(|k| k, hit), &[], WHOLE_S);
        let repeated = |k| k - usize::from(k % 10 == 9);
        check(
            "pictures repeated",
            edited(repeated, released),
            &[],
            WHOLE_S,
        );
        check(
            "without noise",
            film(&even(360), &even(360), 0.0, held),
            &[],
            WHOLE_S,
        );
        let some: Vec<f64> = even(360)
            .into_iter()
            .enumerate()
            .filter_map(|(k, s)| (k == 0 || k == 359 || (k * 7) % 10 > 3).then_some(s))
            .collect();
        check(
            "frames left out",
            film(&some, &some, 0.15, released),
            &[],
            WHOLE_S,
        );
        let gap: Vec<f64> = even(360)
            .into_iter()
            .filter(|s| !(4.0..6.0).contains(s))
            .collect();
        check("a gap", film(&gap, &gap, 0.15, released), &[], WHOLE_S);
    }

    /// A bird takes off with a branch's points; so few points may jump by chance.
    #[test]
    fn a_jump_of_some_points_is_no_cut() {
        let mut film = edited(|k| k, windy);
        for track in film.tracks.iter_mut().step_by(8) {
            for at_px in &mut track.at_px[200..] {
                at_px.x += 15.0;
            }
        }
        check("every eighth", film, &[], WHOLE_S);
        let mut all = edited(cut(150, 60), released);
        all.tracks.drain(..POINTS - 7);
        check("seven points", all, &[], WHOLE_S);
    }

    /// Points come and go, and some are lost in the jump itself.
    #[test]
    fn a_cut_is_found_by_the_points_that_are_seen() {
        let mut film = edited(cut(150, 60), released);
        for (i, track) in film.tracks.iter_mut().enumerate() {
            match i % 3 {
                0 => track.at_px[140 + i..].fill(NOT_SEEN),
                1 => track.at_px[..i].fill(NOT_SEEN),
                _ => {}
            }
        }
        check("gaps", film, &[5.0], [0.0, 149.0 / RATE_HZ]);
    }

    #[test]
    fn a_film_of_nothing_is_in_one_piece() {
        assert_eq!(Take::of(Film::default()), Take::default());
        let nowhere = [
            NOT_SEEN,
            Point2::new(f64::INFINITY, 1.0),
            Point2::new(1e300, -1e300),
        ];
        for at_px in nowhere {
            for frames in [1, 2, 3, 4, 40] {
                let track = FilmTrack {
                    node: NodeId(1),
                    at_px: vec![at_px; frames],
                };
                let film = Film::new(&even(frames), vec![track; POINTS]);
                let take = Take::of(film);
                assert!(take.cuts_s.is_empty() && take.film.times_s.len() == frames);
            }
        }
        // Fewer places than frames.
        let mut film = edited(|k| k, windy);
        for track in &mut film.tracks {
            track.at_px.truncate(7);
        }
        assert!(Take::of(film).cuts_s.is_empty());
    }

    #[test]
    fn the_user_reads_where_and_what_counts() {
        let take = Take {
            film: edited(|k| k, windy),
            cuts_s: vec![12.0, 13.5],
            left_out_s: 3.0,
        };
        let said = take.warning().unwrap();
        assert!(
            said.contains("at 12.0 s, 13.5 s, and its times run on")
                && said.contains("that from 0.0 to 12.0 s"),
            "{said}"
        );
        let many = Take {
            cuts_s: vec![1.0; 9],
            ..Take::default()
        };
        let said = many.warning().unwrap();
        assert!(said.contains("1.0 s and 6 times more") && said.contains("none of its parts"));
    }
}
