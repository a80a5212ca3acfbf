"use strict";
// The page of a project: it shows what the server tells, and asks it for everything that is done. make, css, show: curves.js
const $ = id => document.getElementById(id);
const KINDS = { time: _("time"), temperature: _("temperature"), displacement: _("deviation or displacement"), spindle_speed: _("spindle speed"), position: _("axis position"), angle: _("angle"), feed: _("feed"), cycle: _("label of cycles"), ignore: _("ignore") };
const UNITS = { time: ["", "s", "ms", "min", "h"], temperature: ["degC", "degF", "K"], displacement: ["um", "mm", "in", "nm"], spindle_speed: ["1/min", "Hz"], position: ["mm", "um", "in"], angle: ["urad", "deg"], feed: ["mm/min"] };
const METHODS = ["ols", "partial-f", "mra", "dynamic", "averaged", "grouping", "subsets", "ace", "ace-monotone", "mlp", "ridge", "pcr", "pls", "lasso", "ppr"], USUAL = 5;
const UNIT = { cycle: _("thermal cycles"), day: _("days"), file: _("files") };
const TARGETS = { c99: _("C99 (DSP, PLC, computer)"), st: _("structured text, CODESYS"), "st twincat": _("structured text, TwinCAT"), "st scl": _("structured text, Siemens TIA"), "st iec": _("structured text, IEC 61131-3 second edition"), siemens: "Siemens SINUMERIK", beckhoff: "Beckhoff", linuxcnc: "LinuxCNC", heidenhain: "Heidenhain", fanuc: "Fanuc", haas: "Haas", okuma: "Okuma", klipper: "Klipper", onnx: "ONNX" };
let state = null, seen = {}, shownRun = "", chosenRun = 0, figures = 0;

function alarm(text = "") { $("alarm").textContent = text; $("alarm").hidden = !text; if (text) $("alarm").scrollIntoView({ block: "nearest" }); }
function element(tag, text = "", kind = "", ...inner) { const e = make(tag, kind, text); e.append(...inner); return e; }
function scrolling(inner) { const e = element("div", "", "scroll", inner); e.tabIndex = 0; e.setAttribute("role", "region"); e.setAttribute("aria-label", _("table")); return e; }
function button(text, run, kind = "") { const b = element("button", text, kind); b.type = "button"; b.addEventListener("click", run); return b; }
async function api(path, method = "GET", body, raw = false) {
  if (method !== "GET") alarm();  // what the page reads by itself leaves the answer to the last request
  const sent = body === undefined ? {} : raw ? { body } : { body: JSON.stringify(body), headers: { "Content-Type": "application/json" } };
  let answer;
  try { answer = await fetch(path, { method, ...sent }); } catch { alarm(_("The page has lost its server: start thermocomp app again.")); throw new Error("lost"); }
  const content = await answer.json().catch(() => ({ detail: _("the server answered {status}", { status: answer.status }) }));
  if (!answer.ok) { alarm(typeof content.detail === "string" ? content.detail : JSON.stringify(content.detail)); throw new Error("refused"); }
  return content;
}
const quietly = work => (...given) => Promise.resolve(work(...given)).catch(e => { if (!["lost", "refused"].includes(e.message)) alarm(String(e)); });
const place = name => "api/recordings/" + name.split("/").map(encodeURIComponent).join("/");

// -- files -------------------------------------------------------------------------------------------------------------

const dropFiles = quietly(async files => {
  for (const file of files) {
    $("busy").textContent = _("Reading {file} ...", { file: file.name });
    try { const found = await api(`api/drop/${encodeURIComponent(file.name)}`, "PUT", file, true); seen[found.file] = found; } finally { $("busy").textContent = ""; }
  }
  render(await api("api/project"));
});

const answer = quietly(async (name, remedies) => {
  $("busy").textContent = _("Reading {file} again ...", { file: name });
  try { seen[name] = await api(place(name), "POST", remedies); } finally { $("busy").textContent = ""; }
  draw(name);
});

const removeFile = quietly(async name => { delete seen[name]; render(await api(place(name), "DELETE")); });

const useFile = quietly(async (name, to) => render(await api(`api/uses/${name.split("/").map(encodeURIComponent).join("/")}?to=${to}`, "POST")));

const undo = quietly(async name => { seen[name] = await api("api/undo/" + name.split("/").map(encodeURIComponent).join("/"), "POST"); draw(name); });

function choices(name, options) {
  return element("ul", "", "", ...options.map(o => element("li", "", "", button(_("use this"), () => answer(name, [o.remedy])), " ", element("code", o.toml.replaceAll("\n", "; ")))));
}

function sheets(name, found) {  // of a workbook
  if (!found.sheets) return "";
  const input = element("select");
  for (const sheet of ["", ...found.sheets]) input.append(new Option(sheet || _("found automatically"), sheet, false, sheet === found.sheet));
  input.addEventListener("change", () => answer(name, [{ read: { sheet: input.value } }]));
  return element("p", "", "", element("label", _("Sheet") + " ", "", input));
}

function draw(name) {  // the card of a recording
  offerNext();
  const found = seen[name], card = document.querySelector(`[data-file="${CSS.escape(name)}"]`);
  const remove = button(_("Remove"), () => removeFile(name)); remove.title = _("The file stays in the project's folder.");
  const use = element("select"), assessed = (state.settings.assess || []).some(r => r.file === name);
  use.append(new Option(_("learn from it"), "recordings", false, !assessed), new Option(_("only assess the model on it"), "assess", false, assessed));
  use.addEventListener("change", () => useFile(name, use.value)); use.setAttribute("aria-label", _("use of {file}", { file: name }));
  card.replaceChildren(element("h2", name.replace(/^files\//, "") + " ", "", use, " ", remove));
  if (!found) { card.append(element("p", _("reading ..."), "quiet")); return; }
  const undoing = found.mapping ? button(_("Undo the last change"), () => undo(name)) : "";
  if (found.error) {
    card.append(element("p", found.error, "trouble"), found.options.length ? element("p", _("Which of these is right?")) : element("p", _("This file cannot be used as it is. Export it again from the logger as a table: a heading row with units, then one row per reading."), "quiet"), choices(name, found.options), sheets(name, found), found.columns ? scrolling(preview(name, found.columns)) : "", undoing);
    return;
  }
  card.append(element("p", found.summary), sheets(name, found), scrolling(preview(name, found.columns)));
  if (found.notes.length) card.append(element("h3", _("Notes on reading")), element("ul", "", "", ...found.notes.map(n => element("li", n))));
  for (const [channel, reason] of Object.entries(found.ignored)) card.append(element("p", _("{channel} is not used: {reason}", { channel, reason }) + " ", "warning", button(_("use it nevertheless"), () => answer(name, [{ columns: { [channel]: { role: "temperature", reason: "" } } }]))));
  for (const q of found.questions) card.append(element("p", q.text, "warning"), choices(name, q.options));
  if (found.findings.length) card.append(element("h3", _("Found in the data")), element("ol", "", "", ...found.findings.map(f => {
    const line = element("li", "", f.severity, element("strong", _(f.severity) + " "), `${f.channel} ${f.text} `);
    if (f.toml) { const repair = button(_("repair"), () => answer(name, [f.remedy])); repair.title = f.toml; line.append(repair); }
    return line;
  })));
  if (found.mapping) card.append(element("details", "", "", element("summary", _("Mapping: what was changed in reading this file")), element("pre", found.mapping)), undoing);
  const figure = element("figure"), script = element("script", JSON.stringify(found.panels));
  script.type = "application/json"; figure.append(script); card.append(figure);
  const plots = found.panels.length ? show(figure, figures++) : [];
  document.dispatchEvent(new CustomEvent("card", { detail: { name, found, card, figure, plots } }));
  judgeForm();
}

function preview(name, columns) {
  const heads = columns.map(c => element("th", "", "", button(c.heading || _("column {number}", { number: c.number }), () => changeColumn(name, c)), element("span", c.kind === "ignored" ? _("ignored") : `${KINDS[c.kind] || _(c.kind)}${c.unit ? ` [${c.unit}]` : ""}`, `kind ${c.kind}`)));
  const rows = [0, 1, 2, 3].map(k => element("tr", "", "", ...columns.map(c => element("td", c.cells[k] ?? "", "n"))));
  return element("table", "", "", element("thead", "", "", element("tr", "", "", ...heads)), element("tbody", "", "", ...rows));
}

function changeColumn(name, c) {  // dialog: quantity, unit, sensitivity
  const box = element("dialog"), role = element("select"), unit = element("select"), scale = element("input"), was = KINDS[c.kind] ? c.kind : "ignore";
  for (const [key, text] of Object.entries(KINDS)) role.append(new Option(text, key, false, key === was));
  const units = () => unit.replaceChildren(...(UNITS[role.value] || []).map(u => new Option(u, u, false, u === c.unit)));
  role.addEventListener("change", units); units();
  scale.type = "number"; scale.step = "any"; scale.value = c.scale;
  const close = () => box.close(), label = (text, e) => element("label", text + " ", "", e);
  const save = button(_("Change"), () => {
    const channel = c.channel || c.heading.replace(/[^\p{L}\p{N}_-]+/gu, "_") || `column_${c.number}`, own = columnsOf(name).filter(o => o.heading === c.heading).length === 1;
    if (role.value === "time") { close(); return answer(name, [{ time: { column: own ? c.heading : c.number, unit: unit.value } }]); }
    const said = role.value === "ignore" || role.value === "cycle" ? { role: role.value } : { role: role.value, unit: unit.value, scale: Number(scale.value) };
    close(); answer(name, [{ columns: { [channel]: { column: own ? c.heading : c.number, ...said } } }]);
  }, "main");
  box.append(element("h2", c.heading || _("column {number}", { number: c.number })), element("p", "", "", label(_("This column is"), role), label(_("in"), unit), label(_("number in the file times"), scale)),
    element("p", _("A voltage needs its sensitivity: 25 um per volt is 25, in um."), "quiet"), element("p", "", "", save, " ", button(_("Cancel"), close)));
  box.addEventListener("close", () => box.remove());
  document.body.append(box); box.showModal();
}
const columnsOf = name => (seen[name] && seen[name].columns) || [];

const files = quietly(async () => {
  const learned = state.settings.recordings || [], named = [...learned, ...(state.settings.assess || [])].map(r => r.file), box = $("recordings");
  $("joining").hidden = learned.length < 2; $("join").checked = Boolean(state.settings.join);
  for (const card of [...box.children]) if (!named.includes(card.dataset.file)) card.remove();
  for (const name of named) {
    if (box.querySelector(`[data-file="${CSS.escape(name)}"]`)) continue;
    const card = element("article", "", "card"); card.dataset.file = name; box.append(card); draw(name);
    if (!seen[name]) { seen[name] = await api(place(name)); draw(name); }
  }
  offerNext();
});
function offerNext() { const found = (state.settings.recordings || []).map(r => seen[r.file]); $("to-judge").hidden = !found.length || found.some(f => !f || f.error); }

// -- judging -----------------------------------------------------------------------------------------------------------

function boxes(id, names, chosen, kind = "checkbox") {
  $(id).replaceChildren(...names.map(([value, text]) => {
    const input = element("input"); input.type = kind; input.name = id; input.value = value; input.checked = chosen.includes(value);
    return element("label", "", "", input, ` ${text}`);
  }));
}

const usualInputs = () => Object.assign({}, ...(state.settings.recordings || []).map(r => (seen[r.file] || {}).inputs || {}));

function judgeForm() {  // only what is not yet shown: a choice of the user stays
  const compare = state.settings.compare || {}, names = [...new Set(Object.values(seen).flatMap(s => s.targets || []))];
  const several = (state.settings.recordings || []).length > 1, inputs = usualInputs(), own = [compare.inputs || []].flat(), known = [...new Set([...Object.keys(inputs), ...own])];
  if ([...document.querySelectorAll("#targets input")].map(i => i.value).join() !== names.join()) boxes("targets", names.map(n => [n, n]), compare.targets || names);
  if ([...document.querySelectorAll("#inputs input")].map(i => i.value).join() !== known.join()) boxes("inputs", known.map(n => [n, n]), own.length ? own : known.filter(n => inputs[n]));
  if (!$("methods").children.length) boxes("methods", METHODS.map(n => [n, n]), compare.models || METHODS.slice(0, USUAL));
  if (!$("units").children.length) boxes("units", Object.entries(UNIT), [compare.leave_one || "cycle"], "radio");
  const byFile = document.querySelector("#units [value=file]");
  byFile.disabled = !several && !byFile.checked;
}
const chosen = id => [...document.querySelectorAll(`#${id} input:checked`)].map(i => i.value);

function start(how = "") { $("progress").replaceChildren(_("starting ...")); return api(`api/runs${how}`, "POST"); }

const startRun = quietly(async event => {
  event.preventDefault();
  const all = document.querySelectorAll("#targets input").length, targets = chosen("targets"), models = chosen("methods"), inputs = chosen("inputs"), unit = chosen("units")[0], compare = { ...(state.settings.compare || {}) };
  if (!targets.length || !models.length || !inputs.length) return alarm(_("Choose at least one deviation, one method and one input."));
  const usualOnes = usualInputs(), asUsual = [...document.querySelectorAll("#inputs input")].every(i => i.checked === Boolean(usualOnes[i.value]));
  for (const [key, value, usual] of [["targets", targets, targets.length === all], ["inputs", inputs, asUsual], ["models", models, models.join() === METHODS.slice(0, USUAL).join()], ["leave_one", unit, unit === "cycle"]]) if (usual) delete compare[key]; else compare[key] = value;
  chosenRun = 0;
  const language = state.settings.language || LANGUAGE === "en" ? {} : { language: LANGUAGE };  // of the reports, as of the page
  try {
    await api("api/settings", "PUT", { compare: Object.keys(compare).length ? compare : null, ...language });
    await start(`?again=${$("again").checked}`);
  } catch (e) { render(state); throw e; }
  $("again").checked = false;
});

function minutes(s) { return s < 90 ? `${Math.max(1, Math.round(s))} s` : `${Math.round(s / 60)} min`; }

function progress(run) {
  const box = $("progress"), running = run && run.state === "running";
  $("stop").hidden = !running;
  if (state.trouble && !running) return box.replaceChildren(element("p", state.trouble, "failed"));
  if (!run) return box.replaceChildren();
  if (!running) return box.replaceChildren(run.error ? element("p", _("Run {number} {state}: {error}", { number: run.number, state: _(run.state), error: run.error }), run.state) : "");
  const bar = element("progress"), spent = Date.now() / 1000 - run.step_began;
  if (run.total) { bar.max = run.total; bar.value = run.done; }
  const left = run.done > 2 && run.done > run.total / 20 ? _(", about {time} left", { time: minutes(spent / run.done * Math.max(run.total - run.done, 0)) }) : "";
  bar.setAttribute("aria-label", _("progress"));
  box.replaceChildren(element("p", _("Run {number}: {step}", { number: run.number, step: run.step || _("reading") }) + (run.total ? _(", {done} of {total} tasks", { done: run.done, total: run.total }) + left : "") + `. ${run.task}`), bar);
}

const date = text => LANGUAGE === "en" ? text.replace("T", " ").slice(0, 16) : new Date(text).toLocaleString(LANGUAGE, { dateStyle: "medium", timeStyle: "short" });
const um = v => v == null ? "–" : fixed(v, 2);
const verdict = quietly(async run => {
  if (!run || shownRun === run.number + run.ended) return;
  shownRun = run.number + run.ended;
  const told = await api(`api/runs/${run.number}`), shown = told.results, { compare, fit } = shown, models = (fit || {}).models || [];
  Object.assign(WORDS, told.words);
  const head = [_("deviation"), _("method"), _("verdict"), _("RMS with compensation [um]"), _("RMS without [um]"), _("why")];
  const method = target => [...((compare || {}).recommended || []).map(r => ({ ...r, model: r.written })), ...((compare || {}).results || [])].find(r => r.target === target && r.model);
  const line = m => [m.target, (method(m.target) || { model: m.family }).model, m.verdict, um(m.unseen_rms_um), um(m.none_rms_um), m.reason];
  const body = models.map(line).map(cells => element("tr", "", "", ...cells.map((c, k) => element("td", k === 2 || k === 5 ? _(String(c ?? "")) : String(c ?? ""), k === 2 ? String(c) : k === 3 || k === 4 ? "n" : ""))));
  $("verdict").replaceChildren(element("h2", _("Result of run {number}, on unseen data", { number: run.number })),
    scrolling(element("table", "", "", element("thead", "", "", element("tr", "", "", ...head.map(h => element("th", h)))), element("tbody", "", "", ...body))),
    element("p", "", "", link(run, "comparison.html", _("All methods, with curves and reasons")), " · ", link(run, "check.html", _("Check of the data")), " · ", link(run, "model.json", _("Model file"))));
  deployForm(run, told);
  document.dispatchEvent(new CustomEvent("result", { detail: { run, results: shown } }));
});
function link(run, name, text) { const a = element("a", text); a.href = `runs/${run.number}/${name.split("/").map(encodeURIComponent).join("/")}`; a.target = "_blank"; return a; }

function runsTable(runs) {
  $("runs").tBodies[0].replaceChildren(...[...runs].reverse().map(r => {
    const files = r.steps.flatMap(s => s.files).filter(f => f.endsWith(".html")), said = r.steps.filter(s => s.name === "compare").map(s => s.text).join(" ");
    const without = r.steps.filter(s => s.error).map(s => _("Without {step}: {error}", { step: s.name, error: s.error })).join(" ");
    return element("tr", "", "", element("td", String(r.number)), element("td", _(r.state), r.state), element("td", date(r.began)), element("td", r.error || [said, without].filter(Boolean).join(" ")), element("td", "", "", ...files.flatMap(f => [link(r, f, f.replace(".html", "")), " "])));
  }));
  $("command").textContent = state.command;
}

// -- deployment --------------------------------------------------------------------------------------------------------

const fitted = () => state.runs.filter(r => r.steps.some(s => s.name === "fit"));

function deployForm(run, told) {
  if (!$("to").children.length) for (const [key, text] of Object.entries(TARGETS)) $("to").append(new Option(text, key));
  $("exported").replaceChildren(...fitted().reverse().map(r => new Option(_("{number}, of {began}", { number: r.number, began: date(r.began) }), r.number, false, r.number === run.number)));
  $("verdicts").textContent = run.steps.filter(s => s.name === "compare").map(s => s.text).join(" ");
  const steps = run.steps.filter(s => s.name === "export"), taken = [];
  $("package").replaceChildren(...steps.map(s => s.error ? element("p", s.error, "trouble") : packageCard(run, s)));
  if (!steps.length) $("package").append(element("p", run.state === "running" ? _("The run goes on ...") : _("Nothing is exported yet."), "quiet"));
  const chosen = Object.fromEntries(((state.settings.export || {}).axes || []).map(text => text.split("=")));
  const letters = ((told.results.fit || {}).models || []).map(({ target }) => {  // as chosen before, else as named, each axis once
    const letter = Object.keys(chosen).length ? chosen[target] : (told.axes || {})[target], input = element("select");
    for (const [value, text] of [["", _("not corrected")], ["X", "X"], ["Y", "Y"], ["Z", "Z"]]) input.append(new Option(text, value, false, value === letter && !taken.includes(letter)));
    if (letter) taken.push(letter);
    input.dataset.target = target;
    return element("p", "", "", element("label", `${target} `, "", input));
  });
  $("axes").replaceChildren($("axes").querySelector("legend"), ...letters);
  $("axes").dataset.driven = (told.driven || []).join(" ");
  showAxes();
}
function showAxes() { $("axes").hidden = !$("axes").dataset.driven.split(" ").includes($("to").value.split(" ")[0]); }

function packageCard(run, step) {
  const { files, text } = step, folder = files.length ? files[0].split("/")[0] : "", guides = files.filter(f => f.endsWith(".md"));
  if (!folder) return element("article", "", "card", element("h2", _("nothing exported")), element("p", text));
  const whole = element("a", _("Download the package ({n} files, ZIP)", { n: files.length }), "main"), all = element("ul", "", "", ...files.map(f => element("li", "", "", link(run, f, f.split("/")[1]))));
  whole.href = `api/runs/${run.number}/zip/${encodeURIComponent(folder)}`; whole.download = `${folder}.zip`;
  return element("article", "", "card", element("h2", folder), element("p", text), element("p", "", "", whole), element("p", `${_("In the folder")} ${state.folder}/runs/${run.number}/${folder}`, "quiet"),
    ...guides.map(f => element("p", _("Read first:") + " ", "", link(run, f, f.split("/")[1]))), element("details", "", "", element("summary", _("All files")), all));
}

const exportModels = quietly(async event => {
  event.preventDefault();
  const [to, dialect] = $("to").value.split(" "), { axes: _none, ...kept } = state.settings.export || {};
  const axes = [...$("axes").querySelectorAll("select")].filter(s => s.value).map(s => `${s.dataset.target}=${s.value}`);
  if (!$("axes").hidden && !axes.length) return alarm(_("State the axis of at least one deviation."));
  $("package").replaceChildren(element("p", _("exporting ..."), "quiet"));
  try {
    await api("api/settings", "PUT", { export: { ...kept, to, dialect: dialect || "", ...($("axes").hidden ? {} : { axes }) } });
    await start(`?number=${$("exported").value}`);
  } catch (e) { shownRun = ""; render(state); throw e; }  // refused: not "exporting ..." for ever
});

// -- the page ----------------------------------------------------------------------------------------------------------

function render(found) {
  state = found;
  if (document.activeElement !== $("name")) $("name").value = state.settings.name || "";
  const last = state.runs[state.runs.length - 1];
  files(); judgeForm(); progress(state.runs.find(r => r.state === "running") || last); runsTable(state.runs);
  verdict(fitted().find(r => r.number === chosenRun) || fitted().pop());
  document.dispatchEvent(new CustomEvent("state"));
}

function open(tab) {
  for (const other of document.querySelectorAll("[role=tab]")) {
    const own = other === tab;
    other.setAttribute("aria-selected", own); other.tabIndex = own ? 0 : -1; $(other.getAttribute("aria-controls")).hidden = !own;
  }
  tab.focus();
}

const tabs = [...document.querySelectorAll("[role=tab]")];
tabs.forEach((tab, k) => {
  tab.addEventListener("click", () => open(tab));
  tab.addEventListener("keydown", e => { const step = { ArrowRight: 1, ArrowLeft: -1 }[e.key]; if (step) open(tabs[(k + step + tabs.length) % tabs.length]); });
});
$("chosen").addEventListener("change", e => { dropFiles([...e.target.files]); e.target.value = ""; });
for (const kind of ["dragover", "dragleave", "drop"]) $("drop").addEventListener(kind, e => { e.preventDefault(); $("drop").classList.toggle("over", kind === "dragover"); if (kind === "drop") dropFiles([...e.dataTransfer.files]); });
$("join").addEventListener("change", quietly(e => api("api/settings", "PUT", { join: e.target.checked ? {} : null })));
$("to-judge").addEventListener("click", () => open($("tab-judge")));
$("settings").addEventListener("submit", startRun);
$("language").addEventListener("change", quietly(async e => { await api("api/settings", "PUT", { language: e.target.value }); location.reload(); }));
$("target").addEventListener("submit", exportModels);
$("to").addEventListener("change", showAxes);
$("exported").addEventListener("change", () => { chosenRun = Number($("exported").value); render(state); });
$("stop").addEventListener("click", quietly(() => api(`api/runs/${state.runs.find(r => r.state === "running").number}`, "DELETE")));
$("name").addEventListener("change", quietly(e => api("api/settings", "PUT", { name: e.target.value })));
addEventListener("DOMContentLoaded", () => {  // when the other scripts listen
  api("api/project").then(render).catch(() => 0);
  const events = new EventSource("api/events");
  events.addEventListener("message", e => render(JSON.parse(e.data)));
  events.addEventListener("error", () => alarm(_("The page has lost its server; it tries again. What is running goes on.")));
  events.addEventListener("open", () => alarm());
});
