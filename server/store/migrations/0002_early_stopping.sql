-- Early stopping: a threshold per sample, fixed when its iteration starts.

ALTER TABLE sample ADD COLUMN stop_below REAL;   -- on the largest log likelihood still possible; NULL: never stopped
