"""--tev: what a viewer of the protocol of tev gets is the image."""

import socket
import struct
import threading

import ambilux
import numpy as np
from conftest import SCENES
from test_render import program


class Viewer(threading.Thread):
    """Takes one connection and puts images together from packets."""

    def __init__(self):
        super().__init__(daemon=True)
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.images, self.updates, self.broken = {}, 0, None

    def run(self):
        connection, _ = self.listener.accept()
        with connection, connection.makefile("rb") as stream:
            try:
                while head := stream.read(4):
                    self.take(stream.read(struct.unpack("<I", head)[0] - 4))
            except Exception as e:  # told by the test
                self.broken = e

    def take(self, packet):
        at = 0

        def numbers(form):
            nonlocal at
            values = struct.unpack_from("<" + form, packet, at)
            at += struct.calcsize("<" + form)
            return values

        def text():
            nonlocal at
            end = packet.index(b"\0", at)
            value, at = packet[at:end].decode(), end + 1
            return value

        kind, focus = numbers("BB")
        name = text()
        if kind == 4:
            width, height, count = numbers("iii")
            assert [text() for _ in range(count)] == ["R", "G", "B"] and at == len(packet)
            self.images[name] = np.zeros((height, width, 3), np.float32)
            return
        assert (kind, focus) == (6, 0)
        names = [text() for _ in range(*numbers("i"))]
        x, y, width, height = numbers("iiii")
        offsets, strides = numbers("3q"), numbers("3q")
        data = np.frombuffer(packet, "<f4", offset=at)
        for channel, offset, stride in zip(names, offsets, strides):
            values = data[offset::stride][:width * height]
            self.images[name][y:y + height, x:x + width, "RGB".index(channel)] = values.reshape(height, width)
        self.updates += 1


def test_a_viewer_gets_the_image(tmp_path):
    viewer = Viewer()
    viewer.start()
    out = tmp_path / "a.exr"
    # More than one packet an image, and more than one image.
    done = program("render", SCENES / "cornell.xml", "-o", out, "--size", "512x384", "--time", 1.5, "--tev", f"127.0.0.1:{viewer.port}", "--backend", "cpu")
    viewer.join(timeout=20)
    assert done.returncode == 0 and viewer.broken is None, (done.stderr, viewer.broken)
    assert list(viewer.images) == [str(out)] and viewer.updates >= 6
    np.testing.assert_array_equal(viewer.images[str(out)], ambilux.read(out).rgb)


def test_a_missing_viewer_is_told_before_the_render(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    done = program("render", SCENES / "cornell.xml", "-o", tmp_path / "a.exr", "--tev", f"127.0.0.1:{port}")
    assert done.returncode == 4 and f"--tev 127.0.0.1:{port}: Connection refused" in done.stderr
    assert program("render", SCENES / "cornell.xml", "-o", tmp_path / "a.exr", "--tev", "localhost:x").returncode == 2


def test_a_viewer_that_goes_away_does_not_end_the_render(tmp_path):
    listener = socket.create_server(("127.0.0.1", 0))

    def leave():
        connection, _ = listener.accept()
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        connection.close()
        listener.close()

    threading.Thread(target=leave, daemon=True).start()
    done = program("render", SCENES / "cornell.xml", "-o", tmp_path / "a.exr", "--size", "256x192", "--time", 1.2, "--backend", "cpu",
                   "--tev", f"127.0.0.1:{listener.getsockname()[1]}")
    assert done.returncode == 0 and "goes on without it" in done.stderr and (tmp_path / "a.exr").exists()
