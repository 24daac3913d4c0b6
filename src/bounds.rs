//! A stretch of the number line.

use std::ops::Mul;

/// All numbers from `lo` to `hi`, both included.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounds {
    pub lo: f64,
    pub hi: f64,
}

impl Bounds {
    pub const fn new(lo: f64, hi: f64) -> Self {
        Self { lo, hi }
    }

    /// Whether `x` lies within; no number does not.
    pub fn contains(&self, x: f64) -> bool {
        self.lo <= x && x <= self.hi
    }

    /// The number within that is nearest to `x`.
    pub fn clamp(&self, x: f64) -> f64 {
        x.clamp(self.lo, self.hi)
    }

    /// From end to end.
    pub fn length(&self) -> f64 {
        self.hi - self.lo
    }

    /// With both ends changed by `f`, which must not turn them round.
    pub fn map(&self, f: impl Fn(f64) -> f64) -> Self {
        Self::new(f(self.lo), f(self.hi))
    }
}

impl Mul<f64> for Bounds {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        self.map(|x| factor * x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_are_within() {
        let bounds = Bounds::new(-1.0, 2.0);
        for (x, within) in [
            (-1.0, true),
            (2.0, true),
            (2.1, false),
            (-1.1, false),
            (f64::NAN, false),
        ] {
            assert_eq!(bounds.contains(x), within, "{x}");
        }
        assert_eq!([bounds.clamp(-3.0), bounds.clamp(3.0)], [-1.0, 2.0]);
        assert_eq!((bounds * 2.0).length(), 6.0);
    }
}
