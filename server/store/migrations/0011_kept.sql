-- Files of a program's scratch folder that stay with its run.

CREATE TABLE kept (
  campaign   INTEGER NOT NULL,
  sample     INTEGER NOT NULL,
  experiment INTEGER NOT NULL,
  name       TEXT NOT NULL,                 -- below the scratch folder
  digest     TEXT REFERENCES blob(digest),  -- NULL: it did not come
  reason     TEXT NOT NULL DEFAULT '',      -- why not
  PRIMARY KEY (campaign, sample, experiment, name),
  FOREIGN KEY (campaign, sample, experiment) REFERENCES evaluation(campaign, sample, experiment) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;
