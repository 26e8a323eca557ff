"""What a viewer may do, and how: against the stand-in server."""

from playwright.sync_api import expect

from waiting import ready


def test_without_a_token_the_page_only_watches(still, open_page):
    page = ready(open_page(still.address))
    expect(page.locator("#hint")).to_have_text("View only. Stop: Ctrl-C in the terminal that runs damprig on lab-pc.")
    for name in ("Stop", "Pause run", "Hold point", "Clear fault", "Set spring", "Press"):
        expect(page.get_by_role("button", name=name, exact=True)).to_have_count(0)
    page.keyboard.press("s")
    assert still.actions == []


def test_with_a_token_but_without_control_the_page_only_watches(still, open_page):
    still.about = {"can_control": False, "can_inject": False}
    page = ready(open_page(still.address, token=still.token))
    expect(page.locator("#hint")).to_contain_text("View only.")
    expect(page.locator("#controls")).to_be_hidden()
    expect(page.locator("#panel-inject")).to_be_hidden()


def test_the_token_leaves_the_address_and_lasts_for_the_tab(still, open_page):
    page = ready(open_page(still.address, token=still.token))
    assert page.url == still.address
    assert still.token not in page.content()
    page.reload()
    ready(page)
    page.locator("#stop").click()
    assert still.await_action("stop")["token"] == still.token
    # Another tab of the browser has no token.
    other = page.context.new_page()
    other.goto(still.address)
    expect(ready(other).locator("#controls")).to_be_hidden()


def test_each_button_sends_its_action(still, open_page):
    page = ready(open_page(still.address, token=still.token))
    still.answer = lambda action: (True, f"did {action['do']}")

    def press(name, **expected):
        still.actions.clear()
        page.get_by_role("button", name=name, exact=True).click()
        action = still.await_action(expected["do"])
        assert {key: value for key, value in action.items() if key not in ("id", "token")} == expected

    press("Stop", do="stop")
    expect(page.locator("#answer")).to_have_text("did stop")
    press("Pause run", do="pause")
    press("Hold point", do="hold")
    still.state = {"activity": "paused", "fault": {"what": "A fault.", "advice": ""}}
    still.frame()
    press("Resume run", do="resume")
    press("Clear fault", do="clear_fault")
    still.state = {"activity": "held"}
    still.frame()
    press("Release point", do="release")
    page.get_by_label("Force (N)").fill("12.5")
    press("Set spring", do="set_spring", force_n=12.5)
    press("Release spring", do="set_spring", force_n=0)
    page.get_by_label("Sensor", exact=True).select_option("wall_low")
    page.get_by_label("Fault of the sensor").select_option("stuck")
    press("Apply", do="inject", fault={"kind": "sensor", "sensor": "wall_low", "how": "stuck"})
    page.get_by_label("Fault of the sensor").select_option("repaired")
    press("Apply", do="inject", fault={"kind": "sensor", "sensor": "wall_low", "how": None})
    press("Press", do="inject", fault={"kind": "emergency_stop", "on": True})
    press("Plug in", do="inject", fault={"kind": "cable", "on": False})
    still.actions.clear()
    page.get_by_role("button", name="Off").nth(1).click()
    assert still.await_action("inject")["fault"] == {"kind": "supply", "supply": "amplifier", "on": False}


def test_a_refusal_is_shown(still, open_page):
    page = ready(open_page(still.address, token="not-the-token"))
    page.locator("#stop").click()
    expect(page.locator("#answer")).to_have_text("wrong token; it was printed when damprig was started")
    expect(page.locator("#answer")).to_have_attribute("data-tone", "bad")


def test_a_replay_is_steered_without_a_token(still, open_page):
    still.about = {"is_replay": True, "can_control": False, "can_inject": False}
    still.state = {"speed": 1.0, "replay": {"t_s": 12.0, "end_s": 340.0, "speed": 1.0, "paused": False}}
    page = ready(open_page(still.address))
    expect(page.locator("#replay-clock")).to_have_text("12 s of 5 min 40 s")

    def sent():
        action = still.await_action("replay")
        still.actions.clear()
        assert "token" not in action
        return {key: value for key, value in action.items() if key not in ("id", "do")}

    page.locator("#replay-play").click()
    assert sent() == {"paused": True}
    page.locator("#replay-speed").select_option("0.1")
    assert sent() == {"speed": 0.1}
    page.locator("#replay-speed").select_option("100")
    assert sent() == {"speed": 100}
    page.locator("#replay-time").fill("170.5")
    assert sent() == {"to_s": 170.5}


def test_everything_is_reached_by_tab_with_visible_focus(still, open_page):
    page = ready(open_page(still.address, token=still.token))
    wanted = set(page.evaluate("""[...document.querySelectorAll('button, input, select, [tabindex="0"]')]
      .filter((e) => e.offsetParent !== null && !e.disabled).map((e, i) => (e.dataset.number = String(i)))"""))
    reached, unmarked = set(), []
    for _ in range(len(wanted) + 5):
        page.keyboard.press("Tab")
        number, text, outline = page.evaluate("""(() => { const e = document.activeElement;
          return [e.dataset.number ?? '', e.outerHTML.slice(0, 60), getComputedStyle(e).outlineStyle]; })()""")
        reached.add(number)
        if number and outline == "none":
            unmarked.append(text)
    assert wanted - reached == set() and unmarked == []


def test_keys(still, open_page):
    page = ready(open_page(still.address, token=still.token))
    page.keyboard.press("s")
    expect(page.locator("#stop")).to_be_focused()
    page.keyboard.press("?")
    expect(page.get_by_role("dialog")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_be_hidden()
    page.keyboard.press("3")
    expect(page.locator("[data-span='20']")).to_have_attribute("aria-pressed", "true")
    # Keys in a field are text.
    page.locator("#spring-force").focus()
    page.keyboard.type("4 s")
    expect(page.locator("#spring-force")).to_be_focused()
    expect(page.locator("[data-span='20']")).to_have_attribute("aria-pressed", "true")
    # Space on a focused button presses that button and nothing else.
    page.locator("#zoom-reset").focus()
    page.keyboard.press("Space")
    expect(page.locator("#pause")).to_have_attribute("aria-pressed", "false")
    assert still.actions == []
