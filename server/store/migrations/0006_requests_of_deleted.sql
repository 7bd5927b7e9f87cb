-- A request whose campaign was deleted is new again: its file may be submitted once more.
DELETE FROM request WHERE answer LIKE 'c%' AND answer NOT IN (SELECT 'c' || id FROM campaign);
