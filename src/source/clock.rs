//! The count and the time of a driver, as the rest of the program may rely on them.

use v4l::buffer::Metadata;

/// Turns the driver's count and time into ours.
#[derive(Debug, Default)]
pub(super) struct Clock {
    /// The driver's count, ours and the time of the last frame.
    last: Option<(u32, u64, f64)>,
}

impl Clock {
    /// Number and time of a frame; `None` for one that is not later than what we already have.
    pub(super) fn take(&mut self, meta: &Metadata) -> Option<(u64, f64)> {
        let time_s = meta.timestamp.sec as f64 + meta.timestamp.usec as f64 * 1e-6;
        let Some((last_raw, last_sequence, last_s)) = self.last else {
            self.last = Some((meta.sequence, u64::from(meta.sequence), time_s));
            return Some((u64::from(meta.sequence), time_s));
        };
        if time_s <= last_s {
            return None;
        }
        // The count has 32 bits and wraps; loopback devices do not count at all, which is taken as no loss.
        let step = meta.sequence.wrapping_sub(last_raw);
        let step = if step == 0 || step > u32::MAX / 2 { 1 } else { step };
        let sequence = last_sequence + u64::from(step);
        self.last = Some((meta.sequence, sequence, time_s));
        Some((sequence, time_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(sequence: u32, time_s: f64) -> Metadata {
        let timestamp = v4l::timestamp::Timestamp::new(time_s as i64, (time_s.fract() * 1e6).round() as i64);
        Metadata { sequence, timestamp, ..Metadata::default() }
    }

    #[test]
    fn numbers_go_on_over_a_wrap_show_losses_and_survive_a_driver_that_does_not_count() {
        let numbers = |raw: &[u32]| -> Vec<u64> {
            let mut clock = Clock::default();
            let taken = raw.iter().enumerate().map(|(i, &n)| clock.take(&frame(n, 1.0 + i as f64 / 30.0)));
            taken.map(|t| t.map_or(u64::MAX, |(n, _)| n)).collect()
        };
        assert_eq!(numbers(&[0, 1, 4, 5]), [0, 1, 4, 5]);
        let top = u64::from(u32::MAX);
        assert_eq!(numbers(&[u32::MAX - 1, u32::MAX, 0, 2]), [top - 1, top, top + 1, top + 3]);
        assert_eq!(numbers(&[0, 0, 0]), [0, 1, 2]);
        assert_eq!(numbers(&[7, 3, 4]), [7, 8, 9]);
    }

    #[test]
    fn time_only_grows() {
        let mut clock = Clock::default();
        assert_eq!(clock.take(&frame(1, 50.0)), Some((1, 50.0)));
        assert_eq!(clock.take(&frame(2, 50.0)), None);
        assert_eq!(clock.take(&frame(3, 49.0)), None);
        assert_eq!(clock.take(&frame(4, 50.5)), Some((4, 50.5)));
    }
}
