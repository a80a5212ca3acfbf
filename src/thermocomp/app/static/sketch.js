"use strict";
// Places of the temperature sensors on a sketch of the machine: dragged, or moved by keys; kept in project.toml.
{
  const W = 300, H = 200, STEP = 0.02, ROW = 14, svg = $("sketch").querySelector("svg");
  const MACHINES = {  // outlines, each seen from the side
    mill: ["M30 170H270V190H30Z", "M190 30H250V170H190Z", "M110 35H190V85H110Z", "M135 85H165V110H135Z", "M145 110H155V125H145Z", "M70 140H185V155H70Z", "M95 155H160V170H95Z"],
    lathe: ["M20 140H280V185H20Z", "M30 55H105V140H30Z", "M105 75H125V125H105Z", "M215 80H270V140H215Z", "M190 97H215V103H190Z", "M140 120H185V140H140Z", "M155 100H172V120H155Z"],
    "five-axis": ["M30 170H270V190H30Z", "M200 30H255V170H200Z", "M120 35H200V80H120Z", "M142 80H168V102H142Z", "M150 102H160V114H150Z", "M60 120H80V170H60Z", "M170 120H190V170H170Z", "M80 140Q125 175 170 140V132H80Z", "M100 124H150V132H100Z"],
    printer: ["M40 20H50V185H40Z", "M250 20H260V185H250Z", "M40 12H260V20H40Z", "M30 185H270V195H30Z", "M80 150H220V158H80Z", "M140 158H160V185H140Z", "M50 70H250V78H50Z", "M130 60H165V95H130Z", "M143 95H152V106H143Z"],
  };
  let shownAs = "", places = {}, moving = 0;  // number of changes that are not saved yet

  const sensors = () => [...new Set(Object.values(seen).flatMap(s => (s.columns || []).filter(c => c.kind === "temperature").map(c => c.channel)))];
  const store = quietly(async () => {  // what is shown is what was chosen, until it is saved
    try { state = await api("api/settings", "PUT", { sketch: { machine: $("machine").value, places } }); } finally { moving -= 1; update(); }
  });
  const within = v => Math.round(Math.min(Math.max(v, 0), 1) * 1000) / 1000;

  function put(g, name, k) {
    const free = !places[name], [x, y] = free ? [10 + 97 * (k % 3), H + ROW * (1 + Math.floor(k / 3))] : [places[name][0] * W, places[name][1] * H];
    g.setAttribute("transform", `translate(${x} ${y})`);
    g.classList.toggle("free", free);
    g.setAttribute("aria-label", free ? _("{name}, not placed", { name }) : _("{name}, {x} % from the left, {y} % from the top", { name, x: Math.round(100 * places[name][0]), y: Math.round(100 * places[name][1]) }));
  }

  function sensor(name, k) {
    const g = shape("g", { tabindex: 0, role: "button" });
    g.append(shape("circle", { r: 5 }), shape("text", { x: 8, y: 3 }, name.length > 18 ? name.slice(0, 17) + "…" : name));
    put(g, name, k);
    let waiting = 0;
    g.addEventListener("keydown", e => {
      const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
      if (by) { const [x, y] = places[name] || [0.5 - by[0] * STEP, 0.5 - by[1] * STEP]; places[name] = [within(x + by[0] * STEP), within(y + by[1] * STEP)]; }
      else if (e.key === "Delete" || e.key === "Backspace") delete places[name];
      else return;
      e.preventDefault(); put(g, name, k);
      if (!waiting) moving += 1;
      clearTimeout(waiting); waiting = setTimeout(() => { waiting = 0; store(); }, 400);
    });
    g.addEventListener("pointerdown", e => { g.setPointerCapture(e.pointerId); moving += 1; g.focus(); e.preventDefault(); });
    g.addEventListener("pointermove", e => {
      if (!g.hasPointerCapture(e.pointerId)) return;
      const at = new DOMPoint(e.clientX, e.clientY).matrixTransform(svg.getScreenCTM().inverse());
      places[name] = [within(at.x / W), within(at.y / H)]; put(g, name, k);
    });
    g.addEventListener("lostpointercapture", store);
    return g;
  }

  function draw(names) {
    const focused = [...svg.querySelectorAll("g")].indexOf(document.activeElement), dots = names.map(sensor);
    svg.setAttribute("viewBox", `0 0 ${W} ${H + ROW * (1 + Math.ceil(names.length / 3))}`);  // room for those not placed
    svg.replaceChildren(...MACHINES[$("machine").value].map(d => shape("path", { d })), ...dots);
    if (dots[focused]) dots[focused].focus();
  }

  function update() {
    const own = state.settings.sketch || {}, names = sensors(), now = JSON.stringify([own, names]);
    $("sketch").hidden = !names.length;
    if (moving || now === shownAs) return;
    shownAs = now; places = { ...(own.places || {}) }; $("machine").value = own.machine || "mill";
    draw(names);
  }

  $("machine").addEventListener("change", () => { moving += 1; draw(sensors()); store(); });
  document.addEventListener("state", update);
  document.addEventListener("card", update);
}
