// What is known of the chosen branch, in words.

const interval = (low, high, digits) =>
  low === null || high === null ? "" : ` (${low.toFixed(digits)} to ${high.toFixed(digits)})`;

// Beside what only a branch that moves on the page has.
const NO_MOTION = " does not move here";

// Pairs of a term and its value, with a small addition or none.
export function facts(branch, sway) {
  const original = branch.original;
  const rows = [
    ["Branch", branch.name, ` node ${branch.id}`],
    ["Order", `${branch.order}`, branch.order === 0 ? " trunk" : ""],
    ["Level", `${branch.level}`, ""],
  ];
  if (branch.copy_of !== null) rows.push(["Copy", `repeats branch ${branch.copy_of}`, ""]);
  if (branch.moves_with !== null) rows.push(["Rigid", `moves with branch ${branch.moves_with}`, ""]);
  else rows.push(["Points followed", `${branch.n_tracks}`, ""]);
  const known = original.sway;
  if (sway.identified) {
    const range = interval(known.frequency_lo_hz, known.frequency_hi_hz, 2);
    rows.push(["Frequency", `${sway.hz.toFixed(2)} Hz`, range]);
    if (known.damping_ratio !== null) {
      rows.push(["Damping", known.damping_ratio.toFixed(3), interval(known.damping_lo, known.damping_hi, 3)]);
    }
  } else {
    if (original.why) rows.push(["Identified", "none", ` ${original.why}`]);
    const without = sway.amplitude === null ? NO_MOTION : " none stands out";
    rows.push(["Frequency", sway.hz === null ? "–" : `${sway.hz.toFixed(2)} Hz`, sway.hz === null ? without : " peak"]);
  }
  rows.push(["Amplitude", sway.amplitude === null ? "–" : `${sway.amplitude.toFixed(2)}°`, sway.amplitude === null ? NO_MOTION : ""]);
  return rows;
}

export function fill(list, rows) {
  list.replaceChildren();
  for (const [term, value, addition] of rows) {
    const [dt, dd, small] = ["dt", "dd", "small"].map((tag) => document.createElement(tag));
    dt.textContent = term;
    dd.textContent = value;
    small.textContent = addition;
    dd.append(small);
    list.append(dt, dd);
  }
}
