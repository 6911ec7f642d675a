/**
 * Encoding of the simulator's services: little-endian CDR with its encapsulation header, as in ROS
 * 2. Independent of the connection.
 */
import { CdrReader, CdrWriter, EncapsulationKind } from "@foxglove/cdr";
import type { EditBox } from "./map-edit.ts";

/** States of `simulation_interfaces/msg/SimulationState`. */
export const STATE = { stopped: 0, playing: 1, paused: 2, quitting: 3 } as const;

export const SERVICES = {
  getState: "/sim_server/get_simulation_state",
  setState: "/sim_server/set_simulation_state",
  step: "/sim_server/step_simulation",
  reset: "/sim_server/reset_simulation",
  changeMap: "/sim_server/change_map",
  startRun: "/sim_server/start_run",
} as const;

/** `simulation_interfaces/msg/Result`. */
export interface Outcome {
  readonly code: number;
  readonly message: string;
}

/** Result codes that mean success: done, or already in that state. */
const SUCCESS_CODES = new Set([1, 101]);

export function isSuccess(outcome: Outcome): boolean {
  return SUCCESS_CODES.has(outcome.code);
}

function written(write: (writer: CdrWriter) => void): Uint8Array {
  const writer = new CdrWriter({ kind: EncapsulationKind.CDR_LE });
  write(writer);
  return writer.data;
}

/** A request without fields has one padding byte. */
export const emptyRequest = () => written((writer) => writer.uint8(0));
export const setStateRequest = (state: number) => written((writer) => writer.uint8(state));
export const stepRequest = (ticks: number) => written((writer) => writer.uint64(BigInt(ticks)));
export const resetRequest = () => written((writer) => writer.uint8(0));

/** The request of `maes_msgs/srv/ChangeMap`. */
export const changeMapRequest = (isWall: boolean, { low, high }: EditBox) =>
  written((writer) => {
    writer.uint8(isWall ? 1 : 0);
    for (const metres of [...low, ...high]) writer.float64(metres);
  });

/** How many cells a change of the map has changed; throws the server's reason if it was refused. */
export function readChangedCells(data: Uint8Array): number {
  const reader = new CdrReader(data);
  const [isDone, message] = [reader.uint8() !== 0, reader.string()];
  if (!isDone) throw new Error(`The map stays as it is: ${message}`);
  return reader.uint32();
}

export function readOutcome(data: Uint8Array): Outcome {
  return outcomeOf(new CdrReader(data));
}

export function readState(data: Uint8Array): { state: number; outcome: Outcome } {
  const reader = new CdrReader(data);
  return { state: reader.uint8(), outcome: outcomeOf(reader) };
}

function outcomeOf(reader: CdrReader): Outcome {
  return { code: reader.uint8(), message: reader.string() };
}

/** The request of `start_run`, JSON. The server chooses the file of a recording. */
export function startRequest(scenario: string, isRecorded: boolean): Uint8Array {
  return new TextEncoder().encode(JSON.stringify({ scenario, record: isRecorded }));
}

/** The response of `start_run`. */
export interface StartAnswer {
  /** Why the run has not started; null: it has. */
  readonly refusal: string | null;
  /** File name of its recording; null: it is not recorded. */
  readonly recording: string | null;
}

/** The response of `start_run`; throws if it is malformed. */
export function readStart(data: Uint8Array): StartAnswer {
  const answer: unknown = JSON.parse(new TextDecoder().decode(data));
  if (typeof answer !== "object" || answer === null || !("started" in answer)) {
    throw new Error(
      `The simulator answered ${JSON.stringify(answer)} to start_run; expected an object with "started".`,
    );
  }
  const text = (key: string) => String((answer as Record<string, unknown>)[key] ?? "");
  return {
    refusal: answer.started === true ? null : text("message") || "The simulator did not start the run.",
    recording: text("recording") || null,
  };
}
