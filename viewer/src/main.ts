/**
 * Entry point of the page: opens the recording that its address names, and loads the page
 * meanwhile.
 *
 * `?recording=URL`, `?beside=URL` (a second recording, shown beside it), `?room=URL` (what answers
 * questions about a map), `?server=ws://host:port`, `?picture=1`, and the view (`shared-link.ts`): `?time=S`, `?agent=N`, `?layers=NAME,...`,
 * `?camera=X,Y,Z,YAW,PITCH,DISTANCE`. Without a recording or a server, an exported page shows its
 * recordings (`exported.ts`); another one connects to the simulator that served it, and shows the
 * welcome screen if there is none.
 */
import "./app/base.css";
import "./app/layout.css";
import "./app/panels.css";
import "./app/playback-bar.css";
import { pageQuery } from "./app/exported.ts";
import { pendingHandle } from "./app/handle.ts";
import { isComparison } from "./app/shared-link.ts";
import type { Run } from "./data/run.ts";
import { openUrl } from "./data/sources.ts";

const root = document.getElementById("app")!;
const search = pageQuery();
const recording = new URLSearchParams(search).get("recording");
let opening: Promise<Run> | null = null;
if (recording && !isComparison(search)) {
  opening = openUrl(recording);
  // The page reports a failure, once it is there.
  opening.catch(() => undefined);
}
const page = import("./page.ts").then(({ showPage }) => {
  showPage(root, search, opening);
  return window.maes!;
});
if (!isComparison(search)) window.maes = pendingHandle(page);
