/** Queries a simulator over a connection of their own. */
import type { Page } from "@playwright/test";

/** A parameter of the server that serves the page. */
export function parameterOf(page: Page, name: string): Promise<unknown> {
  return page.evaluate(
    (name) =>
      new Promise((resolve, reject) => {
        const socket = new WebSocket(`ws://${location.host}`, ["foxglove.sdk.v1"]);
        socket.onopen = () =>
          socket.send(JSON.stringify({ op: "getParameters", parameterNames: [name], id: "query" }));
        socket.onerror = () => reject(new Error("The server does not answer"));
        socket.onmessage = ({ data }) => {
          if (typeof data !== "string") return;
          const message = JSON.parse(data) as { op: string; id?: string; parameters?: { value: unknown }[] };
          if (message.op !== "parameterValues" || message.id !== "query") return;
          socket.close();
          resolve(message.parameters?.[0]?.value);
        };
      }),
    name,
  );
}
