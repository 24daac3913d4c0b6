//! Seeded random numbers.
//!
//! Every stage that draws is given a generator or a seed. The same seed gives the same numbers on
//! every machine, in any order of the parts and on any number of threads.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// ChaCha with 8 rounds (Bernstein 2008). Its stream is fixed by its definition, unlike that of
/// `rand`'s own `StdRng`.
pub type Generator = ChaCha8Rng;

/// The generator of part `part` of what `seed` decides. Each part has a stream of its own, whatever
/// is drawn for the others.
pub fn generator(seed: u64, part: u64) -> Generator {
    let mut generator = Generator::seed_from_u64(seed);
    generator.set_stream(part);
    generator
}

/// A seed for part `part` of what `seed` decides, for parts that have parts of their own.
pub fn seed_of_part(seed: u64, part: u64) -> u64 {
    generator(seed, part).next_u64()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Files of the same seed are to stay the same with every version of the crates: these are
    /// ChaCha's numbers.
    #[test]
    fn the_numbers_of_a_seed_stay_as_they_are() {
        let mut first = generator(1, 0);
        let mut second = generator(1, 1);
        let drawn = [first.next_u64(), first.next_u64(), second.next_u64()];
        let expected = [
            0x6709_4cea_8ca4_0db1,
            0x1494_06d8_fc0e_8e6b,
            0xda16_ea55_e3f5_ade7,
        ];
        assert_eq!(drawn, expected);
        assert_eq!(seed_of_part(1, 1), drawn[2]);
    }
}
