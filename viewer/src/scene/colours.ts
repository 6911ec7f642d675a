/**
 * Colours of agents and of time.
 *
 * An agent has the same colour in the scene and in the panels. The first eight are those of Okabe
 * and Ito, distinguishable with any kind of colour vision, made lighter for a dark background. The
 * next ones are as far apart as possible, the brightest first; beyond 27 they follow the golden
 * angle around the hue circle.
 */

/** sRGB components, 0 to 1. */
export type Rgb = readonly [number, number, number];

const FIRST: readonly string[] = [
  ...["#f5a623", "#56c1f5", "#1fc795", "#f6e34c", "#e98cc4", "#ff6b3d", "#5c8dff", "#b9f26d"],
  ...["#c800ff", "#4bfaf0", "#ff00aa", "#00e100", "#f5cdff", "#fa5fff", "#afa0ff", "#fab4a5"],
  ...["#00f09b", "#a5be0f", "#af64c3", "#2896a5", "#00a500", "#915fff", "#be6e78", "#afd2a5"],
  ...["#8c8cbe", "#968746", "#c89b78"],
];

const GOLDEN_ANGLE_DEG = 137.50776405003785;

/** Parses `#rrggbb`. */
export function fromHex(hex: string): Rgb {
  const value = Number.parseInt(hex.slice(1), 16);
  return [((value >> 16) & 255) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255];
}

function toHex(colour: Rgb): string {
  const channels = colour.map((share) =>
    Math.round(share * 255)
      .toString(16)
      .padStart(2, "0"),
  );
  return `#${channels.join("")}`;
}

/** Hue in degrees, saturation and lightness 0 to 1. */
function fromHsl(hueDeg: number, saturation: number, lightness: number): Rgb {
  const amplitude = saturation * Math.min(lightness, 1 - lightness);
  const channel = (offset: number): number => {
    const k = (offset + hueDeg / 30) % 12;
    return lightness - amplitude * Math.max(-1, Math.min(k - 3, 9 - k, 1));
  };
  return [channel(0), channel(8), channel(4)];
}

/** CSS colour of an agent, `#rrggbb`. */
export function agentColour(id: number): string {
  const first = FIRST[id];
  if (first !== undefined) return first;
  const step = id - FIRST.length;
  const lightness = [0.68, 0.58, 0.78][step % 3]!;
  return toHex(fromHsl((25 + step * GOLDEN_ANGLE_DEG) % 360, 0.78, lightness));
}

/** The same as components. */
export function agentRgb(id: number): Rgb {
  return fromHex(agentColour(id));
}

/** Early to late: violet, blue, green, yellow ("viridis" with a lighter start). */
const HEAT: readonly Rgb[] = [
  "#5b3a9e",
  "#4a5fb4",
  "#3583b0",
  "#25a39a",
  "#3dbd78",
  "#84d44b",
  "#c9e12f",
  "#fdf04a",
].map(fromHex);

/** Colour of a share of the duration, 0 (the start) to 1, as the layer `heat` shows it. */
export function heatRgb(share: number): Rgb {
  const scaled = Math.min(Math.max(share, 0), 1) * (HEAT.length - 1);
  const low = Math.min(Math.floor(scaled), HEAT.length - 2);
  const [a, b, rest] = [HEAT[low]!, HEAT[low + 1]!, scaled - low];
  return [a[0] + (b[0] - a[0]) * rest, a[1] + (b[1] - a[1]) * rest, a[2] + (b[2] - a[2]) * rest];
}
