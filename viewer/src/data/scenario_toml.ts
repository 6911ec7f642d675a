/**
 * Looks up single values in the scenario of a recording.
 *
 * A recorded scenario is written by the server, a key to a line with all keys there; this reads no more of TOML than that. What it
 * does not find is null. Nearly everything about a run comes from the message on `/sim/scenario`, and not from here.
 */

/** The text behind `key = ` in `[table]`, or at the top for `""`. */
export function tomlValue(toml: string, table: string, key: string): string | null {
  let present = "";
  for (const line of toml.split(/\r?\n/)) {
    const heading = /^\s*\[\[?\s*([^\]]*?)\s*\]/.exec(line);
    if (heading) {
      present = heading[1]!;
      continue;
    }
    const pair = /^\s*([A-Za-z0-9_-]+)\s*=\s*(.*?)\s*$/.exec(line);
    if (present === table && pair?.[1] === key) {
      return pair[2]!;
    }
  }
  return null;
}

/** The same, of a number. */
export function tomlNumber(toml: string, table: string, key: string): number | null {
  const value = tomlValue(toml, table, key);
  if (value === null) {
    return null;
  }
  const number = value === "inf" ? Infinity : Number(value);
  return Number.isNaN(number) ? null : number;
}

/** The same, of a text in quotes. */
export function tomlText(toml: string, table: string, key: string): string | null {
  return /^"(.*)"$/.exec(tomlValue(toml, table, key) ?? "")?.[1] ?? null;
}
