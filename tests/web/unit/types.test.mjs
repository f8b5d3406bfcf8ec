// The TypeScript of the page is sound: the bundler does not look.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { join } from "node:path";
import { test } from "node:test";
import { webDir } from "../bundled.mjs";

test("tsc has nothing to say", () => {
  const tsc = join(webDir, "node_modules", "typescript", "bin", "tsc");
  const { status, stdout, stderr } = spawnSync(process.execPath, [tsc, "--noEmit", "-p", webDir], {
    encoding: "utf8",
  });
  assert.equal(stdout + stderr, "");
  assert.equal(status, 0);
});
