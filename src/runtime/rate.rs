//! Whether a camera still delivers at the rate that it promised.

/// A rate further off than this share is another one, after it has been so for so long, s.
const OFF: f64 = 0.1;
const LASTING_S: f64 = 3.0;

/// Follows the measured rate.
#[derive(Debug)]
pub struct RateWatch {
    nominal_hz: Option<f64>,
    /// Since when it has been other than is said, s.
    since_s: Option<f64>,
    off: bool,
}

impl RateWatch {
    pub fn new(nominal_hz: Option<f64>) -> Self {
        Self {
            nominal_hz,
            since_s: None,
            off: false,
        }
    }

    /// The rate has been another one for seconds.
    pub fn is_off(&self) -> bool {
        self.off
    }

    /// Takes the time from frame to frame by the newest times; gives a line when the rate has
    /// turned out to be another one.
    pub fn look(&mut self, time_s: f64, interval_s: Option<f64>) -> Option<String> {
        let (Some(nominal_hz), Some(interval_s)) = (self.nominal_hz, interval_s) else {
            return None;
        };
        let measured_hz = 1.0 / interval_s;
        let other = ((measured_hz / nominal_hz - 1.0).abs() > OFF) != self.off;
        if !other {
            self.since_s = None;
            return None;
        }
        let since_s = *self.since_s.get_or_insert(time_s);
        if time_s - since_s < LASTING_S {
            return None;
        }
        (self.off, self.since_s) = (!self.off, None);
        self.off.then(|| {
            format!(
                "the camera delivers {measured_hz:.1} frames a second and not {nominal_hz:.1}: \
                 long exposure or a crowded bus; more light or a fixed exposure helps"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_that_stays_another_one_is_told_once() {
        let mut watch = RateWatch::new(Some(30.0));
        let mut told = Vec::new();
        for n in 0..3000u32 {
            let time_s = f64::from(n) / 30.0;
            // A second of hesitation, then half a minute in the dark.
            let slow = (10.0..11.0).contains(&time_s) || (20.0..50.0).contains(&time_s);
            told.extend(watch.look(time_s, Some(if slow { 1.0 / 15.0 } else { 1.0 / 29.0 })));
            assert_eq!(watch.is_off(), (23.0..53.0).contains(&time_s), "{time_s}");
        }
        assert_eq!(told.len(), 1);
        assert!(
            told[0].contains("15.0 frames a second and not 30.0"),
            "{told:?}"
        );
        assert_eq!(RateWatch::new(None).look(9.0, Some(1.0)), None);
    }
}
