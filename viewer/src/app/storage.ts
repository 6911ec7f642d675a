/**
 * Persistent settings in the browser's local storage. Storage may be forbidden, full or of another
 * version of the page: then the defaults are used, and nothing fails.
 */

const PREFIX = "maes.";

type Plain = string | number | boolean | null | { readonly [key: string]: Plain };

/**
 * Stored values in the shape of the defaults; missing ones and those of another type are replaced.
 */
export function merged<T>(defaults: T, stored: unknown): T {
  if (Array.isArray(defaults)) {
    const isAlike =
      Array.isArray(stored) &&
      stored.length === defaults.length &&
      stored.every((value, index) => typeof value === typeof defaults[index]);
    return isAlike ? (stored as T) : defaults;
  }
  if (typeof defaults !== "object" || defaults === null) {
    return typeof stored === typeof defaults ? (stored as T) : defaults;
  }
  const from = typeof stored === "object" && stored !== null ? (stored as Record<string, unknown>) : {};
  return Object.fromEntries(
    Object.entries(defaults).map(([key, value]) => [key, merged(value as Plain, from[key])]),
  ) as T;
}

export function load<T>(name: string, defaults: T): T {
  try {
    const text = localStorage.getItem(PREFIX + name);
    return text === null ? defaults : merged(defaults, JSON.parse(text));
  } catch {
    return defaults;
  }
}

export function save(name: string, value: unknown): void {
  try {
    localStorage.setItem(PREFIX + name, JSON.stringify(value));
  } catch {
    // Only the settings are lost.
  }
}
