"use strict";
// The next test with its NC program; the live configuration, and its trial with a replay of the recording.
{
  const form = $("next"), DEFAULTS = { hours: 12, swing: 5, probe_every: 30, dialect: "linuxcnc", proof: false };
  let filled = false;

  document.addEventListener("state", () => {
    if (filled) return;
    filled = true;
    for (const [key, value] of Object.entries(state.settings.plan || {})) {
      const input = form.elements[key];
      if (input) if (input.type === "checkbox") input.checked = value; else input.value = value;
    }
  });

  form.addEventListener("submit", quietly(async event => {
    event.preventDefault();
    const plan = { ...(state.settings.plan || {}) };
    for (const input of form.elements) {
      if (!input.name) continue;
      const value = input.type === "checkbox" ? input.checked : input.type === "number" ? input.value && Number(input.value) : input.value;
      if (value === "" || value === DEFAULTS[input.name]) delete plan[input.name]; else plan[input.name] = value;
    }
    await api("api/settings", "PUT", { plan });
    await start();
    $("planned").replaceChildren(element("p", _("Planning ..."), "quiet"));
  }));

  document.addEventListener("result", e => {
    const { run, results } = e.detail, steps = run.steps.filter(s => s.name === "plan"), step = steps[steps.length - 1];
    const range = c => _("{value} ({low} to {high})", { value: um(c.gain_um), low: um(c.gain_range_um[0]), high: um(c.gain_range_um[1]) });
    if (step && step.error) $("planned").replaceChildren(element("p", step.error, "trouble"));
    else if (step && results.plan) {
      const links = step.files.filter(f => !f.endsWith(".json")).flatMap(f => [link(run, f, f.split("/")[1]), " · "]).slice(0, -1);
      for (const a of links) if (a.href && !a.href.endsWith(".png")) a.download = a.textContent;
      $("planned").replaceChildren(element("h2", _("The next test")), element("p", step.text), element("p", _("NC program, measurement sheet and figure:") + " ", "", ...links),
        element("h3", _("Tests considered")), table([_("test"), _("expected gain [um]"), _("new")], results.plan.candidates.map(c => [c.words, range(c), c.news])));
    } else $("planned").replaceChildren(element("p", run.state === "running" && state.settings.plan ? _("Planning ...") : _("Nothing is planned yet."), "quiet"));
    live(run);
  });

  const live = quietly(async run => {
    const box = $("live"), fitted = run.steps.some(s => s.files.includes("live.toml"));
    if (!fitted) return box.replaceChildren();
    const now = await api("api/live"), file = link(run, "live.toml", "live.toml");
    file.download = "live.toml";
    const said = element("p", "", "", now.address ? _("Run {number} is tried at", { number: now.run }) + " " : "");
    said.setAttribute("role", "status");
    if (now.address) { const page = element("a", now.address); page.href = now.address; page.target = "_blank"; page.rel = "noreferrer"; said.append(page); }
    const start = button(_("Try it live"), quietly(async () => {
      said.textContent = _("The live page starts ..."); start.disabled = true;
      try { await api(`api/live/${run.number}`, "POST"); } finally { live(run); }
    }));
    const stop = button(_("End the trial"), quietly(async () => { await api("api/live", "DELETE"); live(run); }));
    box.replaceChildren(element("h2", _("Live")), element("p", _("Configuration of thermocomp serve for these models, to be edited for the machine:") + " ", "", file),
      element("p", _("The live page in shadow, with the recording replayed 60 times faster:") + " ", "", now.address ? stop : start), said);
  });
}
