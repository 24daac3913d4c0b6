//! The way of a marker so far, and where it may be next.

use nalgebra::{Point2, Vector2, distance};

/// Gains of a filter of place and speed (alpha-beta filter, Kalata 1984): a sight is exact to parts of
/// a pixel, so that it counts for most of the place. His relation gives the gain of the speed.
const PLACE_GAIN: f64 = 0.85;
const SPEED_GAIN: f64 = PLACE_GAIN * PLACE_GAIN / (2.0 - PLACE_GAIN);
/// How fast the usual surprise follows those of sights, a frame.
const SURPRISE_SHARE: f64 = 0.05;
/// A sight is no farther from where it was expected than so many usual surprises: one in ten thousand
/// is, of a normal distribution in the plane.
const GATE_SURPRISES: f64 = 3.0;
/// Between two frames, where nothing was seen in two that follow, s.
const USUAL_INTERVAL_S: f64 = 1.0 / 30.0;
/// A marker that is not seen goes straight on for so long, s; then it swings back.
const COAST_S: f64 = 0.1;
/// How far a marker sways is known when it has been seen for so long, s: a period of a slow tree.
const SWAY_KNOWN_S: f64 = 2.0;
/// It sways farther than it has so far by this share of that, to each side.
const FARTHER_SHARE: f64 = 0.5;

/// The way of a marker in the picture, px, from its sights.
#[derive(Clone, Debug)]
pub struct Way {
    radius_px: f64,
    at_px: Point2<f64>,
    speed_px_s: Vector2<f64>,
    seen_s: f64,
    /// Frames since then.
    missed: u32,
    /// Between two frames.
    interval_s: Option<f64>,
    /// Mean square distance of a sight from where it was expected.
    surprise_px2: f64,
    /// The box in which it has been.
    low_px: Point2<f64>,
    high_px: Point2<f64>,
    /// Sum of its places, for the mean, and of the times between sights in two frames that follow.
    sum_px: Vector2<f64>,
    sights: f64,
    seen_for_s: f64,
}

impl Way {
    /// Of a marker of this radius, px, that is seen for the first time.
    pub fn begin(at_px: Point2<f64>, radius_px: f64, time_s: f64) -> Self {
        Self {
            radius_px,
            at_px,
            speed_px_s: Vector2::zeros(),
            seen_s: time_s,
            missed: 0,
            interval_s: None,
            surprise_px2: radius_px * radius_px,
            low_px: at_px,
            high_px: at_px,
            sum_px: at_px.coords,
            sights: 1.0,
            seen_for_s: 0.0,
        }
    }

    /// Where it was when it was seen last, px.
    pub fn at_px(&self) -> Point2<f64> {
        self.at_px
    }

    /// When it was seen last, s.
    pub fn seen_s(&self) -> f64 {
        self.seen_s
    }

    /// Whether it was seen in the last frame.
    pub fn is_seen(&self) -> bool {
        self.missed == 0
    }

    /// It is not seen in the next frame.
    pub fn miss(&mut self) {
        self.missed = self.missed.saturating_add(1);
    }

    /// It is seen in the next frame.
    pub fn see(&mut self, at_px: Point2<f64>, time_s: f64) {
        let off = at_px - self.straight_on(time_s);
        let passed_s = time_s - self.seen_s;
        if self.is_seen() && passed_s > 0.0 {
            self.at_px = at_px - (1.0 - PLACE_GAIN) * off;
            self.speed_px_s += SPEED_GAIN / passed_s * off;
            self.surprise_px2 += SURPRISE_SHARE * (off.norm_squared() - self.surprise_px2);
            self.interval_s = Some(self.interval_s.map_or(passed_s, |s| s.min(passed_s)));
            self.seen_for_s += passed_s;
        } else {
            (self.at_px, self.speed_px_s) = (at_px, Vector2::zeros());
            // Its speed is not known.
            self.surprise_px2 = self.surprise_px2.max(self.radius_px * self.radius_px);
        }
        (self.seen_s, self.missed) = (time_s, 0);
        self.low_px = self.low_px.inf(&at_px);
        self.high_px = self.high_px.sup(&at_px);
        self.sum_px += at_px.coords;
        self.sights += 1.0;
    }

    /// The user says where it is: what was known of its place counts no more.
    pub fn set(&mut self, at_px: Point2<f64>, time_s: f64) {
        *self = Self::begin(at_px, self.radius_px, time_s);
    }

    /// Where it is if it goes straight on for a while.
    fn straight_on(&self, time_s: f64) -> Point2<f64> {
        self.at_px + (time_s - self.seen_s).clamp(0.0, COAST_S) * self.speed_px_s
    }

    /// Where it is expected: straight on, and after a while about the middle of its way.
    pub fn expected(&self, time_s: f64) -> Point2<f64> {
        if time_s - self.seen_s > COAST_S && self.is_sway_known() {
            Point2::from(self.sum_px / self.sights)
        } else {
            self.straight_on(time_s)
        }
    }

    /// How far a place is from where it is expected, px.
    pub fn off_px(&self, place_px: Point2<f64>, time_s: f64) -> f64 {
        distance(&self.expected(time_s), &place_px)
    }

    /// Whether it may be at a place: it does not jump, and stays where it sways.
    pub fn may_be_at(&self, place_px: Point2<f64>, time_s: f64) -> bool {
        let straight_on = self.straight_on(time_s);
        let (low, high) = self.limits();
        distance(&straight_on, &place_px) <= self.reach_px(time_s)
            && low <= place_px
            && place_px <= high
    }

    /// The corners of the box in which it may be.
    pub fn area(&self, time_s: f64) -> (Point2<f64>, Point2<f64>) {
        let (straight_on, reach_px) = (self.straight_on(time_s), self.reach_px(time_s));
        let reach = Vector2::repeat(reach_px);
        let (low, high) = self.limits();
        (
            low.sup(&(straight_on - reach)),
            high.inf(&(straight_on + reach)),
        )
    }

    /// How far from its straight way it may be. A place that was extrapolated from place and speed is
    /// wrong by the time to the power of 1.5 if the acceleration is white noise.
    fn reach_px(&self, time_s: f64) -> f64 {
        let interval_s = self.interval_s.unwrap_or(USUAL_INTERVAL_S);
        let frames = ((time_s - self.seen_s) / interval_s).max(1.0);
        // Half covered, its middle is off by up to half of its radius.
        self.radius_px + GATE_SURPRISES * self.surprise_px2.sqrt() * frames.powf(1.5)
    }

    /// The corners of the box in which it sways.
    fn limits(&self) -> (Point2<f64>, Point2<f64>) {
        if !self.is_sway_known() {
            return (
                Vector2::repeat(f64::NEG_INFINITY).into(),
                Vector2::repeat(f64::INFINITY).into(),
            );
        }
        let farther =
            FARTHER_SHARE * (self.high_px - self.low_px) + Vector2::repeat(2.0 * self.radius_px);
        (self.low_px - farther, self.high_px + farther)
    }

    fn is_sway_known(&self) -> bool {
        self.seen_for_s >= SWAY_KNOWN_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME_S: f64 = 1.0 / 30.0;

    /// Sways by 20 px to each side, once in a second.
    fn sway_px(frame: u32) -> Point2<f64> {
        let angle = std::f64::consts::TAU * f64::from(frame) * FRAME_S;
        Point2::new(100.0 + 20.0 * angle.sin(), 50.0)
    }

    fn seen_for(frames: u32) -> Way {
        let mut way = Way::begin(sway_px(0), 4.0, 0.0);
        for frame in 1..frames {
            let time_s = f64::from(frame) * FRAME_S;
            assert!(way.may_be_at(sway_px(frame), time_s), "frame {frame}");
            way.see(sway_px(frame), time_s);
        }
        way
    }

    #[test]
    fn a_marker_does_not_jump_from_one_frame_to_the_next() {
        let way = seen_for(90);
        let next_s = 90.0 * FRAME_S;
        let jumped = sway_px(90) + Vector2::new(0.0, 12.0);
        assert!(!way.may_be_at(jumped, next_s));
        // It may have gone there when it has not been seen for half a second, but no farther than it
        // sways.
        let later_s = next_s + 0.5;
        let across = Point2::new(75.0, 55.0);
        assert!(way.may_be_at(across, later_s) && !way.may_be_at(across, next_s));
        assert!(!way.may_be_at(Point2::new(100.0, 90.0), later_s + 10.0));
        assert!(!way.may_be_at(Point2::new(160.0, 50.0), later_s + 10.0));
        assert!((way.expected(later_s).x - 100.0).abs() < 2.0);
    }

    #[test]
    fn a_marker_that_has_just_begun_may_go_anywhere() {
        let way = seen_for(3);
        assert!(way.may_be_at(Point2::new(170.0, 90.0), 2.0));
        let (low, high) = way.area(2.0);
        assert!(low.x < 30.0 && high.x > 170.0);
    }
}
