/**
 * Small DOM helpers in place of a framework.
 *
 * Attributes have their HTML names; functions become event listeners. Independent of runs.
 */

export type Child = Node | string | null | undefined | false;

/**
 * Attributes and listeners: `true` sets an attribute without a value, `false` and `undefined` omit
 * it.
 */
export type Props = Record<string, string | number | boolean | undefined | ((event: never) => void)>;

/**
 * Creates an element. `testid` is short for `data-testid`; `on...` with a function is a listener.
 */
export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  props: Props = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (value === undefined || value === false) continue;
    if (typeof value === "function") {
      element.addEventListener(name.slice(2), value as unknown as EventListener);
    } else {
      element.setAttribute(name === "testid" ? "data-testid" : name, value === true ? "" : String(value));
    }
  }
  for (const child of children) {
    if (child !== null && child !== undefined && child !== false) element.append(child);
  }
  return element;
}

/** Sets a text if it changed: panels are updated many times per second with the same values. */
export function setText(node: HTMLElement, text: string): void {
  if (node.textContent !== text) node.textContent = text;
}

export function setHidden(node: HTMLElement, isHidden: boolean): void {
  if (node.hidden !== isHidden) node.hidden = isHidden;
}

/** Replaces the children of a node. */
export function fill(node: HTMLElement, ...children: Child[]): void {
  node.replaceChildren(...children.filter((child): child is Node | string => !!child));
}

/** SVG paths in a 24 x 24 box, filled with the text colour. */
const ICONS = {
  play: "M8 5.5v13l10.5-6.5z",
  pause: "M7.5 5.5h3v13h-3zM13.5 5.5h3v13h-3z",
  step: "M6 5.5v13l8.5-6.5zM16 5.5h2.5v13H16z",
  stop: "M7 7h10v10H7z",
  restart: "M12 5a7 7 0 1 1-6.6 4.7l1.9.7A5 5 0 1 0 12 7v3L7.5 6 12 2z",
  previous: "M15 6l-6 6 6 6z",
  next: "M9 6l6 6-6 6z",
  close: "M6.7 5.3 12 10.6l5.3-5.3 1.4 1.4-5.3 5.3 5.3 5.3-1.4 1.4-5.3-5.3-5.3 5.3-1.4-1.4 5.3-5.3-5.3-5.3z",
  layers: "M12 4 3 9l9 5 9-5zM5.2 12.6 3 13.8 12 19l9-5.2-2.2-1.2-6.8 3.9z",
  panel: "M4 5h16v14H4zm2 2v10h8V7zm10 0v10h2V7z",
  help: "M11 17h2v2h-2zm1-12a4 4 0 0 1 4 4c0 2.6-3 2.9-3 6h-2c0-3.8 3-4.2 3-6a2 2 0 0 0-4 0H8a4 4 0 0 1 4-4z",
  open: "M4 6h6l2 2h8v10H4zm2 4v6h12v-6z",
  link: "M10.6 13.4a1 1 0 0 1 0-1.4l3.5-3.6a3 3 0 0 1 4.3 4.3l-2 2-1.4-1.4 2-2a1 1 0 0 0-1.5-1.5L12 13.4a1 1 0 0 1-1.4 0zm2.8-2.8a1 1 0 0 1 0 1.4l-3.5 3.6a3 3 0 0 1-4.3-4.3l2-2L9 10.7l-2 2a1 1 0 0 0 1.5 1.5l3.5-3.6a1 1 0 0 1 1.4 0z",
  picture:
    "M9 5 7.5 7H4v12h16V7h-3.5L15 5zm3 4a4 4 0 1 1 0 8 4 4 0 0 1 0-8zm0 2a2 2 0 1 0 0 4 2 2 0 0 0 0-4z",
  movie: "M4 7h11v3.5L20 7v10l-5-3.5V17H4z",
  add: "M11 5h2v6h6v2h-6v6h-2v-6H5v-2h6z",
} as const;

export type IconName = keyof typeof ICONS;

export function icon(name: IconName): SVGSVGElement {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("aria-hidden", "true");
  svg.classList.add("icon");
  const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  path.setAttribute("d", ICONS[name]);
  svg.append(path);
  return svg;
}

/** Changes icon and label of a button of `iconButton`. */
export function setIcon(button: HTMLButtonElement, name: IconName, label: string): void {
  if (button.dataset["icon"] === name && button.title === label) return;
  button.dataset["icon"] = name;
  button.title = label;
  button.setAttribute("aria-label", label);
  button.replaceChildren(icon(name));
}

/** A button with an icon; its label is the tooltip and the accessible name. */
export function iconButton(name: IconName, label: string, props: Props = {}): HTMLButtonElement {
  const button = el("button", { type: "button", class: "icon-button", ...props });
  setIcon(button, name, label);
  return button;
}

export function textButton(label: string, props: Props = {}): HTMLButtonElement {
  return el("button", { type: "button", class: "button", ...props }, label);
}

/** A switch with a label. */
export function toggle(
  label: string,
  testid: string,
  isOn: boolean,
  change: (isOn: boolean) => void,
): { root: HTMLLabelElement; input: HTMLInputElement } {
  const input = el("input", { type: "checkbox", class: "switch", role: "switch", testid });
  input.checked = isOn;
  input.addEventListener("change", () => change(input.checked));
  return { root: el("label", { class: "toggle" }, input, el("span", {}, label)), input };
}

export interface SliderRange {
  readonly min: number;
  readonly max: number;
  readonly step: number;
  readonly value: number;
  /** Formats the value beside the slider. */
  readonly format: (value: number) => string;
}

export interface Slider {
  readonly root: HTMLElement;
  readonly input: HTMLInputElement;
  /** Sets the value without calling `change`. */
  set(value: number): void;
  /** Changes the limits. */
  setRange(min: number, max: number): void;
}

/** A slider with a label and its formatted value. */
export function slider(
  label: string,
  testid: string,
  range: SliderRange,
  change: (value: number) => void,
): Slider {
  const output = el("output", { class: "slider-value" });
  const input = el("input", { type: "range", min: range.min, max: range.max, step: range.step, testid });
  input.setAttribute("aria-label", label);
  const write = () => {
    const text = range.format(input.valueAsNumber);
    setText(output, text);
    input.setAttribute("aria-valuetext", text);
    const share = (input.valueAsNumber - Number(input.min)) / (Number(input.max) - Number(input.min) || 1);
    input.style.setProperty("--share", `${share * 100}%`);
  };
  input.value = String(range.value);
  input.addEventListener("input", () => {
    change(input.valueAsNumber);
    write();
  });
  write();
  const name = el("span", { class: "slider-name" }, label);
  return {
    root: el("label", { class: "slider" }, name, output, input),
    input,
    set(value) {
      input.value = String(value);
      write();
    },
    setRange(min, max) {
      input.min = String(min);
      input.max = String(max);
      write();
    },
  };
}

/** A drop-down list. */
export function select(
  label: string,
  testid: string,
  options: readonly { readonly value: string; readonly label: string }[],
  value: string,
  change: (value: string) => void,
): { root: HTMLLabelElement; input: HTMLSelectElement } {
  const input = el("select", { testid });
  for (const option of options) input.append(el("option", { value: option.value }, option.label));
  input.value = value;
  input.addEventListener("change", () => change(input.value));
  return { root: el("label", { class: "field" }, el("span", {}, label), input), input };
}

/** Whether the focused element handles a key itself, so that it is no shortcut. */
export function ownsKey(target: EventTarget | null, key: string): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (key === " " && target.closest("button, summary, input[type=checkbox]")) return true;
  if (target instanceof HTMLInputElement) {
    if (target.type === "range" || target.type === "radio") return /^(Arrow|Home|End|Page)/.test(key);
    return target.type !== "checkbox";
  }
  return (
    target instanceof HTMLTextAreaElement || target instanceof HTMLSelectElement || target.isContentEditable
  );
}
