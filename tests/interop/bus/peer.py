"""Drives our side: the example program bus_peer, a node that obeys lines."""

import json
import pathlib
import subprocess
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2]))
import kit  # noqa: E402


class Peer:
    """One process of ours, a node or a router; `host`: where it runs."""

    def __init__(self, program, node, host=None, **settings):
        words = [f"{key}={value}" for key, value in settings.items()]
        self.name, self.read, self.seen = node, 0, []
        self.process = kit.Process(*(host.inside if host else ()), program, node, *words, stdin=subprocess.PIPE, apart=True)
        self.take("router" if node == "router" else "ready")

    def tell(self, *words):
        self.process.say(" ".join(str(word) for word in words))

    def look(self, keys, match=lambda item: True):
        """The next line with one of these keys, and with what `match` wants, if it has come; others are kept for later."""
        for item in self.seen:
            if any(key in item for key in keys) and match(item):
                self.seen.remove(item)
                return item
        is_silent = self.process.is_silent()
        while self.read < len(self.process.told):
            item = json.loads(self.process.told[self.read])
            self.read += 1
            assert "error" not in item or "error" in keys, f"{self.name}: {item} while waiting for {keys}"
            if any(key in item for key in keys) and match(item):
                return item
            self.seen.append(item)
        assert not is_silent, f"{self.process} has ended without {keys}: {self.process.errors}"
        return None

    def take_any(self, keys, seconds=kit.PATIENCE):
        return kit.until(f"{keys} of {self.name}", lambda: self.look(keys), seconds)

    def take(self, key, match=lambda item: True, seconds=kit.PATIENCE):
        return kit.until(f"{key} of {self.name}", lambda: self.look((key,), match), seconds)

    def ask(self, answer, *words):
        self.tell(*words)
        return self.take(answer)

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        if kind is not None:
            kit.state()
        self.process.kill()


def check(what, found, wanted):
    if found != wanted:
        raise AssertionError(f"{what}\n   found {found!r}\n  wanted {wanted!r}")
