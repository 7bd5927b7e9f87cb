-- A campaign's measurements are read by the rules of its time, whatever later builds read in the same text.
ALTER TABLE campaign ADD COLUMN reading_rules INTEGER NOT NULL DEFAULT 1;   -- campaign::kReadingRules when it was submitted
