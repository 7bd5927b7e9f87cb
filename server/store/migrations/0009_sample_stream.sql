-- Runs that are added to a design have a stream of their own: what decides on packing and seed.

ALTER TABLE sample ADD COLUMN stream INTEGER;   -- NULL: what the campaign file says of the sample, else its number
