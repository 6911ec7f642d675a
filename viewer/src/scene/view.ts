/** View options of the scene: plain values that the page sets and stores. */

/** Visible layers. */
export interface Layers {
  walls: boolean;
  /** Free cells not yet seen by any agent, translucent red. */
  unexplored: boolean;
  /** Cells that a body has entered. */
  covered: boolean;
  /** Colours of the walls by the time they were first seen. */
  heat: boolean;
  /** Past positions of agents. */
  trails: boolean;
  /** Planned paths and their targets. */
  paths: boolean;
  /** Lines between agents in radio contact. */
  contacts: boolean;
  /** Hits of the selected agent's last scan. */
  hits: boolean;
  /** Belief map of the selected agent, compared with the true map. */
  belief: boolean;
  /** Numbers of agents. */
  labels: boolean;
}

export const DEFAULT_LAYERS: Layers = {
  walls: true,
  unexplored: true,
  covered: false,
  heat: false,
  trails: true,
  paths: true,
  contacts: false,
  hits: false,
  belief: false,
  labels: true,
};

export interface View {
  layers: Layers;
  /** Opacity of walls towards the camera; 0: hidden; 1: solid. */
  wallOpacity: number;
  /** What lies beyond this share of the map's length along the axis is cut away; 1: nothing. */
  cut: { axis: "x" | "y" | "z"; share: number };
  /** Whether the background is white, as in print. */
  isOnWhite: boolean;
}

export function defaultView(): View {
  return { layers: { ...DEFAULT_LAYERS }, wallOpacity: 0.1, cut: { axis: "z", share: 1 }, isOnWhite: false };
}
