-- Everything `calibd` knows. Doubles that must come back bit for bit are BLOBs of IEEE-754 little-endian values;
-- identifiers are the natural keys of the domain, so that a repeated write finds its first copy.

CREATE TABLE blob (
  digest  TEXT PRIMARY KEY,                 -- lower-case hex SHA-256
  content BLOB NOT NULL
) STRICT;

CREATE TABLE campaign (
  id              INTEGER PRIMARY KEY AUTOINCREMENT,   -- shown as "c<id>", never used again
  name            TEXT NOT NULL,
  yaml            TEXT NOT NULL,            -- as submitted; what it means is read from it again
  file_name       TEXT NOT NULL,
  seed            INTEGER,                  -- overrides the file's (bits of an unsigned 64-bit number)
  method          TEXT NOT NULL,
  samples         INTEGER NOT NULL,         -- of one iteration
  max_iterations  INTEGER NOT NULL,
  created_unix_ms INTEGER NOT NULL,
  state           TEXT NOT NULL CHECK (state IN ('queued','running','paused','finished','failed','cancelled')),
  reason          TEXT NOT NULL DEFAULT '',
  phase           TEXT NOT NULL DEFAULT 'calibrating' CHECK (phase IN ('calibrating','validating','done')),
  iteration       INTEGER NOT NULL DEFAULT 0,          -- the running or last one, from 0
  converged       INTEGER NOT NULL DEFAULT 0,
  pause_waived    INTEGER NOT NULL DEFAULT 0           -- resumed although too many samples diverged: not asked again
) STRICT;

CREATE TABLE campaign_file (
  campaign INTEGER NOT NULL REFERENCES campaign(id) ON DELETE CASCADE,
  path     TEXT NOT NULL,                   -- as written in the campaign file
  digest   TEXT NOT NULL REFERENCES blob(digest),
  PRIMARY KEY (campaign, path)
) STRICT, WITHOUT ROWID;

CREATE TABLE iteration (
  campaign  INTEGER NOT NULL REFERENCES campaign(id) ON DELETE CASCADE,
  number    INTEGER NOT NULL,
  proposal  TEXT NOT NULL,                  -- JSON: the density its samples were drawn from
  posterior TEXT,                           -- JSON of calib.v1.Posterior once every evaluation has ended
  PRIMARY KEY (campaign, number)
) STRICT, WITHOUT ROWID;

CREATE TABLE sample (
  campaign       INTEGER NOT NULL,
  sample         INTEGER NOT NULL,          -- iteration * campaign.samples + position
  iteration      INTEGER NOT NULL,
  parameters     BLOB NOT NULL,
  log_weight     REAL,                      -- normalised, in the posterior after the last complete iteration
  log_likelihood REAL,
  PRIMARY KEY (campaign, sample),
  FOREIGN KEY (campaign, iteration) REFERENCES iteration(campaign, number) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;

CREATE TABLE evaluation (
  campaign   INTEGER NOT NULL,
  sample     INTEGER NOT NULL,
  experiment INTEGER NOT NULL,              -- index in the campaign file
  status     TEXT NOT NULL CHECK (status IN ('waiting','running','finished','diverged','stopped_early','failed')),
  reason     TEXT NOT NULL DEFAULT '',
  failures   INTEGER NOT NULL DEFAULT 0,    -- attempts lost or failed so far
  digest     TEXT NOT NULL,                 -- of everything that determines its states
  reused     INTEGER NOT NULL DEFAULT 0,    -- states copied from an equal evaluation, nothing was run
  PRIMARY KEY (campaign, sample, experiment),
  FOREIGN KEY (campaign, sample) REFERENCES sample(campaign, sample) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;
CREATE INDEX evaluation_by_digest ON evaluation(digest);

CREATE TABLE attempt (
  id              INTEGER PRIMARY KEY AUTOINCREMENT,   -- the fencing token, unique for ever
  campaign        INTEGER NOT NULL,
  sample          INTEGER NOT NULL,
  experiment      INTEGER NOT NULL,
  worker          TEXT NOT NULL,
  cpu             TEXT NOT NULL,
  engine          TEXT NOT NULL,
  started_unix_ms INTEGER NOT NULL,
  ended_unix_ms   INTEGER,
  outcome         TEXT,                     -- NULL: a worker holds it
  reason          TEXT NOT NULL DEFAULT '',
  steps           INTEGER NOT NULL DEFAULT 0,
  contact_updates INTEGER NOT NULL DEFAULT 0,
  core_seconds    REAL NOT NULL DEFAULT 0,
  staging         TEXT NOT NULL DEFAULT '',
  FOREIGN KEY (campaign, sample, experiment) REFERENCES evaluation(campaign, sample, experiment) ON DELETE CASCADE
) STRICT;
CREATE INDEX attempt_by_evaluation ON attempt(campaign, sample, experiment);
CREATE INDEX attempt_active ON attempt(id) WHERE outcome IS NULL;

CREATE TABLE state (
  campaign    INTEGER NOT NULL,
  sample      INTEGER NOT NULL,
  experiment  INTEGER NOT NULL,
  load_step   INTEGER NOT NULL,
  observables BLOB NOT NULL,                -- in the order of the test's catalogue entry
  PRIMARY KEY (campaign, sample, experiment, load_step),
  FOREIGN KEY (campaign, sample, experiment) REFERENCES evaluation(campaign, sample, experiment) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;

CREATE TABLE request (
  id      TEXT PRIMARY KEY,                 -- chosen by the client
  digest  TEXT NOT NULL,                    -- of what was asked
  answer  TEXT NOT NULL
) STRICT;

CREATE TABLE event (
  id       INTEGER PRIMARY KEY,
  unix_ms  INTEGER NOT NULL,
  campaign INTEGER REFERENCES campaign(id) ON DELETE CASCADE,
  what     TEXT NOT NULL
) STRICT;
CREATE INDEX event_by_campaign ON event(campaign, id);
