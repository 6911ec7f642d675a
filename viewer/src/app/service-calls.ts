/**
 * Pending service calls: maps service names to the ids of this connection, and responses to calls.
 * A call always ends: with its response, with a failure, or with the connection.
 */
import type {
  Service,
  ServiceCallFailure,
  ServiceCallPayload,
  ServiceCallResponse,
} from "@foxglove/ws-protocol";

interface Pending {
  readonly name: string;
  resolve(data: Uint8Array): void;
  reject(error: Error): void;
}

interface Known {
  readonly id: number;
  /** Encoding of requests: `cdr` or `json`. */
  readonly encoding: string;
}

export class ServiceCalls {
  readonly #known = new Map<string, Known>();
  readonly #pending = new Map<number, Pending>();
  #lastCall = 0;
  #send: ((request: ServiceCallPayload) => void) | null = null;

  connect(send: (request: ServiceCallPayload) => void): void {
    this.#send = send;
  }

  disconnect(): void {
    this.#send = null;
    this.#known.clear();
    const calls = [...this.#pending.values()];
    this.#pending.clear();
    for (const call of calls)
      call.reject(new Error(`The connection was lost before ${call.name} was answered.`));
  }

  add(services: readonly Service[]): void {
    for (const { id, name, request } of services) {
      this.#known.set(name, { id, encoding: request?.encoding ?? "cdr" });
    }
  }

  remove(ids: readonly number[]): void {
    for (const [name, service] of this.#known) if (ids.includes(service.id)) this.#known.delete(name);
  }

  has(name: string): boolean {
    return this.#known.has(name);
  }

  call(name: string, data: Uint8Array): Promise<Uint8Array> {
    const service = this.#known.get(name);
    if (!this.#send || !service) {
      return Promise.reject(new Error(`The simulator does not offer ${name}.`));
    }
    this.#lastCall += 1;
    const callId = this.#lastCall;
    const answer = new Promise<Uint8Array>((resolve, reject) => {
      this.#pending.set(callId, { name, resolve, reject });
    });
    this.#send({ serviceId: service.id, callId, encoding: service.encoding, data });
    return answer;
  }

  onResponse(answer: ServiceCallResponse): void {
    const { buffer, byteOffset, byteLength } = answer.data;
    this.#take(answer.callId)?.resolve(new Uint8Array(buffer as ArrayBuffer, byteOffset, byteLength));
  }

  onFailure(failure: ServiceCallFailure): void {
    const call = this.#take(failure.callId);
    call?.reject(new Error(`The simulator refused ${call.name}: ${failure.message}`));
  }

  #take(callId: number): Pending | undefined {
    const call = this.#pending.get(callId);
    this.#pending.delete(callId);
    return call;
  }
}
