//! A stretch of the number line.

/// All numbers from `lo` to `hi`, both included.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounds {
    pub lo: f64,
    pub hi: f64,
}

impl Bounds {
    /// From `lo` to `hi`, as they are given.
    pub const fn new(lo: f64, hi: f64) -> Self {
        Self { lo, hi }
    }

    /// The least and the greatest of all finite numbers among `values`; `None` if there are none.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        values
            .into_iter()
            .filter(|x| x.is_finite())
            .fold(None, |all: Option<Self>, x| {
                let all = all.unwrap_or(Self::new(x, x));
                Some(Self::new(all.lo.min(x), all.hi.max(x)))
            })
    }

    /// Whether the upper end is not above the lower one. An end that is no number does not count.
    pub fn is_empty(&self) -> bool {
        self.lo >= self.hi
    }

    /// Whether `x` lies within; no number does not.
    pub fn contains(&self, x: f64) -> bool {
        self.lo <= x && x <= self.hi
    }

    /// Whether `x` lies between the ends, at neither of them.
    pub fn is_between(&self, x: f64) -> bool {
        self.lo < x && x < self.hi
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
        assert_eq!(bounds.map(|x| 2.0 * x).length(), 6.0);
    }

    #[test]
    fn only_ends_that_are_numbers_can_leave_no_room() {
        for (lo, hi, empty) in [
            (1.0, 2.0, false),
            (1.0, 1.0, true),
            (2.0, 1.0, true),
            (f64::NAN, 1.0, false),
            (1.0, f64::NAN, false),
        ] {
            assert_eq!(Bounds::new(lo, hi).is_empty(), empty, "{lo} {hi}");
        }
    }

    #[test]
    fn the_least_and_the_greatest_are_of_numbers_only() {
        let values = [f64::NAN, 2.0, f64::INFINITY, -1.0, 0.5];
        assert_eq!(Bounds::of(values), Some(Bounds::new(-1.0, 2.0)));
        assert_eq!(Bounds::of([f64::NAN]), None);
    }
}
