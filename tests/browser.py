"""A real browser for pages: headless Chromium, driven by its own command line alone."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import uuid
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

NAMES = ("chromium", "chromium-browser", "google-chrome")

FLAGS = (
    "--headless",
    "--no-sandbox",  # which root, as containers have it, cannot use
    "--hide-scrollbars",
    "--force-device-scale-factor=1",
    "--enable-logging=stderr",
    # WebGL in software, on machines without a graphics card
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    # The browser's own errands; what it tries nevertheless reaches no host.
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-extensions",
    "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--virtual-time-budget=5000",
)

BROWSERS_OWN = "not an origin"
"""Who asks, in the network's log, where it is the browser and no page."""

TIMEOUT_S = 120


@dataclass(frozen=True, slots=True)
class Visit:
    """What a page showed ``(H, W, 3)``, said to the console, and asked the network for."""

    picture: NDArray[np.uint8]
    console: list[str]
    requests: set[str]


@dataclass(frozen=True, slots=True)
class Browser:
    program: str
    folder: Path

    def visit(
        self, page: Path, *flags: str, width: int = 1280, height: int = 1000, script: str = ""
    ) -> Visit:
        """Open a file; `script` runs in it, before the page's own ones."""
        place = self.folder / uuid.uuid4().hex
        place.mkdir()
        shown = place / "page.html"
        html = page.read_text(encoding="utf-8")
        shown.write_text(html.replace("</head>", f"<script>{script}</script></head>", 1), "utf-8")
        run = subprocess.run(
            [
                self.program,
                *FLAGS,
                *flags,
                f"--user-data-dir={place / 'profile'}",
                f"--window-size={width},{height}",
                f"--log-net-log={place / 'net.json'}",
                f"--screenshot={place / 'shot.png'}",
                shown.as_uri(),
            ],
            capture_output=True,
            text=True,
            encoding="utf-8",
            errors="replace",
            timeout=TIMEOUT_S,
            check=True,
        )
        with Image.open(place / "shot.png") as image:
            picture = np.asarray(image.convert("RGB"))
        return Visit(picture, read_console(run.stderr), read_requests(place / "net.json"))


def read_console(log: str) -> list[str]:
    """Whatever the page wrote there, at every level."""
    return re.findall(r":CONSOLE[^\]]*\] \"(.*)\", source: ", log)


def read_requests(path: Path) -> set[str]:
    """Addresses that the page, not the browser, asked for; its own file is none."""
    events = json.loads(path.read_text(encoding="utf-8"))["events"]
    found = [event.get("params", {}) for event in events]
    return {
        item["url"]
        for item in found
        if "url" in item and item.get("initiator", BROWSERS_OWN) != BROWSERS_OWN
    }


def find_program() -> str | None:
    return next(filter(None, map(shutil.which, NAMES)), None)
