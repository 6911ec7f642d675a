/**
 * The form that starts a run: the settings of the reference, advanced settings, and the resulting
 * scenario. Its text may be edited; then it is used instead of the form until the user returns to
 * the form.
 */
import { openDialog } from "./dialogs.ts";
import { el, fill, select, setHidden, slider, textButton, toggle } from "./dom.ts";
import type { Slider } from "./dom.ts";
import { clockTime, speedFactor, words } from "./format.ts";
import { load, save } from "./storage.ts";
import { nearestStep, RUN_RATES } from "./rates.ts";
import {
  buildingHeight,
  CONTROLLERS,
  DEFAULTS,
  drawSeed,
  faults,
  FORM_KEYS,
  help,
  RANGES,
  REFERENCE_AGENTS_MAX,
  SCENES,
  toToml,
} from "./scenario.ts";
import type { FormValues, Generator, Range, SceneName } from "./scenario.ts";

export const GENERATORS: readonly { value: Generator; label: string }[] = [
  { value: "spheres", label: "Connected spheres" },
  { value: "noise", label: "Smoothed noise" },
  { value: "building", label: "Building" },
  { value: "mine", label: "Mine" },
  { value: "scene", label: "Place at true scale" },
  { value: "file", label: "Map file" },
];

/** Storage key of the form. JSON has no Infinity: an unlimited range is stored as 0. */
const REMEMBERED = "start";

type NumberKey = {
  [K in keyof FormValues]: FormValues[K] extends number ? K : never;
}[keyof FormValues];

export class StartForm {
  readonly #start: (scenario: string, isRecorded: boolean) => Promise<string | null>;
  readonly #values: FormValues;
  #isRandom: boolean;
  #isLinked: boolean;
  #isRecorded: boolean;
  #isEdited = false;
  #dialog: HTMLDialogElement | null = null;
  readonly #problems = el("div", {
    class: "form-problems",
    role: "alert",
    testid: "start-problems",
    hidden: true,
  });
  readonly #text = el("textarea", {
    class: "toml",
    rows: 30,
    spellcheck: "false",
    testid: "start-toml",
    "aria-label": "Scenario",
  });
  readonly #edited = el(
    "p",
    { class: "note", hidden: true },
    "The text was edited: it is used instead of the form.",
  );
  readonly #back = textButton("Back to the form", { testid: "start-back" });
  readonly #go = textButton("Start", { class: "button primary big", testid: "start-go" });
  readonly #fields = el("div", { class: "form-fields" });
  /** Update the parts of the form that depend on the values. */
  #refreshers: (() => void)[] = [];

  /** `start` resolves to the error in the scenario, or null. */
  constructor(start: (scenario: string, isRecorded: boolean) => Promise<string | null>) {
    this.#start = start;
    const stored = load(REMEMBERED, {
      values: { ...DEFAULTS, communicationRangeM: 0 },
      isRandom: true,
      isLinked: true,
      isRecorded: false,
    });
    const { communicationRangeM, ...values } = stored.values;
    this.#values = { ...values, communicationRangeM: communicationRangeM || Infinity };
    this.#isRandom = stored.isRandom;
    this.#isLinked = stored.isLinked;
    this.#isRecorded = stored.isRecorded;
    if (this.#isRandom) this.#values.seed = drawSeed(Math.random());
    this.#text.addEventListener("input", () => this.#setEdited(true));
    this.#back.addEventListener("click", () => {
      this.#setEdited(false);
      this.#changed();
    });
    this.#go.addEventListener("click", () => void this.#submit());
  }

  open(): void {
    if (this.#dialog?.open) return;
    if (this.#isRandom) this.#values.seed = drawSeed(Math.random());
    this.#build();
    this.#changed();
    this.#dialog = openDialog(
      "Start a run",
      "start-form",
      el(
        "div",
        { class: "form-columns" },
        this.#fields,
        el(
          "div",
          { class: "form-preview" },
          el("h3", {}, "Scenario"),
          this.#text,
          this.#edited,
          this.#back,
          this.#problems,
          el("div", { class: "dialog-foot" }, this.#recordSwitch(), this.#go),
        ),
      ),
    );
    this.#dialog.classList.add("wide");
    this.#go.focus();
  }

  close(): void {
    this.#dialog?.close();
  }

  async #submit(): Promise<void> {
    const found = this.#isEdited ? [] : faults(this.#values);
    this.#showProblems(found);
    if (found.length > 0) return;
    this.#go.disabled = true;
    try {
      const refusal = await this.#start(this.#text.value, this.#isRecorded);
      if (refusal === null) this.close();
      else this.#showProblems([refusal]);
    } catch (error) {
      this.#showProblems([(error as Error).message]);
    } finally {
      this.#go.disabled = false;
    }
  }

  #showProblems(problems: readonly string[]): void {
    setHidden(this.#problems, problems.length === 0);
    fill(this.#problems, ...problems.map((problem) => el("p", {}, problem)));
  }

  #setEdited(isEdited: boolean): void {
    this.#isEdited = isEdited;
    setHidden(this.#edited, !isEdited);
    setHidden(this.#back, !isEdited);
    this.#fields.classList.toggle("is-idle", isEdited);
  }

  #changed(): void {
    for (const refresh of this.#refreshers) refresh();
    const range = this.#values.communicationRangeM;
    save(REMEMBERED, {
      values: { ...this.#values, communicationRangeM: range === Infinity ? 0 : range },
      isRandom: this.#isRandom,
      isLinked: this.#isLinked,
      isRecorded: this.#isRecorded,
    });
    if (this.#isEdited) return;
    this.#text.value = toToml(this.#values);
    this.#showProblems(faults(this.#values));
  }

  #slider(label: string, key: NumberKey, range: Range, format: (value: number) => string = String): Slider {
    return slider(label, `start-${key}`, { ...range, value: this.#values[key], format }, (value) => {
      this.#values[key] = value;
      this.#changed();
    });
  }

  /** A part that is visible while a condition holds. */
  #when(condition: () => boolean, ...content: HTMLElement[]): HTMLElement {
    const part = el("div", { class: "form-part" }, ...content);
    this.#refreshers.push(() => setHidden(part, !condition()));
    return part;
  }

  #build(): void {
    this.#refreshers = [];
    this.#setEdited(false);
    const values = this.#values;
    fill(
      this.#fields,
      el("h3", {}, "Team"),
      this.#slider("Agents", "agents", RANGES.agents, (agents) =>
        agents > REFERENCE_AGENTS_MAX ? `${agents} (beyond MAES3D)` : String(agents),
      ).root,
      select("Algorithm", "start-controller", CONTROLLERS, values.controller, (controller) => {
        values.controller = controller;
        this.#changed();
      }).root,
      this.#slider("Duration", "durationMin", RANGES.durationMin, (minutes) => clockTime(minutes * 60)).root,
      this.#speedSlider().root,
      el("h3", {}, "Map"),
      select("Generator", "start-generator", GENERATORS, values.generator, (generator) => {
        this.#setGenerator(generator as Generator);
      }).root,
      this.#when(() => values.generator === "file", this.#fileField()),
      this.#when(() => values.generator === "scene", this.#sceneField()),
      this.#when(() => !["file", "scene"].includes(values.generator), ...this.#sizeFields()),
      this.#seedField(),
      this.#advanced(),
    );
    for (const name of Object.keys(FORM_KEYS) as (keyof typeof FORM_KEYS)[]) {
      const input = this.#fields.querySelector(`[data-testid="start-${name}"]`);
      input?.closest("label")?.setAttribute("title", help(name));
    }
  }

  /** Beside the scenario, because it is no key of it: the simulator chooses the file. */
  #recordSwitch(): HTMLElement {
    return toggle("Record the run", "start-record", this.#isRecorded, (isRecorded) => {
      this.#isRecorded = isRecorded;
      this.#changed();
    }).root;
  }

  #speedSlider(): Slider {
    const range = { min: 0, max: RUN_RATES.length - 1, step: 1 };
    const value = nearestStep(RUN_RATES, this.#values.rtf);
    const format = (index: number) => speedFactor(RUN_RATES[index]!);
    return slider("Speed", "start-rtf", { ...range, value, format }, (index) => {
      this.#values.rtf = RUN_RATES[index]!;
      this.#changed();
    });
  }

  #setGenerator(generator: Generator): void {
    const values = this.#values;
    const wasBuilding = values.generator === "building";
    values.generator = generator;
    if (generator === "building") {
      // A building as high as a cave is wide would be mostly solid.
      this.#isLinked = false;
      values.size[2] = buildingHeight(values.buildingFloors);
    } else if (wasBuilding) {
      values.size[2] = values.size[0];
      this.#isLinked = values.size[0] === values.size[1];
    }
    this.#changed();
  }

  #sizeFields(): HTMLElement[] {
    const values = this.#values;
    const cells = (value: number) => `${value} cells`;
    const axes = ["x", "y", "z"].map((name, axis) => {
      const part = slider(
        `Size along ${name}`,
        `start-size-${name}`,
        { ...RANGES.size, value: values.size[axis]!, format: cells },
        (value) => {
          values.size[axis] = value;
          if (this.#isLinked) values.size = [value, value, value];
          this.#changed();
        },
      );
      this.#refreshers.push(() => {
        const isHeight = axis === 2 && values.generator === "building";
        const range = isHeight ? RANGES.buildingHeight : RANGES.size;
        part.setRange(range.min, range.max);
        part.set(values.size[axis]!);
        setHidden(part.root, this.#isLinked && axis > 0);
        part.root.querySelector(".slider-name")!.textContent = this.#isLinked ? "Size" : `Size along ${name}`;
      });
      return part.root;
    });
    const linked = toggle("Cube", "start-linked", this.#isLinked, (isLinked) => {
      this.#isLinked = isLinked;
      if (isLinked) values.size = [values.size[0], values.size[0], values.size[0]];
      this.#changed();
    });
    this.#refreshers.push(() => (linked.input.checked = this.#isLinked));
    return [this.#when(() => values.generator !== "building", linked.root), ...axes];
  }

  #sceneField(): HTMLElement {
    const scenes = Object.keys(SCENES).map((value) => ({ value, label: words(value) }));
    return select("Place", "start-sceneName", scenes, this.#values.sceneName, (name) => {
      this.#values.sceneName = name as SceneName;
      this.#changed();
    }).root;
  }

  #fileField(): HTMLElement {
    const input = el("input", {
      type: "text",
      testid: "start-mapFile",
      placeholder: "caves/mine.m3dm",
      spellcheck: "false",
    });
    input.value = this.#values.mapFile;
    input.addEventListener("input", () => {
      this.#values.mapFile = input.value;
      this.#changed();
    });
    return el(
      "label",
      { class: "field" },
      el("span", {}, "Path of the map on the machine of the simulator"),
      input,
    );
  }

  #seedField(): HTMLElement {
    const input = el("input", {
      type: "text",
      inputmode: "numeric",
      testid: "start-seed",
      "aria-label": "Seed",
    });
    this.#refreshers.push(() => {
      if (document.activeElement !== input) input.value = String(this.#values.seed);
    });
    input.addEventListener("input", () => {
      this.#values.seed = /^\d+$/.test(input.value.trim()) ? Number(input.value) : NaN;
      this.#isRandom = false;
      random.input.checked = false;
      this.#changed();
    });
    const random = toggle("Random", "start-random", this.#isRandom, (isRandom) => {
      this.#isRandom = isRandom;
      if (isRandom) {
        this.#values.seed = drawSeed(Math.random());
        input.value = String(this.#values.seed);
      }
      this.#changed();
    });
    return el("div", { class: "field seed" }, el("span", {}, "Seed"), input, random.root);
  }

  #advanced(): HTMLElement {
    const values = this.#values;
    const cells = (value: number) => `${value} cells`;
    const share = (value: number) => `${value} %`;
    const is = (generator: Generator) => () => values.generator === generator;
    const searches = () => CONTROLLERS.find(({ value }) => value === values.controller)?.searches ?? false;
    const flag = (label: string, key: "isSearchBudgeted" | "stopWhenExplored" | "stopWhenCovered") =>
      toggle(label, `start-${key}`, values[key], (isOn) => {
        values[key] = isOn;
        this.#changed();
      }).root;
    return el(
      "details",
      { class: "form-advanced", testid: "start-advanced" },
      el("summary", {}, "Advanced"),
      this.#when(
        is("spheres"),
        this.#slider("Fill", "spheresFillPercent", RANGES.spheresFillPercent, share).root,
        this.#slider("Smallest radius", "spheresRadiusMin", RANGES.spheresRadius, cells).root,
        this.#slider("Largest radius", "spheresRadiusMax", RANGES.spheresRadius, cells).root,
        this.#slider("Connections", "spheresConnections", RANGES.spheresConnections).root,
        this.#slider("Smoothing", "spheresSmoothing", RANGES.smoothing).root,
      ),
      this.#when(
        is("noise"),
        this.#slider("Initial wall share", "noiseFillPercent", RANGES.noiseFillPercent, share).root,
        this.#slider("Smoothing", "noiseSmoothing", RANGES.smoothing).root,
      ),
      this.#when(
        is("building"),
        slider(
          "Floors",
          "start-buildingFloors",
          { min: 1, max: 10, step: 1, value: values.buildingFloors, format: String },
          (floors) => {
            values.buildingFloors = floors;
            values.size[2] = buildingHeight(floors);
            this.#changed();
          },
        ).root,
      ),
      this.#when(
        searches,
        flag("Searches take sim time", "isSearchBudgeted"),
        this.#when(
          () => values.isSearchBudgeted,
          this.#slider("A* iterations per tick", "searchCellsPerTick", RANGES.searchCellsPerTick).root,
        ),
      ),
      this.#rangeField(),
      this.#slider("Sensing angle", "sensingFovDeg", RANGES.sensingFovDeg, (degrees) => `${degrees}°`).root,
      this.#slider("Map exchange", "sharePeriodTicks", RANGES.sharePeriodTicks, (ticks) =>
        ticks === 0 ? "never" : `every ${(ticks * 0.02).toFixed(2)} s`,
      ).root,
      flag("End when all is explored", "stopWhenExplored"),
      flag("End when all is covered", "stopWhenCovered"),
    );
  }

  #rangeField(): HTMLElement {
    const values = this.#values;
    const range = RANGES.communicationRangeM;
    let lastM = Number.isFinite(values.communicationRangeM) ? values.communicationRangeM : 50;
    const unlimited = toggle(
      "Unlimited radio range",
      "start-unlimited",
      values.communicationRangeM === Infinity,
      (isOn) => {
        values.communicationRangeM = isOn ? Infinity : lastM;
        this.#changed();
      },
    );
    const part = slider(
      "Radio range",
      "start-communicationRangeM",
      { ...range, value: lastM, format: (value) => `${value} m` },
      (value) => {
        lastM = value;
        values.communicationRangeM = value;
        this.#changed();
      },
    );
    return el(
      "div",
      { class: "form-part" },
      unlimited.root,
      this.#when(() => values.communicationRangeM !== Infinity, part.root),
    );
  }
}
