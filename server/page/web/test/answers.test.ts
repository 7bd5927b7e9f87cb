import assert from "node:assert/strict";
import test from "node:test";
import { Answers, kLeastInterval, type Answer, type Reply } from "../src/answers.ts";

const settled = (): Promise<void> => new Promise((resolve) => setImmediate(resolve));
const json = (value: unknown, status = 200, etag: string | null = null): Reply => ({ status, text: JSON.stringify(value), etag });

test("a document is asked for once, however many watch it", async () => {
  let asked = 0;
  const answers = new Answers(async () => json({ n: ++asked }));
  const seen: Answer<unknown>[] = [];
  answers.watch("a", (answer) => seen.push(answer));
  answers.watch("a", () => {});
  await settled();
  assert.equal(asked, 1);
  assert.deepEqual(seen, [{ state: "asked" }, { state: "here", value: { n: 1 } }]);
});

test("marks are gathered: at most one question in the least interval", async () => {
  const timers: { task: () => void; ms: number }[] = [];
  let now = 0;
  let asked = 0;
  const answers = new Answers(async () => json({ n: ++asked }), () => now, (task, ms) => timers.push({ task, ms }));
  answers.watch("a", () => {});
  await settled();
  for (let i = 0; i < 100; ++i) answers.mark((path) => (path === "a" ? kLeastInterval : null));
  await settled();
  assert.equal(asked, 1);
  assert.deepEqual(timers.map(({ ms }) => ms), [kLeastInterval]);
  now += kLeastInterval;
  timers[0]!.task();
  await settled();
  assert.equal(asked, 2);
});

test("what nobody watches is not asked for again", async () => {
  let asked = 0;
  let now = 0;
  const answers = new Answers(async () => json({ n: ++asked }), () => now);
  const stop = answers.watch("a", () => {});
  await settled();
  stop();
  now += 2 * kLeastInterval;
  answers.mark(() => kLeastInterval);
  await settled();
  assert.equal(asked, 1);
  answers.watch("a", () => {});
  await settled();
  assert.equal(asked, 2, "but when somebody watches it again");
});

test("an unchanged document is not drawn anew, and 304 is asked for by its tag", async () => {
  let now = 0;
  const tags: (string | null)[] = [];
  const answers = new Answers(async (_, etag) => {
    tags.push(etag);
    return etag === '"1"' ? { status: 304, text: "", etag: null } : json({ n: 1 }, 200, '"1"');
  }, () => now);
  let told = 0;
  answers.watch("a", () => ++told);
  await settled();
  now += kLeastInterval;
  answers.mark(() => kLeastInterval);
  await settled();
  assert.deepEqual(tags, [null, '"1"']);
  assert.equal(told, 2, "asked, here");
});

test("what was here stays while the server is away; a refusal replaces it", async () => {
  let now = 0;
  let mode = "here";
  const answers = new Answers(async () => {
    if (mode === "away") throw new TypeError("fetch failed");
    return mode === "here" ? json([1]) : json({ error: "no token" }, 401);
  }, () => now);
  let last: Answer<unknown> = { state: "asked" };
  answers.watch("a", (answer) => (last = answer));
  await settled();
  mode = "away";
  now += kLeastInterval;
  answers.mark(() => kLeastInterval);
  await settled();
  assert.deepEqual(last, { state: "here", value: [1] });
  mode = "refused";
  now += kLeastInterval;
  answers.mark(() => kLeastInterval);
  await settled();
  assert.deepEqual(last, { state: "failed", status: 401, sentence: "no token" });
});

test("no document is told from a broken answer, in the server's words", async () => {
  const replies: Record<string, Reply> = {
    none: json({ error: "c9 has no diagnosis." }, 404),
    broken: { status: 200, text: '{"campaign": "c1', etag: null },
    strange: { status: 502, text: "<html>", etag: null },
  };
  const answers = new Answers(async (path) => replies[path]!);
  const last = new Map<string, Answer<unknown>>();
  for (const path of Object.keys(replies)) answers.watch(path, (answer) => last.set(path, answer));
  await settled();
  assert.deepEqual(last.get("none"), { state: "none", sentence: "c9 has no diagnosis." });
  assert.equal(last.get("broken")?.state, "failed");
  assert.deepEqual(last.get("strange"), { state: "failed", status: 502, sentence: "The server answered with status 502." });
});

test("what may wait is asked for in the end, and sooner when it becomes urgent", async () => {
  const timers: { task: () => void; ms: number }[] = [];
  let now = 0;
  let asked = 0;
  const answers = new Answers(async () => json({ n: ++asked }), () => now, (task, ms) => timers.push({ task, ms }));
  answers.watch("a", () => {});
  await settled();
  answers.mark(() => 15 * kLeastInterval);
  answers.mark(() => kLeastInterval);
  assert.deepEqual(timers.map(({ ms }) => ms), [15 * kLeastInterval, kLeastInterval]);
  now += kLeastInterval;
  timers[1]!.task();
  await settled();
  assert.equal(asked, 2);
  now += 14 * kLeastInterval;
  timers[0]!.task();
  await settled();
  assert.equal(asked, 2, "the patient question has been answered");
  answers.mark(() => 15 * kLeastInterval);
  assert.equal(timers.length, 3);
  now += 15 * kLeastInterval;
  timers[2]!.task();
  await settled();
  assert.equal(asked, 3);
});
