"use strict";
// Two runs side by side, of this project or of another one: results by deviation and method, and what was chosen differently.
{
  const fill = (select, runs, wanted) => select.replaceChildren(...runs.filter(r => !r.steps || r.steps.some(s => s.name === "fit")).reverse().map(r => new Option(`${r.number} (${r.began.slice(0, 10)})`, r.number, false, r.number === wanted)));
  const other = () => $("other").value.trim();

  document.addEventListener("state", () => {
    const runs = state.runs, last = runs.length;
    $("beside").hidden = !last;
    if ($("run-a").dataset.known === runs.map(r => r.number + r.state).join()) return;
    $("run-a").dataset.known = runs.map(r => r.number + r.state).join();
    fill($("run-a"), runs, runs[last - 1] && runs[last - 1].number);
    if (!other()) fill($("run-b"), runs, runs[last - 2] && runs[last - 2].number);
  });

  $("other").addEventListener("focus", quietly(async () => $("projects").replaceChildren(...(await api("api/projects")).projects.map(p => new Option(p)))), { once: true });
  $("other").addEventListener("change", quietly(async () => {
    const { runs } = other() ? await api(`api/others?${new URLSearchParams({ project: other() })}`) : state;
    fill($("run-b"), runs, runs.length && runs[runs.length - 1].number);
  }));

  const cells = one => one ? [one.rms_um, one.worst ? _("{value} in {cycle}", { value: um(one.worst[0]), cycle: one.worst[1] }) : "–", element("span", _(one.verdict) + (one.written ? ` (${_("used")})` : ""), one.verdict.split(" ")[0])] : ["–", "–", _("not compared")];
  $("beside").addEventListener("submit", quietly(async event => {
    event.preventDefault();
    const [a, b] = [$("run-a").value, $("run-b").value];
    if (!a || !b) return alarm(_("Choose two runs."));
    const { rows, differences } = await api(`api/runs/${a}/beside/${b}?${new URLSearchParams({ project: other() })}`);
    const names = [other() ? _("run {number} there", { number: b }) : _("run {number}", { number: b }), _("run {number}", { number: a })], head = [_("deviation"), _("method"), ...names.flatMap(n => [`RMS [um], ${n}`, `${_("worst cycle [um]")}, ${n}`, `${_("verdict")}, ${n}`])];
    $("compared").replaceChildren(element("h3", _("From {first} to {second}", { first: names[0], second: names[1] })), differences.length ? element("ul", "", "", ...differences.map(d => element("li", d))) : element("p", _("The choices are the same.")),
      table(head, rows.map(r => [r.target, r.model, ...cells(r.of[0]), ...cells(r.of[1])])));
  }));
}
