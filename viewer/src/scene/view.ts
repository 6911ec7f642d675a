/** What the scene is asked to show; plain values that the page sets and keeps. */

/** What can be shown or left out. */
export interface Layers {
  walls: boolean;
  /** Free cells that nobody has seen, translucent red. */
  unexplored: boolean;
  /** Cells in which a body has been. */
  covered: boolean;
  /** Colours of the walls by when they were first seen. */
  heat: boolean;
  /** Where agents were. */
  trails: boolean;
  /** Where they are going: their ways, and the targets at the ends of them. */
  paths: boolean;
  /** Lines between agents that hear each other. */
  contacts: boolean;
  /** What the selected agent's last scan has hit. */
  hits: boolean;
  /** What the selected agent knows, against what there is. */
  belief: boolean;
  /** Names of agents. */
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
  /** 0: walls towards the eye are not there; 1: they are solid. */
  wallOpacity: number;
  /** What lies beyond this share of the map's length along the axis is cut off; 1: nothing is. */
  cut: { axis: "x" | "y" | "z"; share: number };
}

export function defaultView(): View {
  return { layers: { ...DEFAULT_LAYERS }, wallOpacity: 0.1, cut: { axis: "z", share: 1 } };
}
