"""What the page shows, against the stand-in server."""

import re

from playwright.sync_api import expect

from rig import Rig
from stand_in import HOST, PAGE, files
from waiting import await_change, picture, ready

def test_the_page_is_small_and_complete():
    served = files()
    assert sum(file.stat().st_size for file in served.values()) < 300 * 1024
    markup = (PAGE / "index.html").read_text()
    wanted = re.findall(r'(?:src|href)="(/[^"]*)"', markup)
    for file in PAGE.glob("*.js"):
        if file.name != "uplot.js":
            wanted += ["/" + name for name in re.findall(r'from "\./([^"]+)"', file.read_text())]
    assert [name for name in wanted if name not in served] == []
    assert not re.search(r"<script>|<style|\sstyle=|\son\w+=", markup)
    assert (PAGE / "uplot.LICENSE").read_text().startswith("The MIT License")


def test_a_late_viewer_sees_the_history(still, open_page):
    still.warm_up(18)
    page = ready(open_page(still.address))
    expect(page.locator("#name")).to_have_text("hybrid")
    expect(page.locator("#badge")).to_have_text("Running")
    expect(page.locator("#headline")).to_have_text("Set-up bare, 2.25 Hz")
    expect(page.locator("#advice")).to_have_text("Z = 1.2 mm, set-up bare")
    expect(page.locator("#n-frequency")).to_have_text("2.250")
    expect(page.locator("#response-legend")).to_contain_text("bare5 points")
    expect(page.locator("#points")).to_have_text("5 of 63 points · 232 s to 464 s left")
    expect(page.locator("#log")).to_contain_text("Set-up bare: the sweep begins.")
    # The curve reaches over the whole window: there is ink in its left half.
    ink = page.evaluate("""() => {
      const canvas = document.querySelector('#plot-x canvas');
      const { data } = canvas.getContext('2d').getImageData(90, 20, canvas.width / 3, canvas.height - 60);
      let dark = 0;
      for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200 && data[i] < 40) dark += 1;
      return dark;
    }""")
    assert ink > 300, ink


def test_curves_move_and_points_appear_one_by_one(live, open_page):
    page = ready(open_page(live.address))
    before = {plot: picture(page, plot) for plot in ("plot-x", "plot-z", "plot-phase", "plot-response")}
    for plot, old in before.items():
        await_change(page, plot, old)
    for number in range(1, 4):
        live.frame(points=[{"set_up": "bare", "experiment": "step", "frequency_hz": 2 + number / 10, "x_over_z": 3.0 * number,
                            "steadiness": "steady"}])
        expect(page.locator("#response-legend")).to_contain_text(f"bare · step{number} point")
    # A point that comes again replaces the earlier one.
    live.frame(points=[{"set_up": "bare", "experiment": "step", "frequency_hz": 2.3, "x_over_z": 8.0, "steadiness": "not steady"}])
    live.frame(log=[{"at": "15:00:00", "level": "info", "text": "after the points"}])
    expect(page.locator("#log")).to_contain_text("after the points")
    expect(page.locator("#response-legend")).to_contain_text("bare · step3 points")


def test_a_fault_is_unmissable_and_goes_again(still, open_page):
    page = ready(open_page(still.address))
    calm = page.locator("#badge").evaluate("e => getComputedStyle(e).backgroundColor")
    still.state = {"activity": "faulted", "headline": "Faulted.", "alarms": ["Impacts are missing: 12 predicted, 3 measured."],
                   "fault": {"what": "The emergency stop was pressed.", "advice": "Release it, then clear the fault."}}
    still.frame(log=[{"at": "14:10:00", "level": "fault", "text": "The emergency stop was pressed."}])
    expect(page.locator("#badge")).to_have_text("Fault")
    expect(page.locator("#headline")).to_have_text("The emergency stop was pressed.")
    expect(page.locator("#advice")).to_have_text("Release it, then clear the fault.")
    expect(page.get_by_role("alert")).to_contain_text("The emergency stop was pressed.")
    expect(page.locator("#alarms")).to_contain_text("12 predicted, 3 measured")
    strip = page.locator("#strip")
    assert strip.evaluate("e => getComputedStyle(e).backgroundColor") not in (calm, "rgb(255, 255, 255)")
    page.evaluate("scrollTo(0, 2000)")
    expect(strip).to_be_in_viewport()
    still.state = {}
    still.frame()
    expect(page.locator("#badge")).to_have_text("Running")
    expect(page.get_by_role("alert")).to_have_text("")


def test_every_state_has_words(still, open_page):
    page = ready(open_page(still.address))
    words = {"held": "Held", "paused": "Paused", "waiting": "Waiting", "stopping": "Stopping", "idle": "Idle", "lost": "Link lost",
             "over": "Ended", "replay": "Replay", "something new": "Unknown"}
    for activity, word in words.items():
        still.frame(state=still.rig.state() | {"activity": activity, "headline": f"About {activity}"})
        expect(page.locator("#badge")).to_have_text(word)
        expect(page.locator("#headline")).to_have_text(f"About {activity}")


def test_unknown_numbers_are_dashes(still, open_page):
    page = ready(open_page(still.address))
    state = still.rig.state()
    state["numbers"] = dict.fromkeys(state["numbers"])
    state["limits"] = state["link"] = None
    still.frame(state=state)
    for name in ("frequency", "ratio", "x", "z", "phase", "impacts", "residual"):
        expect(page.locator(f"#n-{name}")).to_have_text("–")


def test_old_numbers_are_dimmed_with_their_age(still, open_page):
    page = ready(open_page(still.address))
    expect(page.locator("body")).not_to_have_class("stale")
    for age_s, words in ((1.2, "Newest sample 1 s old"), (75, "Newest sample 1 min 15 s old")):
        still.state = {"age_s": age_s}
        still.frame()
        expect(page.locator("body")).to_have_class("stale")
        expect(page.locator("#age")).to_have_text(re.compile(words[:-5]))
        opacity = "getComputedStyle(document.querySelector('{}')).opacity"
        assert float(page.evaluate(opacity.format("#numbers"))) < 0.6 and float(page.evaluate(opacity.format(".panels"))) < 0.6
    still.state = {}
    still.frame()
    expect(page.locator("#age")).to_be_hidden()
    # A server that says nothing more is no reason to show old numbers as new ones.
    expect(page.locator("#age")).to_have_text(re.compile("Newest sample [1-9] s old"))
    assert page.evaluate("seen.shift") < 0.001, page.evaluate("seen.shifts")


def test_a_replay_is_not_running(still, open_page):
    still.about = {"source": {"kind": "replay", "name": "hybrid"}, "is_replay": True, "can_control": False}
    still.state = {"activity": "replay", "headline": "Paused: set-up bare", "left": None, "age_s": 7.5,
                   "replay": {"t_s": 3, "end_s": 40, "speed": 1, "paused": True}}
    page = ready(open_page(still.address))
    expect(page.locator("#badge")).to_have_text("Replay")
    # In a gap of the record nothing is shown as measured; its age is that of the record.
    expect(page.locator("#age")).to_have_text("Nothing recorded for 7 s")
    page.wait_for_timeout(1500)
    expect(page.locator("#age")).to_have_text("Nothing recorded for 7 s")


def test_panels_without_data_fold_and_late_ones_open_behind(still, open_page):
    still.rig.set_ups, still.kept["impacts"] = ["bare"], []
    state = still.rig.state()
    none = {name: None for name in state["numbers"] if name.startswith(("wall", "spring", "twin", "impacts"))}
    still.state = {"numbers": state["numbers"] | none, "limits": {}}
    still.about = {"signals": [{"name": "x", "unit": "m"}, {"name": "z", "unit": "m"}], "slow": {"t_s": [], "values": {}}}
    page = ready(open_page(still.address))
    for name in ("impacts", "twin", "spring", "transients"):
        expect(page.locator(f"#panel-{name}")).to_be_hidden()
    before = page.locator("#panel-log").bounding_box()
    still.state = {}
    still.frame(transients=[{"set_up": "bare", "experiment": "pull", "text": "peak |x| 12.3 mm at 4.21 s"}])
    for name in ("impacts", "twin", "spring", "transients"):
        expect(page.locator(f"#panel-{name}")).to_be_visible()
    expect(page.locator("#transients")).to_contain_text("peak |x| 12.3 mm")
    assert page.locator("#panel-log").bounding_box() == before
    assert page.evaluate("seen.shift") < 0.001, page.evaluate("seen.shifts")


def test_nothing_moves_while_data_arrive(live, open_page):
    page = ready(open_page(live.address, token=live.token))
    live.await_viewers(1)
    for text in ("short", "a much longer entry of the log, " * 12):
        live.frame(log=[{"at": "14:03:08", "level": "warning", "text": text}])
        page.wait_for_timeout(300)
    for state in ({"headline": "Running: set-up with a rather long name of some sixty characters, 12.345 Hz, held by hand"},
                  {"activity": "faulted", "fault": {"what": "A long fault. " * 20, "advice": "A long advice. " * 20}},
                  {"alarms": [f"Alarm number {n}" for n in range(9)]}, {"injected": ["sensor x is unplugged"]},
                  {"points_taken": 126000, "points_planned": 999999, "left": {"text": "10 days 20 h to 40 days left"}, "speed": 12.5}, {}):
        live.state = state
        page.wait_for_timeout(400)
    assert page.evaluate("seen.shift") < 0.001, page.evaluate("seen.shifts")


def test_a_phone_has_one_column_without_overflow(still, open_page):
    still.state = {"alarms": ["A" * 300], "fault": {"what": "F" * 300, "advice": "x " * 300}}
    still.about = {"source": {"kind": "run", "name": "n" * 200, "rig": "r" * 200, "folder": "f" * 300}, "is_replay": True}
    page = ready(open_page(still.address, token=still.token, viewport={"width": 360, "height": 740}))
    width = page.evaluate("Math.max(document.documentElement.scrollWidth, document.body.scrollWidth)")
    assert width == 360
    panels = page.locator(".panel:visible")
    boxes = [panels.nth(i).bounding_box() for i in range(panels.count())]
    assert len(boxes) >= 8 and all(box["width"] > 330 and box["x"] < 15 for box in boxes)
    wide = page.evaluate("""[...document.querySelectorAll('main *, .dock *')].filter((e) => e.offsetParent !== null
      && e.getBoundingClientRect().right > innerWidth + 0.5 && !e.closest('.plot')).map((e) => e.outerHTML.slice(0, 80))""")
    assert wide == []


def test_light_and_dark_follow_the_system_until_the_reader_chooses(still, open_page):
    page = ready(open_page(still.address, color_scheme="dark"))
    background = "getComputedStyle(document.body).backgroundColor"
    assert page.evaluate(background) == "rgb(21, 23, 26)"
    before = picture(page, "plot-response")
    page.get_by_role("button", name="light and dark").click()
    assert page.evaluate(background) == "rgb(253, 253, 252)"
    await_change(page, "plot-response", before)
    page.reload()
    ready(page)
    assert page.evaluate(background) == "rgb(253, 253, 252)"


def test_a_faster_stream_says_that_it_shows_extremes(still, open_page):
    page = ready(open_page(still.address))
    expect(page.locator("#histories-note")).not_to_contain_text("real time")
    still.state = {"speed": 20.0}
    still.frame(50)
    expect(page.locator("#histories-note")).to_contain_text("20× real time: extremes")


def test_a_restart_forgets_the_earlier_time(still, open_page):
    page = ready(open_page(still.address))
    still.rig = Rig()
    still.frame(1000, restart=True)
    before = picture(page, "plot-x")
    still.frame(1000)
    await_change(page, "plot-x", before)
    expect(page.locator("#rig-time")).to_contain_text("rig time 2 s")
    # The window of 5 s ends at the newest sample, so ticks before 0 show that nothing older is left.
    newest = page.evaluate("""async () => { const { Ring, append } = await import('/ring.js');
      const ring = new Ring(8, ['x']); append(ring, { t_s: [5, 6], values: { x: [1, 2] } });
      append(ring, { t_s: [5.5], values: { x: [3] } }); return [ring.length, ring.last, ring.newest('x')]; }""")
    assert newest == [2, 5.5, 3]


def test_extremes_and_gaps_survive_decimation(still, open_page):
    page = ready(open_page(still.address))
    result = page.evaluate("""async () => {
      const { Ring, append } = await import('/ring.js');
      const { extremes } = await import('/decimate.js');
      const ring = new Ring(50000, ['x']);
      const t = [], x = [];
      for (let i = 0; i < 120000; i += 1) { t.push(i / 1000); x.push(Math.sin(i / 777)); }
      x[90017] = 40; x[100503] = -50; x[110000] = null;
      for (let i = 0; i < t.length; i += 1000) append(ring, { t_s: t.slice(i, i + 1000), values: { x: x.slice(i, i + 1000) } });
      const far = extremes(ring, ['x'], 75, 120, 700);
      const near = extremes(ring, ['x'], 109.9, 110.1, 700);
      const known = far.series[0].filter((v) => v !== null);
      return { kept: ring.length, count: far.t.length, high: Math.max(...known), low: Math.min(...known),
        rising: far.t.every((v, i) => i === 0 || v > far.t[i - 1]), gaps: far.series[0].filter((v) => v === null).length,
        nearGaps: near.series[0].filter((v) => v === null).length, per: [far.perColumn, near.perColumn] };
    }""")
    assert 50_000 <= result["kept"] <= 100_000
    assert result["count"] <= 1405
    assert (result["high"], result["low"]) == (40, -50)
    assert result["rising"] and result["gaps"] == 1 and result["nearGaps"] == 1
    assert result["per"] == [64, 1]


def test_ticks_and_colours_are_those_of_the_report(still, open_page):
    page = ready(open_page(still.address))
    ticks = page.evaluate("""async () => {
      const { around, linearTicks, linearLabels, logTicks, logLabels } = await import('/axis.js');
      return { log: logTicks(0.9, 110).major, linear: linearLabels(linearTicks(...around([2, 3]))), half: logLabels([0.5]),
        empty: around([], true), minus: linearLabels([-10, 0, 10]),
        short: logLabels(logTicks(1.1, 1.9).major), small: linearLabels(linearTicks(0.9, 2.9, 2)) };
    }""")
    # The examples of the tests in plot/axis.rs.
    assert ticks["log"] == [1, 2, 5, 10, 20, 50, 100]
    assert ticks["linear"] == ["2.0", "2.2", "2.4", "2.6", "2.8", "3.0"]
    assert ticks["half"] == ["0.5"] and ticks["empty"] == [0.5, 2] and ticks["minus"] == ["−10", "0", "10"]
    # Three labels or more, on a logarithmic axis of less than a decade and on a small plot too.
    assert ticks["short"] == ["1.2", "1.4", "1.6", "1.8"] and ticks["small"] == ["1.0", "1.5", "2.0", "2.5"]
    source = (HOST / "report/plot/palette.rs").read_text()
    table = re.findall(r"\(0x(..), 0x(..), 0x(..)\),", source.split("const ALL")[1].split("];")[0])
    curves = page.evaluate("""[...Array(12).keys()].map((i) =>
      getComputedStyle(document.documentElement).getPropertyValue(`--curve-${i}`).trim())""")
    assert curves == ["#" + "".join(colour) for colour in table]


def test_zoom_pause_and_windows(live, open_page):
    page = ready(open_page(live.address))
    # Pause: the plots stand still, the numbers go on.
    page.keyboard.press("Space")
    expect(page.locator("#pause")).to_have_attribute("aria-pressed", "true")
    expect(page.locator("#histories-note")).to_contain_text("paused")
    page.wait_for_timeout(200)
    before, rig_time = picture(page, "plot-x"), page.locator("#rig-time").text_content()
    expect(page.locator("#rig-time")).not_to_have_text(rig_time)
    assert picture(page, "plot-x") == before
    page.keyboard.press("Space")
    await_change(page, "plot-x", before)
    # Zoom by keys, then reset.
    page.locator("#histories").focus()
    page.keyboard.press("+")
    expect(page.locator("#histories-note")).to_contain_text("Zoomed")
    page.keyboard.press("Escape")
    expect(page.locator("#pause")).to_have_attribute("aria-pressed", "false")
    # Zoom by drag.
    box = page.locator("#plot-x .u-over").bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 50)
    page.mouse.down()
    page.mouse.move(box["x"] + 300, box["y"] + 50, steps=4)
    page.mouse.up()
    expect(page.locator("#histories-note")).to_contain_text("Zoomed")
    page.get_by_role("button", name="Reset").click()
    page.get_by_role("button", name="20 s").click()
    expect(page.get_by_role("button", name="20 s")).to_have_attribute("aria-pressed", "true")


def test_a_folder_and_a_bare_rig_need_no_campaign(still, open_page):
    state = {"activity": "idle", "headline": "The rig is idle.", "numbers": {"frequency_hz": None}, "link": {"name": "serial:x"}}
    still.about = {"source": {"kind": "rig", "name": "serial:/dev/ttyACM0", "rig": None, "board": "nucleo-g474re", "folder": None},
                   "curves": [], "points": [], "rows": {"t_s": [], "values": {}}, "slow": {"t_s": [], "values": {}}, "state": state}
    page = ready(open_page(still.address))
    expect(page.locator("#badge")).to_have_text("Idle")
    expect(page.locator("#progress")).to_be_hidden()
    expect(page.locator("#where")).to_have_text("rig · board nucleo-g474re")
    assert page.evaluate("seen.shift") < 0.001, page.evaluate("seen.shifts")


SHEET = {"set_up": "hybrid", "experiment": "sheets at 3 mm", "draws": "sheet", "predicted": [[2.2, 4e-4], [2.5, 1e-4], [2.8, 5e-4]]}
BACKBONE = {"set_up": "hybrid", "experiment": "backbone", "draws": "backbone", "is_in_order": True, "predicted": [[1e-3, 2.6], [6e-3, 2.5]]}


def test_kept_responses_and_backbones_grow_in_panels_of_their_own(still, open_page):
    still.about = {"curves": [SHEET, BACKBONE], "points": []}
    page = ready(open_page(still.address))
    expect(page.locator("#panel-response")).to_be_hidden()
    for panel, experiment in (("sheets", SHEET["experiment"]), ("backbone", BACKBONE["experiment"])):
        expect(page.locator(f"#{panel}-legend")).to_contain_text("hybrid predicted".replace(" ", ""))
        before = picture(page, f"plot-{panel}")
        for index in range(3):
            still.frame(points=[{"set_up": "hybrid", "experiment": experiment, "index": index, "frequency_hz": 2.5, "x_over_z": 7.5,
                                 "x_amplitude_m": 3e-3 + 1e-3 * index, "z_amplitude_m": 4e-4, "phase_rad": -1.57, "steadiness": "steady"}])
        # Three points at one frequency: none replaces another.
        expect(page.locator(f"#{panel}-legend")).to_contain_text("3 points")
        await_change(page, f"plot-{panel}", before)
    page.locator("#plot-backbone .u-over").hover(position={"x": 100, "y": 60})
    expect(page.locator("#backbone-note")).to_contain_text("2.5 Hz at X 3.000 mm, phase −90.0°, steady")
    # A response that comes later opens its panel behind the others.
    still.frame(points=[{"set_up": "bare", "experiment": "sweep", "frequency_hz": 2.5, "x_over_z": 9, "steadiness": "steady"}])
    expect(page.locator("#panel-response")).to_be_visible()


def test_the_margin_the_countdown_and_the_steadiness_are_numbers(still, open_page):
    page = ready(open_page(still.address))
    numbers = still.rig.state()["numbers"]

    def show(limit_m=0.08, **changed):
        still.state = {"numbers": numbers | changed, "limits": {"x_m": limit_m, "z_m": 0.01, "wall_force_n": 450.0, "clearance_m": None}}
        still.frame()

    show(max_abs_x_m=0.0312, stage="measuring", stage_left_s=2.34, dwells=1, x_over_z_spread=0.0123)
    for name, text in (("n-margin", "48.8"), ("l-left", "Measuring (s left)"), ("n-left", "2.3"), ("n-spread", "1.23")):
        expect(page.locator(f"#{name}")).to_have_text(text)
    expect(page.locator("#n-margin")).to_have_attribute("data-tone", "quiet")
    show(max_abs_x_m=0.0755, dwells=2)
    expect(page.locator("#n-margin")).to_have_attribute("data-tone", "bad")
    expect(page.locator("#l-left")).to_have_text("Dwell 2 (s left)")
    show(limit_m=None, stage="settling", stage_left_s=0, x_over_z_spread=None)
    for name, text in (("n-margin", "–"), ("l-left", "Settling (s left)"), ("n-left", "–"), ("n-spread", "–")):
        expect(page.locator(f"#{name}")).to_have_text(text)


def test_limits_are_drawn_wherever_the_axis_ends(still, open_page):
    page = ready(open_page(still.address))
    # Pixels in the colour of the limit, in the uppermost part of the plot of x.
    red = """() => {
      const canvas = document.querySelector('#plot-x canvas');
      const copy = new OffscreenCanvas(canvas.width - 100, 30).getContext('2d', { willReadFrequently: true });
      copy.drawImage(canvas, -80, 0);
      const { data } = copy.getImageData(0, 0, canvas.width - 100, 30);
      let count = 0;
      for (let i = 0; i < data.length; i += 4) if (data[i] > 150 && data[i + 1] < 90 && data[i + 2] < 90) count += 1;
      return count;
    }"""
    for limit_m in (80.0, 0.08, None):
        before = picture(page, "plot-x")
        still.state = {"limits": {"x_m": limit_m, "z_m": None, "wall_force_n": None, "clearance_m": None}}
        still.frame(100)
        await_change(page, "plot-x", before)
        page.wait_for_timeout(200)
        assert (page.evaluate(red) > 50) == (limit_m is not None), limit_m


def test_the_spectrum_and_its_waterfall_grow(still, open_page):
    page = ready(open_page(still.address))
    expect(page.locator("#spectrum-note")).to_have_text("0.12 Hz a line, of 8.19 s; colours: 4 decades")
    for plot in ("plot-spectrum", "plot-waterfall"):
        before = picture(page, plot)
        still.frame(1000)
        await_change(page, plot, before)
    page.locator("#plot-spectrum .u-over").hover(position={"x": 60, "y": 20})
    expect(page.locator("#spectrum-note")).to_have_text(re.compile(r"^[\d.]+ Hz: [\d.e-]+ mm$"))
    still.frame(spectra=[None, {"t_s": 1, "step_hz": 0, "amplitude_m": [1, 2]}, {"t_s": 1, "step_hz": 1, "amplitude_m": [1, "x"]}])
    expect(page.locator("#ignored")).to_have_text("3")


def test_pictures_and_the_log_are_saved(still, open_page):
    page = ready(open_page(still.address))
    panels = page.locator(".panel:visible:has(.plot)")
    assert panels.count() >= 7
    for i in range(panels.count()):
        with page.expect_download() as download:
            panels.nth(i).locator(".save").click()
        file = download.value.path()
        assert file.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" and file.stat().st_size > 4000
        assert re.fullmatch(r"hybrid-[a-z-]+-3-s\.png", download.value.suggested_filename), download.value.suggested_filename
    still.frame(log=[{"at": "14:10:00", "level": "warning", "text": "A warning."}, {"at": "14:10:01", "level": "action", "text": "Held."}])
    expect(page.locator("#log")).to_contain_text("Held.")
    page.get_by_label("Entries of the log").select_option("trouble")
    expect(page.locator("#log li:visible")).to_have_text(["14:10:00Warning: A warning."])
    with page.expect_download() as download:
        page.get_by_role("button", name="Save log").click()
    assert download.value.path().read_text().splitlines()[-2:] == ["14:10:00\twarning\tA warning.", "14:10:01\taction\tHeld."]


def test_large_numbers_fill_a_second_screen(still, open_page):
    still.state = {"numbers": still.rig.state()["numbers"] | {"x_phase_rad": -3.1, "x_amplitude_m": 0.12345, "x_over_z_lock_in": 123.4}}
    page = open_page(still.address, viewport={"width": 1920, "height": 1080})
    page.goto(still.address + "?large")
    expect(page.locator("#n-frequency")).to_be_visible()
    expect(page.locator(".panels")).to_be_hidden()
    for name in ("frequency", "ratio", "x", "z", "phase", "margin", "left", "spread"):
        number = page.locator(f"#n-{name}")
        expect(number).to_be_in_viewport(ratio=1)
        # Letters of 5 % of the width are 25 mm high on a screen of half a metre. None is cut off.
        assert number.evaluate("e => parseFloat(getComputedStyle(e).fontSize)") > 0.05 * 1920
        assert number.evaluate("e => e.scrollWidth <= e.clientWidth"), name
    page.keyboard.press("l")
    expect(page.locator(".panels")).to_be_visible()
    assert page.url == still.address
    page.get_by_role("button", name="Large", exact=True).click()
    expect(page.locator(".panels")).to_be_hidden()
    page.reload()
    expect(page.locator(".panels")).to_be_hidden()
