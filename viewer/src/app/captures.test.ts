import { expect, test } from "vitest";
import { captureName } from "./captures.ts";

test("captures have names that any file system takes", () => {
  expect(captureName("run.mcap", 425, "png")).toBe("run-07m05s.png");
  expect(captureName("ws://host:1/ spheres", 3723, "webm")).toBe("ws-host-1-spheres-1h02m03s.webm");
  expect(captureName("//", 0, "png")).toBe("run-00m00s.png");
});
