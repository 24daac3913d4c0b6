// Frequency and amplitude of every branch, worked out once it is asked for.
import { amplitude, spectrum } from "./spectrum.js";

export class Sway {
  constructor(data) {
    this.data = data;
    this.known = new Map();
  }

  // {amplitude: degrees or null, spectrum or null, hz or null, identified: whether the capture says so}.
  // A copy sways as the branch that it repeats.
  of(branch) {
    const original = this.data.byId.get(branch.id)?.original ?? branch;
    if (!this.known.has(original.id)) {
      const seen = spectrum(this.data.times_s, original.angle_deg);
      const identified = original.sway?.frequency_hz ?? null;
      this.known.set(original.id, {
        amplitude: amplitude(original.angle_deg),
        spectrum: seen,
        hz: identified ?? seen?.peak?.hz ?? null,
        identified: identified !== null,
      });
    }
    return this.known.get(original.id);
  }
}
