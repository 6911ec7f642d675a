/** Memory of the processes of a browser, from `/proc`: Linux only. */
import { readdirSync, readFileSync } from "node:fs";

/** Text of a file of a process; empty if the process has ended meanwhile. */
function read(pid, name) {
  try {
    return readFileSync(`/proc/${pid}/${name}`, "utf8");
  } catch {
    return "";
  }
}

/** A process and those that it has started, and so on. */
function familyOf(root) {
  const parents = new Map();
  for (const entry of readdirSync("/proc")) {
    // The name of the program, in parentheses, may have any character.
    const parent = /^\d+$/.test(entry) ? /.*\) \S (\d+)/s.exec(read(entry, "stat")) : null;
    if (parent) parents.set(Number(entry), Number(parent[1]));
  }
  const isOfFamily = (pid) => pid === root || (parents.has(pid) && isOfFamily(parents.get(pid)));
  return [...parents.keys()].filter(isOfFamily);
}

/** Proportional set size of a browser, MB: of all its processes, and of those that draw. */
export function memoryOf(root) {
  const megabytes = { allMB: 0, pageMB: 0, gpuMB: 0 };
  for (const pid of familyOf(root)) {
    const kilobytes = /^Pss:\s+(\d+)/m.exec(read(pid, "smaps_rollup"));
    if (!kilobytes) continue;
    const own = (Number(kilobytes[1]) * 1024) / 1e6;
    const kind = /--type=([\w-]+)/.exec(read(pid, "cmdline"))?.[1];
    megabytes.allMB += own;
    if (kind === "renderer") megabytes.pageMB += own;
    if (kind === "gpu-process") megabytes.gpuMB += own;
  }
  return megabytes;
}

/** What one has more than the other, rounded. */
export function increase(after, before) {
  return Object.fromEntries(Object.keys(after).map((name) => [name, Math.round(after[name] - before[name])]));
}
