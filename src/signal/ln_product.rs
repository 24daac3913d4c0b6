//! The logarithm of a product of many numbers, of which few logarithms are taken.

/// A product is carried on while it is in this range, as are its factors as a rule.
const RANGE: std::ops::Range<f64> = 1e-100..1e100;

/// A product of positive numbers.
pub struct LnProduct {
    ln: f64,
    /// Of the factors whose logarithms are still to be taken.
    product: f64,
}

impl LnProduct {
    /// Of no factor.
    pub fn one() -> Self {
        Self {
            ln: 0.0,
            product: 1.0,
        }
    }

    /// Multiplies it by a factor.
    pub fn times(&mut self, factor: f64) {
        if !RANGE.contains(&self.product) {
            self.ln += self.product.ln();
            self.product = 1.0;
        }
        self.product *= factor;
    }

    /// Its logarithm: infinite where the product is 0 or infinite, no number where it is negative.
    pub fn ln(&self) -> f64 {
        self.ln + self.product.ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_beyond_the_range_of_numbers_have_a_logarithm() {
        let (mut product, mut sum) = (LnProduct::one(), 0.0);
        for k in 0..2000 {
            let factor = 10_f64.powi(k % 90 - 60);
            product.times(factor);
            sum += factor.ln();
        }
        assert!((product.ln() - sum).abs() < 1e-9 * sum.abs());
    }
}
