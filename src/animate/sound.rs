//! A sound as what drives the wind: how loud it is from moment to moment (Li et al. section 6: "the
//! user can drive a tree using an audio signal of a windy day").

use super::fraction;
use std::io::Cursor;

/// Values of loudness a second.
const RATE_HZ: f64 = 64.0;
/// Loudness is a mean over about so long, s: branches are slower than tones.
const SMOOTHED_S: f64 = 0.1;
/// At an end that is joined to the beginning the two are blended over this share of the period.
const SEAM: f64 = 0.1;
/// Longer sounds are not read, s.
const LONGEST_S: f64 = 3600.0;

/// Why a sound cannot drive the wind.
#[derive(Debug, thiserror::Error)]
pub enum SoundError {
    #[error("it is no WAV file that can be read ({0}); give PCM or 32-bit float")]
    Unreadable(String),
    #[error("it holds no samples; record it anew")]
    Empty,
    #[error("sample {0} is no number; record it anew")]
    NoNumber(u64),
    #[error("it is silent throughout; give another sound, or leave it out")]
    Silent,
    #[error("it is longer than an hour; cut it")]
    TooLong,
}

/// How loud a sound is from moment to moment; its root mean square is 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Loudness {
    values: Vec<f64>,
}

impl Loudness {
    /// From the bytes of a WAV file; the channels are taken together.
    ///
    /// # Errors
    /// It is no WAV, damaged, empty, silent or too long, or a sample is no number.
    pub fn of_wav(bytes: &[u8]) -> Result<Self, SoundError> {
        let mut reader = hound::WavReader::new(Cursor::new(bytes)).map_err(unreadable)?;
        let spec = reader.spec();
        if spec.sample_rate == 0 || spec.channels == 0 {
            return Err(SoundError::Unreadable(
                "no sample rate, or no channels".into(),
            ));
        }
        let per_s = f64::from(spec.sample_rate) * f64::from(spec.channels);
        if f64::from(reader.len()) > LONGEST_S * per_s {
            return Err(SoundError::TooLong);
        }
        let samples: Result<Vec<f64>, _> = match spec.sample_format {
            hound::SampleFormat::Float => {
                reader.samples::<f32>().map(|s| s.map(f64::from)).collect()
            }
            hound::SampleFormat::Int => reader.samples::<i32>().map(|s| s.map(f64::from)).collect(),
        };
        Self::of_samples(&samples.map_err(unreadable)?, per_s)
    }

    /// From samples, so many a second, in any unit.
    ///
    /// # Errors
    /// There is none, one is no number, or all are alike.
    pub fn of_samples(samples: &[f64], per_s: f64) -> Result<Self, SoundError> {
        if samples.is_empty() || !(per_s.is_finite() && per_s > 0.0) {
            return Err(SoundError::Empty);
        }
        if let Some(k) = samples
            .iter()
            .position(|s| !s.is_finite() || s.abs() > 1e30)
        {
            return Err(SoundError::NoNumber(k as u64));
        }
        // Some microphones add a constant, which nobody hears.
        let mean = samples.iter().sum::<f64>() / samples.len() as f64;
        let mut power_until = Vec::with_capacity(samples.len() + 1);
        power_until.push(0.0);
        let mut power = 0.0;
        for s in samples {
            power += (s - mean) * (s - mean);
            power_until.push(power);
        }
        let count = ((samples.len() as f64 / per_s * RATE_HZ).ceil() as usize).max(1);
        let reach = 0.5 * SMOOTHED_S * per_s;
        let mut values = Vec::with_capacity(count);
        for k in 0..count {
            let middle = k as f64 * per_s / RATE_HZ;
            let from = ((middle - reach).max(0.0) as usize).min(samples.len() - 1);
            let to = ((middle + reach) as usize + 1).clamp(from + 1, samples.len());
            let power = (power_until[to] - power_until[from]).max(0.0) / (to - from) as f64;
            values.push(power.sqrt());
        }
        let rms = (values.iter().map(|v| v * v).sum::<f64>() / count as f64).sqrt();
        let largest = samples.iter().fold(0.0f64, |m, s| m.max(s.abs()));
        if rms <= 1e-9 * largest || rms <= 0.0 {
            return Err(SoundError::Silent);
        }
        values.iter_mut().for_each(|v| *v /= rms);
        Ok(Self { values })
    }

    /// Its first `period_s` as something that comes round without a seam; a shorter sound is gone
    /// through again and again until then.
    pub fn looped(&self, period_s: f64) -> Self {
        let count = ((period_s * RATE_HZ).round() as usize).max(1);
        let seam = SEAM * count as f64;
        let first = self.values.first().copied().unwrap_or(0.0);
        let mut values = Vec::with_capacity(count);
        for k in 0..count {
            let repeated = self.values.get(k % self.values.len().max(1));
            let here = repeated.copied().unwrap_or(0.0);
            let left = (count - k) as f64 / seam;
            values.push(if left < 1.0 {
                first + (here - first) * left
            } else {
                here
            });
        }
        Self { values }
    }

    /// Length, s.
    pub fn length_s(&self) -> f64 {
        self.values.len() as f64 / RATE_HZ
    }

    /// How loud it is at a time, s; after its end it begins anew.
    pub fn at(&self, time_s: f64) -> f64 {
        let n = self.values.len();
        if n == 0 {
            return 0.0;
        }
        let turns = time_s * RATE_HZ / n as f64;
        let place = fraction(turns) * n as f64;
        let k = place as usize;
        let (a, b) = (self.values[k % n], self.values[(k + 1) % n]);
        a + (b - a) * (place - k as f64)
    }
}

fn unreadable(error: hound::Error) -> SoundError {
    SoundError::Unreadable(error.to_string())
}
