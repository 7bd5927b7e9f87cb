-- Early stopping is audited: some of the stopped samples are run to their ends all the same.

ALTER TABLE sample ADD COLUMN audited REAL;   -- share of the finished mass that its bound left it; NULL: not audited
