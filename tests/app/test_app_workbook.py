"""A workbook with a cover sheet, and deviations whose names hold their axes, from the drop to two controllers."""

from pathlib import Path

import numpy as np
from apppages import opened
from openpyxl import Workbook
from projects import QUICK
from smallmachine import small_machine

from thermocomp.app.runfolder import runs_of

HEADINGS = {
    "t1_C": ("Lager vorn", "°C"),
    "t2_C": ("Lager hinten", "°C"),
    "t3_C": ("Halle", "°C"),
    "spindle_rpm": ("Drehzahl", "1/min"),
    "z_um": ("Verlagerung Z", "µm"),
    "x_um": ("Verlagerung X oben", "µm"),
    "lower_um": ("Verlagerung X unten", "µm"),
    "coolant": ("Kühlmittel", "°C"),
}
#: a test that is too short for its plan
SETTINGS = (
    f'{QUICK.partition("[[recordings]]")[0]}[compare]\nmodels = ["ols"]\nrobustness = false\n\n[plan]\nhours = 0.001\n'
)


def save(path: Path) -> None:
    recording = small_machine()
    columns = {str(name): cells.to_numpy() for name, cells in recording.table.items()}
    columns["lower_um"] = 0.8 * columns["x_um"] + 0.1 * np.sin(np.arange(len(recording)))
    columns["coolant"] = 20.0 + columns["z_um"] / 50.0  # computed from the deviation
    book = Workbook()
    cover = book.worksheets[0]
    cover.title = "Deckblatt"
    for row in (["Warmlaufversuch"], ["Prüfer", "K. Hartmann"], ["Drehzahl", 6000]):
        cover.append(row)
    sheet = book.create_sheet("Messdaten")
    sheet.append(["Messprotokoll", "MX500"])
    sheet.append(["Zeit", *(HEADINGS[c][0] for c in columns), "Bemerkung"])
    sheet.append(["s", *(HEADINGS[c][1] for c in columns)])
    for time, *cells in zip(recording.time.tolist(), *columns.values(), strict=True):
        sheet.append([time, *(f"{v:.3f}".replace(".", ",") for v in cells)])
    book.save(path)


def test_from_a_workbook_to_two_controllers(tmp_path: Path) -> None:
    folder, file = tmp_path / "project", tmp_path / "Warmlauf.xlsx"
    save(file)
    folder.mkdir()
    (folder / "project.toml").write_text(SETTINGS, encoding="utf-8")
    with opened(folder) as page:
        page.set_input_files("#chosen", file)
        page.wait_for_selector("#recordings canvas", timeout=120_000)
        card = page.locator("#recordings .card")
        assert "Kühlmittel_C is not used: Kühlmittel_C has the noise of" in card.locator(".warning").first.inner_text()
        page.get_by_role("button", name="use it nevertheless").press("Enter")
        page.wait_for_selector("#recordings li.trouble:has-text('Kühlmittel_C has the noise')", timeout=120_000)
        page.get_by_role("button", name="Undo the last change").press("Enter")
        page.wait_for_selector("#recordings .warning:has-text('is not used')", timeout=120_000)
        card.get_by_label("Sheet").select_option("Deckblatt")
        page.wait_for_selector("#recordings .trouble", timeout=120_000)
        assert "K. Hartmann" in card.locator("table").inner_text(), "what the sheet holds"
        assert not page.locator("#to-judge").is_visible()
        card.get_by_label("Sheet").select_option("Messdaten")
        page.wait_for_selector("#recordings canvas", timeout=120_000)
        page.locator("#to-judge").press("Enter")
        page.locator("#start").press("Enter")
        page.wait_for_selector("#verdict table", timeout=240_000)
        page.wait_for_selector("#progress:empty", state="attached", timeout=240_000)
        (run,) = runs_of(folder)
        assert ([e.split(":")[0] for e in run.errors()], run.read()["state"]) == (["plan"], "done")
        page.locator("#tab-plan").press("Enter")
        assert page.locator("#planned .trouble").inner_text() in run.errors()[0]
        page.locator("#tab-deploy").press("Enter")
        page.select_option("#to", "siemens")
        axes = {s.get_attribute("data-target"): s.input_value() for s in page.locator("#axes select").all()}
        assert axes == {"Verlagerung_Z_um": "Z", "Verlagerung_X_oben_um": "X", "Verlagerung_X_unten_um": ""}
        page.locator("#target .main").press("Enter")
        page.wait_for_selector("#package a.main", timeout=120_000)
        page.screenshot(path=tmp_path / "deploy.png")
        page.select_option("#to", "heidenhain")
        page.locator("#axes [data-target=Verlagerung_X_oben_um]").select_option("Z")
        page.locator("#target .main").press("Enter")
        page.wait_for_selector("#package .trouble", timeout=120_000)
        assert "Verlagerung_Z_um, Verlagerung_X_oben_um are all for axis Z" in page.inner_text("#package .trouble")
        page.select_option("#to", "c99")
        assert not page.locator("#axes").is_visible()
        page.locator("#target .main").press("Enter")
        page.wait_for_selector("#package h2:has-text('export-c99')", timeout=120_000)
    assert [s["name"] for s in run.read()["steps"]] == ["check", "compare", "fit", "plan", "export", "export"]
