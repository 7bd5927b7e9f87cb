-- What is removed in pieces, and contents that nobody has named yet.

CREATE TABLE leaving (
  campaign INTEGER PRIMARY KEY REFERENCES campaign(id) ON DELETE CASCADE,
  whole    INTEGER NOT NULL                 -- 1: all of it, and nobody sees it any more; 0: states that `pruned` does not keep
) STRICT;

CREATE TABLE pruned (
  campaign INTEGER PRIMARY KEY REFERENCES campaign(id) ON DELETE CASCADE,
  kept     INTEGER NOT NULL                 -- samples whose states stay: those of largest weight
) STRICT;

CREATE TABLE put (
  digest  TEXT PRIMARY KEY REFERENCES blob(digest) ON DELETE CASCADE,   -- until something names it
  unix_s  INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

CREATE INDEX campaign_file_by_digest ON campaign_file(digest);
CREATE INDEX finding_by_digest ON finding(digest);
CREATE INDEX kept_by_digest ON kept(digest);

INSERT INTO put SELECT digest, CAST(strftime('%s', 'now') AS INTEGER) FROM blob
WHERE digest NOT IN (SELECT digest FROM campaign_file) AND digest NOT IN (SELECT digest FROM finding)
  AND NOT EXISTS (SELECT 1 FROM kept WHERE kept.digest = blob.digest);
