/**
 * The agents of a run at a moment: bodies, trails, ways and targets, who hears whom, names.
 */

import { Group, Vector3, type PerspectiveCamera } from "three";
import type { AgentState, Run, Vec3 } from "../data/run.ts";
import { Bodies, BODY_RADIUS_PX } from "./bodies.ts";
import { agentRgb, type Rgb } from "./colours.ts";
import type { Common } from "./glsl.ts";
import { Glyphs, GLYPH, type Glyph } from "./glyphs.ts";
import { Pieces, type Piece } from "./ribbons.ts";
import { Trail } from "./trails.ts";
import type { View } from "./view.ts";

/** Where an agent is on the canvas, CSS pixels from its upper left corner. */
interface OnScreen {
  readonly state: AgentState;
  readonly x: number;
  readonly y: number;
  readonly depthM: number;
  readonly radiusPx: number;
}

/** How the picture is taken. */
export interface Shot {
  readonly camera: PerspectiveCamera;
  /** Of the canvas, CSS pixels. */
  readonly width: number;
  readonly height: number;
}

/** Bodies with a larger radius on the screen are drawn finely. */
const LARGE_PX = 22;
const NAME_RADIUS_PX = 15;
/** How far from an agent a click may be. */
const PICK_SLACK_PX = 8;

export class Team {
  readonly root = new Group();
  readonly #colours: readonly Rgb[];
  readonly #bodies: Bodies;
  readonly #trails: readonly Trail[];
  readonly #lines: Pieces;
  readonly #glyphs: Glyphs;
  #onScreen: readonly OnScreen[] = [];

  constructor(
    readonly run: Run,
    common: Common,
  ) {
    const ids = Array.from({ length: run.setup.agents }, (_, id) => id);
    this.#colours = ids.map(agentRgb);
    this.#bodies = new Bodies(common, this.#colours);
    this.#trails = this.#colours.map((colour, id) => new Trail(common, colour, this.#radiusM(id)));
    this.#lines = new Pieces(common, 0.25, 4);
    this.#glyphs = new Glyphs(common, ids.length);
    this.root.add(...this.#bodies.meshes, ...this.#lines.meshes, this.#glyphs.mesh);
    for (const trail of this.#trails) this.root.add(...trail.meshes);
  }

  show(timeS: number, view: View, selected: number | null, shot: Shot): void {
    const states = this.#colours.map((_, id) => this.run.agentAt(id, timeS));
    this.#onScreen = states.map((state) => this.#place(state, shot));
    const pieces: Piece[] = [];
    const glyphs: Glyph[] = [];
    for (const seen of this.#onScreen) {
      const { id, position, yawRad } = seen.state;
      const pixels = seen.radiusPx / this.#trueRadiusPx(seen, shot);
      this.#bodies.show(id, position, yawRad, this.#radiusM(id) * pixels, seen.radiusPx > LARGE_PX);
      this.#showTrail(seen.state, timeS, view, selected, pieces);
      glyphs.push(...this.#glowOf(seen, selected));
      if (view.layers.paths) this.#showWay(seen.state, selected, pieces, glyphs);
    }
    if (view.layers.contacts) this.#showContacts(states, selected, pieces);
    if (view.layers.labels) glyphs.push(...this.#names(selected));
    this.#lines.show(pieces);
    this.#glyphs.show(glyphs);
  }

  /** The agent at a place of the canvas in the last picture. */
  pick(x: number, y: number): number | null {
    let best: OnScreen | null = null;
    for (const seen of this.#onScreen) {
      const isHit = seen.depthM > 0 && Math.hypot(seen.x - x, seen.y - y) <= seen.radiusPx + PICK_SLACK_PX;
      if (isHit && (best === null || seen.depthM < best.depthM)) best = seen;
    }
    return best === null ? null : best.state.id;
  }

  dispose(): void {
    this.#bodies.dispose();
    for (const trail of this.#trails) trail.dispose();
    this.#lines.dispose();
    this.#glyphs.dispose();
  }

  #radiusM(id: number): number {
    return this.run.setup.radiusM[id] ?? 0.4 * this.run.terrain.cellM;
  }

  #trueRadiusPx(seen: { readonly depthM: number; readonly state: AgentState }, shot: Shot): number {
    const halfHeightM = Math.tan((shot.camera.fov * Math.PI) / 360) * Math.max(seen.depthM, 0.01);
    return (this.#radiusM(seen.state.id) / halfHeightM) * (shot.height / 2);
  }

  #place(state: AgentState, shot: Shot): OnScreen {
    const view = new Vector3(...state.position).applyMatrix4(shot.camera.matrixWorldInverse);
    const depthM = -view.z;
    const screen = view.applyMatrix4(shot.camera.projectionMatrix);
    return {
      state,
      x: (screen.x * 0.5 + 0.5) * shot.width,
      y: (0.5 - screen.y * 0.5) * shot.height,
      depthM,
      radiusPx: Math.max(this.#trueRadiusPx({ depthM, state }, shot), BODY_RADIUS_PX),
    };
  }

  #showTrail(state: AgentState, timeS: number, view: View, selected: number | null, pieces: Piece[]): void {
    const trail = this.#trails[state.id]!;
    if (!view.layers.trails) {
      trail.hide();
      return;
    }
    trail.learn(this.run.track(state.id));
    const isChosen = selected === state.id;
    const bright = selected === null ? 0.85 : isChosen ? 1 : 0.45;
    const widthPx = isChosen ? 3 : 2.2;
    const last = trail.show(timeS, { bright, widthPx });
    if (last === null) return;
    const colour = this.#colours[state.id]!.map((share) => share * 0.65 + 0.35) as [number, number, number];
    pieces.push({ from: last, to: state.position, colour, alpha: bright, widthPx, dashM: 0 });
  }

  #glowOf(seen: OnScreen, selected: number | null): Glyph[] {
    const { id, position } = seen.state;
    const base = { place: position, abovePx: 0, colour: this.#colours[id]!, number: 0 };
    const glow = { ...base, kind: GLYPH.glow, radiusPx: seen.radiusPx * 2 + 10, alpha: 0.42 };
    if (id !== selected) return [glow];
    return [
      glow,
      { ...base, kind: GLYPH.ring, radiusPx: seen.radiusPx * 1.25 + 9, alpha: 0.95, colour: [1, 1, 1] },
    ];
  }

  #showWay(state: AgentState, selected: number | null, pieces: Piece[], glyphs: Glyph[]): void {
    if (state.path.length === 0) return;
    const isChosen = state.id === selected;
    const colour = this.#colours[state.id]!;
    const alpha = selected === null ? 0.6 : isChosen ? 0.95 : 0.25;
    let from: Vec3 = state.position;
    for (const [index, to] of state.path.entries()) {
      pieces.push({
        from,
        to,
        colour,
        alpha,
        widthPx: isChosen ? 1.8 : 1.2,
        dashM: 0.8 * this.run.terrain.cellM,
      });
      const isLast = index + 1 === state.path.length;
      const mark = { place: to, abovePx: 0, colour, number: 0 };
      if (isLast) glyphs.push({ ...mark, kind: GLYPH.target, radiusPx: isChosen ? 11 : 7, alpha });
      else if (isChosen) glyphs.push({ ...mark, kind: GLYPH.dot, radiusPx: 2.5, alpha });
      from = to;
    }
  }

  #showContacts(states: readonly AgentState[], selected: number | null, pieces: Piece[]): void {
    for (const a of states) {
      for (const b of states) {
        if (b.id <= a.id || !(a.contacts.includes(b.id) || b.contacts.includes(a.id))) continue;
        const isChosen = a.id === selected || b.id === selected;
        pieces.push({
          from: a.position,
          to: b.position,
          colour: [0.66, 0.93, 1],
          alpha: isChosen ? 0.75 : selected === null ? 0.4 : 0.18,
          widthPx: isChosen ? 1.4 : 1,
          dashM: 1.2 * this.run.terrain.cellM,
        });
      }
    }
  }

  /** Names, the nearest ones on top; those that others cover are faint. */
  #names(selected: number | null): Glyph[] {
    const isBefore = (a: OnScreen, b: OnScreen): number =>
      Number(b.state.id === selected) - Number(a.state.id === selected) ||
      a.depthM - b.depthM ||
      a.state.id - b.state.id;
    const placed: { x: number; y: number }[] = [];
    const names = [...this.#onScreen].sort(isBefore).map((seen): Glyph => {
      const abovePx = seen.radiusPx + NAME_RADIUS_PX + 4;
      const y = seen.y - abovePx;
      const isFree = placed.every(
        (other) =>
          Math.abs(other.x - seen.x) > NAME_RADIUS_PX * 1.3 || Math.abs(other.y - y) > NAME_RADIUS_PX * 1.3,
      );
      if (isFree) placed.push({ x: seen.x, y });
      return {
        kind: GLYPH.name,
        place: seen.state.position,
        radiusPx: NAME_RADIUS_PX,
        abovePx,
        colour: this.#colours[seen.state.id]!,
        alpha: isFree ? 1 : 0.25,
        number: seen.state.id,
      };
    });
    return names.reverse();
  }
}
