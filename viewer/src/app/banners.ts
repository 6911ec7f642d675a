/**
 * Problems and notices over the picture, in words. Each has a subject; a subject has one banner at the most. One that was dismissed
 * stays away until it says something else.
 */
import { el, iconButton } from "./dom.ts";

export type BannerKind = "error" | "warning" | "notice";

export class Banners {
  readonly root = el("div", { class: "banners", testid: "banners", role: "status", "aria-live": "polite" });
  readonly #shown = new Map<string, { text: string; element: HTMLElement }>();
  readonly #dismissed = new Map<string, string>();

  /** Shows a text under its subject, or nothing if it is null. */
  set(subject: string, text: string | null, kind: BannerKind = "error"): void {
    const shown = this.#shown.get(subject);
    if (shown?.text === text) return;
    shown?.element.remove();
    this.#shown.delete(subject);
    if (text === null) {
      this.#dismissed.delete(subject);
      return;
    }
    if (this.#dismissed.get(subject) === text) return;
    this.#dismissed.delete(subject);
    const element = el(
      "div",
      {
        class: `banner banner-${kind}`,
        testid: `banner-${subject}`,
        role: kind === "error" ? "alert" : undefined,
      },
      el("p", {}, text),
      iconButton("close", "Dismiss", {
        testid: `banner-${subject}-close`,
        onclick: () => this.#dismiss(subject, text),
      }),
    );
    this.#shown.set(subject, { text, element });
    this.root.append(element);
  }

  /** What is shown, by subject. */
  get texts(): ReadonlyMap<string, string> {
    return new Map([...this.#shown].map(([subject, { text }]) => [subject, text]));
  }

  #dismiss(subject: string, text: string): void {
    this.set(subject, null);
    this.#dismissed.set(subject, text);
  }
}
