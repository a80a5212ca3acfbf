"use strict";
// Evidence of a result: every method with its worst cycle, noise and lost sensor, its curves per cycle, sensors against error.
const SVG = "http://www.w3.org/2000/svg";
function shape(tag, attributes, text = "") { const e = document.createElementNS(SVG, tag); for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v); if (text) e.textContent = text; return e; }
function table(head, rows) {  // cells: text, numbers (right-aligned), elements
  const cell = c => c instanceof Node ? element("td", "", "", c) : element("td", typeof c === "number" ? um(c) : c ?? "–", typeof c === "number" ? "n" : "");
  return scrolling(element("table", "", "", element("thead", "", "", element("tr", "", "", ...head.map(h => element("th", h)))), element("tbody", "", "", ...rows.map(cells => element("tr", "", "", ...cells.map(cell))))));
}
function field(text, input) { return element("label", text + " ", "", input); }
// the last entry of a method is that over all cycles
const overall = compare => [...new Map(((compare || {}).results || []).map(r => [JSON.stringify([r.target, r.model]), r])).values()];
const most = pairs => pairs.filter(([, v]) => v != null).sort((a, b) => b[1] - a[1])[0];

{
  let plotted = 1000;

  function methodRow(run, r, written) {
    const worst = most(r.units.map(u => [u.name, u.rms_um])), robust = r.robustness, lost = robust && most(Object.entries(robust.lost_sensor_rms_um));
    const noise = robust && robust.noise_rms_um.normal, method = r.model + (written ? ` (${_("used")})` : ""), curves = button(method, quietly(() => plot(run, r)));
    curves.setAttribute("aria-label", _("{method}: curves for {target}", { method, target: r.target }));
    return [r.target, r.rms_um == null ? method : curves, element("span", r.rms_um == null ? _(r.reason) : _(r.verdict), r.verdict.split(" ")[0]), r.rms_um, r.none_rms_um, worst ? _("{value} in {cycle}", { value: um(worst[1]), cycle: worst[0] }) : "–",
      r.half_width_um == null ? "–" : _("± {width}, {share} % inside", { width: um(r.half_width_um), share: r.coverage_pct.toFixed(0) }), noise ? _("{value} with {noise} degC", { value: um(noise.mean), noise: robust.noise_degC.toLocaleString(LANGUAGE) }) : "–", lost ? _("{value} without {sensor}", { value: um(lost[1]), sensor: lost[0] }) : "–", String(r.n_sensors)];
  }

  async function plot(run, r) {  // measured, predicted, residual; a button for each cycle
    const asked = new URLSearchParams({ target: r.target, model: r.model }), panels = await api(`api/runs/${run.number}/curves?${asked}`);
    const figure = element("figure"), script = element("script", JSON.stringify(panels)), box = $("curves"), cycles = element("p", _("Cycle:") + " ", "zoom");
    script.type = "application/json"; figure.append(script);
    box.replaceChildren(element("h3", _("{model} for {target}, on unseen data", { model: r.model, target: r.target })), cycles, figure);
    const plots = show(figure, plotted++);
    for (const [from, to, name, told] of panels[0].cycles) {
      const zoomTo = button(name || _("rows"), () => { for (const u of plots) u.setScale("x", { min: from, max: to }); $("cycle").textContent = [name, told].filter(Boolean).join(": "); });
      cycles.append(zoomTo, " ");
    }
    const said = element("span", "", "soft"); said.id = "cycle"; said.setAttribute("role", "status"); cycles.append(said);
    box.scrollIntoView({ block: "nearest" });
  }

  const size = p => p.count ?? p.sensors.length;  // a method may use other sensors in each fold: the set names all of them

  function use(temperatures) {  // of the other inputs those that are chosen remain
    const all = new Set(Object.values(seen).flatMap(s => (s.columns || []).filter(c => c.kind === "temperature").map(c => c.channel)));
    for (const box of document.querySelectorAll("#inputs input")) if (all.has(box.value)) box.checked = temperatures.includes(box.value);
    $("inputs").scrollIntoView({ block: "center" });
    $("start").focus({ preventScroll: true });
  }

  function scatter(title, what, unit, points, order, sets = false) {  // number of sensors against error; a point shows its set
    const W = 440, H = 250, L = 52, B = 40, xs = points.map(p => size(p)), top = Math.max(...points.map(p => p.error)) * 1.08 || 1, last = Math.max(...xs);
    const names = order.filter(name => points.some(p => p.model === name)), colour = name => `var(--c${order.indexOf(name) % 6})`, svg = shape("svg", { viewBox: `0 0 ${W} ${H}`, class: "scatter", role: "group", "aria-label": title });
    const x = n => L + (W - L - 12) * (n - 0.5) / last, y = v => (H - B) * (1 - v / top) + 12, said = element("p", _("A click on a point shows its sensors."), "quiet");
    said.setAttribute("role", "status");
    for (const part of [0, 0.25, 0.5, 0.75, 1]) svg.append(shape("line", { x1: L, x2: W - 8, y1: y(part * top), y2: y(part * top), class: "grid" }), shape("text", { x: L - 6, y: y(part * top) + 4, "text-anchor": "end" }, Number((part * top).toPrecision(2)).toLocaleString(LANGUAGE)));
    for (let n = 1; n <= last; n += Math.ceil(last / 12)) svg.append(shape("text", { x: x(n), y: H - B + 24, "text-anchor": "middle" }, String(n)));
    svg.append(shape("text", { x: (W + L) / 2, y: H - 1, "text-anchor": "middle" }, what));
    for (const p of points) {
      const dot = shape("circle", { cx: x(size(p)) + 7 * (names.indexOf(p.model) - (names.length - 1) / 2) * Math.min(1, 6 / names.length), cy: y(p.error), r: 6, tabindex: 0, role: "button", "aria-pressed": "false", "aria-label": `${p.model}, ${size(p)} ${what}: ${um(p.error)} ${unit}`, style: `fill: ${colour(p.model)}` });
      const choose = () => {
        for (const other of svg.querySelectorAll("circle")) other.setAttribute("aria-pressed", other === dot);
        const set = p.sensors.join(", ") || _("no sensor");
        said.textContent = `${p.model} (${size(p)}): ${um(p.error)} ${unit}. ${p.sensors.length === size(p) ? set : _("In each division {n} of: {set}", { n: size(p), set })}`;
        if (sets && p.sensors.length) said.append(" ", button(_("Choose these inputs for the next run"), () => use(p.sensors)), " ", _("They are chosen on these data: the next run will state too small an error; a new recording shows the true one."));
      };
      dot.addEventListener("click", choose);
      dot.addEventListener("keydown", e => { if (e.key === "Enter" || e.key === " ") { e.preventDefault(); choose(); } });
      svg.append(dot);
    }
    const legend = element("p", "", "zoom", ...names.map(n => { const mark = element("span", "● "); mark.style.color = colour(n); return element("span", "", "", mark, n + "  "); }));
    return element("div", "", "card", element("h4", title), svg, legend, said);
  }

  function sensors(run, results) {
    const own = overall(results.compare).filter(r => r.rms_um != null), chosen = ((results.sensors || {}).choices || []), box = element("div", "", "charts"), order = [...new Set([...own, ...chosen.flatMap(c => c.points)].map(p => p.model))];
    for (const c of chosen) {
      const points = c.points.filter(p => p.error != null);
      if (points.length) box.append(scatter(_("Smallest sets of temperatures: {target}", { target: c.target }), _("temperature sensors"), c.unit, points, order, true));
    }
    for (const target of new Set(own.map(r => r.target))) box.append(scatter(_("Methods compared, all inputs: {target}", { target }), _("inputs"), "um", own.filter(r => r.target === target).map(r => ({ model: r.model, sensors: r.sensors, count: r.n_sensors, error: r.rms_um })), order));
    const ask = button(_("Find the smallest sufficient set of sensors"), quietly(async () => { await api("api/settings", "PUT", { select: state.settings.select || {} }); await start(); }));
    const failed = run.steps.filter(s => s.name === "select" && s.error).map(s => element("p", s.error, "trouble"));
    return [element("h3", _("Number of sensors against error on unseen data")), ...failed, ...chosen.map(c => element("p", c.why)), box, chosen.length ? "" : element("p", "", "", ask)];
  }

  document.addEventListener("result", e => {
    const { run, results } = e.detail, used = new Set(((results.compare || {}).recommended || []).map(r => JSON.stringify([r.target, r.written])));
    const head = [_("deviation"), _("method"), _("verdict"), "RMS [um]", _("without [um]"), _("worst cycle [um]"), _("band [um]"), _("with noise [um]"), _("sensor lost [um]"), _("inputs")], kept = element("div");
    kept.id = "curves";
    const rows = overall(results.compare).map(r => methodRow(run, r, used.has(JSON.stringify([r.target, r.model]))));
    $("details").replaceChildren(element("h3", _("All methods, RMS on unseen data")), element("p", _("A click on a method shows its curves. The band is made to contain 90 % of a further cycle, and each learned cycle counts as one value: with three or four cycles it is several times as wide as the RMS, with more cycles it becomes narrower."), "quiet"), table(head, rows), kept, ...sensors(run, results));
  });
}
