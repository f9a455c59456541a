import re
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser

import numpy as np
import pytest

from mpucal.data import Recording, Sensor
from mpucal.export.c_code import c_functions
from mpucal.export.python import python_functions
from mpucal.export.ros import ros_node
from mpucal.report import render
from mpucal.result.calibration import Calibration

VOID = {"meta", "br", "link", "img", "hr", "input"}


class Page(HTMLParser):
    """The page's elements as (path, attributes, text), and the proof that its tags match."""

    def __init__(self, html):
        super().__init__()
        self.open, self.elements, self.tables, self.texts = [], [], {}, {}
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.elements.append((tag, attributes))
        if tag in VOID:
            return
        self.open.append((tag, attributes.get("id")))
        if tag == "table":
            self.tables[attributes["id"]] = []
        elif tag == "tr":
            self._table().append([])
        elif tag in ("td", "th"):
            self._table()[-1].append("")

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop()[0] == tag

    def handle_data(self, data):
        if self.open and self.open[-1][0] in ("td", "th"):
            self._table()[-1][-1] += data
        for _, id_ in self.open:
            if id_:
                self.texts[id_] = self.texts.get(id_, "") + data

    def _table(self):
        return self.tables[next(id_ for tag, id_ in reversed(self.open) if tag == "table")]


@pytest.fixture
def calibration():
    random = np.random.default_rng(3)
    return Calibration(
        D=np.eye(3) + 0.05 * random.normal(size=(3, 3)),
        b_a=np.array([0.3, -0.2, 1.1]),
        D_std=np.abs(random.normal(size=(3, 3))) * 1e-3,
        b_a_std=np.array([0.0021, 0.00033, 0.012]),
        noise_std=np.array([0.03, 0.04, 0.05]),
        fit={"model": "accel", "why": "it turned in place", "gravity": 9.82, "samples": 12000, "nis": 3.01},
        quality={
            "verdict": "usable",
            "reasons": [
                {"code": "few_orientations", "message": "only 5 orientations were seen: show it more sides."},
                {"code": "gyro_clipped", "message": "18 samples clipped: turn it more slowly."},
            ],
            "magnitude_before": {"median": 10.123456, "mean": 10.2, "std": 0.5},
            "magnitude_after": {"median": 9.820001, "mean": 9.83, "std": 0.04},
        },
        sensor=Sensor("MPU-6050", 0x68, 4.0, 500.0, 199.4, 31.2),
        created="2024-05-17T09:30:00+00:00",
    )


@pytest.fixture
def recording(calibration):
    random = np.random.default_rng(4)
    s = random.normal(size=(5000, 3))
    s *= 9.82 / np.linalg.norm(s, axis=1, keepdims=True)
    acc = s @ calibration.D.T + calibration.b_a
    acc[2500] = (60.0, 0.0, 0.0)
    return Recording.from_arrays(np.arange(5000) / 200, acc, np.zeros((5000, 3)), name="capture.mcap")


def test_says_the_verdict_and_every_reason_in_its_own_words(calibration):
    page = Page(render(calibration))
    assert page.texts["verdict"].startswith("Usable")
    for reason in calibration.quality["reasons"]:
        assert reason["message"] in page.texts["reasons"]
    assert ("p", {"class": "verdict usable", "id": "verdict"}) in page.elements


@pytest.mark.parametrize("applied", [[0, 0, 0], [0.25, -0.1, 1.0]], ids=["nothing applied", "applied in hardware"])
def test_the_formula_computes_what_the_calibration_does(calibration, applied):
    calibration = replace(calibration, applied_in_hardware=np.array(applied, float))
    text = Page(render(calibration)).texts["formula"]
    y = dict(zip(("y_x", "y_y", "y_z"), (0.5, -3.0, 9.0), strict=True))
    a = []
    for line, axis in zip(text.splitlines(), "xyz", strict=True):
        name, expression = line.split(" = ")
        assert name == f"a_{axis}"
        assert re.fullmatch(r"[-+*(). \d_xyz]+", expression)
        a.append(eval(expression, {"__builtins__": {}}, y))
    np.testing.assert_allclose(a, calibration.apply(list(y.values())), atol=2e-5)


def test_shows_the_sensor_and_the_settings(calibration, recording):
    rows = dict(Page(render(calibration, recording)).tables["settings"])
    assert rows["chip"] == "MPU-6050"
    assert rows["WHO_AM_I"] == "0x68"
    assert rows["accelerometer range"] == "±4 g"
    assert rows["gyroscope range"] == "±500 deg/s"
    assert rows["sample rate"] == "199.4 Hz"
    assert rows["model"] == "accel"
    assert rows["why this model"] == "it turned in place"
    assert rows["gravity"] == "9.82 m/s²"
    assert rows["recording"] == "capture.mcap"
    assert rows["made"] == "2024-05-17T09:30:00+00:00"


def test_what_is_unknown_is_called_so():
    page = Page(render(Calibration(np.full((3, 3), np.nan), np.full(3, np.nan))))
    assert page.texts["verdict"].startswith("Refused")
    assert page.tables["parameters"][1][1] == "unknown"
    assert page.tables["settings"] == []
    assert "cannot be inverted" in page.texts["formula"]


def test_says_that_the_recording_was_cut_short(calibration, recording):
    sentence = "capture.mcap was never closed: its 7 records are whole."
    assert sentence in render(calibration, replace(recording, recovered=sentence))


def test_there_is_no_picture_of_a_gain_that_cannot_be_inverted(calibration, recording):
    page = Page(render(replace(calibration, D=np.ones((3, 3))), recording))
    assert "svg" not in [tag for tag, _ in page.elements]


def test_everything_that_comes_from_outside_is_escaped(calibration, recording):
    evil = "<script>alert(1)</script>\"'&\u202e\x1b"
    page = render(
        replace(
            calibration,
            sensor=Sensor(chip=evil),
            created=evil,
            fit={"model": evil, "why": evil},
            quality={"verdict": evil, "reasons": [{"code": evil, "message": evil}]},
        ),
        replace(recording, name=evil),
    )
    assert "<script" not in page
    parsed = Page(page)
    shown = "<script>alert(1)</script>\"'&\\u202e\\x1b"
    assert shown in parsed.texts["reasons"]
    assert dict(parsed.tables["settings"])["chip"] == shown


def test_needs_no_network_and_no_script(calibration, recording):
    html = render(calibration, recording)
    for tag, attributes in Page(html).elements:
        assert tag not in ("script", "link", "iframe", "img", "object")
        for name, value in attributes.items():
            assert not name.startswith("on")
            if name in ("src", "href", "xlink:href"):
                assert value.startswith("#")
    assert "@import" not in html
    assert not re.search(r"url\((?!#)", html)
    assert "prefers-color-scheme: dark" in html


def test_the_picture_takes_its_colours_from_the_page(calibration, recording):
    html = render(calibration, recording)
    svg = html[html.index("<svg") : html.index("</svg>")]
    assert "var(--before)" in svg
    assert "var(--after)" in svg
    assert not re.search(r"(fill|stroke): #", svg)
    assert html == render(calibration, recording), "the same result gives the same page"


def test_the_picture_keeps_a_single_spike(calibration, recording):
    html = render(calibration, recording)
    html = html[html.index('id="magnitude-over-time"') :]
    path = re.search(r'<path d="([^"]*)"[^>]*stroke: var\(--before\)', html).group(1)
    heights = np.sort([float(y) for y in re.findall(r"[ML]\S+ ([^ML]+)", path)])  # SVG counts downwards
    assert len(heights) < len(recording) / 4
    assert heights[-1] - heights[1] < 0.3 * (heights[1] - heights[0])


def test_says_whose_calibration_it_is_of_when(calibration):
    page = render(replace(calibration, extra={"name": "left wing"}))
    assert "<h1>Calibration of left wing</h1>" in page
    assert "MPU-6050, 17 May 2024, 09:30 UTC" in page


@pytest.mark.parametrize(
    ("verdict", "extra", "command"),
    [
        ("good", {}, "mpucal export calibration.json --to c-header"),
        ("good", {"autopilot": {"firmware": "px4"}}, "mpucal write calibration.json autopilot --mavlink URL"),
        ("refused", {}, "mpucal session"),
    ],
)
def test_the_command_for_what_comes_next_follows_the_verdict(calibration, verdict, extra, command):
    page = render(replace(calibration, quality={"verdict": verdict}, extra=extra))
    top = page[page.index('id="verdict"') : page.index("<h2>")]
    assert f"<code>{command}</code>" in top


@pytest.mark.parametrize("verdict", ["good", "usable", "refused"])
def test_says_what_to_do_now(calibration, verdict):
    page = render(replace(calibration, quality={"verdict": verdict}))
    assert ("mpucal write" in page, "repeat the session" in page) == (verdict != "refused", verdict != "good")


def test_the_page_shows_them(result):
    for name, text in (("c", c_functions), ("python", python_functions), ("ros", ros_node)):
        shown = re.search(rf'<pre id="{name}"[^>]*>(.*?)</pre>', result.html, re.DOTALL)[1]
        assert unescape(shown) == text(result.calibration)
