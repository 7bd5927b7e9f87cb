-- Programs of users' own as the model: what they tell beyond what they were asked, what they say when they fail, and
-- evaluations on which one failed as often as it may.

ALTER TABLE state ADD COLUMN others TEXT NOT NULL DEFAULT '';     -- JSON object of numbers; empty: nothing
ALTER TABLE attempt ADD COLUMN words TEXT NOT NULL DEFAULT '';    -- last of its standard error
ALTER TABLE evaluation ADD COLUMN aside INTEGER NOT NULL DEFAULT 0;   -- 1 with status 'failed': unknown, nothing more is run
