/**
 * Parses the output of `maes info`: the expected numbers of a recording, independent of the
 * page.
 */

export interface AgentInfo {
  readonly explored: string;
  readonly covered: string;
  /** Metres with one decimal, and the unit. */
  readonly distance: string;
}

export interface Info {
  readonly agents: readonly AgentInfo[];
  readonly team: AgentInfo;
  /** mm:ss.cc. */
  readonly endTime: string;
  readonly tick: number;
  readonly reason: string;
  /** Time at which each share was explored, mm:ss.cc, by the share. */
  readonly reached: ReadonlyMap<string, string>;
  readonly counters: ReadonlyMap<string, number>;
  readonly digest: string;
}

export function parseInfo(text: string): Info {
  const rows = new Map<string, AgentInfo>();
  for (const line of text.split("\n")) {
    const row = /^│ (agent \d+|team) +┆ +([\d.]+) % ┆ +([\d.]+) % ┆ +([\d.]+ k?m) │$/.exec(line);
    if (row) rows.set(row[1]!, { explored: row[2]!, covered: row[3]!, distance: row[4]! });
  }
  const ended = found(text, /^ended after ([\d:.]+) of sim time \(tick (\d+)\): (.+)$/m);
  const reached = found(text, /^time to see (.+)$/m)[1]!.split(", ");
  const counters = found(text, /^(free_cells \d+.*)$/m)[1]!.split(", ");
  const team = rows.get("team");
  if (!team) throw new Error(`No line of the team in: ${text}`);
  return {
    agents: [...rows].filter(([name]) => name !== "team").map(([, row]) => row),
    team,
    endTime: ended[1]!,
    tick: Number(ended[2]),
    reason: ended[3]!,
    reached: new Map(
      reached.map((part) => {
        const [, share, time] = found(part, /^([\d.]+) % ([\d:.]+|never)$/);
        return [share!, time!];
      }),
    ),
    counters: new Map(
      counters.map((part) => {
        const [, name, value] = found(part, /^(\w+) (\d+)$/);
        return [name!, Number(value)];
      }),
    ),
    digest: digestIn(text),
  };
}

/** The digest that a server or `info` prints. */
export function digestIn(text: string): string {
  return found(text, /^digest: ([0-9a-f]{64})$/m)[1]!;
}

function found(text: string, what: RegExp): RegExpExecArray {
  const match = what.exec(text);
  if (!match) throw new Error(`Nothing like ${what} in: ${text}`);
  return match;
}
