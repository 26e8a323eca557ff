"""A browser for all tests; pages that fail a test when the browser reports an error or leaves the server."""

import pytest
from playwright.sync_api import expect, sync_playwright

from stand_in import Server

# Long, because events are awaited: a busy machine makes the tests slow, not red.
expect.set_options(timeout=30_000)

ARGUMENTS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--enable-precise-memory-info",
]

# Counts drawings of each plot and movements of elements, before any script of the page runs.
OBSERVE = """
window.seen = { draws: 0, byPlot: {}, shift: 0, shifts: [] };
const clear = CanvasRenderingContext2D.prototype.clearRect;
CanvasRenderingContext2D.prototype.clearRect = function (...rest) {
  const id = this.canvas.closest('.plot')?.id;
  seen.draws += 1;
  seen.byPlot[id] = (seen.byPlot[id] ?? 0) + 1;
  return clear.apply(this, rest);
};
new PerformanceObserver((list) => {
  for (const entry of list.getEntries()) {
    seen.shift += entry.value;
    seen.shifts.push(entry.sources.map((s) => [s.node?.id || s.node?.parentElement?.id || s.node?.nodeName,
      JSON.stringify(s.previousRect), JSON.stringify(s.currentRect)]));
  }
}).observe({ type: 'layout-shift', buffered: true });
"""


@pytest.fixture(scope="session")
def browser():
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture
def open_page(browser):
    """Opens a page: open_page(address, token, **options of the context)."""
    contexts, errors = [], []

    def open_one(address, token=None, is_loss_expected=False, **options):
        options = {"viewport": {"width": 1440, "height": 1900}} | options
        context = browser.new_context(**options)
        contexts.append(context)
        context.set_default_timeout(60_000)
        context.add_init_script(OBSERVE)
        page = context.new_page()
        page.on("pageerror", lambda error: errors.append(f"error: {error.stack or error}"))
        lost = "WebSocket connection to"
        page.on("console", lambda m: m.type in ("error", "warning") and not (is_loss_expected and lost in m.text)
                and errors.append(f"console: {m.text}"))
        page.on("request", lambda request: request.url.startswith((address, "data:")) or errors.append(f"fetched {request.url}"))
        page.goto(address + (f"#token={token}" if token else ""))
        return page

    yield open_one
    for context in contexts:
        context.close()
    assert errors == []


def warm(pace):
    """A server with 3 s of history."""
    server = Server(pace=pace)
    server.warm_up(3)
    return server


@pytest.fixture
def still():
    """Sends only what the test tells it to."""
    with warm(pace=0) as server:
        yield server


@pytest.fixture
def live():
    """Streams at real-time pace."""
    with warm(pace=1) as server:
        yield server
