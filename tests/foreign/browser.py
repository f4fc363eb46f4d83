"""A Chromium without a window, driven by the DevTools protocol, and a Firefox, driven by WebDriver BiDi."""

import asyncio
import base64
import json
import shutil
import subprocess
import threading
import time
import urllib.request
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.util import find_spec
from pathlib import Path

from tornado.websocket import websocket_connect

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
FIREFOX = shutil.which("firefox") or shutil.which("firefox-esr")
LIMIT = 120  # s for one answer of the browser
# Chromium without a window has no mouse; a page may treat that as a touch screen.
MOUSE = "--blink-settings=primaryHoverType=2,availableHoverTypes=2,primaryPointerType=4,availablePointerTypes=4"


class Page:
    """A page of the browser, with what it and its workers asked for, and what it complained about."""

    def __init__(self, loop, connection):
        self.loop, self.connection, self.number = loop, connection, 0
        self.requests, self.complaints = [], []

    async def _send(self, method, values, **session):
        self.number += 1
        await self.connection.write_message(json.dumps({"id": self.number, "method": method, "params": values, **session}))

    async def _note(self, message):
        method, values = message.get("method"), message.get("params", {})
        if method == "Target.attachedToTarget":
            # A worker, which waits; answers need no attention.
            for command in ("Network.enable", "Runtime.runIfWaitingForDebugger"):
                await self._send(command, {}, sessionId=values["sessionId"])
        elif method == "Network.requestWillBeSent":
            self.requests.append(values["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(values["exceptionDetails"]))
        elif method == "Log.entryAdded" and values["entry"]["level"] in ("error", "warning"):
            self.complaints.append(values["entry"]["text"])
        elif method == "Runtime.consoleAPICalled" and values["type"] in ("error", "warning"):
            self.complaints.append(json.dumps(values["args"]))

    async def _call(self, method, values):
        await self._send(method, values)
        number = self.number
        while True:
            message = json.loads(await asyncio.wait_for(self.connection.read_message(), LIMIT))
            if message.get("id") == number:
                assert "error" not in message, message
                return message["result"]
            await self._note(message)

    def call(self, method, **values):
        """A command of the protocol."""
        return self.loop.run_until_complete(self._call(method, values))

    def evaluate(self, script):
        """The value of an expression, or of the promise that it is."""
        words = {"expression": script, "awaitPromise": True, "returnByValue": True}
        answer = self.call("Runtime.evaluate", **words)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def until(self, script, limit=60):
        """Waits until an expression is true."""
        end = time.monotonic() + limit
        while not self.evaluate(script):
            assert time.monotonic() < end, f"{script} did not become true; {self.complaints}"
            time.sleep(0.05)

    def open(self, address):
        """Loads a page."""
        self.call("Page.navigate", url=address)
        self.until("document.readyState === 'complete'")

    def places(self, selector, parts):
        """Where parts of the width of an element are on the screen, in the middle of its height."""
        box = self.evaluate(f"document.querySelector({json.dumps(selector)}).getBoundingClientRect().toJSON()")
        return [(box["left"] + part * box["width"], box["top"] + box["height"] / 2) for part in parts]

    def _touch(self, kind, points):
        points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)]
        self.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    def pinch(self, selector, start, end, turns=5):
        """Puts fingers on parts of the width of an element and moves them to others."""
        start, end = self.places(selector, start), self.places(selector, end)
        self._touch("touchStart", start)
        for k in range(1, turns + 1):
            share = k / turns
            self._touch("touchMove", [(x + share * (to - x), y) for (x, y), (to, _) in zip(start, end, strict=True)])
        self._touch("touchEnd", [])

    def double_tap(self, selector):
        """Taps twice on the middle of an element."""
        for _ in range(2):
            self._touch("touchStart", self.places(selector, [0.5]))
            self._touch("touchEnd", [])

    def swipe_up(self, selector, distance):
        """Moves one finger upwards from the middle of an element."""
        ((x, y),) = self.places(selector, [0.5])
        self._touch("touchStart", [(x, y)])
        for k in range(1, 16):
            self._touch("touchMove", [(x, y - k * distance / 15)])
        self._touch("touchEnd", [])

    def serious(self, place="document", **rules):
        """What axe-core finds serious or critical in a part of the page, an expression: rule and elements.

        `rules` are axe's options that choose rules.
        """
        package = find_spec("axe_playwright_python")
        assert package, "axe-core is missing: pip install --no-deps --requirement scripts/build/axe-requirements.txt"
        if not self.evaluate("'axe' in window"):
            self.evaluate((Path(package.submodule_search_locations[0]) / "axe.min.js").read_text(encoding="utf-8"))
        options = json.dumps({"resultTypes": ["violations"], **rules})
        violations = self.evaluate(f"axe.run({place}, {options}).then((found) => found.violations)")
        serious = [rule for rule in violations if rule["impact"] in ("serious", "critical")]
        return [(rule["id"], [node["target"][0] for node in rule["nodes"]]) for rule in serious]

    def violations(self):
        """What axe-core finds serious or critical in the page, light and dark: scheme, rule and elements."""
        findings = []
        for scheme in ("light", "dark"):
            self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
            findings += [(scheme, *rule) for rule in self.serious()]
        return findings

    def picture(self, path):
        """Writes a screenshot of the whole page."""
        shot = self.call("Page.captureScreenshot", captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(shot["data"]))


@contextmanager
def browser(folder, width=1200, height=900, flags=()):
    """A page in a new browser; `folder` keeps its profile."""
    words = ["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0", f"--user-data-dir={folder}"]
    words += [f"--window-size={width},{height}", "--no-first-run", *flags, "about:blank"]
    process = subprocess.Popen([CHROMIUM, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    loop = asyncio.new_event_loop()
    try:
        place, end = folder / "DevToolsActivePort", time.monotonic() + 60
        while not (place.exists() and place.read_text(encoding="ascii").count("\n")):
            assert process.poll() is None and time.monotonic() < end, "the browser did not start"
            time.sleep(0.05)
        port = place.read_text(encoding="ascii").split()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            target = next(page for page in json.load(answer) if page["type"] == "page")
        address = target["webSocketDebuggerUrl"]
        page = Page(loop, loop.run_until_complete(_connected(address)))
        for domain in ("Page", "Runtime", "Network", "Log"):
            page.call(f"{domain}.enable")
        page.call("Target.setAutoAttach", autoAttach=True, waitForDebuggerOnStart=True, flatten=True)
        yield page
    finally:
        process.kill()
        process.wait()
        loop.close()


class FirefoxPage(Page):
    """A page of Firefox, for what needs no command of the DevTools protocol."""

    context = ""

    async def _note(self, message):
        if message.get("method") == "log.entryAdded" and message["params"]["level"] in ("error", "warn"):
            self.complaints.append(message["params"]["text"])

    def evaluate(self, script):
        """The value of an expression: a text, a number or a Boolean."""
        answer = self.call("script.evaluate", expression=script, target={"context": self.context}, awaitPromise=True)
        assert answer["type"] == "success", answer["exceptionDetails"]
        return answer["result"].get("value")

    def open(self, address):
        self.call("browsingContext.navigate", context=self.context, url=address, wait="complete")


@contextmanager
def firefox(folder):
    """A page in a new Firefox that asks for less motion; `folder` keeps its profile."""
    folder.mkdir()
    (folder / "user.js").write_text('user_pref("ui.prefersReducedMotion", 1);', encoding="ascii")
    words = [FIREFOX, "--headless", "--no-remote", "--remote-debugging-port", "0", "--profile", folder]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    loop = asyncio.new_event_loop()
    try:
        address = next(line.split()[-1] for line in process.stderr if "WebDriver BiDi listening" in line)
        page = FirefoxPage(loop, loop.run_until_complete(_connected(f"{address}/session")))
        page.call("session.new", capabilities={})
        page.call("session.subscribe", events=["log.entryAdded"])
        page.context = page.call("browsingContext.getTree")["contexts"][0]["context"]
        yield page
    finally:
        process.kill()
        process.wait()
        loop.close()


async def _connected(address):
    return await websocket_connect(address, max_message_size=1 << 28)


@contextmanager
def served(folder, requested=None):
    """The address of a file server of a folder; `requested` gets the paths asked for."""

    class Handler(SimpleHTTPRequestHandler):
        def log_request(self, *_):
            """Keeps the path."""
            if requested is not None:
                requested.append(self.path)

        def log_message(self, *_):
            """Nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
