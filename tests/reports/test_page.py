"""report.html: all in one file, read by a machine, by a reader who sees nothing, and by a browser."""

import json
import shutil
import subprocess

import numpy as np
import pandas as pd
import pytest
from lxml import html
from PIL import Image

from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.experiments.provenance import provenance
from tltlrl.reports.clauses import standings
from tltlrl.reports.page import _curves, _table, write_page
from tltlrl.reports.plotting import PANELS
from tltlrl.reports.report import Tables, summarise
from tltlrl.store.run import joined, read_results
from tltlrl.training.session import train

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
SMALL = [
    "task.steps=12", "trials=3", "algorithm.iterations=3", "seeds=2", "cases=[tltl_episodic,discrete_episodic]",
    "constants.goal_radius=9", "algorithm.calm=1",  # satisfied, so that there are calm policies, too
]  # fmt: skip
CONTENT = {
    "command": ["tltl-run", "experiment=reach_avoid", "name=a b"],
    "later_sessions": [],
    "git": {"commit": "0123456789" * 4, "dirty": True},
    "packages": {"tltlrl": "0.2.0"},
    "python": "3.11",
    "platform": "Linux",
    "cpu": {"model": "x"},
    "started": "2026-01-01",
}


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The page of four short runs, as a file."""
    folder = tmp_path_factory.mktemp("page")
    study, _ = read(compose(["experiment=reach_avoid", "name=small", *SMALL]))
    finished = {}
    for run in study.runs():
        path = folder / run.case.name / f"seed_{run.seed}"
        path.mkdir(parents=True)
        train(run, path, lambda _: None)
        finished[path] = read_results(path, run.identity())
    (folder / "curves.csv").write_text(joined([(path / "progress.csv").read_text() for path in finished]))
    Image.new("RGB", (4, 4)).save(folder / "tltl_episodic" / "workspace.png")
    curves = pd.read_csv(folder / "curves.csv")
    failures = {"tltl_step/seed_0": "ValueError: <script>alert(1)</script>"}
    write_page(
        folder, study, Tables(curves, summarise(curves, finished), standings(finished)), finished, failures,
        provenance(study, CONTENT),
    )  # fmt: skip
    return folder / "report.html"


def test_nothing_comes_from_elsewhere(page):
    root = html.parse(page).getroot()
    links = [value for name in ("src", "href") for value in root.xpath(f"//@{name}")]
    assert links
    assert all(value.startswith(("data:", "#")) for value in links)
    assert "default-src 'none'" in root.xpath("//meta[@http-equiv='Content-Security-Policy']/@content")[0]
    assert "<script>alert" not in page.read_text()  # of a message


def test_what_it_says_in_order(page):
    root = html.parse(page).getroot()
    titles = [title.text for title in root.xpath("//h2")]
    assert titles == [
        "Verdict", "Learning curves", "Clauses", "Motions", "Measures of motion", "Trials", "Statistics",
        "Configuration",
    ]  # fmt: skip
    assert root.xpath("//nav/a/@href") == [f"#{title.replace(' ', '-')}" for title in titles]
    cases = root.xpath("//*[@aria-label='measures of motion']//tbody/tr/td[1]/text()")
    assert [case.endswith(", calm") for case in cases] == [False, True, False, True]
    players = ["motion-tltl_episodic", "motion-tltl_episodic-calm", "motion-discrete_episodic"]
    assert root.xpath("//@data-motion")[:3] == players
    text = root.text_content()
    assert "tltl-run experiment=reach_avoid 'name=a b'" in text
    differs = root.xpath("//*[@aria-label='what differs from the defaults']//tbody/tr/td[1]//text()")
    assert {"name", "task.steps", "algorithm.iterations", "trials"} <= set(differs)
    assert "task.max_speed" not in differs


def test_every_picture_has_a_text_and_every_chart_its_values(page):
    root = html.parse(page).getroot()
    assert all(alt.strip() for alt in root.xpath("//img/@alt"))
    assert len(root.xpath("//img")) == len(root.xpath("//img/@alt")) == 1
    assert not root.xpath("//svg[@role='img'][not(@aria-label)]")
    assert not root.xpath("//svg[not(@role)][not(@aria-hidden)]")
    assert not root.xpath("//table[not(@aria-label)][not(ancestor::*[@role='region'][@aria-label])]")
    identifiers = root.xpath("//@id")
    assert len(identifiers) == len(set(identifiers))
    for chart in root.xpath("//svg[@data-chart]/@data-chart"):
        values = json.loads(root.get_element_by_id(chart).text)
        assert values["x"] == [0, 1, 2]
        assert all(len(y) == 3 for _, y in values["lines"])
    for player in root.xpath("//*[@data-motion]/@data-motion"):
        values = json.loads(root.get_element_by_id(player).text)
        assert len(values["times"]) == len(values["paths"][0]) == len(values["robot"]) == 12
        assert [len(clause) for clause in values["clauses"]] == [12, 12]
    names = root.xpath("//text[@class='name']")
    assert {name.text for name in names} == {"at_goal"}
    assert not any(name.xpath("following-sibling::polyline") for name in names)  # over the path, so that it can be read


def test_curves_of_300_runs_are_small_and_gaps_stay_gaps():
    rng = np.random.default_rng(0)
    rows = [
        {"case": f"case_{seed % 3}", "seed": seed, "iteration": np.arange(200), **dict.fromkeys(PANELS, y)}
        for seed in range(300)
        for y in [rng.standard_normal(200)]
    ]  # fmt: skip
    curves = pd.concat(map(pd.DataFrame, rows))
    curves.loc[curves["iteration"].between(50, 100), "robustness_policy"] = -np.inf
    text = _curves(curves)
    assert len(text) < 5e6
    assert "inf" not in text.lower()
    assert "nan" not in text.lower()


def test_a_reason_is_no_number():
    cells = html.fromstring(_table(["", "", "", ""], [["1 of 2 (3 %)", "-0.5", "never", "7: `a < b` at step 3"]], "x"))
    assert cells.xpath("//td[not(@class)]/text()") == ["7: `a < b` at step 3"]


def test_what_differs_is_also_known_of_an_environment_of_others(tmp_path):
    spec = tmp_path / "caught.tltl"
    spec.write_text("signal reward\nspec: F reward > 0.5\n")
    study, _ = read(compose(["task=suite", "task.id=ball_in_cup-catch", f"spec={spec}", "task.steps=6"]))
    known = provenance(study, CONTENT)
    assert {key for key, value in known.settings.items() if known.defaults[key] != value} == {"task.steps"}


NO_BROWSER = "no Chromium to look at the page with (Debian: apt-get install chromium)"
NARROW = """<script>document.documentElement.style.width = "390px";
document.title = document.body.scrollWidth + " of " + document.body.clientWidth;</script>"""


def look(page, folder, *flags):
    """What Chromium says of a page, after its scripts."""
    assert BROWSER is not None
    own = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'profile'}"]
    return subprocess.run(
        [BROWSER, *own, *flags, page.as_uri()], capture_output=True, text=True, timeout=120, check=False
    )


@pytest.mark.skipif(BROWSER is None, reason=NO_BROWSER)
def test_in_print_what_is_folded_on_the_screen_is_open(page, tmp_path):
    shown = look(page, tmp_path, f"--print-to-pdf={tmp_path / 'page.pdf'}")
    assert (tmp_path / "page.pdf").read_bytes().count(b"/Subtype /Image") == 1, shown.stderr


@pytest.mark.skipif(BROWSER is None, reason=NO_BROWSER)
def test_a_browser_shows_it_and_its_script_runs(page, tmp_path):
    picture, narrow = tmp_path / "page.png", tmp_path / "narrow.html"
    narrow.write_text(page.read_text() + NARROW)
    shown = look(narrow, tmp_path, "--window-size=420,2400", f"--screenshot={picture}", "--dump-dom")
    assert picture.exists(), shown.stderr
    assert len(Image.open(picture).convert("L").getcolors()) > 20
    root = html.fromstring(shown.stdout)
    assert root.xpath("//title/text()") == ["390 of 390"]  # nothing is wider than a phone
    assert root.xpath("//input/@aria-valuetext") == ["0.55 s", "0.55 s"]  # the script set it
    assert all(root.xpath("//*[contains(@class, 'robot')]/@points"))
