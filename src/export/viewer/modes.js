// The modes of the whole tree in a table, which stays hidden where there are none.

const number = (x, digits) => (x === null ? "–" : x.toFixed(digits));
const interval = (low, high, digits) => (low === null || high === null ? "" : `${low.toFixed(digits)} to ${high.toFixed(digits)}`);

// Cells of a mode: a text, and a small one below it or none.
function cells(mode) {
  const [most] = mode.energy;
  return [
    [number(mode.frequency_hz, 2), interval(mode.frequency_lo_hz, mode.frequency_hi_hz, 2)],
    [number(mode.damping_ratio, 3), interval(mode.damping_lo, mode.damping_hi, 3)],
    [mode.branch ?? "–", ""],
    [most ? `${most.limb} ${Math.round(100 * most.share)} %` : "–", ""],
  ];
}

export function fillModes(part, modes) {
  part.hidden = modes.length === 0;
  const rows = modes.map((mode) => {
    const row = document.createElement("tr");
    for (const [text, small] of cells(mode)) {
      const cell = document.createElement("td");
      const below = document.createElement("small");
      cell.textContent = text;
      below.textContent = small;
      cell.append(below);
      row.append(cell);
    }
    return row;
  });
  part.querySelector("tbody").replaceChildren(...rows);
}
