"""The ways to the page: below a path of a proxy, on a phone, and before there is a publisher. Same browser and arguments
as stage_picture.py.

    stage_ways.py SCENARIO PROGRAM NAME
"""

import contextlib
import json
import re
import socket
import socketserver
import subprocess
import tempfile
import threading
import urllib.request

from stage_picture import NAME, PROGRAM, STILL, browser, play, publisher, server, started, until

PREFIX = "/dragon"


@contextlib.contextmanager
def proxy(url):
    """A proxy that has a server below PREFIX and nothing beside it. Returns its address, and the paths that it has not."""
    host, port = re.fullmatch(r"http://([^:]+):(\d+)/", url).groups()
    misplaced = []

    class Handler(socketserver.BaseRequestHandler):
        def handle(self):
            head = b""
            while b"\r\n\r\n" not in head:
                more = self.request.recv(65536)
                if not more:
                    return
                head += more
            method, path, rest = head.split(b" ", 2)
            if not path.startswith(f"{PREFIX}/".encode()):
                misplaced.append(path.decode())
                self.request.sendall(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
                return
            # One request a connection, unless it becomes a WebSocket.
            rest = re.sub(rb"(?i)\r\nconnection: keep-alive", b"\r\nConnection: close", rest)
            with socket.create_connection((host, int(port))) as inner:
                inner.sendall(method + b" " + path[len(PREFIX) :] + b" " + rest)
                threading.Thread(target=pump, args=(self.request, inner), daemon=True).start()
                pump(inner, self.request)

    def pump(source, target):
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                target.sendall(data)
        for end in (source, target):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    class Server(socketserver.ThreadingTCPServer):
        daemon_threads = allow_reuse_address = True

    with Server(("127.0.0.1", 0), Handler) as outer:
        threading.Thread(target=outer.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{outer.server_address[1]}", misplaced
        outer.shutdown()


def below_a_path():
    """Page, modules, frames and own pages come through a proxy that has them below a path."""
    with tempfile.TemporaryDirectory() as folder, started("view", "--json", "--port", "0", "--pages", folder) as child:
        with open(f"{folder}/index.html", "w", encoding="utf-8") as file:
            file.write("own")
        url = json.loads(child.stdout.readline())["url"]
        with publisher(*STILL), browser() as (page, complaints), proxy(url) as (outside, misplaced):
            page.goto(f"{outside}{PREFIX}/")
            until(page, "picture.received > 3 && picture.drawn > 0", "a picture through the proxy")
            assert not complaints and not misplaced, (complaints, misplaced)
            with urllib.request.urlopen(f"{outside}{PREFIX}/pages") as own:
                assert (own.url, own.read()) == (f"{outside}{PREFIX}/pages/", b"own"), own.url


def command(*arguments):
    done = subprocess.run([PROGRAM, "--name", NAME, "control", *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def held_on_a_phone():
    """A phone has no key H: the words name the button, and the button releases."""
    phone = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
    with started("view", "--json", "--port", "0", "--control") as child, publisher("--start", "300"), browser(**phone) as (page, complaints):
        page.goto(json.loads(child.stdout.readline())["url"])
        until(page, "document.body.dataset.transport === 'playing'", "a playing show")
        command("hold")
        until(page, "document.getElementById('playback-detail').textContent.endsWith('release: the red button')", "words for a hand")
        until(page, "document.getElementById('conduct-hold').textContent === 'HELD: release'", "the button")
        page.locator("#conduct-hold").tap()
        until(page, "document.body.dataset.transport === 'paused'", "the release")
        assert not complaints, complaints


def nobody_publishes():
    """Without a publisher the page says what runs here instead, or what to start."""
    detail = "document.getElementById('playback-detail').textContent"
    other = f"{NAME}_other"
    with server() as url, browser() as (page, complaints):
        page.goto(url)
        # Other tests may run shows.
        said = until(page, f"/; (running here|start it with): /.test({detail}) && {detail}", "what to start")
        start = f"start it with: bench-dragon run --name {NAME}"
        assert re.fullmatch(rf"waiting for a publisher; (running here: .+|{re.escape(start)})", said), said
        with subprocess.Popen([PROGRAM, "--name", other, "run", "--quiet"], stdout=subprocess.DEVNULL) as running:
            until(page, f"/running here: .*{other}/.test({detail})", "the other show")
            running.kill()
        assert not complaints, complaints


if __name__ == "__main__":
    play(below_a_path, held_on_a_phone, nobody_publishes)
