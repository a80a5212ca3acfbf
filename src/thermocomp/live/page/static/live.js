"use strict";
const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const at = (root, selector) => root.querySelector(selector);
const put = (node, text) => { if (node && node.textContent !== text) node.textContent = text; };
const um = x => x === null || x === undefined ? "–" : (x >= 0 ? "+" : "−") + Math.abs(x).toFixed(1) + " um";
const clock = t => new Date(t * 1000).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", hourCycle: "h23" });
const tint = k => css("--c" + k % 7);
const MOST = 720;
let curves = { time: [] }, charts = new Map(), heard = 0;

function axis(label) {
  return { stroke: css("--soft"), grid: { stroke: css("--line"), width: 1 }, label, labelSize: 20, size: 56 };
}

function times(_plot, splits) {  // 24 h, and the ISO date where it begins
  const two = n => String(n).padStart(2, "0"), fine = splits.length > 1 && splits[1] - splits[0] < 60;
  let day = "";
  return splits.map(s => {
    const d = new Date(1e3 * s), own = `${d.getFullYear()}-${two(d.getMonth() + 1)}-${two(d.getDate())}`;
    const text = `${two(d.getHours())}:${two(d.getMinutes())}` + (fine ? `:${two(d.getSeconds())}` : "") + (own === day ? "" : "\n" + own);
    day = own;
    return text;
  });
}

function draw(id, node, series, data, bands, label, points) {
  if (!node || data[0].length < 1) return;
  const shape = JSON.stringify(series.map(s => s.label));
  let chart = charts.get(id);
  if (chart && chart.shape !== shape) { chart.plot.destroy(); chart = null; }
  if (chart) { chart.plot.setData(data); return; }
  const options = {
    width: Math.max(260, node.clientWidth), height: points ? 200 : 230, series: [{}, ...series], bands,
    axes: [{ stroke: css("--soft"), grid: { stroke: css("--line"), width: 1 }, values: times, space: 70 }, axis(label)],
    cursor: { drag: { x: false, y: false } }, legend: { live: false, show: label !== "um" },
  };
  const plot = new uPlot(options, data, node), words = series.map(s => s.label).join(", ");
  for (const [name, value] of Object.entries({ role: "img", "aria-label": `${words} over time` })) plot.ctx.canvas.setAttribute(name, value);
  charts.set(id, { plot, shape, node });
}

function add(point) {
  if (point.time === undefined || point.time === curves.time[curves.time.length - 1]) return;
  const n = curves.time.length;
  for (const name of new Set([...Object.keys(curves), ...Object.keys(point)])) {
    const known = curves[name] || Array(n).fill(null);
    known.push(point[name] === undefined ? null : point[name]);
    curves[name] = known.slice(-MOST);
  }
}

function drawAll(state) {
  const time = curves.time;
  for (const t of state.targets) {
    const said = curves[t.name + " predicted"] || time.map(() => null), wide = curves[t.name + " +-"] || [];
    const edge = sign => said.map((v, k) => v === null || wide[k] == null ? null : v + sign * wide[k]);
    draw(t.name, at(document, `[data-target="${CSS.escape(t.name)}"] .chart`), [
      { label: "band, upper", stroke: "transparent", points: { show: false } },
      { label: "band, lower", stroke: "transparent", points: { show: false } },
      { label: "predicted deviation", stroke: css("--hot"), width: 2, points: { show: false } },
      { label: "correction", stroke: css("--cold"), width: 2, points: { show: false } },
    ], [time, edge(1), edge(-1), said, curves[t.name + " correction"] || []],
    [{ series: [1, 2], fill: css("--band") }], "um");
  }
  const heat = Object.keys(curves).filter(n => n !== "time" && !/ (predicted|\+-|correction)$/.test(n));
  if (heat.length) draw("heat", at(document, "#heat"), heat.map((label, k) => (
    { label, stroke: tint(k), width: 1.5, dash: k < 7 ? [] : [6, 4], points: { show: false } })),
    [time, ...heat.map(n => curves[n])], [], "degC");
  drawResiduals(state);
}

function drawResiduals(state) {
  const found = state.residuals;
  if (!found.length) return;
  const last = found[found.length - 1], beyond = Math.abs(last.residual) > last.limit;
  put(at(document, "#unprobed"), `${found.length} in all; the last, of ${last.target}: ${um(last.residual)}, action limit ${last.limit.toFixed(1)} um` +
    (beyond ? ": look for the cause" : "") + (last.refused ? "; refused: " + last.refused : ""));
  const names = [...new Set(found.map(r => r.target))], time = found.map(r => r.time);
  const series = names.map((label, k) => ({ label, stroke: tint(k), width: 0, paths: () => null, points: { show: true, size: 9, fill: tint(k) } }));
  const limit = label => ({ label, stroke: css("--bad"), dash: [5, 5], points: { show: false } });
  draw("residuals", at(document, "#residuals"), [...series, limit("action limit"), limit("action limit, lower")],
    [time, ...names.map(n => found.map(r => r.target === n && r.limit ? r.residual / r.limit : null)), found.map(() => 1), found.map(() => -1)], [], "residual / action limit", true);
}

function table(id, rows) {
  const body = at(document, id + " tbody"), text = JSON.stringify(rows);
  if (body.dataset.shown === text) return;
  body.dataset.shown = text;
  body.replaceChildren(...rows.map(cells => {
    const row = document.createElement("tr");
    row.append(...cells.map(cell => {
      const td = document.createElement("td"), [words, kind] = Array.isArray(cell) ? cell : [cell, ""];
      td.textContent = words;
      if (kind) td.className = kind;
      return td;
    }));
    return row;
  }));
}

function show(state) {
  put(at(document, "#clock"), "machine " + clock(state.time) + (state.speed === 1 ? "" : `, at ${state.speed} times real time`));
  const overall = at(document, "#overall"), silent = at(document, "#alarm");
  put(overall, state.state.word + (state.state.reason ? ": " + state.state.reason : ""));
  silent.hidden = !state.alarms.length;
  put(silent, state.alarms.join("; "));
  for (const t of state.targets) {
    const card = at(document, `[data-target="${CSS.escape(t.name)}"]`), word = at(card, ".word");
    put(word, t.state); word.className = "word " + t.state.replace(/\W+/g, "-");
    put(at(card, ".reason"), t.reason);
    put(at(card, ".correction"), um(t.correction_um) + (t.slope_um_per_m ? `, ${um(t.slope_um_per_m)}/m` : ""));
    put(at(card, ".there"), (t.at_controller.correction_um === null ? "" : um(t.at_controller.correction_um) + ", ") + t.at_controller.state);
    put(at(card, ".deviation"), um(t.deviation_um) + (t.half_width_um === null ? "" : ` ± ${t.half_width_um.toFixed(1)}`));
    put(at(card, ".settled"), String(state.settled_um));
    put(at(card, ".settling"), t.settling);
    put(at(card, ".reference"), t.reference ? `${clock(t.reference.time)}: ${t.reference.why}` : "not known yet");
  }
  table("#sensors", state.sensors.map(s => [s.name, s.value.toFixed(2), [s.state, s.state === "good" ? "active" : s.state === "not watched" ? "" : "failed"]])
    .concat(state.missing.map(n => [n, "–", ["missing", "failed"]])));
  put(at(document, "#others"), state.left_out ? `and ${state.left_out}${state.left_out < 10000 ? "" : " or"} more channels that no model uses` : "");
  table("#links", state.links.map(l => [l.name, [l.state, l.state], l.reason]));
  put(at(document, "#counts"), `${state.counts.readings} readings, ${state.counts.rejected} of them rejected${state.rejected ? ": " + state.rejected : ""}`);
  table("#events", state.events.slice(0, 100).map(e => [clock(e.time), e.kind, e.text]));
}

if (at(document, "#door")) at(document, "#door").addEventListener("submit", event => event.preventDefault());
document.addEventListener("click", async event => {
  const button = event.target.closest("button[data-do]");
  if (!button) return;
  const card = button.closest("article"), answer = at(card, ".answer");
  try {
    const response = await fetch("/api/order", {
      method: "POST",
      headers: { "Content-Type": "application/json", Authorization: "Bearer " + at(document, "#token").value },
      body: JSON.stringify({ target: card.dataset.target, do: button.dataset.do }),
    });
    const content = await response.json();
    put(answer, response.ok ? "done: " + content.done : String(content.detail));
  } catch (error) { put(answer, "the service does not answer: " + error.message); }
});

function restyle() { for (const c of charts.values()) c.plot.destroy(); charts.clear(); }
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", restyle);
addEventListener("resize", () => {
  for (const c of charts.values()) if (c.node.clientWidth !== c.plot.width) c.plot.setSize({ width: Math.max(260, c.node.clientWidth), height: c.plot.height });
});
setInterval(() => { if (heard && Date.now() - heard > 5000) { const a = at(document, "#alarm"); a.hidden = false; put(a, "the service does not respond: the values shown are old"); } }, 1000);

fetch("/api/curves").then(r => r.json()).then(found => {
  if (found.time) curves = found;
  const events = new EventSource("/api/events");
  events.onmessage = message => {
    const { state, point } = JSON.parse(message.data);
    heard = Date.now();
    add(point); show(state); drawAll(state);
  };
});
