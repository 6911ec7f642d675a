/**
 * The address of what is shown: run, time, agent, layers and camera. Pure.
 *
 * Such an address holds no token: whoever opens a live run with it needs the token of that run.
 */
import { DEFAULT_LAYERS, type Layers } from "../scene/view.ts";
import type { Orbit } from "../scene/orbit.ts";

/** What an address can say about the view; null: nothing. */
export interface SharedView {
  readonly timeS: number | null;
  readonly agent: number | null;
  readonly layers: Layers | null;
  readonly camera: Orbit | null;
}

/** A non-negative number of a query; null if it is missing or malformed. */
function numberOf(query: URLSearchParams, name: string): number | null {
  const text = query.get(name);
  if (text === null || text.trim() === "") return null;
  const value = Number(text);
  return Number.isFinite(value) && value >= 0 ? value : null;
}

/** `layers=walls,trails`: these, and no others. Names of other versions are ignored. */
function layersOf(query: URLSearchParams): Layers | null {
  const text = query.get("layers");
  if (text === null) return null;
  const shown = new Set(text.split(","));
  const names = Object.keys(DEFAULT_LAYERS) as (keyof Layers)[];
  return Object.fromEntries(names.map((name) => [name, shown.has(name)])) as unknown as Layers;
}

/**
 * `camera=X,Y,Z,YAW,PITCH,DISTANCE`: metres and degrees; the centre is relative to the middle of
 * the map, or to the selected agent.
 */
function cameraOf(query: URLSearchParams): Orbit | null {
  const values = query.get("camera")?.split(",").map(Number) ?? [];
  if (values.length !== 6 || !values.every(Number.isFinite)) return null;
  const [x, y, z, yaw, pitch, distanceM] = values as [number, number, number, number, number, number];
  if (distanceM <= 0 || Math.abs(pitch) > 89) return null;
  const radians = Math.PI / 180;
  return { centre: [x, y, z], yawRad: yaw * radians, pitchRad: pitch * radians, distanceM };
}

export function parseLink(search: string): SharedView {
  const query = new URLSearchParams(search);
  return {
    timeS: numberOf(query, "time"),
    agent: numberOf(query, "agent"),
    layers: layersOf(query),
    camera: cameraOf(query),
  };
}

/** Whether a query names two recordings to be shown side by side; not so in a frame of them. */
export function isComparison(search: string): boolean {
  const query = new URLSearchParams(search);
  return query.has("recording") && query.has("beside") && !query.has("side");
}

/** The query of the second of two recordings: the same view with both exchanged. */
export function besideOf(search: string): string {
  const query = new URLSearchParams(search);
  const [recording, beside] = [query.get("recording") ?? "", query.get("beside") ?? ""];
  query.set("recording", beside);
  query.set("beside", recording);
  return query.toString();
}

/**
 * The address of the page with a view. `recording`, `beside` and `server` are kept from the page's
 * own address, everything else is that of the view.
 */
export function linkTo(page: string, view: SharedView): string {
  const link = new URL(page);
  const source = link.searchParams;
  const query = new URLSearchParams();
  for (const name of ["recording", "beside", "server"]) {
    const value = source.get(name);
    if (value !== null) query.set(name, withoutToken(value));
  }
  const rounded = (value: number, digits: number) => String(Number(value.toFixed(digits)));
  if (view.timeS !== null) query.set("time", rounded(view.timeS, 2));
  if (view.agent !== null) query.set("agent", String(view.agent));
  if (view.layers !== null) {
    const shown = Object.entries(view.layers).filter(([, isShown]) => isShown === true);
    query.set("layers", shown.map(([name]) => name).join(","));
  }
  if (view.camera !== null) {
    const { centre, yawRad, pitchRad, distanceM } = view.camera;
    const degrees = 180 / Math.PI;
    const values = [
      ...centre.map((metres) => rounded(metres, 2)),
      rounded(yawRad * degrees, 1),
      rounded(pitchRad * degrees, 1),
      rounded(distanceM, 2),
    ];
    query.set("camera", values.join(","));
  }
  // Commas and slashes need no escaping in a query, and people read these addresses.
  link.search = query.toString().replaceAll("%2C", ",").replaceAll("%2F", "/").replaceAll("%3A", ":");
  link.hash = "";
  return link.href;
}

/** The address of a server without the token in its query. */
function withoutToken(address: string): string {
  return address.replace(/([?&])token=[^&]*&?/, "$1").replace(/[?&]$/, "");
}
