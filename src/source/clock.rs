//! The count and the time of a driver, as the rest of the program may rely on them: both only grow.
//!
//! A driver's clock is believed for as long as it can be true. Where it jumps, stands still or
//! starts anew, the time that went by here, between two frames received, bridges the step, and the
//! driver's clock is followed again from there on.

use v4l::buffer::{Flags, Metadata};

/// What the times of the frames are by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClockKind {
    /// The times that a file says.
    #[default]
    File,
    /// The system's monotonic clock, read by the driver when the picture was taken.
    Monotonic,
    /// Handed through from the program that feeds the device.
    Copied,
    /// The driver does not say which.
    Unknown,
    /// The moment at which we received the frame: the driver has no usable clock.
    Received,
}

impl ClockKind {
    pub const ALL: [Self; 5] = [
        Self::File,
        Self::Monotonic,
        Self::Copied,
        Self::Unknown,
        Self::Received,
    ];

    pub fn name(self) -> &'static str {
        match self {
            ClockKind::File => "file",
            ClockKind::Monotonic => "monotonic",
            ClockKind::Copied => "copied",
            ClockKind::Unknown => "unknown",
            ClockKind::Received => "received",
        }
    }
}

/// A frame's time may differ by so much from what the time of its reception allows, s. Deliveries
/// are late by a few frames; a clock that jumps usually does so by far more.
const SLACK_S: f64 = 2.0;
/// After so many frames without progress the clock counts as broken, not the frames.
const STANDS_STILL: u32 = 5;
/// A clock that begins beyond this, s, is counted from our own zero: 64 bits of nanoseconds end at
/// 9.2e9 s, and a time that goes on past them would stand still in every file that counts so.
const FAR_S: f64 = 4e9;
/// Least step where the times of reception cannot tell two frames apart, s.
const LEAST_STEP_S: f64 = 1e-4;

/// Turns the driver's count and time into ours.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    kind: ClockKind,
    /// Whether the driver counts at all.
    counts: bool,
    raw_sequence: Option<u32>,
    sequence: u64,
    last: Option<Last>,
    /// From the driver's time to ours, s.
    offset_s: f64,
    /// Least time from a frame's own time to its reception since the last bridge, s; its zero means
    /// nothing.
    least_delay_s: f64,
    stood_still: u32,
    first_still_raw_s: f64,
    /// The camera has come back and its clock may be another one.
    returned: bool,
}

#[derive(Clone, Copy, Debug)]
struct Last {
    raw_s: f64,
    time_s: f64,
    received_s: f64,
}

impl Clock {
    /// `counts`: whether the driver numbers its frames.
    pub(super) fn new(counts: bool) -> Self {
        Self {
            kind: ClockKind::Unknown,
            counts,
            raw_sequence: None,
            sequence: 0,
            last: None,
            offset_s: 0.0,
            least_delay_s: f64::INFINITY,
            stood_still: 0,
            first_still_raw_s: 0.0,
            returned: false,
        }
    }

    pub(super) fn kind(&self) -> ClockKind {
        self.kind
    }

    /// The camera was opened anew: it counts from the beginning, and its clock may have started
    /// again.
    pub(super) fn returned(&mut self) {
        (self.raw_sequence, self.returned) = (None, true);
    }

    /// Number and time of a frame that was received at `received_s` by any clock that only grows;
    /// `None` for a frame that is not later than the one before. No number where the driver does
    /// not count or starts counting anew.
    pub(super) fn take(&mut self, meta: &Metadata, received_s: f64) -> Option<(Option<u64>, f64)> {
        let raw_s = meta.timestamp.sec as f64 + meta.timestamp.usec as f64 * 1e-6;
        let sequence = self.number(meta.sequence);
        let kind = match meta.flags & Flags::TIMESTAMP_MASK {
            Flags::TIMESTAMP_MONOTONIC => ClockKind::Monotonic,
            Flags::TIMESTAMP_COPY => ClockKind::Copied,
            _ => ClockKind::Unknown,
        };
        if self.kind != ClockKind::Received {
            self.kind = kind;
        }
        let time_s = self.time(raw_s, received_s)?;
        self.last = Some(Last {
            raw_s,
            time_s,
            received_s,
        });
        self.least_delay_s = self.least_delay_s.min(received_s - raw_s);
        (self.stood_still, self.returned) = (0, false);
        Some((sequence, time_s))
    }

    /// The driver's count with its wraps undone; going on by one where the driver begins anew.
    fn number(&mut self, raw: u32) -> Option<u64> {
        if !self.counts {
            return None;
        }
        let before = self.raw_sequence.replace(raw);
        // The count has 32 bits and wraps; half its range backwards is a reset.
        let step = before.map_or(0, |before| raw.wrapping_sub(before));
        let known = (1..=u32::MAX / 2).contains(&step);
        let first = before.is_none() && self.last.is_none();
        self.sequence += if known {
            u64::from(step)
        } else {
            u64::from(!first)
        };
        (known || first).then_some(self.sequence)
    }

    fn time(&mut self, raw_s: f64, received_s: f64) -> Option<f64> {
        let Some(last) = self.last else {
            self.offset_s = if raw_s.abs() < FAR_S {
                0.0
            } else {
                received_s - raw_s
            };
            return Some(raw_s + self.offset_s);
        };
        let (by_driver_s, by_us_s) = (raw_s - last.raw_s, received_s - last.received_s);
        if self.kind == ClockKind::Received {
            return Some(last.time_s + by_us_s.max(LEAST_STEP_S));
        }
        // A frame that came late leaves the next one, which comes in time, a longer step by its own
        // clock than by ours.
        let came_late_s = (last.received_s - last.raw_s - self.least_delay_s).max(0.0);
        let from_the_future = by_driver_s > by_us_s + came_late_s + SLACK_S;
        let another_clock = self.returned
            && (self.kind != ClockKind::Monotonic
                || (by_driver_s - by_us_s).abs() > came_late_s + SLACK_S);
        if from_the_future || another_clock || by_driver_s < -SLACK_S {
            return Some(self.bridge(last, raw_s, received_s));
        }
        if by_driver_s > 0.0 {
            let time_s = raw_s + self.offset_s;
            // After a bridge rounding may put two close frames at the same time.
            return (time_s > last.time_s).then_some(time_s);
        }
        if self.stood_still == 0 {
            self.first_still_raw_s = raw_s;
        }
        self.stood_still += 1;
        if self.stood_still < STANDS_STILL {
            return None;
        }
        if raw_s <= self.first_still_raw_s {
            self.kind = ClockKind::Received;
        }
        Some(self.bridge(last, raw_s, received_s))
    }

    /// The step from the last frame by the times of reception; the driver's clock is followed again
    /// from here.
    fn bridge(&mut self, last: Last, raw_s: f64, received_s: f64) -> f64 {
        let time_s = last.time_s + (received_s - last.received_s).max(LEAST_STEP_S);
        (self.offset_s, self.least_delay_s) = (time_s - raw_s, received_s - raw_s);
        time_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn meta(sequence: u32, time_s: f64, flags: Flags) -> Metadata {
        let whole = time_s.floor();
        let timestamp =
            v4l::timestamp::Timestamp::new(whole as i64, ((time_s - whole) * 1e6).round() as i64);
        Metadata {
            sequence,
            timestamp,
            flags,
            ..Metadata::default()
        }
    }

    fn monotonic(sequence: u32, time_s: f64) -> Metadata {
        meta(sequence, time_s, Flags::TIMESTAMP_MONOTONIC)
    }

    fn numbers(raw: &[u32]) -> Vec<Option<u64>> {
        let mut clock = Clock::new(true);
        let at = |i: usize| 1.0 + i as f64 / 30.0;
        raw.iter()
            .enumerate()
            .map(|(i, &n)| clock.take(&monotonic(n, at(i)), at(i)).expect("later").0)
            .collect()
    }

    #[test]
    fn numbers_go_on_over_a_wrap_and_are_unknown_where_the_driver_starts_anew() {
        assert_eq!(numbers(&[0, 1, 4, 5]), [0, 1, 4, 5].map(Some));
        let top = u64::from(u32::MAX) - 1;
        let numbers_at_top = numbers(&[u32::MAX - 1, u32::MAX, 0, 2]);
        let first = numbers_at_top[0].expect("a number");
        assert_eq!(
            numbers_at_top,
            [first, first + 1, first + 2, first + 4].map(Some)
        );
        assert!(top >= first);
        assert_eq!(numbers(&[7, 3, 4, 6]), [Some(0), None, Some(2), Some(4)]);
        assert_eq!(numbers(&[5, 5, 5, 6]), [Some(0), None, None, Some(3)]);
        let mut silent = Clock::new(false);
        assert_eq!(silent.take(&monotonic(3, 1.0), 1.0), Some((None, 1.0)));
    }

    #[test]
    fn a_frame_that_is_not_later_is_left_out() {
        let mut clock = Clock::new(true);
        let mut at = |n, s: f64, received_s| {
            clock
                .take(&monotonic(n, s), received_s)
                .map(|(_, time_s)| time_s)
        };
        assert_eq!(at(1, 50.0, 0.0), Some(50.0));
        assert_eq!(at(2, 50.0, 0.03), None);
        assert_eq!(at(3, 49.5, 0.06), None);
        assert_eq!(at(4, 50.5, 0.09), Some(50.5));
    }

    /// Times in ms of frames by the driver and by us, and the times they must get.
    fn check(name: &str, flags: Flags, frames: &[(f64, f64, f64)], kind: ClockKind) {
        let mut clock = Clock::new(false);
        for (i, &(raw_ms, received_ms, expected_ms)) in frames.iter().enumerate() {
            let taken = clock
                .take(&meta(0, raw_ms / 1e3, flags), received_ms / 1e3)
                .map(|(_, time_s)| time_s * 1e3);
            let good = if expected_ms.is_nan() {
                taken.is_none()
            } else {
                taken.is_some_and(|t| (t - expected_ms).abs() < 0.1)
            };
            assert!(
                good,
                "{name}, frame {i}: {taken:?} instead of {expected_ms}"
            );
        }
        assert_eq!(clock.kind(), kind, "{name}");
    }

    #[test]
    fn a_clock_is_followed_for_as_long_as_it_can_be_true() {
        let gone = f64::NAN;
        let monotonic = Flags::TIMESTAMP_MONOTONIC;
        // Half a minute of standstill here, then what waited in the buffers, then a picture in
        // time.
        let late = [
            (0.0, 1.0, 0.0),
            (33.0, 30_000.0, 33.0),
            (66.0, 30_000.0, 66.0),
            (30_033.0, 30_034.0, 30_033.0),
        ];
        check("late deliveries", monotonic, &late, ClockKind::Monotonic);
        let wrapped = [
            (5e6, 0.0, 5e6),
            (5e6 + 33.0, 33.0, 5e6 + 33.0),
            (-5e6, 66.0, 5e6 + 66.0),
            (-5e6 + 40.0, 100.0, 5e6 + 106.0),
        ];
        check("a wrap", monotonic, &wrapped, ClockKind::Monotonic);
        // Milliseconds before 64 bits of nanoseconds end, and after it.
        let end = 9_223_372_036_000.0;
        let far = [
            (end, 5.0, 5.0),
            (end + 40.0, 45.0, 45.0),
            (-end, 90.0, 90.0),
            (-end + 40.0, 130.0, 130.0),
        ];
        check("a wrap of 64 bits", monotonic, &far, ClockKind::Monotonic);
        check(
            "a jump ahead",
            monotonic,
            &[(0.0, 0.0, 0.0), (9e6, 33.0, 33.0), (9e6 + 33.0, 70.0, 66.0)],
            ClockKind::Monotonic,
        );
        // A program that feeds a loopback device faster than it was filmed has its own times.
        let fast: Vec<_> = (0..2000)
            .map(|i| (33.0 * f64::from(i), f64::from(i), 33.0 * f64::from(i)))
            .collect();
        check(
            "a fast feeder",
            Flags::TIMESTAMP_COPY,
            &fast,
            ClockKind::Copied,
        );
        let mut still = vec![(0.0, 0.0, 0.0)];
        still.extend((1..5).map(|i| (0.0, 33.0 * f64::from(i), gone)));
        still.extend((5..9).map(|i| (0.0, 33.0 * f64::from(i), 33.0 * f64::from(i))));
        check(
            "a clock that stands",
            Flags::TIMESTAMP_UNKNOWN,
            &still,
            ClockKind::Received,
        );
    }

    #[test]
    fn a_camera_that_comes_back_leaves_a_gap_of_its_true_length() {
        // Name, flags, and the first raw time after 10 s without the camera.
        let cases = [
            ("the clock went on", Flags::TIMESTAMP_MONOTONIC, 110.0),
            ("it started anew", Flags::TIMESTAMP_MONOTONIC, 0.5),
            (
                "anew, and beyond what it was",
                Flags::TIMESTAMP_MONOTONIC,
                101.0,
            ),
            ("a copied clock", Flags::TIMESTAMP_COPY, 100.02),
        ];
        for (name, flags, back_raw_s) in cases {
            let mut clock = Clock::new(true);
            assert!(clock.take(&meta(70, 100.0, flags), 100.0).is_some());
            clock.returned();
            let (number, time_s) = clock
                .take(&meta(0, back_raw_s, flags), 110.0)
                .expect("a frame");
            assert!((time_s - 110.0).abs() < 1e-3, "{name}: {time_s}");
            assert_eq!(
                number, None,
                "{name}: nobody knows how many it would have been"
            );
            let (number, later_s) = clock
                .take(&meta(1, back_raw_s + 0.04, flags), 110.03)
                .expect("a frame");
            assert!(
                (later_s - 110.04).abs() < 1e-3 && number.is_some(),
                "{name}: {later_s} {number:?}"
            );
        }
    }

    proptest! {
        /// Whatever a driver says, numbers and times only grow.
        #[test]
        fn numbers_and_times_only_grow(
            frames in prop::collection::vec(
                (any::<u32>(), -1e7..1e7f64, 0.0..5.0f64, 0..3u8, any::<bool>()),
                1..200,
            )
        ) {
            let mut clock = Clock::new(true);
            let (mut received_s, mut last_number, mut last_s) = (0.0, None, f64::NEG_INFINITY);
            for (sequence, raw_s, wait_s, kind, returned) in frames {
                received_s += wait_s;
                if returned {
                    clock.returned();
                }
                let flags = match kind {
                    0 => Flags::TIMESTAMP_MONOTONIC,
                    1 => Flags::TIMESTAMP_COPY,
                    _ => Flags::TIMESTAMP_UNKNOWN,
                };
                if let Some((number, time_s)) = clock.take(&meta(sequence, raw_s, flags), received_s) {
                    prop_assert!(time_s > last_s);
                    last_s = time_s;
                    if number.is_some() {
                        prop_assert!(number > last_number);
                        last_number = number;
                    }
                }
            }
        }
    }
}
