//! Frames that were lost before they reached us, counted twice over: by the driver's numbers and by
//! the times.
//!
//! Some drivers start counting anew or do not count, others give times that jitter; so both counts
//! are kept. A hole in the numbers is believed at once. A hole in the times is judged late, when
//! the frames around it are known: one that the frames before or after make up for was jitter, and
//! one as long as all the steps on either side is a slower rate.

use crate::model::{Gap, GapCause};
use std::collections::VecDeque;

/// Steps on either side of the one that is judged: of sixteen, with two frames in
/// five lost, now and then so few are of one frame that the rate is taken for half of what it is.
const AROUND: usize = 32;
/// Fewer steps than this say nothing of the rate.
const LEAST_STEPS: usize = 4;
/// Where there are fewer on one side than this the other, longer one tells the rate alone: of so few, with a third of
/// the frames lost, now and then none is of one frame. Of more, a camera that begins slowly has lost none.
const SHORT_SIDE: usize = 12;
/// A frame that came late is made up for within so many steps.
const MADE_UP: usize = 6;
/// A driver that numbers only what it delivers shows no hole: its times are believed from so many
/// losses on, if they are also more than this share of all frames.
const TIMES_BELIEVED: u64 = 5;
const TIMES_SHARE: f64 = 0.01;

/// Losses so far; they only grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// `None` while no two frames have had numbers.
    pub by_sequence: Option<u64>,
    pub by_time: u64,
    /// What is to be believed of the two.
    pub reconciled: u64,
}

/// A frame's place in the capture.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrival {
    pub index: u64,
    /// Holes found with it: before it by the numbers, or some frames back by the times.
    pub gaps: Vec<Gap>,
}

#[derive(Clone, Copy, Debug)]
struct Tick {
    index: u64,
    time_s: f64,
    /// Frames that came before it and were of no use.
    broken: u64,
    numbered: bool,
}

/// Follows numbers and times of one source.
#[derive(Debug)]
pub struct Losses {
    live: bool,
    nominal_s: Option<f64>,
    /// The last number, and frames without one since, useless ones included.
    last_number: Option<(u64, u64)>,
    /// The last frame, one that is to be judged at most [`AROUND`] before it, and the frames before
    /// that one.
    ticks: VecDeque<Tick>,
    /// Position in `ticks` of the next one to be judged.
    next: usize,
    /// The last frame before the source was away.
    before_away: Option<(Tick, GapCause)>,
    seen: u64,
    totals: Totals,
    /// Losses by the times in steps without a number.
    unnumbered: u64,
}

impl Losses {
    /// `live`: the source is a camera; the numbers of a file are its own.
    pub fn new(live: bool, nominal_rate_hz: Option<f64>) -> Self {
        Self {
            live,
            nominal_s: nominal_rate_hz
                .map(|hz| 1.0 / hz)
                .filter(|s| s.is_finite() && *s > 0.0),
            last_number: None,
            ticks: VecDeque::new(),
            next: 1,
            before_away: None,
            seen: 0,
            totals: Totals::default(),
            unnumbered: 0,
        }
    }

    pub fn totals(&self) -> Totals {
        self.totals
    }

    /// Time from frame to frame by the last times, losses left out, s; `None` while there are too
    /// few.
    pub fn interval_s(&self) -> Option<f64> {
        self.interval_of(
            self.ticks.len().saturating_sub(2 * AROUND),
            self.ticks.len(),
        )
    }

    /// A frame has come; `broken` came before it and were of no use.
    pub fn arrived(&mut self, sequence: Option<u64>, time_s: f64, broken: u64) -> Arrival {
        self.seen += 1;
        let first = Tick {
            index: 0,
            time_s,
            broken,
            numbered: false,
        };
        if let Some((last, cause)) = self.before_away.take() {
            return self.arrived_after(last, cause, first, sequence);
        }
        let Some(&last) = self.ticks.back() else {
            self.begin(first, sequence);
            return Arrival {
                index: 0,
                gaps: Vec::new(),
            };
        };
        let hole = self.number(sequence, broken);
        let missing = hole.unwrap_or(0);
        let index = last.index + 1 + broken + missing;
        let mut gaps = Vec::new();
        if missing > 0 {
            gaps.push(Gap {
                after_frame: last.index,
                time_s: last.time_s,
                missing,
                cause: GapCause::Dropped,
                length_s: time_s - last.time_s,
            });
        }
        self.ticks.push_back(Tick {
            index,
            time_s,
            broken,
            numbered: hole.is_some(),
        });
        while self.ticks.len() > self.next + AROUND {
            gaps.extend(self.judge());
            if self.ticks.len() > 2 * AROUND + MADE_UP {
                self.ticks.pop_front();
                self.next -= 1;
            }
        }
        self.reconcile();
        Arrival { index, gaps }
    }

    /// The first frame after the source was away, which it was since `last`.
    fn arrived_after(
        &mut self,
        last: Tick,
        cause: GapCause,
        mut tick: Tick,
        sequence: Option<u64>,
    ) -> Arrival {
        let length_s = tick.time_s - last.time_s;
        let interval_s = self
            .interval_s()
            .or(self.nominal_s)
            .unwrap_or(f64::INFINITY);
        // `as` saturates, and makes 0 of what is no number.
        let step = ((length_s / interval_s).round() as u64).max(1);
        let gap = Gap {
            after_frame: last.index,
            time_s: last.time_s,
            missing: step - 1,
            cause,
            length_s,
        };
        tick.index = last.index + step;
        self.ticks.clear();
        self.begin(tick, sequence);
        Arrival {
            index: tick.index,
            gaps: vec![gap],
        }
    }

    /// Takes a frame's number in: how many are missing before it by the numbers, `None` where there
    /// are no two to compare.
    fn number(&mut self, sequence: Option<u64>, broken: u64) -> Option<u64> {
        let Some((last, since)) = self.last_number else {
            self.last_number = sequence.map(|now| (now, 0));
            return None;
        };
        let Some(now) = sequence else {
            self.last_number = Some((last, since + 1 + broken));
            return None;
        };
        self.last_number = Some((now, 0));
        let missing = now.saturating_sub(last).saturating_sub(1 + since + broken);
        *self.totals.by_sequence.get_or_insert(0) += missing;
        Some(missing)
    }

    fn begin(&mut self, tick: Tick, sequence: Option<u64>) {
        self.last_number = sequence.map(|n| (n, 0));
        self.ticks.push_back(tick);
        self.next = 1;
    }

    /// The source is away; the next frame is the first after that.
    pub fn away(&mut self, cause: GapCause) -> Vec<Gap> {
        let gaps = self.finish();
        self.before_away = self
            .ticks
            .back()
            .map(|last| (*last, cause))
            .or(self.before_away);
        gaps
    }

    /// Nothing more comes, `length_s` after the last frame; gives the gap if the source was still
    /// away.
    pub fn ended_away(&mut self, length_s: f64) -> Option<Gap> {
        let (last, cause) = self.before_away.take()?;
        Some(Gap {
            after_frame: last.index,
            time_s: last.time_s,
            missing: 0,
            cause,
            length_s,
        })
    }

    /// Judges the steps that still wait for more frames.
    pub fn finish(&mut self) -> Vec<Gap> {
        let mut gaps = Vec::new();
        while self.next < self.ticks.len() {
            gaps.extend(self.judge());
        }
        self.reconcile();
        gaps
    }

    /// Judges one step by the times; gives a gap if only they can tell.
    fn judge(&mut self) -> Option<Gap> {
        let at = self.next;
        self.next += 1;
        let interval_s = self.interval_about(at)?;
        let (mut later, mut sooner) = (u64::MAX, u64::MAX);
        for k in 0..MADE_UP {
            if let Some(missing) = self.missing_between(at - 1, at + k, interval_s) {
                later = later.min(missing);
            }
            if let Some(from) = (at - 1).checked_sub(k)
                && let Some(missing) = self.missing_between(from, at, interval_s)
            {
                sooner = sooner.min(missing);
            }
        }
        // Both have the step itself.
        let missing = later.min(sooner);
        if missing == 0 {
            return None;
        }
        self.totals.by_time += missing;
        let (last, this) = (*self.ticks.get(at - 1)?, *self.ticks.get(at)?);
        if this.numbered {
            return None;
        }
        self.unnumbered += missing;
        let (time_s, length_s) = (last.time_s, this.time_s - last.time_s);
        Some(Gap {
            after_frame: last.index,
            time_s,
            missing,
            cause: GapCause::Dropped,
            length_s,
        })
    }

    /// Time from frame to frame where the step to the tick `at` is judged: the slower of before and after, as no frame
    /// is lost where the rate changes. At either end of a film the shorter side may have too few to say.
    fn interval_about(&self, at: usize) -> Option<f64> {
        let first = at.saturating_sub(AROUND + 1);
        let last = self.ticks.len().min(at + AROUND);
        let (n_before, n_after) = (at - first, last - at);
        let before = self.interval_of(first, at);
        let after = self.interval_of(at - 1, last);
        match (before, after) {
            (Some(before), Some(after)) if n_before.min(n_after) >= SHORT_SIDE => {
                Some(before.max(after))
            }
            (before, after) if n_before > n_after => before.or(after),
            (before, after) => after.or(before),
        }
    }

    /// Frames missing from one tick to another by their times.
    fn missing_between(&self, from: usize, to: usize, interval_s: f64) -> Option<u64> {
        let (first, last) = (self.ticks.get(from)?, self.ticks.get(to)?);
        let steps = ((last.time_s - first.time_s) / interval_s).round();
        let broken: u64 = self.ticks.range(from + 1..=to).map(|t| t.broken).sum();
        Some((steps.max(0.0) as u64).saturating_sub((to - from) as u64 + broken))
    }

    /// Time from frame to frame among the ticks from `from` to before `to`, however many were lost
    /// between them: most of the short steps are of one frame.
    fn interval_of(&self, from: usize, to: usize) -> Option<f64> {
        let ticks = self.ticks.range(from.min(to)..to.min(self.ticks.len()));
        let later = ticks.clone().skip(1);
        let mut steps_s: Vec<f64> = ticks
            .zip(later)
            .map(|(a, b)| (b.time_s - a.time_s) / (1 + b.broken) as f64)
            .collect();
        steps_s.retain(|s| *s > 0.0);
        if steps_s.len() < LEAST_STEPS {
            return None;
        }
        steps_s.sort_unstable_by(f64::total_cmp);
        let short_s = steps_s[steps_s.len() / 5];
        let mut singles_s: Vec<f64> = steps_s.iter().map(|s| s / frames_in(*s, short_s)).collect();
        singles_s.sort_unstable_by(f64::total_cmp);
        // Over the whole of it jitter weighs next to nothing.
        let single_s = singles_s[singles_s.len() / 2];
        let frames: f64 = steps_s.iter().map(|s| frames_in(*s, single_s)).sum();
        Some(steps_s.iter().sum::<f64>() / frames)
    }

    fn reconcile(&mut self) {
        let t = &mut self.totals;
        let believed = TIMES_BELIEVED.max((TIMES_SHARE * self.seen as f64) as u64);
        let numbers_only_delivered = self.live && t.by_sequence == Some(0) && t.by_time > believed;
        let now = if numbers_only_delivered {
            t.by_time
        } else {
            t.by_sequence.unwrap_or(0) + self.unnumbered
        };
        t.reconciled = t.reconciled.max(now);
    }
}

/// Frames that a step stands for, one at least.
fn frames_in(step_s: f64, interval_s: f64) -> f64 {
    (step_s / interval_s).round().max(1.0)
}

#[cfg(test)]
#[path = "tests/losses.rs"]
mod tests;
