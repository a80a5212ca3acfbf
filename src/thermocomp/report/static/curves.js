"use strict";
// Puts curves with hover and zoom in place of the pictures; without this script, and on paper, the pictures stay.
const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const make = (tag, kind, text = "") => Object.assign(document.createElement(tag), { className: kind, textContent: text });
const DASHES = [[], [8, 4], [2, 3], [8, 3, 2, 3]];
// translations of the texts of the scripts, from the page
const WORDS = JSON.parse((document.getElementById("words") || {}).textContent || "{}"), LANGUAGE = document.documentElement.lang || "en";
const _ = (text, values = {}) => (WORDS[text] || text).replace(/\{(\w+)\}/g, (all, key) => key in values ? values[key] : all);
const fixed = (v, digits) => v.toLocaleString(LANGUAGE, { minimumFractionDigits: digits, maximumFractionDigits: digits, useGrouping: false });
const HINT = _("Drag across to zoom in, double-click for all; a name hides its curve, with Ctrl all others. Keyboard: arrow keys, + and −.");

function within(panel) {  // a spike beyond the limits does not flatten the rest, unless there is nothing else
  const [low, high] = panel.limits;
  return (_, a, b) => {
    if (a === null) [a, b] = [low, high];
    else if (Math.max(a, low) < Math.min(b, high)) [a, b] = [Math.max(a, low), Math.min(b, high)];
    const room = 0.05 * (b - a) || 1;
    return [a - room, b + room];
  };
}

function shade(u, cycles) {  // every second cycle, with its name or the number it begins with where there is room
  const { ctx, bbox } = u, dpr = devicePixelRatio;
  ctx.save();
  ctx.textAlign = "left";
  ctx.font = `${11 * dpr}px system-ui, sans-serif`;
  cycles.forEach(([from, to, name], k) => {
    const [a, b] = [from, to].map(t => Math.min(Math.max(u.valToPos(t, "x", true), bbox.left), bbox.left + bbox.width));
    ctx.fillStyle = css("--shade");
    if (k % 2 === 0) ctx.fillRect(a, bbox.top, b - a, bbox.height);
    ctx.fillStyle = css("--soft");
    const text = [name, name.split(" ")[0]].find(t => ctx.measureText(t).width < b - a - 6 * dpr);
    if (text) ctx.fillText(text, a + 3 * dpr, bbox.top - 5 * dpr);
  });
  ctx.restore();
}

function number(u, curves) {  // dots of a finding begin with its number in the list
  const { ctx } = u, dpr = devicePixelRatio;
  ctx.save();
  ctx.textAlign = "left";
  ctx.font = `bold ${12 * dpr}px system-ui, sans-serif`;
  curves.forEach((c, k) => {
    const first = u.data[k + 1].findIndex(v => v != null), x = u.data[0][first];
    if (c.shape !== "dots" || !u.series[k + 1].show || first < 0 || x < u.scales.x.min || x > u.scales.x.max) return;
    ctx.fillStyle = css(c.tone);
    ctx.fillText(c.name.split(" ")[0], u.valToPos(x, "x", true) + 6 * dpr, u.valToPos(u.data[k + 1][first], "y", true) - 6 * dpr);
  });
  ctx.restore();
}

function nearest(values, at) {  // each curve is thinned by itself: the point that it has nearest to the cursor
  for (let d = 0; d < values.length; d++) for (const k of [at - d, at + d]) if (values[k] !== undefined) return k;
  return at;
}

function options(panel, key, last, zoomed) {
  const line = () => css("--line"), soft = () => css("--soft"), axis = { stroke: soft, grid: { stroke: line, width: 1 }, ticks: { stroke: line } };
  const cycle = t => (panel.cycles.find(([from, to]) => from <= t && t <= to) || []).slice(2).filter(Boolean).join(": ");
  const series = panel.curves.map(c => ({
    label: c.name, stroke: () => css(c.tone), width: c.name.startsWith("band, ") ? 0 : 1.5, dash: DASHES[c.dash % 4],
    paths: c.shape === "dots" ? () => null : c.shape ? uPlot.paths.stepped({ align: 1 }) : undefined,
    points: c.shape === "dots" ? { show: true, size: 8, fill: () => css(c.tone) } : { show: false },
    value: (_, v) => v == null ? "–" : fixed(v, panel.digits),
  }));
  const edges = panel.curves.flatMap((c, k) => c.name.startsWith("band, ") ? [k + 1] : []);
  return {
    width: 300, height: panel.height, title: panel.title, padding: [20, 12, 0, 0], focus: { alpha: 0.3 },
    scales: { x: { time: false }, y: { range: within(panel) } },
    series: [{ label: _("time"), value: (u, t) => t == null ? "–" : `${fixed(t, 2)} h${cycle(t) && ", " + cycle(t)}` }, ...series],
    bands: edges.length ? [{ series: edges.reverse(), fill: () => css("--band") }] : [],
    axes: [{ ...axis, label: last ? _("time [h]") : undefined, labelSize: 18, size: 32 }, { ...axis, size: 60 }],
    cursor: { y: false, focus: { prox: 24 }, sync: { key, scales: ["x", null] }, dataIdx: (u, k, at) => k && panel.curves[k - 1].shape !== "dots" ? nearest(u.data[k], at) : at, drag: { x: true, y: false } },
    legend: { markers: { stroke: (u, k) => k ? `var(${panel.curves[k - 1].tone})` : "", fill: (u, k) => k && panel.curves[k - 1].shape === "dots" ? `var(${panel.curves[k - 1].tone})` : "none", dash: (u, k) => k && panel.curves[k - 1].dash ? "dashed" : "solid" } },
    hooks: { drawClear: [u => shade(u, panel.cycles)], draw: [u => number(u, panel.curves)], setScale: [zoomed] },
  };
}

function enable(u, panel) {  // keyboard and screen reader
  const over = u.over, told = () => over.setAttribute("aria-valuetext", [...u.root.querySelectorAll(".u-legend tr")].map(r => [...r.children].map(c => c.textContent).join(" ")).join("; "));
  const names = [...u.root.querySelectorAll(".u-legend th")].slice(1);
  const attributes = { role: "slider", tabindex: 0, "aria-label": _("time cursor of {panel}", { panel: panel.title }), "aria-valuemin": 0, "aria-valuemax": 100, "aria-valuenow": 0 };
  for (const [name, value] of Object.entries(attributes)) over.setAttribute(name, value);
  over.addEventListener("keydown", event => {
    const step = { ArrowLeft: -1, ArrowRight: 1, PageUp: -20, PageDown: 20, Home: -1e9, End: 1e9 }[event.key], width = over.clientWidth;
    if (step) {
      const left = Math.min(Math.max((u.cursor.left >= 0 ? u.cursor.left : 0) + step * Math.max(1, width / 200), 0), width);
      u.setCursor({ left, top: 1 }, true, true);
      over.setAttribute("aria-valuenow", Math.round(100 * left / width));
      told();
    } else if ("+=".includes(event.key)) zoom(u, 0.5);
    else if (event.key === "-") zoom(u, 2);
    else return;
    event.preventDefault();
  });
  u.root.querySelector(".u-legend").setAttribute("role", "presentation");
  names.forEach((th, k) => {
    const state = () => th.setAttribute("aria-pressed", u.series[k + 1].show);
    th.tabIndex = 0; th.setAttribute("role", "button"); state();
    th.addEventListener("keydown", event => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); th.click(); } });
    (u.hooks.setSeries ||= []).push(state);
  });
}

function zoom(u, by) {  // about the cursor, else the middle; 0: all
  const { min, max } = u.scales.x, all = u.data[0], at = u.cursor.left >= 0 ? u.posToVal(u.cursor.left, "x") : (min + max) / 2;
  u.setScale("x", by ? { min: Math.max(all[0], at - by * (at - min)), max: Math.min(all[all.length - 1], at + by * (max - at)) } : { min: all[0], max: all[all.length - 1] });
}

function show(figure, number) {
  const script = figure.querySelector("script"), plots = [], box = make("div", "curves"), buttons = make("p", "zoom");
  const zoomed = (u, key) => {
    const { min, max } = u.scales.x;
    if (key === "x") for (const other of plots) if (other.scales.x.min !== min || other.scales.x.max !== max) other.setScale("x", { min, max });
  };
  for (const [text, by] of [[_("zoom in"), 0.5], [_("zoom out"), 2], [_("all"), 0]]) {
    const button = make("button", "", text);
    button.addEventListener("click", () => zoom(plots[0], by));
    buttons.append(button, " ");
  }
  buttons.append(make("span", "soft", HINT));
  box.append(buttons);
  figure.insertBefore(box, script);
  figure.classList.add("drawn");
  JSON.parse(script.textContent).forEach((panel, k, panels) => {
    const data = uPlot.join(panel.curves.map(c => { let n = 0; return [c.x.map(d => panel.first + panel.unit * (n += d)), c.y]; }));
    const u = new uPlot(options(panel, `curves ${number}`, k === panels.length - 1, zoomed), data, box);
    enable(u, panel);
    plots.push(u);
  });
  new ResizeObserver(() => { for (const u of plots) u.setSize({ width: Math.max(240, box.clientWidth), height: u.height }); }).observe(box);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { for (const u of plots) u.redraw(); });
  return plots;
}

addEventListener("DOMContentLoaded", () => {
  const figures = [...document.querySelectorAll("figure:has(> script)")];
  const seen = new IntersectionObserver(found => {
    for (const one of found) if (one.isIntersecting) { seen.unobserve(one.target); show(one.target, figures.indexOf(one.target)); }
  }, { rootMargin: "1000px" });
  figures.forEach(figure => seen.observe(figure));
});
