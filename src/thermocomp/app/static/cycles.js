"use strict";
// Thermal cycles by hand: borders are dragged on the curves, or moved, merged and split in a table; the mapping keeps them.
{
  const NEAR = 7;  // px

  const save = (name, starts) => answer(name, [{ cycles: { starts: starts.map(s => Math.round(s * 1000) / 1000).sort((a, b) => a - b) } }]);

  function grip(name, found, figure, plots) {  // a border within reach of the mouse is dragged instead of a zoom
    const starts = found.cycles.slice(1).map(c => c.start_s), hours = starts.map(s => s / 3600);
    const near = (u, x) => hours.findIndex(h => Math.abs(u.valToPos(h, "x") - x) <= NEAR);
    const left = (u, e) => e.clientX - u.over.getBoundingClientRect().left;
    for (const u of plots) {
      u.over.addEventListener("mousemove", e => u.root.classList.toggle("borders", near(u, left(u, e)) >= 0));
      u.root.addEventListener("mousedown", down => {
        const k = near(u, left(u, down));
        if (k < 0 || down.button) return;
        down.stopPropagation(); down.preventDefault();
        const line = element("div", "", "border"), follow = e => { line.style.left = `${Math.min(Math.max(left(u, e), 0), u.over.clientWidth)}px`; };
        u.over.append(line); follow(down);
        const end = up => {
          removeEventListener("mousemove", follow);
          line.remove();
          if (Math.abs(left(u, up) - left(u, down)) > 1) save(name, starts.map((s, n) => (n === k ? u.posToVal(left(u, up), "x") * 3600 : s) + found.origin_s));
        };
        addEventListener("mousemove", follow); addEventListener("mouseup", end, { once: true });
      }, { capture: true });
    }
  }

  function tableOf(name, found, plots) {
    const starts = found.cycles.map(c => c.start_s), keep = list => save(name, list.map(s => s + found.origin_s)), end = plots[0].data[0][plots[0].data[0].length - 1] * 3600;
    const rows = found.cycles.map((c, k) => {
      const start = element("input"), until = k + 1 < starts.length ? starts[k + 1] : end, others = starts.filter((_, n) => n && n !== k);
      start.type = "number"; start.step = "any"; start.value = (c.start_s / 3600).toFixed(4); start.disabled = !k; start.setAttribute("aria-label", _("start of cycle {cycle} [h]", { cycle: c.name }));
      start.addEventListener("change", () => keep([...others, start.valueAsNumber * 3600]));
      const merge = button(_("merge with the one before"), () => keep(others)), split = button(_("split"), () => {
        const at = plots[0].cursor.left >= 0 ? plots[0].posToVal(plots[0].cursor.left, "x") * 3600 : -1;  // at the cursor of the curves, else in the middle
        keep([...starts.slice(1), at > c.start_s && at < until ? at : (c.start_s + until) / 2]);
      });
      merge.setAttribute("aria-label", _("merge cycle {cycle} with the one before", { cycle: c.name })); split.setAttribute("aria-label", _("split cycle {cycle}", { cycle: c.name }));
      return [c.name, start, k ? merge : "", split];
    });
    const found_again = button(_("Find the cycles again"), () => answer(name, [{ cycles: { starts: [] } }]));
    return element("details", "", "cycles", element("summary", _("Thermal cycles: {n}", { n: found.cycles.length })), element("p", _("Drag a border on the curves, or state the start of a cycle; a cycle is split at the cursor of the curves, or in the middle."), "quiet"),
      table([_("cycle"), _("start [h]"), "", ""], rows), found_again);
  }

  document.addEventListener("card", e => {
    const { name, found, card, figure, plots } = e.detail;
    if (!plots.length) return;
    const box = tableOf(name, found, plots);
    box.open = opened.has(name); box.addEventListener("toggle", () => opened[box.open ? "add" : "delete"](name));
    card.insertBefore(box, figure);
    grip(name, found, figure, plots);
  });
  const opened = new Set();  // a table in use stays open when its card is drawn again
}
