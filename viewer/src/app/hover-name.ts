/** The name of what the mouse points at; empty: nothing with a name. An agent covers an obstacle. */
export function hoverName(agent: number | null | undefined, obstacle: number | null | undefined): string {
  if (typeof agent === "number") return `agent ${agent}`;
  return typeof obstacle === "number" ? `obstacle ${obstacle}` : "";
}
