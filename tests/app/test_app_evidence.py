"""What the page shows of finished runs: methods with their curves, sensors against error, two runs side by side."""

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import httpx
import pytest
from apppages import TOKEN, WHOLE, asked_of, copy_of, finished, opened
from projects import small_project
from smallmachine import small_machine

import thermocomp as tc
from thermocomp.api.keywords import silent
from thermocomp.app.comparing import compare_runs
from thermocomp.app.project import Project
from thermocomp.app.runfolder import runs_of
from thermocomp.app.running import run_project


@pytest.fixture(scope="module")
def finished_project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return finished(tmp_path_factory.mktemp("finished") / "project")


def read(folder: Path, name: str, run: int = 1) -> Any:
    return json.loads((folder / "runs" / str(run) / name).read_text(encoding="utf-8"))


def test_the_numbers_are_those_of_the_commands(finished_project: Path) -> None:
    compared = tc.compare(finished_project / "files" / "drift.csv", "z_um", ["ols"], robustness=False, jobs=1)
    curves = read(finished_project, "curves.json")["curves"]
    assert [(c["target"], c["model"]) for c in curves] == [("z_um", "ols"), ("z_um", "averaged")]
    by_name = {c["name"].split(" ")[0]: c["y"] for c in curves[0]["panels"][0]["curves"]}
    residual = compared.residuals()["residual"]
    assert max(by_name["residual"]) == pytest.approx(residual.max(), abs=0.02)
    assert len(curves[0]["panels"][0]["cycles"]) == 4
    chosen = tc.select(finished_project / "files" / "drift.csv", "z_um", max_sensors=2, jobs=1)
    (sensors,) = read(finished_project, "sensors.json")["choices"]
    assert sensors["chosen"] == list(chosen.choices[0].sensors)
    (table,) = [t for t in chosen.choices[0].tables if "averaged mean RMS [um]" in t.columns]
    place = table.columns.index("averaged mean RMS [um]")
    assert [p["error"] for p in sensors["points"] if p["model"] == "averaged"] == [row[place] for row in table.rows]


def test_evidence_in_a_browser(finished_project: Path) -> None:
    with opened(finished_project) as page:
        page.locator("#tab-judge").press("Enter")  # a mouse that rests on curves would dim their names
        page.wait_for_selector("#details table")
        assert page.locator("#details table tbody tr").count() == 2
        page.get_by_role("button", name="averaged (used): curves for z_um").press("Enter")
        page.wait_for_selector("#curves canvas")
        page.locator("#curves .zoom button", has_text="2 (2500").press("Enter")
        assert "RMS" in page.inner_text("#cycle")
        (points,) = [c["points"] for c in read(finished_project, "sensors.json")["choices"]]
        dots = page.locator("#details .charts .card").first.locator("circle")
        assert dots.count() == len(points)
        dots.nth(1).press("Enter")
        assert ", ".join(points[1]["sensors"]) in page.locator("#details .charts [role=status]").first.inner_text()


def test_a_smaller_set_is_taken_for_the_next_run(finished_project: Path, tmp_path: Path) -> None:
    folder = copy_of(finished_project, tmp_path / "mine")
    (points,) = [c["points"] for c in read(folder, "sensors.json")["choices"]]
    one = next(k for k, p in enumerate(points) if len(p["sensors"]) == 1)

    def inputs() -> object:
        return Project(folder).settings.compare.inputs

    with opened(folder) as page:
        page.wait_for_selector("#files .card canvas", timeout=120_000)
        page.locator("#tab-judge").press("Enter")
        assert page.locator("#inputs input:checked").count() == page.locator("#inputs input").count() == 4
        page.locator("#details .charts .card").first.locator("circle").nth(one).press("Enter")
        assert "too small an error" in page.locator("#details .charts [role=status]").first.inner_text()
        page.get_by_role("button", name="Choose these inputs for the next run").press("Enter")
        assert page.evaluate("document.activeElement.id") == "start"
        page.keyboard.press("Enter")
        page.wait_for_selector("#runs tbody tr:nth-child(2)")
        assert inputs() == [*points[one]["sensors"], "spindle_rpm"]
        page.wait_for_selector("#runs tbody tr:first-child td.done", timeout=120_000)
    used = {s for r in read(folder, "compare.json", 2)["results"] for s in r["sensors"]}
    assert used == {*points[one]["sensors"], "spindle_rpm"}
    with opened(folder) as page:  # and is still chosen
        page.wait_for_selector("#inputs input", state="attached", timeout=120_000)
        assert page.locator("#inputs input:checked").count() == 2


def test_two_runs_side_by_side(finished_project: Path, tmp_path: Path) -> None:
    folder, script = copy_of(finished_project, tmp_path / "mine"), "<img/src=x/onerror=alert(1)>"
    text = WHOLE.replace('models = ["ols", "averaged"]', 'models = ["ols", "ridge"]').replace("Small machine", script)
    (folder / "project.toml").write_text(text, encoding="utf-8")
    run_project(Project(folder), silent)
    found = compare_runs(*runs_of(folder))
    assert found["differences"] == [
        "compare.models: ols, averaged; then ols, ridge",
        f"name: Small machine; then {script}",
    ]
    by_model = {r["model"]: r["of"] for r in found["rows"]}
    assert by_model["ols"][0]["rms_um"] == by_model["ols"][1]["rms_um"]
    assert (by_model["averaged"][1], by_model["ridge"][0]) == (None, None)
    with opened(folder, width=1000, dark=False) as page:
        page.locator("#tab-judge").press("Enter")  # a mouse that rests on curves would dim their names
        page.locator("#beside button").press("Enter")
        page.wait_for_selector("#compared table")
        assert script in page.inner_text("#compared")
        assert page.locator("#compared tbody tr").count() == 3
        page.fill("#other", str(finished_project))
        page.locator("#other").press("Tab")
        page.wait_for_function("document.querySelectorAll('#run-b option').length === 1")
        page.locator("#beside button").press("Enter")
        page.wait_for_selector("#compared h3:has-text('there')")


def test_what_differs_is_said_in_words(finished_project: Path, tmp_path: Path) -> None:
    folder = copy_of(finished_project, tmp_path / "mine")
    drift = folder / "files" / "drift.csv"
    drift.write_text("\n".join(drift.read_text(encoding="utf-8").splitlines()[:-3]) + "\n", encoding="utf-8")
    run_project(Project(folder), silent)
    first, second = runs_of(folder)
    assert compare_runs(first, second)["differences"] == ["the content of a recording or of its mapping"]
    assert compare_runs(first, first)["differences"] == []


@pytest.mark.parametrize("content", ["[]", '{"results": [{}]}', '{"results": [{"target": 1, "model": 1}]}', "{"])
def test_results_of_another_version(finished_project: Path, tmp_path: Path, content: str) -> None:
    folder = copy_of(finished_project, tmp_path / "mine")
    for name in ("compare.json", "curves.json"):
        (folder / "runs" / "1" / name).write_text(content, encoding="utf-8")

    async def work(client: httpx.AsyncClient) -> None:
        for path in ("beside/1", "curves?target=a&model=b"):  # an error of the server would be raised here
            assert (await client.get(f"/{TOKEN}/api/runs/1/{path}")).status_code in (200, 404, 422)

    asked_of(folder, work)


@pytest.mark.parametrize("project", ["files", "/", "/nowhere", "../x", "a" * 5000, "%00"])
def test_other_folders_are_refused(finished_project: Path, project: str) -> None:
    async def work(client: httpx.AsyncClient) -> None:
        for path in (f"others?project={project}", f"runs/1/beside/1?project={project}"):
            assert (await client.get(f"/{TOKEN}/api/{path}")).status_code == 422

    asked_of(finished_project, work)


def test_a_package_is_one_file(finished_project: Path, tmp_path: Path) -> None:
    folder = copy_of(finished_project, tmp_path / "mine")
    package = folder / "runs" / "1" / "export-st"
    package.mkdir()
    for name in ("a.st", "read me.md"):
        (package / name).write_text(f"content of {name}", encoding="utf-8")
    (package / "outside.txt").symlink_to(folder / "project.toml")
    (package.parent / "words.json").write_text("{}", encoding="utf-8")

    async def work(client: httpx.AsyncClient) -> None:
        answer = await client.get(f"/{TOKEN}/api/runs/1/zip/export-st")
        with zipfile.ZipFile(io.BytesIO(answer.content)) as whole:
            assert whole.namelist() == ["export-st/a.st", "export-st/read me.md"]
            assert whole.read("export-st/a.st") == b"content of a.st"
        for wrong in ("plan", "export-c99", "%2e%2e", "export-st%2F..%2F..", "run.json"):
            assert (await client.get(f"/{TOKEN}/api/runs/1/zip/{wrong}")).status_code in (404, 422), wrong
        assert (await client.get(f"/{TOKEN}/api/runs/2/zip/export-st")).status_code == 404
        assert (await client.get(f"/{TOKEN}/api/runs/1")).status_code == 200

    asked_of(folder, work)


def test_names_that_are_scripts_never_run(tmp_path: Path) -> None:
    """Channels, cycles and the project are named by scripts; every step of the page shows them as text."""
    folder, script = tmp_path / "project", "<img/src=x/onerror=alert(1)>"
    text = WHOLE.replace("z_um", f"{script}z_um").replace("Small machine", script)
    small_project(folder, text)
    table = small_machine().to_frame()
    table.columns = [c if c in ("time_s", "spindle_rpm") else f"{script}{c}" for c in table.columns]
    table["cycle"] = [f"{script}{k // 200}" for k in range(len(table))]
    table.to_csv(folder / "files" / "drift.csv", index=False)
    run_project(Project(folder), silent)
    with opened(folder, width=1200, dark=False) as page:
        page.wait_for_selector("#sketch:not([hidden])", timeout=120_000)
        for summary in ("#sketch summary", "details.cycles summary"):
            page.locator(summary).press("Enter")
        assert page.locator("#sketch g").first.get_attribute("aria-label") == f"{script}t1_C, not placed"
        page.locator("#tab-judge").press("Enter")
        page.locator("#details td button").first.press("Enter")
        page.wait_for_selector("#curves canvas")
        page.locator("#curves .zoom button", has_text=script).first.press("Enter")
        page.locator("#details circle").first.press("Enter")
        assert script in page.locator("#details .charts [role=status]").first.inner_text()
        page.select_option("#run-b", "1")
        page.locator("#beside button").press("Enter")
        page.wait_for_selector("#compared table")
        page.locator("#tab-plan").press("Enter")
        page.wait_for_selector("#planned table")
        page.locator("#tab-deploy").press("Enter")
        assert page.locator("img").count() == 0
    assert json.dumps(f"{script}t1_C") in (folder / "runs" / "1" / "live.toml").read_text(encoding="utf-8")
