// One bundle, two pages: where documents are embedded it is a report of them, else it is live.

import { showLivePage } from "./live_page.ts";
import { showReport, type Embedded } from "./report_page.ts";

const embedded = document.getElementById("documents");
if (embedded === null) showLivePage();
else showReport(JSON.parse(embedded.textContent ?? "{}") as Embedded);
