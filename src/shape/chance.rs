//! Chance that is the same for the same seed on every machine.

/// SplitMix64 (Steele, Lea and Flood 2014): a counter, scrambled.
#[derive(Clone, Copy, Debug)]
pub struct Chance(u64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// A source of its own for part `k`, whatever was drawn for the other parts.
    pub fn part(seed: u64, k: u64) -> u64 {
        scramble(seed ^ scramble(k.wrapping_add(0x9E37_79B9_7F4A_7C15)))
    }

    /// Evenly in 0..1.
    pub fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        (scramble(self.0) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Evenly in `low..high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.share()
    }

    /// Evenly in -1..1.
    pub fn either(&mut self) -> f64 {
        self.between(-1.0, 1.0)
    }

    /// Mean 0, variance 1; a sum of twelve even numbers, so never beyond 6.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.share()).sum::<f64>() - 6.0
    }

    /// One of `all`, if there is any.
    pub fn one_of<'a, T>(&mut self, all: &'a [T]) -> Option<&'a T> {
        all.get((self.share() * all.len() as f64) as usize)
    }
}

/// From -1 to 1, the same for the same counters.
pub(super) fn signed(seed: u64, a: u64, b: u64) -> f64 {
    Chance::new(Chance::part(Chance::part(seed, a), b)).between(-1.0, 1.0)
}

/// A whole number below `n`, the same for the same counters; 0 if `n` is 0.
pub(super) fn below(seed: u64, a: u64, b: u64, n: usize) -> usize {
    (Chance::new(Chance::part(Chance::part(seed, a), b)).share() * n as f64) as usize
}

fn scramble(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}
