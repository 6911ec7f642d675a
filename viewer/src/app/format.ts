/**
 * Numbers in words for people. Pure; everything that the page shows as text passes through here, so that a time or a share looks
 * the same everywhere.
 */

/** Minutes and seconds, or hours as well from an hour on: 07:05, 1:02:03. Parts of a second are cut off. */
export function clockTime(timeS: number): string {
  if (!Number.isFinite(timeS)) return "--:--";
  // A tick is 0.02 s: what is a hair below a second is that second.
  const whole = Math.floor(Math.max(0, timeS) + 1e-6);
  const seconds = String(whole % 60).padStart(2, "0");
  const minutes = Math.floor(whole / 60);
  if (minutes < 60) return `${String(minutes).padStart(2, "0")}:${seconds}`;
  return `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}:${seconds}`;
}

/** A share as a percentage that is never rounded up: 100 % means all of it. */
export function percent(share: number, digits = 0): string {
  if (!Number.isFinite(share)) return "- %";
  const scale = 10 ** digits;
  return `${(Math.floor(share * 100 * scale + 1e-7) / scale).toFixed(digits)} %`;
}

/** As many digits after the point as say something: 99.95 %, 50.2 %. */
export function finePercent(share: number): string {
  return percent(share, share >= 0.99 && share < 1 ? 2 : 1);
}

/** Thousands apart, by narrow spaces. */
export function count(value: number): string {
  return String(Math.round(value)).replace(/\B(?=(\d{3})+(?!\d))/g, "\u202f");
}

/** Bytes with a unit, in thousands. */
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
export function place(position: readonly number[]): string {
  return position.map((value) => value.toFixed(1)).join("  ");
}

/** A heading in whole degrees from 0 to 359, mathematically positive. */
export function heading(yawRad: number): string {
  const degrees = Math.round((yawRad * 180) / Math.PI);
  return `${((degrees % 360) + 360) % 360}°`;
}

/** How many times as fast as the clock on the wall: 0.25x, 12x; 0 is as fast as possible. */
export function speedFactor(rate: number): string {
  if (rate === 0) return "max";
  if (rate >= 9.95) return `${Math.round(rate)}x`;
  return `${Number(rate.toFixed(rate >= 1 ? 1 : 2))}x`;
}

/** Words of a key such as `scans_cast`: scans cast. */
export function words(key: string): string {
  return key.replace(/_/g, " ");
}
