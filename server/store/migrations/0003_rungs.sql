-- Breadth-first scheduling: an evaluation rests at a rung until the others have come there too.

ALTER TABLE evaluation ADD COLUMN rest_after INTEGER;               -- load step; NULL: runs to its end
ALTER TABLE evaluation ADD COLUMN held_in TEXT NOT NULL DEFAULT ''; -- checkpoint folder that can go on with it
