/**
 * Entry point of the page: parses the query of its address and opens what it names.
 *
 * `?recording=URL`, `?beside=URL` (a second recording, shown beside it), `?server=ws://host:port`,
 * `?picture=1`, and the view (`shared-link.ts`): `?time=S`, `?agent=N`, `?layers=NAME,...`,
 * `?camera=X,Y,Z,YAW,PITCH,DISTANCE`. Without a recording or a server, the page connects to the
 * simulator that served it, and shows the welcome screen if there is none.
 */
import "./app/base.css";
import "./app/layout.css";
import "./app/panels.css";
import { App } from "./app/app.ts";
import { Comparison } from "./app/comparison.ts";
import type { Handle } from "./app/handle.ts";
import { isComparison, parseLink } from "./app/shared-link.ts";

const root = document.getElementById("app")!;
if (isComparison(location.search)) new Comparison(root, location.search);
else showOne(root, location.search);

/** Shows a run: the whole page, or a frame of a comparison. */
function showOne(root: HTMLElement, search: string): void {
  const query = new URLSearchParams(search);
  const app = new App(root, {
    view: parseLink(search),
    isPicture: query.get("picture") === "1",
  });

  const handle: Handle = {
    get run() {
      return app.run;
    },
    get scene() {
      return app.scene;
    },
    ready: app.ready,
    showAt: (timeS) => app.showAt(timeS),
    follow: (playback) => app.follow(playback),
    get state() {
      return app.state;
    },
  };
  window.maes = handle;

  // Unhandled errors are shown as well.
  window.addEventListener("error", ({ message }) => app.shell.banners.set("error", message));
  window.addEventListener("unhandledrejection", ({ reason }) =>
    app.shell.banners.set("error", String(reason)),
  );

  const recording = query.get("recording");
  const server = query.get("server");
  if (recording) void app.openUrl(recording);
  else if (server) app.connect(server);
  else if (location.protocol.startsWith("http")) {
    app.connect(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}`, true);
  }
}
