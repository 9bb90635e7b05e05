"""Takes the picture of the README: the demo's last drop on the page. Needs Chromium.

.venv/bin/droptower demo --once --data demo-data && .venv/bin/python docs/images/take.py demo-data
"""

import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]

command = [Path(sys.executable).with_name("droptower"), "serve", "--data", sys.argv[1], "--port", "0"]
with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as service, sync_playwright() as play:
    assert service.stderr is not None
    url = next(word for word in service.stderr.readline().split() if word.startswith("http"))
    browser = play.chromium.launch(executable_path="/usr/bin/chromium", args=FLAGS)
    page = browser.new_page(viewport={"width": 1400, "height": 1290})
    page.goto(url)
    page.goto(url.rstrip("/") + str(page.locator("table a").first.get_attribute("href")))
    page.locator(".js-plotly-plot").nth(2).wait_for()  # no wait_for_function: the page's policy forbids eval
    page.wait_for_load_state("networkidle")
    page.screenshot(path=Path(__file__).with_name("run.png"))
    browser.close()
    service.terminate()
