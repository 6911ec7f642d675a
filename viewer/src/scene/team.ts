/** The agents of a run at a time: bodies, trails, paths and targets, contacts, labels. */

import { Group, type Object3D } from "three";
import type { AgentState, Run, Vec3 } from "../data/run.ts";
import { Bodies, BODY_RADIUS_PX } from "./bodies.ts";
import { agentRgb, type Rgb } from "./colours.ts";
import type { SharedUniforms } from "./glsl.ts";
import { Markers, MARKER, type Marker } from "./markers.ts";
import { nearest, onScreen, type OnScreen, type Viewport } from "./on-screen.ts";
import { Segments, type Segment } from "./ribbons.ts";
import { Trail } from "./trails.ts";
import type { View } from "./view.ts";

/** An agent on the canvas. */
interface ScreenAgent extends OnScreen {
  readonly state: AgentState;
}

/** Bodies above this radius on the screen get a fine tessellation. */
const LARGE_PX = 22;
const LABEL_RADIUS_PX = 15;

export class Team {
  readonly root = new Group();
  readonly #colours: readonly Rgb[];
  readonly #bodies: Bodies;
  readonly #trails: readonly Trail[];
  readonly #lines: Segments;
  readonly #markers: Markers;
  readonly #labels: Markers;
  #onScreen: readonly ScreenAgent[] = [];

  constructor(
    readonly run: Run,
    common: SharedUniforms,
    labelCommon: SharedUniforms,
  ) {
    const ids = Array.from({ length: run.setup.agents }, (_, id) => id);
    this.#colours = ids.map(agentRgb);
    this.#bodies = new Bodies(common, this.#colours);
    this.#trails = this.#colours.map((colour, id) => new Trail(common, colour, this.#radiusM(id)));
    this.#lines = new Segments(common, 0.25, 4);
    this.#markers = new Markers(common, 0);
    this.#labels = new Markers(labelCommon, ids.length);
    this.root.add(...this.#bodies.meshes, ...this.#lines.meshes, this.#markers.mesh);
    for (const trail of this.#trails) this.root.add(...trail.meshes);
  }

  /** The numbers of agents, to be drawn over everything else. */
  get labels(): Object3D {
    return this.#labels.mesh;
  }

  show(timeS: number, view: View, selected: number | null, viewport: Viewport): void {
    const states = this.#colours.map((_, id) => this.run.agentAt(id, timeS));
    this.#onScreen = states.map((state) => ({
      state,
      ...onScreen(state.position, this.#radiusM(state.id), BODY_RADIUS_PX, viewport),
    }));
    const segments: Segment[] = [];
    const markers: Marker[] = [];
    for (const agent of this.#onScreen) {
      const { id, position, yawRad } = agent.state;
      const pixels = agent.radiusPx / agent.trueRadiusPx;
      this.#bodies.show(id, position, yawRad, this.#radiusM(id) * pixels, agent.radiusPx > LARGE_PX);
      this.#showTrail(agent.state, timeS, view, selected, segments);
      markers.push(...this.#glowMarkers(agent, selected));
      if (view.layers.paths) this.#showPath(agent.state, selected, segments, markers);
    }
    if (view.layers.contacts) this.#showContacts(states, selected, segments);
    this.#lines.show(segments);
    this.#markers.show(markers);
    this.#labels.show(view.layers.labels ? this.#labelMarkers(selected) : []);
  }

  /** The agent at a position of the canvas in the last frame. */
  pick(x: number, y: number): number | null {
    return nearest(this.#onScreen, x, y)?.state.id ?? null;
  }

  dispose(): void {
    this.#bodies.dispose();
    for (const trail of this.#trails) trail.dispose();
    this.#lines.dispose();
    this.#markers.dispose();
    this.#labels.dispose();
  }

  #radiusM(id: number): number {
    return this.run.setup.radiusM[id] ?? 0.4 * this.run.terrain.cellM;
  }

  #showTrail(
    state: AgentState,
    timeS: number,
    view: View,
    selected: number | null,
    segments: Segment[],
  ): void {
    const trail = this.#trails[state.id]!;
    if (!view.layers.trails) {
      trail.hide();
      return;
    }
    trail.extend(this.run.track(state.id));
    const isChosen = selected === state.id;
    const bright = selected === null ? 0.85 : isChosen ? 1 : 0.45;
    const widthPx = isChosen ? 3 : 2.2;
    const last = trail.show(timeS, { bright, widthPx });
    if (last === null) return;
    const colour = this.#colours[state.id]!.map((share) => share * 0.65 + 0.35) as [number, number, number];
    segments.push({ from: last, to: state.position, colour, alpha: bright, widthPx, dashM: 0 });
  }

  #glowMarkers(agent: ScreenAgent, selected: number | null): Marker[] {
    const { id, position } = agent.state;
    const base = { anchor: position, abovePx: 0, colour: this.#colours[id]!, number: 0 };
    const glow = { ...base, kind: MARKER.glow, radiusPx: agent.radiusPx * 2 + 10, alpha: 0.42 };
    if (id !== selected) return [glow];
    return [
      glow,
      { ...base, kind: MARKER.ring, radiusPx: agent.radiusPx * 1.25 + 9, alpha: 0.95, colour: [1, 1, 1] },
    ];
  }

  #showPath(state: AgentState, selected: number | null, segments: Segment[], markers: Marker[]): void {
    if (state.path.length === 0) return;
    const isChosen = state.id === selected;
    const colour = this.#colours[state.id]!;
    const alpha = selected === null ? 0.6 : isChosen ? 0.95 : 0.25;
    let from: Vec3 = state.position;
    for (const [index, to] of state.path.entries()) {
      segments.push({
        from,
        to,
        colour,
        alpha,
        widthPx: isChosen ? 1.8 : 1.2,
        dashM: 0.8 * this.run.terrain.cellM,
      });
      const isLast = index + 1 === state.path.length;
      const marker = { anchor: to, abovePx: 0, colour, number: 0 };
      if (isLast) markers.push({ ...marker, kind: MARKER.target, radiusPx: isChosen ? 11 : 7, alpha });
      else if (isChosen) markers.push({ ...marker, kind: MARKER.dot, radiusPx: 2.5, alpha });
      from = to;
    }
  }

  #showContacts(states: readonly AgentState[], selected: number | null, segments: Segment[]): void {
    for (const a of states) {
      for (const b of states) {
        if (b.id <= a.id || !(a.contacts.includes(b.id) || b.contacts.includes(a.id))) continue;
        const isChosen = a.id === selected || b.id === selected;
        segments.push({
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

  /** Labels, the nearest ones on top; occluded ones are faint. */
  #labelMarkers(selected: number | null): Marker[] {
    const isBefore = (a: ScreenAgent, b: ScreenAgent): number =>
      Number(b.state.id === selected) - Number(a.state.id === selected) ||
      a.depthM - b.depthM ||
      a.state.id - b.state.id;
    const placed: { x: number; y: number }[] = [];
    const labels = [...this.#onScreen].sort(isBefore).map((agent): Marker => {
      const abovePx = agent.radiusPx + LABEL_RADIUS_PX + 4;
      const y = agent.y - abovePx;
      const isFree = placed.every(
        (other) =>
          Math.abs(other.x - agent.x) > LABEL_RADIUS_PX * 1.3 ||
          Math.abs(other.y - y) > LABEL_RADIUS_PX * 1.3,
      );
      if (isFree) placed.push({ x: agent.x, y });
      return {
        kind: MARKER.label,
        anchor: agent.state.position,
        radiusPx: LABEL_RADIUS_PX,
        abovePx,
        colour: this.#colours[agent.state.id]!,
        alpha: isFree ? 1 : 0.25,
        number: agent.state.id,
      };
    });
    return labels.reverse();
  }
}
