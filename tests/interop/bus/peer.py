"""Drives our side: the example program bus_peer, a node that obeys lines."""

import json
import queue
import subprocess
import threading
import time

PATIENCE = 60.0


class Peer:
    """One process of ours, a node or a router."""

    def __init__(self, program, node, netns=None, **settings):
        words = [f"{key}={value}" for key, value in settings.items()]
        inside = ["ip", "netns", "exec", netns] if netns else []
        self.name = node
        self.process = subprocess.Popen(
            [*inside, program, node, *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        self.lines = queue.Queue()
        self.seen = []
        threading.Thread(target=self._read, daemon=True).start()
        self.take("router" if node == "router" else "ready")

    def _read(self):
        for line in self.process.stdout:
            self.lines.put(json.loads(line))
        self.lines.put({"end": self.process.wait()})

    def tell(self, *words):
        self.process.stdin.write(" ".join(str(word) for word in words) + "\n")

    def take_any(self, keys, patience=PATIENCE):
        """The next line with one of these keys."""
        for item in self.seen:
            if any(key in item for key in keys):
                self.seen.remove(item)
                return item
        while True:
            try:
                item = self.lines.get(timeout=patience)
            except queue.Empty:
                raise AssertionError(f"{self.name}: none of {keys} within {patience} s") from None
            if any(key in item for key in keys):
                return item

    def take(self, key, match=lambda item: True, patience=PATIENCE):
        """The next line with that key, and with what `match` wants; others are kept for later."""
        deadline = time.monotonic() + patience
        for item in list(self.seen):
            if key in item and match(item):
                self.seen.remove(item)
                return item
        while True:
            try:
                item = self.lines.get(timeout=max(0.0, deadline - time.monotonic()))
            except queue.Empty:
                raise AssertionError(f"{self.name}: no {key} within {patience} s; seen {self.seen[-5:]}") from None
            if "error" in item and key != "error" or "end" in item:
                raise AssertionError(f"{self.name}: {item} while waiting for {key}")
            if key in item and match(item):
                return item
            self.seen.append(item)

    def ask(self, answer, *words):
        self.tell(*words)
        return self.take(answer)

    def end(self):
        self.process.stdin.close()
        self.process.wait(PATIENCE)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()


def check(what, found, wanted):
    if found != wanted:
        raise AssertionError(f"{what}\n   found {found!r}\n  wanted {wanted!r}")


def until(what, ready, patience=PATIENCE):
    """Waits for what an implementation without a way to wait will do."""
    deadline = time.monotonic() + patience
    while not ready():
        if time.monotonic() > deadline:
            raise AssertionError(f"{what}: not within {patience} s")
        time.sleep(0.01)
