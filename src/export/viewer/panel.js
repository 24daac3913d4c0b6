// The panel of the chosen branch: facts, angle over time, spectrum.
import { facts, fill } from "./facts.js";
import { Plot } from "./plot.js";

// Trees sway below this, Hz.
const HIGHEST_HZ = 6;

export class Panel {
  // `seek(time)` is called where the angle's plot is pressed.
  constructor(data, sway, seek) {
    const at = (id) => document.getElementById(id);
    Object.assign(this, { data, sway, branch: null, time: 0 });
    [this.hint, this.body, this.list] = ["hint", "chosen", "facts"].map(at);
    this.angle = new Plot(at("angle"), "s", "°");
    this.spectrum = new Plot(at("spectrum"), "Hz", "°");
    new ResizeObserver(() => this.draw()).observe(this.body);
    const press = (event) => {
      const time = event.buttons ? this.angle.under(event) : null;
      if (time !== null) seek(time - data.start_s);
    };
    for (const kind of ["pointerdown", "pointermove"]) this.angle.svg.addEventListener(kind, press);
  }

  show(branch) {
    this.branch = branch;
    this.hint.hidden = branch !== null;
    this.body.hidden = branch === null;
    if (!branch) return;
    fill(this.list, facts(branch, this.sway.of(branch)));
    this.draw();
  }

  draw() {
    const { branch, data } = this;
    if (!branch) return;
    this.angle.draw(data.times_s.map((t) => t + data.start_s), branch.original.angle_deg ?? []);
    this.at(this.time);
    const seen = this.sway.of(branch);
    const n = seen.spectrum ? seen.spectrum.hz.findLastIndex((f) => f <= HIGHEST_HZ) + 1 : 0;
    this.spectrum.draw(seen.spectrum?.hz.slice(0, n) ?? [], seen.spectrum?.amplitude.slice(0, n) ?? [], { area: true });
    const known = branch.original.sway;
    if (seen.identified && known.frequency_lo_hz !== null && known.frequency_hi_hz !== null) {
      this.spectrum.band(known.frequency_lo_hz, known.frequency_hi_hz);
    }
    const peak = seen.spectrum?.peak;
    if (peak && peak.hz <= HIGHEST_HZ) this.spectrum.mark(peak.hz, peak.amplitude, `${peak.hz.toFixed(2)} Hz`);
  }

  at(time) {
    this.time = time;
    if (this.branch) this.angle.now(Math.min(this.data.start_s + time, this.angle.last ?? Infinity));
  }
}
