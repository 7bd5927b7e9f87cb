-- Early stopping is audited: some of the stopped samples are run to their ends all the same.

ALTER TABLE sample ADD COLUMN audited INTEGER NOT NULL DEFAULT 0;
