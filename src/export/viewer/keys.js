// The keyboard. Controls that have the focus keep their own keys.

export function listen(actions, canvas, views) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const at = event.target;
    if (at === canvas && turn(event.key, views)) {
      event.preventDefault();
      return;
    }
    const typing = at.matches?.("select, input, textarea");
    const presses = event.key === " " && at.matches?.("button, summary");
    const action = actions[event.key.toLowerCase()];
    if (!action || presses || (typing && !(at.type === "range" && event.key === " "))) return;
    event.preventDefault();
    action();
  });
}

function turn(key, views) {
  const step = Math.PI / 24;
  const ways = {
    ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step],
    "+": [0, 0, 1.15], "=": [0, 0, 1.15], "-": [0, 0, 1 / 1.15],
  };
  if (!ways[key]) return false;
  views.turn(...ways[key]);
  return true;
}
