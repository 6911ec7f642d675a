/** The welcome screen, shown while there is no run: the ways to open one. */
import { el, icon, setHidden, setText, textButton } from "./dom.ts";
import type { LiveConnection } from "./live.ts";
import { load, save } from "./storage.ts";

export interface WelcomeActions {
  chooseFile(): void;
  openUrl(url: string): void;
  connect(address: string): void;
  newRun(): void;
  /** Cancels the opening in progress. */
  cancel(): void;
}

const ADDRESS = "address";

export class Welcome {
  readonly root: HTMLElement;
  readonly #busy: HTMLElement;
  readonly #busyText = el("p", { testid: "welcome-busy" });
  readonly #choices: HTMLElement;
  readonly #server: HTMLElement;
  readonly #serverText = el("p", {});
  readonly #new: HTMLButtonElement;

  constructor(actions: WelcomeActions) {
    const file = textButton("Open a recording", {
      class: "button primary big",
      testid: "open-file",
      onclick: actions.chooseFile,
    });
    file.prepend(icon("open"));
    this.#new = textButton("Start a run", {
      class: "button primary big",
      testid: "welcome-new",
      onclick: actions.newRun,
    });
    this.#new.prepend(icon("add"));
    this.#server = el("div", { class: "welcome-server" }, this.#serverText, this.#new);

    this.#busy = el(
      "div",
      { class: "welcome-busy", role: "status" },
      this.#busyText,
      textButton("Cancel", { testid: "welcome-cancel", onclick: actions.cancel }),
    );

    const address = el("input", {
      type: "text",
      testid: "server-address",
      "aria-label": "Address of a simulator",
      placeholder: "ws://localhost:8765",
      spellcheck: "false",
    });
    address.value = load(ADDRESS, "ws://localhost:8765");
    const url = el("input", {
      type: "text",
      testid: "recording-url",
      "aria-label": "Address of a recording",
      placeholder: "https://.../run.mcap",
      spellcheck: "false",
    });
    const form = (input: HTMLInputElement, action: string, testid: string, then: (text: string) => void) =>
      el(
        "form",
        {
          class: "welcome-form",
          onsubmit: (event: Event) => {
            event.preventDefault();
            if (input.value.trim() !== "") then(input.value.trim());
          },
        },
        input,
        el("button", { type: "submit", class: "button", testid }, action),
      );
    this.#choices = el(
      "div",
      { class: "welcome-choices" },
      el(
        "div",
        { class: "drop-zone", testid: "drop-zone" },
        file,
        el("p", { class: "quiet" }, "or drop a .mcap file anywhere on this page"),
      ),
      form(url, "Open address", "open-url", actions.openUrl),
      form(address, "Connect", "connect", (text) => {
        save(ADDRESS, text);
        actions.connect(text);
      }),
    );
    this.root = el(
      "section",
      { class: "welcome", testid: "welcome" },
      el("h1", {}, "MAES viewer"),
      el(
        "p",
        { class: "welcome-lead" },
        "Watch teams of agents explore caves and buildings in three dimensions: open a recording, or connect to a " +
          "running simulator.",
      ),
      this.#busy,
      this.#server,
      this.#choices,
    );
  }

  /** `busy`: the opening in progress; null: none. */
  update(busy: string | null, live: LiveConnection | null): void {
    setHidden(this.#busy, busy === null);
    if (busy !== null) setText(this.#busyText, busy);
    setHidden(this.#choices, busy !== null);
    const isWaiting = live?.state === "open";
    setHidden(this.#server, !isWaiting || busy !== null);
    setHidden(this.#new, !live?.isIdleServer);
    setText(
      this.#serverText,
      live?.isIdleServer
        ? `The simulator at ${live.url} is idle.`
        : `Connected to ${live?.url ?? ""}, which has no active run.`,
    );
  }
}
