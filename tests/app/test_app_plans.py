"""The next test and the live trial: as steps of a run, and on the page."""

import time
from pathlib import Path

import httpx
import pytest
from apppages import TOKEN, asked_of, copy_of, finished, opened

import thermocomp as tc
from thermocomp.app.runfolder import runs_of
from thermocomp.live.commands.serve import serve


@pytest.fixture(scope="module")
def finished_project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return finished(tmp_path_factory.mktemp("finished") / "project")


def answers(address: str) -> bool:
    try:
        return httpx.get(f"{address}/api/state", timeout=10.0).status_code == 200
    except httpx.TransportError:
        return False


def test_the_plan_is_that_of_the_command(finished_project: Path, tmp_path: Path) -> None:
    tc.plan(finished_project / "files" / "drift.csv", "z_um", hours=6.0, curve=False, jobs=1).write(
        tmp_path / "next.ngc"
    )
    for suffix in (".ngc", ".csv"):
        written = (finished_project / "runs" / "1" / "plan" / f"next-test{suffix}").read_text(encoding="utf-8")
        assert written == (tmp_path / f"next{suffix}").read_text(encoding="utf-8").replace("next.", "next-test.")


def test_the_live_configuration_can_be_used(finished_project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert serve(finished_project / "runs" / "1" / "live.toml", check=True, port=0) == 0
    assert "z_um: shadow" in capsys.readouterr().out


def test_another_test_is_planned_on_the_page(finished_project: Path, tmp_path: Path) -> None:
    folder = copy_of(finished_project, tmp_path / "mine")
    with opened(folder) as page:
        page.locator("#tab-plan").press("Enter")
        page.wait_for_selector("#planned table")
        assert page.input_value("[name=hours]") == "6"
        page.fill("[name=hours]", "3")
        page.select_option("[name=dialect]", "fanuc")
        page.locator("#next .main").press("Enter")
        page.wait_for_selector("#planned a:has-text('next-test.nc')", timeout=240_000)
        with page.expect_download() as loaded:
            page.locator("#planned a", has_text="next-test.nc").press("Enter")
        assert "M30" in loaded.value.path().read_text(encoding="utf-8")
    assert 'dialect = "fanuc"' in (folder / "project.toml").read_text(encoding="utf-8")
    (run,) = runs_of(folder)
    steps = run.read()["steps"]
    assert ([s["name"] for s in steps][-2:], steps[-1]["files"][0]) == (["select", "plan"], "plan-2/next-test.nc")


def test_a_model_is_tried_live(finished_project: Path, tmp_path: Path) -> None:
    """In shadow, on a page of its own, which ends with a click and with the server."""
    folder = copy_of(finished_project, tmp_path / "mine")
    with opened(folder) as page:
        page.locator("#tab-deploy").press("Enter")
        addresses = []
        for _ in range(2):
            page.get_by_role("button", name="Try it live").press("Enter")
            addresses.append(page.locator("#live a[rel=noreferrer]").inner_text(timeout=120_000))
            until = time.monotonic() + 60.0
            while (state := httpx.get(f"{addresses[-1]}/api/state").json())["state"]["word"] != "shadow":
                assert time.monotonic() < until, state
                time.sleep(0.2)
            assert [(t["name"], t["correction_um"]) for t in state["targets"]] == [("z_um", 0.0)]
            if len(addresses) == 1:
                assert "reading_age = 180.0" in (folder / "runs/1/trial/live.toml").read_text(encoding="utf-8")
                page.get_by_role("button", name="End the trial").press("Enter")
                page.get_by_role("button", name="Try it live").wait_for()
                assert not answers(addresses[0])
        assert answers(addresses[1])
    until = time.monotonic() + 30.0
    while answers(addresses[1]):
        assert time.monotonic() < until, "the trial goes on without its server"
        time.sleep(0.2)


def test_a_trial_that_cannot_start_says_why(finished_project: Path, tmp_path: Path) -> None:
    folder = copy_of(finished_project, tmp_path / "mine")
    (folder / "files" / "drift.csv").unlink()

    async def work(client: httpx.AsyncClient) -> None:
        answer = await client.post(f"/{TOKEN}/api/live/1")
        assert answer.status_code == 422
        assert "drift.csv" in answer.json()["detail"]
        assert (await client.get(f"/{TOKEN}/api/live")).json() == {}
        assert (await client.delete(f"/{TOKEN}/api/live")).json() == {}
        assert (await client.post(f"/{TOKEN}/api/live/2")).status_code == 404

    asked_of(folder, work)
