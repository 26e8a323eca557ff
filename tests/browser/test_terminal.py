"""The terminal view of `damprig run --tui` and `damprig monitor --tui`, in tmux."""

import asyncio
import os
import re
import shutil
import subprocess
import time
import uuid
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import aiohttp
import pytest

COMMAND = os.environ.get("DAMPRIG_COMMAND")
CAMPAIGNS = Path(__file__).parents[2] / "host" / "campaigns"

pytestmark = [
    pytest.mark.skipif(not COMMAND, reason="needs DAMPRIG_COMMAND"),
    pytest.mark.skipif(not shutil.which("tmux"), reason="needs tmux"),
]


class Terminal:
    """A terminal with a command in it."""

    def __init__(self, folder, command, columns=100, lines=30):
        self.socket = f"damprig-{uuid.uuid4().hex[:8]}"
        self.tmux("-f", "/dev/null", "new-session", "-d", "-x", str(columns), "-y", str(lines), "-c", str(folder),
                  f"{COMMAND} {command}; echo exit=$?; cat")

    def tmux(self, *arguments):
        result = subprocess.run(["tmux", "-L", self.socket, *arguments], capture_output=True, text=True, timeout=30)
        assert result.returncode == 0, result.stderr
        return result.stdout

    def screen(self):
        return self.tmux("capture-pane", "-p")

    def press(self, key):
        self.tmux("send-keys", key)

    def until(self, *texts):
        end = time.monotonic() + 60
        while time.monotonic() < end:
            screen = self.screen()
            if all(text in screen for text in texts):
                return screen
            time.sleep(0.1)
        raise AssertionError(f"{texts} did not appear:\n{screen}")

    def close(self):
        subprocess.run(["tmux", "-L", self.socket, "kill-server"], capture_output=True, timeout=30)


@pytest.fixture
def terminal(tmp_path):
    terminals = []

    def start(command, **size):
        terminals.append(Terminal(tmp_path, command, **size))
        return terminals[-1]

    yield start
    for one in terminals:
        one.close()


def test_the_keys_of_the_terminal_hold_pause_and_stop_a_run(terminal, tmp_path):
    view = terminal(f"run {CAMPAIGNS}/hybrid.toml --out out --rig virtual:realtime --speed 10 --tui")
    screen = view.until("RUNNING", "0 of 426 points", "s stop   p pause   h hold")
    assert "hybrid" in screen and "X/Z (cycle maxima) over frequency" in screen
    # The controller's numbers appear: the base moves.
    view.until("Z (mm) 0.4")
    view.press("h")
    view.until("HELD", "h release")
    view.press("p")
    view.until("PAUSED", "p resume")
    view.press("p")
    view.until("RUNNING")
    view.press("s")
    screen = view.until("exit=130", "continue with `damprig run --resume out`")
    assert "RUNNING" not in screen, "the terminal is restored"
    journal = (tmp_path / "out" / "journal.jsonl").read_text()
    for what in ("held at the present point", "paused", "resumed"):
        assert what in journal


def test_control_c_stops_the_run_of_a_terminal_view(terminal):
    view = terminal(f"run {CAMPAIGNS}/hybrid.toml --out out --rig virtual:realtime --speed 10 --tui")
    view.until("RUNNING")
    view.press("C-c")
    view.until("exit=130")


def test_a_terminal_that_closes_ends_the_run_in_an_orderly_way(terminal, tmp_path):
    view = terminal(f"run {CAMPAIGNS}/hybrid.toml --out out --rig virtual:realtime --speed 10 --tui")
    view.until("RUNNING")
    view.close()
    manifest = tmp_path / "out" / "manifest.json"
    end = time.monotonic() + 60
    while '"status": "incomplete"' not in manifest.read_text():
        assert time.monotonic() < end, manifest.read_text()[:200]
        time.sleep(0.1)


def test_an_idle_rig_is_shown_in_the_terminal(terminal):
    view = terminal("monitor --rig virtual:realtime --listen 127.0.0.1:0 --tui")
    view.until("IDLE", "The rig is idle.", "q end")
    view.press("q")
    view.until("exit=0")


def ask(url, action):
    """Sends an action to the page of the rig, as a viewer with the token."""
    address, token = re.fullmatch(r"(http://[\d.:]+)/#token=([0-9a-f]+)", url).groups()

    async def send():
        async with aiohttp.ClientSession() as session:
            async with session.ws_connect(f"{address}/live", protocols=("damprig", f"token.{token}")) as socket:
                await socket.send_json({"id": 1, "token": token, **action})
                while True:
                    message = await socket.receive_json()
                    if message["kind"] == "answer":
                        return message

    # In a thread of its own: the browser's loop may run in this one.
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(asyncio.run, send()).result()
    assert answer["ok"], answer


def test_old_numbers_and_a_sensor_without_a_signal_are_seen_in_the_terminal(terminal, tmp_path):
    view = terminal("monitor --rig virtual:realtime --listen 127.0.0.1:0 --control --tui 2>err.txt")
    view.until("IDLE", "x mean (mm) ")
    url = re.search(r"Monitor: (\S+)", (tmp_path / "err.txt").read_text()).group(1)
    ask(url, {"do": "inject", "fault": {"kind": "sensor", "sensor": "x", "how": "unplugged"}})
    view.until("IDLE", "The x sensor reads an end of its span", "X (mm) –", "z mean (mm) ")
    assert "newest sample" not in view.screen()
    ask(url, {"do": "inject", "fault": {"kind": "cable", "on": True}})
    # Long before the link counts as lost.
    assert "LINK LOST" not in view.until("newest sample", " s old")
    ask(url, {"do": "inject", "fault": {"kind": "cable", "on": False}})
    view.press("q")
    view.until("exit=0")


def test_a_replay_stands_until_it_is_played_in_the_terminal(terminal, tmp_path):
    done = subprocess.run([COMMAND, "run", str(CAMPAIGNS / "short.toml"), "--out", str(tmp_path / "run")],
                          capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    view = terminal("monitor --run run --listen 127.0.0.1:0 --speed 20 --tui")
    screen = view.until("REPLAY", "p play", "0 of 6 points")
    assert "RUNNING" not in screen
    view.press("p")
    view.until("REPLAY", "p pause", "of 6 points", "X/Z (lock-in) ")
    view.until("6 of 6 points")
    view.press("q")
    view.until("exit=0")


def test_names_cannot_control_the_terminal(terminal, tmp_path):
    campaign = (CAMPAIGNS / "short.toml").read_text().replace('"bare"', '"a\\u001b[31mb\\u001b]0;x\\u0007"')
    (tmp_path / "hostile.toml").write_text(campaign)
    view = terminal("run hostile.toml --out out --rig virtual:realtime --speed 20 --tui")
    view.until("RUNNING", "\\u{1b}")


def test_a_small_terminal_shows_the_state_the_keys_and_the_main_numbers(terminal):
    view = terminal(f"run {CAMPAIGNS}/hybrid.toml --out out --rig virtual:realtime --tui", columns=30, lines=9)
    view.until("RUNNING", "s stop", "X/Z (lock-in)")
    view.press("s")
    view.until("exit=130")


def test_a_terminal_of_two_lines_is_no_reason_to_fail_and_its_stop_key_works(terminal):
    view = terminal(f"run {CAMPAIGNS}/hybrid.toml --out out --rig virtual:realtime --tui", columns=12, lines=2)
    view.until("RUNNING")
    view.press("s")
    view.until("exit=130")
