/**
 * The page, loaded by the entry point: two recordings side by side, or a run. See `main.ts` for the
 * query of its address.
 */
import { App } from "./app/app.ts";
import { Comparison } from "./app/comparison.ts";
import type { Handle } from "./app/handle.ts";
import { isComparison, parseLink } from "./app/shared-link.ts";
import type { Run } from "./data/run.ts";

/** `opening`: the recording of the address, which is being opened. */
export function showPage(root: HTMLElement, search: string, opening: Promise<Run> | null): void {
  if (isComparison(search)) new Comparison(root, search);
  else window.maes = showOne(root, search, opening);
}

/** Shows a run: the whole page, or a frame of a comparison. */
function showOne(root: HTMLElement, search: string, opening: Promise<Run> | null): Handle {
  const query = new URLSearchParams(search);
  const app = new App(root, {
    view: parseLink(search),
    isPicture: query.get("picture") === "1",
    room: query.get("room"),
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
    get playback() {
      return app.playback;
    },
    get lineEndS() {
      return app.lineEndS;
    },
    scaleTo: (endS) => app.scaleTo(endS),
    follow: (playback) => app.follow(playback),
    get state() {
      return app.state;
    },
  };

  // Unhandled errors are shown as well.
  window.addEventListener("error", ({ message }) => app.shell.banners.set("error", message));
  window.addEventListener("unhandledrejection", ({ reason }) =>
    app.shell.banners.set("error", String(reason)),
  );

  const recording = query.get("recording");
  const server = query.get("server");
  if (recording && opening) void app.openFirst(recording, opening);
  else if (server) app.connect(server);
  else if (location.protocol.startsWith("http")) {
    app.connect(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}`, true);
  }
  return handle;
}
