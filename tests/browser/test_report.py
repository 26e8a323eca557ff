"""The script of the report pages: values under the pointer, zoom, hidden curves; and what a phone and a printer get."""

import json
import math
import os
import subprocess
from pathlib import Path

import pytest
from playwright.sync_api import expect

COMMAND = os.environ.get("DAMPRIG_COMMAND")
HOST = Path(__file__).parents[2] / "host"

pytestmark = pytest.mark.skipif(not COMMAND, reason="needs DAMPRIG_COMMAND")


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The report of the shipped short campaign."""
    folder = tmp_path_factory.mktemp("report")
    subprocess.run([COMMAND, "run", HOST / "campaigns/short.toml", "--out", "run"], cwd=folder, check=True, capture_output=True)
    return f"file://{folder}/run/report.html"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The page of a shipped study with curves."""
    folder = tmp_path_factory.mktemp("study")
    subprocess.run([COMMAND, "study", "run", HOST / "studies/single-particle.toml", "--out", "study"], cwd=folder, check=True,
                   capture_output=True)
    return f"file://{folder}/study/study.html"


def curves(drawing):
    """Names and points of the curves of a drawing."""
    groups = drawing.locator("[data-curve]").all()
    return {group.get_attribute("data-label"): json.loads(group.get_attribute("data-points")) for group in groups}


def place(drawing, x):
    """Where an abscissa is on the screen, in the middle of the frame's height."""
    axes = json.loads(drawing.locator("[data-axes]").first.get_attribute("data-axes"))
    left, top, right, bottom = axes["bounds"]
    box = drawing.bounding_box()
    scale = box["width"] / float(drawing.get_attribute("viewBox").split()[2])
    share = (x - axes["x"]["from"]) / (axes["x"]["to"] - axes["x"]["from"])
    return box["x"] + scale * (left + share * (right - left)), box["y"] + scale * (top + bottom) / 2


def labels(drawing):
    """Labels of the ticks of both axes."""
    return [text.strip() for text in drawing.locator("[data-ticks] text").all_text_contents()]


def shown(value):
    """A number as the page has it, with four significant digits."""
    return f"{float(f'{value:.3e}'):g}"


def drag(page, drawing, from_x, to_x):
    page.mouse.move(*place(drawing, from_x))
    page.mouse.down()
    page.mouse.move(*place(drawing, to_x), steps=5)
    page.mouse.up()


@pytest.mark.parametrize("which", ["report", "study"])
def test_the_pointer_reads_the_nearest_points(which, request, open_page):
    page = open_page(request.getfixturevalue(which))
    drawing = page.locator("svg.interactive:visible").first
    drawing.scroll_into_view_if_needed()
    own = curves(drawing)
    abscissae = sorted({point[0] for points in own.values() for point in points})
    for x in (abscissae[0], abscissae[-1]):
        page.mouse.move(*place(drawing, x))
        readout = drawing.locator("xpath=following-sibling::p[1]")
        for name, points in own.items():
            value = next(point[1] for point in points if point[0] == x)
            expect(readout).to_contain_text(f"{name}: {shown(value)}")
    assert drawing.locator(".cursor circle").count() == len(own)
    page.mouse.move(1, 1)
    expect(drawing.locator(".cursor circle")).to_have_count(0)


def test_dragging_zooms_and_the_whole_range_comes_back(study, open_page):
    page = open_page(study)
    drawing = page.locator("svg.interactive:visible").first
    drawing.scroll_into_view_if_needed()
    places = "e => [...e.querySelectorAll('[data-curve] polyline')].flatMap((line) => line.getAttribute('points').split(/[ ,]/).map(Number))"
    before, whole = drawing.evaluate(places), labels(drawing)
    drag(page, drawing, 2.25, 2.65)
    button = page.get_by_role("button", name="Whole range").first
    expect(button).to_be_visible()
    numbers = [float(text.replace("−", "-")) for text in labels(drawing)]
    assert labels(drawing) != whole and len(numbers) >= 6
    # The axis is the dragged part, to a pixel.
    across = [n for n in numbers if 2.2 < n < 2.7]
    assert len(across) >= 3 and min(across) >= 2.245 and max(across) <= 2.655, numbers
    zoomed = drawing.evaluate(places)
    assert all(map(math.isfinite, zoomed)) and max(abs(a - b) for a, b in zip(before, zoomed)) > 50
    button.click()
    expect(button).to_be_hidden()
    assert labels(drawing) == whole
    # What was drawn is drawn again, to the tenth of a point.
    assert max(abs(a - b) for a, b in zip(before, drawing.evaluate(places))) < 0.11


def test_a_click_in_the_legend_hides_a_curve_and_fits_the_axis_to_the_rest(report, open_page):
    page = open_page(report)
    drawing = page.locator("svg.interactive:visible").first
    drawing.scroll_into_view_if_needed()
    whole = labels(drawing)
    entry = drawing.locator("[data-legend]").first
    entry.locator("text").first.click()
    expect(entry).to_have_attribute("aria-pressed", "false")
    expect(drawing.locator("[data-curve]").first).to_be_hidden()
    expect(drawing.locator("[data-curve]").nth(1)).to_be_visible()
    assert labels(drawing) != whole and len(labels(drawing)) >= 6
    entry.focus()
    page.keyboard.press("Enter")
    expect(drawing.locator("[data-curve]").first).to_be_visible()
    assert labels(drawing) == whole


def test_without_scripts_the_figures_are_whole(report, open_page):
    page = open_page(report, java_script_enabled=False)
    expect(page.locator("figure svg [data-curve]:visible").first).to_be_visible()
    expect(page.locator(".readout")).to_have_count(0)


@pytest.mark.parametrize("which", ["report", "study"])
def test_figures_fit_a_phone_with_letters_that_can_be_read(which, request, open_page):
    page = open_page(request.getfixturevalue(which), viewport={"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    drawings = page.locator("svg.interactive:visible").all()
    assert len(drawings) >= 2
    for drawing in drawings:
        box = drawing.bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= 390, box
        heights = drawing.evaluate("e => [...e.querySelectorAll('text')].map((t) => t.getBoundingClientRect().width > 0"
                                   " && parseFloat(t.getAttribute('font-size')) * e.getBoundingClientRect().width / e.viewBox.baseVal.width)")
        # 8 px, which a phone shows with 2 to 3 dots each.
        assert min(heights) >= 8, heights


def test_print_has_wall_forces_and_sketches_and_no_controls(report, open_page):
    page = open_page(report)
    page.emulate_media(media="print")
    for caption in ("Amplitude ratio X/Z", "Largest force on a wall"):
        expect(page.locator("figure", has_text=caption).first.locator("svg:visible").first).to_be_visible()
    expect(page.locator(".sketches svg:visible")).to_have_count(2)
    assert page.locator(".readout:visible, .whole:visible").count() == 0
