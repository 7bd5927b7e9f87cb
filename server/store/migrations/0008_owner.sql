-- Who submitted a campaign: the name of a certificate, else the account's of the server.
ALTER TABLE campaign ADD COLUMN owner TEXT NOT NULL DEFAULT '';   -- empty: submitted before owners were kept
