"""A stand-in for damprig's monitor server: serves the page and streams a small rig, or what a test tells it to send."""

import asyncio
import json
import pathlib
import threading
import time

from aiohttp import WSMsgType, web

from rig import SIGNALS, Rig, transmissibility

HOST = pathlib.Path(__file__).resolve().parents[2] / "host/src"
PAGE = HOST / "monitor/page"
POLICY = ("default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
          "base-uri 'none'; form-action 'none'; frame-ancestors 'none'")
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}
FRAME_S = 0.05
HISTORY_ROWS = 20_000


def files():
    """The files that the server embeds, by the path at which it serves them."""
    found = {f"/{file.name}": file for file in PAGE.iterdir() if file.suffix in (".js", ".css")}
    shared = {f"/{name}": HOST / "report/script" / name for name in ("axis.js", "text.js")}
    return found | shared | {"/": PAGE / "index.html", "/look.css": HOST / "report/look.css"}


class Server:
    """Runs in a thread of its own. `pace` is rig seconds per second; 0 sends nothing by itself."""

    def __init__(self, pace=1.0, port=0, token="0123abcd", rig=None, **snapshot):
        self.pace, self.port, self.token, self.rig = pace, port, token, rig or Rig()
        self.about = snapshot
        self.state = {}          # replaces parts of the rig's state
        self.actions = []        # what viewers asked for
        self.answer = None       # function of an action that gives (ok, text)
        self.frames = 0
        self.sockets = set()
        self.history = {"t_s": [], "values": {name: [] for name, _ in SIGNALS}}
        self.slow = {"t_s": [], "values": {name: [] for name in self.rig.slow()}}
        self.kept = {"points": [], "impacts": [], "section": [], "spectra": [], "transients": [],
                     "log": [{"at": "14:03:07", "level": "info", "text": "Set-up bare: the sweep begins."}]}
        self.started = threading.Event()

    def __enter__(self):
        self.loop = asyncio.new_event_loop()
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()
        assert self.started.wait(10), "the stand-in server did not start"
        return self

    def __exit__(self, *_):
        asyncio.run_coroutine_threadsafe(self._close(), self.loop).result(10)
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join(10)

    @property
    def address(self):
        return f"http://127.0.0.1:{self.port}/"

    def send(self, message):
        """Sends an object, or text as it is, to all viewers."""
        text = message if isinstance(message, (str, bytes)) else json.dumps(message)
        asyncio.run_coroutine_threadsafe(self._broadcast(text), self.loop).result(10)

    def frame(self, ticks=0, **parts):
        """Sends a frame: the rig moves on by some ticks; `parts` replace or add keys."""
        self.send(self._frame(ticks) | parts)

    def drop(self):
        """Closes all connections."""
        async def close():
            for socket in list(self.sockets):
                await socket.close()
        asyncio.run_coroutine_threadsafe(close(), self.loop).result(10)

    def await_action(self, what, timeout_s=5):
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            for action in self.actions:
                if action.get("do") == what:
                    return action
            time.sleep(0.01)
        raise AssertionError(f"no action {what}; there were {self.actions}")

    def await_viewers(self, count, timeout_s=10):
        end = time.monotonic() + timeout_s
        while len(self.sockets) != count:
            assert time.monotonic() < end, f"{len(self.sockets)} viewers instead of {count}"
            time.sleep(0.01)

    def warm_up(self, seconds):
        """History from before the first viewer."""
        for _ in range(int(seconds / FRAME_S)):
            self._frame(int(FRAME_S * 1000))

    # The server's thread.

    def _serve(self):
        asyncio.set_event_loop(self.loop)
        self.loop.run_until_complete(self._open())
        self.loop.run_forever()

    async def _open(self):
        app = web.Application()
        for path, file in files().items():
            app.router.add_get(path, self._file(file))
        app.router.add_get("/live", self._live)
        self.runner = web.AppRunner(app, access_log=None)
        await self.runner.setup()
        site = web.TCPSite(self.runner, "127.0.0.1", self.port, reuse_address=True)
        await site.start()
        self.port = site._server.sockets[0].getsockname()[1]
        self.streaming = self.loop.create_task(self._stream())
        self.started.set()

    async def _close(self):
        self.streaming.cancel()
        for socket in list(self.sockets):
            await socket.close()
        await self.runner.cleanup()

    def _file(self, file):
        async def serve(_):
            headers = {"Content-Security-Policy": POLICY, "Content-Type": f"{TYPES[file.suffix]}; charset=utf-8",
                       "Cache-Control": "no-store", "X-Content-Type-Options": "nosniff"}
            return web.Response(body=file.read_bytes(), headers=headers)
        return serve

    async def _live(self, request):
        socket = web.WebSocketResponse(max_msg_size=4096, protocols=("damprig",))
        await socket.prepare(request)
        text = json.dumps(self.snapshot())
        self.sockets.add(socket)
        await socket.send_str(text)
        try:
            async for message in socket:
                if message.type == WSMsgType.TEXT:
                    await socket.send_str(json.dumps(self._act(json.loads(message.data))))
        finally:
            self.sockets.discard(socket)
        return socket

    def _act(self, action):
        self.actions.append(action)
        if action["do"] != "replay" and action.get("token") != self.token:
            ok, text = False, "wrong token; it was printed when damprig was started"
        else:
            ok, text = self.answer(action) if self.answer else (True, "")
        return {"kind": "answer", "id": action["id"], "ok": ok, "text": text}

    def snapshot(self):
        curves = [{"set_up": name, "about": f"Z = 1.2 mm, set-up {name}", "experiment": "sweep",
                   "predicted": [[2 + i / 200, transmissibility(2 + i / 200, d)] for i in range(201)]}
                  for name, d in zip(self.rig.set_ups, (0.02, 0.035, 0.05))]
        return {
            "kind": "snapshot", "version": "damprig 0.1.0 (stand-in)",
            "source": {"kind": "run", "name": "hybrid", "rig": "virtual:realtime", "board": "virtual", "folder": "runs/2026-11-22-hybrid"},
            "can_control": True, "can_inject": True, "is_replay": False,
            "where_to_stop": "Stop: Ctrl-C in the terminal that runs damprig on lab-pc.",
            "signals": [{"name": name, "unit": unit} for name, unit in SIGNALS], "curves": curves,
            "rows": self.history, "slow": self.slow, "state": self.rig.state() | self.state} | self.kept | self.about

    def _frame(self, ticks):
        fresh = self.rig.advance(ticks)
        now = {"t_s": [], "values": {name: [] for name in self.slow["values"]}}
        if ticks and int(self.rig.t_s * 10) != int((self.rig.t_s - ticks / 1000) * 10):
            now["t_s"].append(self.rig.t_s)
            for name, value in self.rig.slow().items():
                now["values"][name].append(value)
        for kept, new in ((self.history, fresh["rows"]), (self.slow, now)):
            for target, source in [(kept["t_s"], new["t_s"])] + [(kept["values"][n], new["values"][n]) for n in kept["values"]]:
                target.extend(source)
                del target[:-HISTORY_ROWS]
        is_due = ticks and int(self.rig.t_s * 2) != int((self.rig.t_s - ticks / 1000) * 2)
        fresh["spectra"] = [self.rig.spectrum()] if is_due else []
        for name in ("points", "impacts", "section", "spectra"):
            self.kept[name].extend(fresh[name])
            del self.kept[name][:-2000]
        log = [{"at": "14:04:12", "level": "info", "text": f"{p['set_up']}: {p['frequency_hz']} Hz, X/Z {p['x_over_z']:.2f} (cycle maxima)."}
               for p in fresh["points"]]
        self.kept["log"].extend(log)
        del self.kept["log"][:-200]
        self.frames += 1
        return {"kind": "frame", **fresh, "slow": now, "log": log, "state": self.rig.state() | self.state}

    async def _broadcast(self, text):
        for socket in list(self.sockets):
            if socket.closed:
                continue
            await (socket.send_bytes(text) if isinstance(text, bytes) else socket.send_str(text))

    async def _stream(self):
        start, sent = self.loop.time(), 0
        while True:
            await asyncio.sleep(FRAME_S)
            if self.pace <= 0:
                start, sent = self.loop.time(), 0
                continue
            due = int((self.loop.time() - start) * self.pace * 1000)
            ticks, sent = min(due - sent, int(2000 * self.pace)), due
            await self._broadcast(json.dumps(self._frame(ticks)))
