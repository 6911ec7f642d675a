/** Pictures and movies of the image, made by the page and saved by the browser. */
import { clockTime } from "./format.ts";

/** Frames per second of a movie. */
const MOVIE_HZ = 30;
const MOVIE_BITS_PER_S = 12e6;
/** Containers and codecs of movies; the first that the browser can write. */
const MOVIE_TYPES = ["video/mp4;codecs=avc1", "video/webm;codecs=vp9", "video/webm"];

/** `run-07m05s.png`: a name without characters that file systems refuse. */
export function captureName(title: string, timeS: number, extension: string): string {
  const stem = title
    .replace(/\.mcap$/, "")
    .replace(/[^A-Za-z0-9._-]+/g, "-")
    .replace(/^-+|-+$/g, "");
  const time = clockTime(timeS).split(":");
  const units = ["h", "m", "s"].slice(-time.length);
  return `${stem || "run"}-${time.map((part, index) => part + units[index]).join("")}.${extension}`;
}

/** Saves a text as a file. */
export function saveText(name: string, text: string): void {
  save(name, new Blob([text], { type: "text/plain" }));
}

function save(name: string, blob: Blob): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  // Browsers read the file after the click has been handled.
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/** Saves the image; `draw` has to draw it in the same task, since WebGL forgets it afterwards. */
export function savePicture(canvas: HTMLCanvasElement, name: string, draw: () => void): Promise<void> {
  draw();
  return new Promise((resolve, reject) => {
    canvas.toBlob((blob) => {
      if (blob === null) {
        reject(new Error("The browser cannot make a picture of this size."));
        return;
      }
      save(name, blob);
      resolve();
    }, "image/png");
  });
}

/** A movie that is being captured. */
export class MovieCapture {
  readonly #recorder: MediaRecorder;
  readonly #parts: Blob[] = [];

  /** Throws if the browser cannot capture movies. */
  constructor(canvas: HTMLCanvasElement) {
    const mimeType =
      typeof MediaRecorder === "undefined"
        ? undefined
        : MOVIE_TYPES.find((candidate) => MediaRecorder.isTypeSupported(candidate));
    if (mimeType === undefined) throw new Error("This browser cannot capture movies; use `maes movie`.");
    const stream = canvas.captureStream(MOVIE_HZ);
    this.#recorder = new MediaRecorder(stream, { mimeType, videoBitsPerSecond: MOVIE_BITS_PER_S });
    this.#recorder.addEventListener("dataavailable", ({ data }) => this.#parts.push(data));
    this.#recorder.start(1000);
  }

  /** Ends the capture and saves it; `name` gets the extension of the container. */
  async end(name: (extension: string) => string): Promise<void> {
    const stopped = new Promise((resolve) =>
      this.#recorder.addEventListener("stop", resolve, { once: true }),
    );
    this.#recorder.stop();
    await stopped;
    for (const track of this.#recorder.stream.getTracks()) track.stop();
    const extension = this.#recorder.mimeType.startsWith("video/mp4") ? "mp4" : "webm";
    save(name(extension), new Blob(this.#parts, { type: this.#recorder.mimeType }));
  }
}
