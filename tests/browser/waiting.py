"""Waits for what a page shows. Playwright's own wait for an expression is refused by the page's security policy."""

import time


def until(page, expression, argument=None, timeout_s=60):
    """Waits until a JavaScript expression or function is true in the page."""
    end = time.monotonic() + timeout_s
    while not page.evaluate(expression, argument):
        assert time.monotonic() < end, f"never true: {expression}"
        page.wait_for_timeout(50)


def ready(page):
    """Waits for the first drawing of the page."""
    until(page, "document.querySelector('#plot-x canvas') !== null")
    return page


def picture(page, plot):
    """The drawing of a plot."""
    return page.evaluate("id => document.querySelector(`#${id} canvas`).toDataURL()", plot)


def await_change(page, plot, before):
    """Waits until a plot's drawing differs from an earlier one."""
    until(page, "([id, before]) => document.querySelector(`#${id} canvas`).toDataURL() !== before", [plot, before])
