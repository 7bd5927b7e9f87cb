-- What campaigns and their owners may take of the slots, and how often a run was lost with its node.

ALTER TABLE campaign ADD COLUMN priority INTEGER NOT NULL DEFAULT 0;   -- among its owner's; the highest first

ALTER TABLE evaluation ADD COLUMN losses INTEGER NOT NULL DEFAULT 0;   -- beside `failures`, which are those of the model

CREATE TABLE quota (
  owner TEXT PRIMARY KEY,                   -- as of a campaign
  slots INTEGER NOT NULL                    -- that all its runs hold together, at most
) STRICT, WITHOUT ROWID;
