/**
 * Transfer size of the page: everything that it loads to show a recording, without the recording.
 */
import { expect, test } from "./support/fixtures.ts";
import { recording } from "./support/recordings.ts";
import * as shown from "./support/shown.ts";

const LIMIT_BYTES = 2_000_000;

test("the page is light", async ({ page, servers }) => {
  const sizes = new Map<string, Promise<number>>();
  page.on("requestfinished", (request) => {
    const name = new URL(request.url()).pathname;
    const size = request
      .sizes()
      .then(({ responseBodySize, responseHeadersSize }) => responseBodySize + responseHeadersSize);
    if (!name.endsWith(".mcap")) sizes.set(name, size);
  });
  await shown.openWhole(page, await servers.view(recording("radio")));
  const names = [...sizes.keys()];
  for (const part of [/^\/$/, /index.*\.js$/, /\.css$/, /worker.*\.js$/]) {
    expect(
      names.some((name) => part.test(name)),
      `${part} of ${names.join(", ")}`,
    ).toBe(true);
  }
  const total = (await Promise.all(sizes.values())).reduce((sum, size) => sum + size, 0);
  expect(total).toBeGreaterThan(10_000);
  expect(total).toBeLessThan(LIMIT_BYTES);
});
