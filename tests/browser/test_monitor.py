"""The page against damprig itself: `damprig run … --rig virtual:realtime --monitor --control` and `damprig monitor`.

Needs DAMPRIG_COMMAND, the path of a built damprig that has the monitor; without it these tests are skipped.
"""

import os
import pathlib
import queue
import re
import signal
import subprocess
import threading
import time
import urllib.request

import pytest
from playwright.sync_api import expect

from stand_in import HOST
from waiting import await_change, picture, ready, until

COMMAND = os.environ.get("DAMPRIG_COMMAND")
pytestmark = pytest.mark.skipif(not COMMAND, reason="DAMPRIG_COMMAND is not set")

CAMPAIGN = HOST.parent / "campaigns/short.toml"
STARTED = re.compile(r"^Monitor: (http://[\d.]+:\d+/)(?:#token=([\w-]+))?$")


class Damprig:
    """A running damprig with a monitor; `address` and `token` are those that it printed."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen([COMMAND, *map(str, arguments)], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, text=True)
        self.lines, self.seen = queue.Queue(), []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.put(line.rstrip("\n"))
        self.lines.put(None)

    def __enter__(self):
        end = time.monotonic() + 60
        while True:
            try:
                line = self.lines.get(timeout=max(0.1, end - time.monotonic()))
            except queue.Empty:
                self.__exit__()
                raise AssertionError(f"no line 'Monitor: …' within 60 s; there were {self.seen}") from None
            assert line is not None, f"damprig ended before it served a page: {self.seen}"
            self.seen.append(line)
            if found := STARTED.match(line):
                self.address, self.token = found.groups()
                return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(30)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()


def run(folder, *more):
    return Damprig("run", CAMPAIGN, "--rig", "virtual:realtime", "--out", folder, "--monitor", "--listen", "127.0.0.1:0", *more)


def test_a_run_is_watched_from_the_first_sample_to_the_stop(tmp_path, open_page):
    with run(tmp_path / "run", "--control", "--speed", "1") as damprig:
        assert damprig.token
        page = ready(open_page(damprig.address, token=damprig.token, is_loss_expected=True))
        expect(page.locator("#name")).to_contain_text("short")
        expect(page.locator("#badge")).to_have_text("Running")
        before = picture(page, "plot-x")
        await_change(page, "plot-x", before)
        # X/Z appears point by point.
        expect(page.locator("#response-legend")).to_contain_text(re.compile("[1-3] points"))
        expect(page.locator("#points")).to_contain_text(re.compile("[1-5] of 6 points"))
        expect(page.locator("#n-frequency")).not_to_have_text("–")
        # A late viewer sees the history.
        late = ready(open_page(damprig.address, is_loss_expected=True))
        expect(late.locator("#response-legend")).to_contain_text(re.compile("[1-3] points"))
        expect(late.locator("#hint")).to_contain_text("View only.")
        assert page.locator("#ignored").text_content() == "0"
        # Stop.
        page.locator("#stop").click()
        expect(page.locator("#badge")).to_have_text("Ended")
        expect(page.locator("#headline")).to_contain_text(f"`damprig run --resume {tmp_path / 'run'}` continues the run.")
        for one in (page, late):
            one.close()
        assert damprig.process.wait(60) == 130


def test_the_end_of_a_run_is_no_lost_connection(tmp_path, open_page):
    with run(tmp_path / "run", "--control", "--speed", "2") as damprig:
        page = ready(open_page(damprig.address, token=damprig.token, is_loss_expected=True))
        expect(page.locator("#headline")).to_contain_text("The run is complete.", timeout=60_000)
        expect(page.locator("#badge")).to_have_text("Ended")
        expect(page.locator("#points")).to_contain_text("6 of 6 points")
        # It is served as long as somebody looks at it.
        page.reload()
        expect(ready(page).locator("#headline")).to_contain_text("The run is complete.")
        page.close()
        assert damprig.process.wait(60) == 0


def test_a_fault_stays_with_the_decay_and_what_to_do(tmp_path, open_page):
    with run(tmp_path / "run", "--control", "--speed", "1") as damprig:
        page = ready(open_page(damprig.address, token=damprig.token, is_loss_expected=True))
        expect(page.locator("#n-ratio")).not_to_have_text("–")
        page.get_by_role("button", name="Press", exact=True).click()
        expect(page.locator("#badge")).to_have_text("Fault")
        expect(page.locator("#headline")).to_contain_text("The drive was cut at once: the emergency stop is pressed; set-up \"bare\", t = ")
        expect(page.locator("#advice")).to_have_text(f"`damprig run --resume {tmp_path / 'run'}` continues the run.")
        # The drive is off, so nothing is measured over its cycle; the structure rings.
        expect(page.locator("#n-ratio")).to_have_text("–")
        expect(page.locator("#l-x")).to_have_text("x, mean of 1 s (mm)")
        await_change(page, "plot-x", picture(page, "plot-x"))
        late = ready(open_page(damprig.address, is_loss_expected=True))
        expect(late.locator("#headline")).to_contain_text("The drive was cut at once")
        for one in (page, late):
            one.close()
        assert damprig.process.wait(60) == 1


def test_a_paused_run_shows_no_zeros(tmp_path, open_page):
    with run(tmp_path / "run", "--control", "--speed", "1") as damprig:
        page = ready(open_page(damprig.address, token=damprig.token, is_loss_expected=True))
        expect(page.locator("#n-ratio")).not_to_have_text("–")
        page.locator("#pause-run").click()
        expect(page.locator("#badge")).to_have_text("Paused")
        for name in ("frequency", "ratio", "phase", "impacts"):
            expect(page.locator(f"#n-{name}")).to_have_text("–")
        expect(page.locator("#l-x")).to_have_text("x, mean of 1 s (mm)")
        expect(page.locator("#n-x")).to_have_text(re.compile(r"^−?\d+\.\d{3}$"))
        # The time left stands.
        text = page.locator("#points").text_content()
        assert " left" in text
        page.wait_for_timeout(1500)
        expect(page.locator("#points")).to_have_text(text)


def test_a_resumed_run_shows_what_was_measured_before(tmp_path, open_page):
    folder = tmp_path / "run"
    with run(folder, "--control") as damprig:
        page = ready(open_page(damprig.address, token=damprig.token, is_loss_expected=True))
        expect(page.locator("#points")).to_contain_text(re.compile("[1-5] of 6 points"))
        page.locator("#stop").click()
        expect(page.locator("#badge")).to_have_text("Ended")
        page.close()
        assert damprig.process.wait(60) == 130
    assert '"stopped on the live page"' in (folder / "journal.jsonl").read_text()
    page.close()
    resumed = Damprig("run", "--resume", folder, "--speed", "2", "--monitor", "--listen", "127.0.0.1:0")
    with resumed as damprig:
        page = ready(open_page(damprig.address, is_loss_expected=True))
        expect(page.locator("#response-legend")).to_contain_text(re.compile("[1-5] points"))
        expect(page.locator("#points")).to_contain_text("6 of 6 points", timeout=60_000)
        page.close()
        assert damprig.process.wait(60) == 0


def test_an_idle_rig_answers_at_once(tmp_path, open_page):
    with Damprig("monitor", "--rig", "virtual:realtime", "--listen", "127.0.0.1:0", "--control") as damprig:
        page = ready(open_page(damprig.address, token=damprig.token, is_loss_expected=True))
        page.get_by_role("button", name="Press", exact=True).click()
        expect(page.locator("#badge")).to_have_text("Fault")
        begun = time.monotonic()
        damprig.process.send_signal(signal.SIGINT)
        assert damprig.process.wait(30) == 0
        # The farewell to the viewer included.
        assert time.monotonic() - begun < 5


def test_an_injected_fault_shows(tmp_path, open_page):
    with run(tmp_path / "run", "--control") as damprig:
        page = ready(open_page(damprig.address, token=damprig.token, is_loss_expected=True))
        expect(page.locator("#badge")).to_have_text("Running")
        page.get_by_role("button", name="Press", exact=True).click()
        until(page, "document.getElementById('strip').dataset.tone === 'bad'")
        expect(page.get_by_role("alert")).to_contain_text("emergency stop", ignore_case=True)


def test_without_control_the_page_has_no_buttons_and_actions_are_refused(tmp_path, open_page):
    with run(tmp_path / "run") as damprig:
        assert damprig.token is None
        page = ready(open_page(damprig.address, is_loss_expected=True))
        expect(page.locator("#hint")).to_contain_text("View only.")
        expect(page.locator("#controls")).to_be_hidden()
        answer = page.evaluate(ASK, [f"ws{damprig.address[4:]}live", {"id": 1, "token": "guess", "do": "stop"}])
        assert answer["ok"] is False and answer["text"]


# Opens a socket, sends an action, resolves to its answer, or to null if the socket is refused.
ASK = """([url, action]) => new Promise((resolve) => {
  const socket = new WebSocket(url);
  socket.onopen = () => socket.send(JSON.stringify(action));
  socket.onerror = () => resolve(null);
  socket.onmessage = (event) => {
    const message = JSON.parse(event.data);
    if (message.kind === 'answer') resolve(message);
  };
})"""


def test_another_origin_is_refused(tmp_path, browser):
    with run(tmp_path / "run", "--control") as damprig:
        context = browser.new_context()
        try:
            page = context.new_page()
            page.route("http://elsewhere.test/", lambda route: route.fulfill(body="<title>elsewhere</title>", content_type="text/html"))
            page.goto("http://elsewhere.test/")
            answer = page.evaluate(ASK, [f"ws{damprig.address[4:]}live", {"id": 1, "token": damprig.token, "do": "stop"}])
            assert answer is None or answer["ok"] is False
        finally:
            context.close()
        assert damprig.process.poll() is None


def test_the_files_have_a_strict_policy(tmp_path):
    with run(tmp_path / "run") as damprig:
        with urllib.request.urlopen(damprig.address, timeout=10) as answer:
            policy = answer.headers["Content-Security-Policy"]
            assert "default-src 'none'" in policy and "unsafe" not in policy
            assert pathlib.Path(HOST / "monitor/page/index.html").read_bytes() == answer.read()


def test_a_finished_run_is_replayed(tmp_path, open_page):
    folder = tmp_path / "run"
    done = subprocess.run([COMMAND, "run", str(CAMPAIGN), "--out", str(folder)], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    with Damprig("monitor", "--run", folder, "--listen", "127.0.0.1:0", "--speed", "2") as damprig:
        page = ready(open_page(damprig.address, is_loss_expected=True))
        expect(page.locator("#replay")).to_be_visible()
        # It stands at its first sample.
        expect(page.locator("#badge")).to_have_text("Replay")
        expect(page.locator("#headline")).to_contain_text("Paused: set-up bare")
        expect(page.locator("#replay-play")).to_have_text("Play")
        expect(page.locator("#replay-clock")).to_contain_text("0 s of")
        before = picture(page, "plot-x")
        page.locator("#replay-play").click()
        await_change(page, "plot-x", before)
        expect(page.locator("#badge")).to_have_text("Replay")
        page.locator("#replay-time").fill("20")
        expect(page.locator("#response-legend")).to_contain_text("3 points")
        # Back: nothing of the later time is left.
        page.locator("#replay-play").click()
        expect(page.locator("#replay-play")).to_have_text("Play")
        page.locator("#replay-time").fill("0.05")
        expect(page.locator("#n-ratio")).to_have_text("–")
        expect(page.locator("#points")).to_contain_text("0 of 6 points")


def test_an_idle_rig_is_watched(open_page):
    with Damprig("monitor", "--rig", "virtual:realtime", "--listen", "127.0.0.1:0") as damprig:
        page = ready(open_page(damprig.address, is_loss_expected=True))
        expect(page.locator("#badge")).to_have_text("Idle")
        await_change(page, "plot-x", picture(page, "plot-x"))


def monitored_rig(open_page):
    """An idle rig in real time with its page."""
    damprig = Damprig("monitor", "--rig", "virtual:realtime", "--listen", "127.0.0.1:0", "--control")
    damprig.__enter__()
    return damprig, ready(open_page(damprig.address, token=damprig.token, is_loss_expected=True))


def test_an_idle_rig_shows_where_its_sensors_stand_and_which_is_unplugged(open_page):
    damprig, page = monitored_rig(open_page)
    try:
        strip = page.locator("#strip")
        for name in ("x", "z"):
            expect(page.locator(f"#l-{name}")).to_have_text(f"{name}, mean of 1 s (mm)")
            expect(page.locator(f"#n-{name}")).to_have_text(re.compile(r"^−?\d+\.\d{3}$"))
        expect(page.locator("#n-ratio")).to_have_text("–")
        expect(strip).to_have_attribute("data-tone", "quiet")
        page.get_by_role("button", name="Apply", exact=True).click()
        expect(page.locator("#n-x")).to_have_text("–")
        expect(page.locator("#n-z")).not_to_have_text("–")
        expect(page.locator("#badge")).to_have_text("Idle")
        expect(strip).to_have_attribute("data-tone", "warn")
        expect(page.locator("#advice")).to_contain_text("Alarm: The x sensor reads an end of its span")
        expect(page.locator("#alarms")).to_contain_text("check its cable")
        page.get_by_label("Fault of the sensor").select_option("repaired")
        page.get_by_role("button", name="Apply", exact=True).click()
        expect(page.locator("#n-x")).not_to_have_text("–")
        expect(strip).to_have_attribute("data-tone", "quiet")
    finally:
        damprig.__exit__()


def test_numbers_of_a_dead_link_are_dimmed_long_before_the_link_counts_as_lost(open_page):
    damprig, page = monitored_rig(open_page)
    try:
        expect(page.locator("#n-x")).not_to_have_text("–")
        expect(page.locator("body")).not_to_have_class("stale")
        page.get_by_role("button", name="Pull", exact=True).click()
        pulled = time.monotonic()
        expect(page.locator("#age")).to_have_text(re.compile(r"^Newest sample [1-4] s old$"))
        expect(page.locator("body")).to_have_class("stale")
        took = time.monotonic() - pulled
        # At 1 s, and what a busy machine adds; the link counts as lost after 10 s.
        assert took < 5, took
        expect(page.locator("#badge")).to_have_text("Link lost")
        page.get_by_role("button", name="Plug in", exact=True).click()
        expect(page.locator("body")).not_to_have_class("stale")
        expect(page.locator("#age")).to_be_hidden()
    finally:
        damprig.__exit__()
