-- What was concluded about a campaign: documents among the blobs, found by the campaign they speak of.

CREATE TABLE finding (
  id              INTEGER PRIMARY KEY,      -- in the order in which they were first added
  campaign        INTEGER NOT NULL REFERENCES campaign(id) ON DELETE CASCADE,
  kind            TEXT NOT NULL,            -- diagnosis, improvement
  digest          TEXT NOT NULL REFERENCES blob(digest),
  created_unix_ms INTEGER NOT NULL,
  UNIQUE (campaign, kind, digest)
) STRICT;
