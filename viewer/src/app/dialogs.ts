/**
 * Modal dialogs: confirmations and the list of keys. A closed dialog is removed from the document.
 */
import { el, iconButton, textButton } from "./dom.ts";

/** Opens a dialog; Escape and its close button close it. */
export function openDialog(title: string, testid: string, ...content: HTMLElement[]): HTMLDialogElement {
  const dialog = el("dialog", { class: "dialog", testid, "aria-label": title });
  dialog.append(
    el(
      "div",
      { class: "dialog-head" },
      el("h2", {}, title),
      iconButton("close", "Close", { testid: `${testid}-close`, onclick: () => dialog.close() }),
    ),
    ...content,
  );
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
  return dialog;
}

/** Asks for confirmation. */
export function confirmed(question: string, consequence: string, action: string): Promise<boolean> {
  return new Promise((resolve) => {
    const dialog = openDialog(
      question,
      "confirm",
      el("p", {}, consequence),
      el(
        "div",
        { class: "dialog-foot" },
        textButton("Cancel", { testid: "confirm-no", onclick: () => dialog.close() }),
        textButton(action, {
          class: "button danger",
          testid: "confirm-yes",
          onclick: () => dialog.close("yes"),
        }),
      ),
    );
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"));
  });
}

/** Keys and their actions. */
const KEYS: readonly (readonly [readonly string[], string])[] = [
  [["Space"], "Play or pause"],
  [["←", "→"], "One second back or forward; with Shift ten seconds"],
  [[",", "."], "One tick back or forward"],
  [["Home", "End"], "Start and end"],
  [["<", ">"], "Slower and faster"],
  [["G"], "Follow the live run"],
  [["0", "9"], "Select an agent; two digits in quick succession for 10 and above"],
  [["[", "]"], "Previous and next agent"],
  [["Esc"], "The whole cave"],
  [["W", "A", "S", "D"], "Rotate the view; with Shift pan it"],
  [["-", "+"], "Zoom out and in"],
  [["U"], "Show or hide unexplored cells"],
  [["L"], "Layers"],
  [["P"], "Panels"],
  [["F"], "Rendering statistics"],
  [["?"], "This list"],
  [["Drag"], "Rotate the view; with Shift or the middle button pan it"],
  [["Wheel"], "Zoom"],
  [["Click"], "Select an agent"],
  [["One finger"], "Rotate the view"],
  [["Two fingers"], "Zoom and pan"],
  [["Tap"], "Select an agent"],
];

export function openHelp(): void {
  if (document.querySelector('[data-testid="help"]')) return;
  const rows = KEYS.map(([caps, what]) =>
    el(
      "div",
      { class: "key-row" },
      el("dt", {}, ...caps.map((cap) => el("kbd", {}, cap))),
      el("dd", {}, what),
    ),
  );
  const dialog = openDialog("Keys, mouse and touch", "help", el("dl", { class: "keys" }, ...rows));
  dialog.classList.add("wide");
}
