"""What a hand or another server could take from a survey in the browser, and does not."""

from __future__ import annotations

import http.server
import os
import signal
import threading
from typing import Any

from tests.browser import Driver, Served


def test_what_waits_is_said_asked_about_and_sent_by_the_next_tab(
    browser: Any, server: Served
) -> None:
    page = Driver(browser, server)
    page.empty()
    page.click("mode-photos")
    page.settled("true")
    assert server.process is not None
    os.kill(server.process.pid, signal.SIGSTOP)
    try:
        page.click("mode-orientation")
        assert page.tab.get_by_test_id("link").get_attribute("data-level") == "fair"
        assert "1" in page.tab.get_by_test_id("link").inner_text()
        closing = "() => !window.dispatchEvent(new Event('beforeunload', { cancelable: true }))"
        assert page.tab.evaluate(closing)
        old, tab = page.tab, page.context.new_page()
        old.close()
    finally:
        os.kill(server.process.pid, signal.SIGCONT)
    page.open(tab, server)
    assert page.settled("state.stage === 'orientation'")
    assert not page.tab.evaluate(closing)
    assert page.tab.get_by_test_id("link").get_attribute("data-level") == "good"
    page.close()


def test_the_token_goes_to_no_other_server_on_the_computer(browser: Any, server: Served) -> None:
    heard: list[str] = []

    class Listening(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            heard.append(str(self.headers))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_: Any) -> None:
            pass

    page = Driver(browser, server)
    assert page.tab.evaluate("() => location.search") == ""
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Listening) as other:
        threading.Thread(target=other.serve_forever, daemon=True).start()
        page.context.request.get(f"http://127.0.0.1:{other.server_port}/")
        page.tab.evaluate(
            "(url) => fetch(url, { mode: 'no-cors', credentials: 'include' }).catch(() => 0)",
            f"http://127.0.0.1:{other.server_port}/",
        )
        other.shutdown()
    assert heard
    assert server.token not in "".join(heard)
    assert page.tab.reload().status == 200
    page.close()


def test_an_accepted_orientation_is_exchanged_only_after_a_question(
    browser: Any, server: Served
) -> None:
    page = Driver(browser, server)
    page.empty()
    page.click("mode-points")
    assert not page.tab.get_by_test_id("exchange").is_visible()
    page.click("mode-orientation")
    page.click("exchange")
    assert page.tab.get_by_test_id("dialog-yes").is_visible()
    assert page.state["pair"]["accepted"]
    page.keys("Escape")
    page.close()


def test_a_tab_that_is_not_looked_at_holds_no_connection(browser: Any, server: Served) -> None:
    page = Driver(browser, server)
    hide = """(hidden) => {
      Object.defineProperty(document, "hidden", { value: hidden, configurable: true });
      document.dispatchEvent(new Event("visibilitychange"));
    }"""
    page.tab.evaluate(hide, True)
    page.command("setup.set", d1=17.25)
    assert page.state["setup"]["d1"] != 17.25
    page.tab.evaluate(hide, False)
    page.settled("state.setup.d1 === 17.25")
    page.close()
