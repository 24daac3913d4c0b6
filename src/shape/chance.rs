//! Chance that is the same for the same seed: a number for each pair of counters (SplitMix64).

fn bits(seed: u64, a: u64, b: u64) -> u64 {
    let mut x = seed ^ a.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ b.wrapping_mul(0xD1B5_4A32_D192_ED03);
    for _ in 0..2 {
        x = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
        x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^= x >> 31;
    }
    x
}

/// From -1 to 1.
pub(super) fn signed(seed: u64, a: u64, b: u64) -> f64 {
    (bits(seed, a, b) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A whole number below `n`; 0 if `n` is 0.
pub(super) fn below(seed: u64, a: u64, b: u64, n: usize) -> usize {
    (bits(seed, a, b) % n.max(1) as u64) as usize
}
