/**
 * Text formats of all numbers on the page, so that a time or a share looks the same everywhere.
 * Pure.
 */

/** mm:ss, from an hour on h:mm:ss: 07:05, 1:02:03. Fractions of a second are cut off. */
export function clockTime(timeS: number): string {
  if (!Number.isFinite(timeS)) return "--:--";
  // A tick is 0.02 s: a rounding error below a full second counts as that second.
  const whole = Math.floor(Math.max(0, timeS) + 1e-6);
  const seconds = String(whole % 60).padStart(2, "0");
  const minutes = Math.floor(whole / 60);
  if (minutes < 60) return `${String(minutes).padStart(2, "0")}:${seconds}`;
  return `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}:${seconds}`;
}

/** A share as a percentage, rounded down: 100 % means all of it. */
export function percent(share: number, digits = 0): string {
  if (!Number.isFinite(share)) return "- %";
  const scale = 10 ** digits;
  return `${(Math.floor(share * 100 * scale + 1e-7) / scale).toFixed(digits)} %`;
}

/** A percentage with two decimals from 99 % on, else one: 99.95 %, 50.2 %. */
export function finePercent(share: number): string {
  return percent(share, share >= 0.99 && share < 1 ? 2 : 1);
}

/** An integer with thousands separated by narrow spaces. */
export function count(value: number): string {
  return String(Math.round(value)).replace(/\B(?=(\d{3})+(?!\d))/g, "\u202f");
}

/** Bytes with a decimal unit. */
export function bytes(value: number): string {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let unit = 0;
  let scaled = value;
  while (scaled >= 999.5 && unit < units.length - 1) {
    scaled /= 1000;
    unit += 1;
  }
  return `${unit === 0 || scaled >= 99.95 ? scaled.toFixed(0) : scaled.toFixed(1)} ${units[unit]}`;
}

export function metres(value: number): string {
  if (!Number.isFinite(value)) return "unlimited";
  return value >= 1000 ? `${(value / 1000).toFixed(2)} km` : `${value.toFixed(1)} m`;
}

/** A position in metres. */
export function positionText(position: readonly number[]): string {
  return position.map((value) => value.toFixed(1)).join("  ");
}

/** A yaw angle in whole degrees, 0 to 359, counterclockwise. */
export function heading(yawRad: number): string {
  const degrees = Math.round((yawRad * 180) / Math.PI);
  return `${((degrees % 360) + 360) % 360}°`;
}

/** A real-time factor: 0.25x, 12x; 0 is as fast as possible. */
export function speedFactor(rate: number): string {
  if (rate === 0) return "max";
  if (rate >= 9.95) return `${Math.round(rate)}x`;
  return `${Number(rate.toFixed(rate >= 1 ? 1 : 2))}x`;
}

/** A key such as `scans_cast` as words: scans cast. */
export function words(key: string): string {
  return key.replace(/_/g, " ");
}
