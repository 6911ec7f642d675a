/**
 * Banners over the image for errors, warnings and notices. A subject has at most one banner; a
 * dismissed one stays hidden until its text changes.
 */
import { el, iconButton } from "./dom.ts";

export type BannerKind = "error" | "warning" | "notice";

export class Banners {
  readonly root = el("div", { class: "banners", testid: "banners", role: "status", "aria-live": "polite" });
  readonly #shown = new Map<string, { text: string; element: HTMLElement }>();
  readonly #dismissed = new Map<string, string>();

  /** Shows a text under its subject, or hides the banner if it is null. */
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

  /** The visible texts, by subject. */
  get texts(): ReadonlyMap<string, string> {
    return new Map([...this.#shown].map(([subject, { text }]) => [subject, text]));
  }

  #dismiss(subject: string, text: string): void {
    this.set(subject, null);
    this.#dismissed.set(subject, text);
  }
}
