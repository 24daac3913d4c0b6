// How a branch sways: amplitude and spectrum of its angle. After the same steps as src/dynamics/spectrum.rs.

const MIN_SAMPLES = 32;
const MIN_PERIODS = 2;

// Amplitude of the sine that has the same mean square about the mean, degrees; null where nothing is known.
export function amplitude(angles) {
  const known = angles ? Array.from(angles).filter(Number.isFinite) : [];
  if (known.length < 2) return null;
  const mean = known.reduce((a, x) => a + x, 0) / known.length;
  return Math.sqrt((2 * known.reduce((a, x) => a + (x - mean) ** 2, 0)) / known.length);
}

// {hz, amplitude: degrees of each bin, peak: {hz, amplitude} or null}, or null where too little is known.
export function spectrum(times, angles) {
  const signal = evenly(times, angles);
  if (!signal) return null;
  const { values, step } = signal;
  const n = values.length;
  const hann = values.map((_, k) => 0.5 - 0.5 * Math.cos((2 * Math.PI * k) / (n - 1)));
  const weight = hann.reduce((a, w) => a + w, 0);
  // With the window's own mean taken off nothing is left at 0 Hz, which would spill over the slow sway.
  const mean = values.reduce((a, x, k) => a + hann[k] * x, 0) / weight;
  // Four times the length draws the peak with more points; it adds no information.
  const size = 2 ** Math.ceil(Math.log2(4 * n));
  const re = new Float64Array(size);
  for (let k = 0; k < n; k++) re[k] = hann[k] * (values[k] - mean);
  const im = new Float64Array(size);
  fft(re, im);
  const half = size / 2;
  const bin = 1 / (step * size);
  const amplitudes = Array.from({ length: half }, (_, k) => (2 * Math.hypot(re[k], im[k])) / weight);
  const hz = amplitudes.map((_, k) => k * bin);
  return { hz, amplitude: amplitudes, peak: peakOf(amplitudes, bin, Math.ceil(MIN_PERIODS / (n * step) / bin)) };
}

// The highest bin from `lowest` on, where it is a maximum and stands four times above the median.
function peakOf(amplitudes, bin, lowest) {
  let top = Math.max(1, lowest);
  if (top >= amplitudes.length - 1) return null;
  for (let k = top; k < amplitudes.length - 1; k++) if (amplitudes[k] > amplitudes[top]) top = k;
  const sorted = amplitudes.slice(Math.max(1, lowest)).sort((a, b) => a - b);
  const [a, b, c] = [amplitudes[top - 1], amplitudes[top], amplitudes[top + 1]];
  if (b < a || b < c || b <= 0 || b < 4 * sorted[sorted.length >> 1]) return null;
  const curve = a - 2 * b + c;
  const shift = curve < 0 ? (0.5 * (a - c)) / curve : 0;
  return { hz: (top + shift) * bin, amplitude: b };
}

// Linear interpolation of what is known at as many evenly spaced times.
function evenly(times, angles) {
  const known = [];
  for (let k = 0; angles && k < Math.min(times.length, angles.length); k++) {
    if (Number.isFinite(angles[k])) known.push([times[k], angles[k]]);
  }
  const n = known.length;
  const span = n ? known[n - 1][0] - known[0][0] : 0;
  if (n < MIN_SAMPLES || !(span > 0)) return null;
  const step = span / (n - 1);
  let j = 0;
  const values = Array.from({ length: n }, (_, k) => {
    const t = known[0][0] + k * step;
    while (j + 2 < n && known[j + 1][0] < t) j++;
    const [[t0, a0], [t1, a1]] = [known[j], known[j + 1]];
    const share = t1 > t0 ? Math.min(1, Math.max(0, (t - t0) / (t1 - t0))) : 0;
    return a0 + share * (a1 - a0);
  });
  return { values, step };
}

// Radix 2, in place (Cooley and Tukey).
function fft(re, im) {
  const n = re.length;
  for (let i = 1, j = 0; i < n; i++) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) {
      [re[i], re[j]] = [re[j], re[i]];
      [im[i], im[j]] = [im[j], im[i]];
    }
  }
  for (let size = 2; size <= n; size *= 2) {
    const half = size / 2;
    for (let k = 0; k < half; k++) {
      const c = Math.cos((-2 * Math.PI * k) / size);
      const s = Math.sin((-2 * Math.PI * k) / size);
      for (let a = k; a < n; a += size) {
        const b = a + half;
        const [x, y] = [c * re[b] - s * im[b], c * im[b] + s * re[b]];
        re[b] = re[a] - x;
        im[b] = im[a] - y;
        re[a] += x;
        im[a] += y;
      }
    }
  }
}
