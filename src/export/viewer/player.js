// Play, pause, speed, scrub bar.

const PLAY = "M3 1.5v13l11-6.5z";
const PAUSE = "M3 2h3.5v12H3zM9.5 2H13v12H9.5z";

export class Player {
  // `show(time)` puts the tree into its pose at that time.
  constructor(tree, { times_s: times, start_s: start }, show) {
    const at = (id) => document.getElementById(id);
    Object.assign(this, { tree, times, start, show, playing: false, time: 0 });
    [this.button, this.scrub, this.clock, this.speed] = ["play", "scrub", "clock", "speed"].map(at);
    this.scrub.max = tree.duration;
    if (!(tree.duration > 0)) {
      for (const control of [this.button, this.scrub, this.speed]) control.disabled = true;
      this.button.title = "This model has no motion";
    }
    this.button.addEventListener("click", () => this.toggle());
    this.scrub.addEventListener("input", () => this.seek(Number(this.scrub.value)));
    this.label();
    this.seek(0);
  }

  toggle(playing = !this.playing) {
    this.playing = playing && this.tree.duration > 0;
    this.label();
    cancelAnimationFrame(this.asked);
    if (!this.playing) return;
    let last = null;
    const step = (now) => {
      // Whoever comes back to the page after a while goes on where it stood.
      const passed = last === null ? 0 : Math.min(0.25, (now - last) / 1000);
      last = now;
      this.seek((this.time + passed * Number(this.speed.value)) % this.tree.duration);
      this.asked = requestAnimationFrame(step);
    };
    this.asked = requestAnimationFrame(step);
  }

  seek(time) {
    this.time = Math.min(this.tree.duration, Math.max(0, time));
    this.scrub.value = this.time;
    // Told in the time of the film, of which a long capture's animation is the end.
    const [now, end] = [this.time, this.tree.duration].map((t) => (this.start + t).toFixed(2));
    this.clock.textContent = `${now} / ${end} s`;
    this.scrub.setAttribute("aria-valuetext", `${now} seconds`);
    this.show(this.time);
  }

  // To the next frame in one direction or the other, and stops there.
  step(direction) {
    this.toggle(false);
    const near = 1e-3;
    const next =
      direction > 0
        ? this.times.find((t) => t > this.time + near)
        : this.times.findLast((t) => t < this.time - near);
    this.seek(next ?? (direction > 0 ? this.tree.duration : 0));
  }

  label() {
    this.button.querySelector("path").setAttribute("d", this.playing ? PAUSE : PLAY);
    this.button.querySelector("span").textContent = this.playing ? "Pause" : "Play";
    this.button.setAttribute("aria-label", this.playing ? "Pause" : "Play");
  }
}
