import { expect, test } from "vitest";
import { hoverName } from "./hover-name.ts";

test("agents and obstacles have names, agents before obstacles", () => {
  expect(hoverName(0, null)).toBe("agent 0");
  expect(hoverName(null, 0)).toBe("obstacle 0");
  expect(hoverName(2, 1)).toBe("agent 2");
  expect(hoverName(null, null)).toBe("");
  expect(hoverName(undefined, undefined)).toBe("");
});
