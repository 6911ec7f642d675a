"""Opens a file in the viewer Rerun without a window, and looks at the view of the cave.

    view_rerun.py FILE.rrd SECONDS

Fails unless all views show what they have to without a complaint, and the view of the cave has more
of it after so many seconds of sim time than at the start.
"""

import io
import socket
import sys
import time
from pathlib import Path

import numpy as np
from PIL import Image
from rerun.experimental import ViewerClient

# Until the viewer has loaded and drawn everything, seconds.
PATIENCE_S = 120.0
# Sum of red, green and blue; the background is darker, and so is the grid.
BRIGHT = 150

with socket.socket() as probe:
    probe.bind(("127.0.0.1", 0))
    port = probe.getsockname()[1]
program = str(Path(sys.executable).with_name("rerun"))
viewer = ViewerClient.spawn(headless=True, port=port, executable_path=program)
try:
    viewer.open(sys.argv[1])
    (cave,) = [view for view in viewer.get_state().views if view.name == "Cave"]

    def bright(seconds):
        viewer.set_time("sim_time", duration=seconds, play_state="paused")
        picture = Image.open(io.BytesIO(viewer.take_screenshot(view_id=cave.view_id)))
        return int((np.asarray(picture.convert("RGB")).astype(int).sum(axis=2) > BRIGHT).sum())

    deadline, before = time.monotonic() + PATIENCE_S, None
    while True:
        # It loads what a time needs once that is shown: until nothing changes any more.
        start, end = bright(0.0), bright(float(sys.argv[2]))
        if start > 1000 and end > 1.2 * start and before == (start, end):
            break
        before = start, end
        assert time.monotonic() < deadline, f"{start} pixels at the start, {end} later"
    views = viewer.get_state().views
    assert len(views) == 3 and all(view.visible and not view.reports for view in views), views
    print(f"{start} bright pixels at the start, {end} later")
finally:
    viewer.quit()
