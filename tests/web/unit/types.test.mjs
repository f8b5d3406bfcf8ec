// Type check of the page's TypeScript, which the bundler does not do.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { join } from "node:path";
import { test } from "node:test";
import { webDir } from "../bundled.mjs";

test("tsc reports no error", () => {
  const tsc = join(webDir, "node_modules", "typescript", "bin", "tsc");
  const { status, stdout, stderr } = spawnSync(process.execPath, [tsc, "--noEmit", "-p", webDir], {
    encoding: "utf8",
  });
  assert.equal(stdout + stderr, "");
  assert.equal(status, 0);
});
